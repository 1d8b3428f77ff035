"""Work on many frames at a time, in threads that let go of Python's lock (kernels, NumPy, OpenCV)."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from importlib import import_module
from threading import Thread
from typing import TypeVar

S = TypeVar("S")
T = TypeVar("T")

# results that wait for each thread: enough that none idles, few enough that frames don't pile up in memory
_AHEAD = 2


def threads() -> int:
    """How many threads work at a time: OMP_NUM_THREADS if set, else the cores that this process may use."""
    said = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0].strip()
    return int(said) if said.isdecimal() and int(said) > 0 else len(os.sched_getaffinity(0))


def each(work: Callable[[S], T], items: Iterable[S]) -> Iterator[T]:
    """`work(item)` of every item, in their order.

    Each item is worked on by itself, so that the results don't depend on the number of threads. Who takes the
    results slowly holds the threads up: no more than a few wait.
    """
    count = threads()
    if count < 2:
        yield from map(work, items)
        return
    waiting: deque[Future[T]] = deque()
    pool = ThreadPoolExecutor(count)
    try:
        for item in items:
            waiting.append(pool.submit(work, item))
            if len(waiting) > _AHEAD * count:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        pool.shutdown(cancel_futures=True)


def import_ahead(*modules: str) -> None:
    """Import in a thread what is needed later and takes long to import, where there is a core for it.

    An import that fails is told where the module is needed.
    """

    def work() -> None:
        for name in modules:
            with suppress(Exception):
                import_module(name)

    if threads() > 1:
        Thread(target=work).start()

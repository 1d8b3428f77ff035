"""Ends an interrupted command in one line, wherever it is: compiled code, threads, children at work."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, NoReturn

MESSAGE, REMEDY = "interrupted", "run the same command again to go on"
# s, chosen by us: to unwind and remove temporary files; what dies without is cleared by the next run
_GRACE = 3.0
_AGAIN = 0.002  # s until an interruption that was dropped is raised again
_signals: list[int] = []
_deadline: list[float] = []


def handle() -> None:
    """Take SIGINT and SIGTERM from now on. The first one unwinds the program; a second one, or a program that
    does not end in three seconds, ends it at once. Nothing is lost: every file is replaced whole."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupted)
    signal.signal(signal.SIGALRM, _late)
    sys.unraisablehook = _unraisable
    # Runs after all other exit functions: then Python takes its handlers away and unloads modules.
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)


def happened() -> bool:
    """Whether the user interrupted: any error after that only tells where the program was."""
    return bool(_signals)


def code() -> int:
    """The exit code that says so: 128 + signal, 130 for Ctrl-C."""
    return 128 + (_signals[0] if _signals else signal.SIGINT)


def leave(tell: bool = False) -> NoReturn:
    """End this process and what it started, now."""
    for child in _descendants(os.getpid()):
        with suppress(OSError):
            os.kill(child, signal.SIGKILL)
    if sys.stderr.isatty():
        os.write(2, b"\r\x1b[?25h\x1b[2K")  # a progress bar hides the cursor
    if tell:
        os.write(2, f"twin: {MESSAGE}; {REMEDY}\n".encode())
    with suppress(Exception):
        sys.stdout.flush()
    os._exit(code())


def finish(code: int) -> NoReturn:
    """End the finished program with its exit code; an interruption from here on only hastens the end.

    One that a library dropped on the way is told now: the user's shell shall stop, and know why."""
    if happened():
        leave(tell=code != 128 + _signals[0])
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(code))
    sys.exit(code)


@contextmanager
def spared() -> Iterator[None]:
    """Processes started in here don't hear Ctrl-C, which a terminal sends to all: they end with this one."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _interrupted(number: int, frame: FrameType | None) -> None:
    if happened():
        leave(tell=True)
    _signals.append(number)
    _deadline[:] = [time.monotonic() + _GRACE]
    _raise(frame)


def _raise(frame: FrameType | None) -> None:
    """Raise the interruption in `frame`, or a little later where it would be dropped and told as an error."""
    while frame is not None:
        if frame.f_code is _unraisable.__code__:
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
            return
        frame = frame.f_back
    signal.setitimer(signal.ITIMER_REAL, max(_deadline[0] - time.monotonic(), _AGAIN))
    raise KeyboardInterrupt


def _late(_number: int, frame: FrameType | None) -> None:
    """The time to unwind is over, or the interruption was dropped and is raised once more."""
    if time.monotonic() >= _deadline[0]:
        leave(tell=True)
    _raise(frame)


def _unraisable(dropped: Any) -> None:
    """An interruption that fell into a callback or finalizer (Python drops it there) is raised again soon."""
    if not happened():
        sys.__unraisablehook__(dropped)
    elif (
        isinstance(dropped.exc_value, KeyboardInterrupt)
        and threading.current_thread() is threading.main_thread()
    ):
        signal.setitimer(signal.ITIMER_REAL, _AGAIN)


def _descendants(process: int) -> list[int]:
    """Processes that this one started, and theirs (Linux: from /proc)."""
    from pathlib import Path  # here: the handler is to stand before anything takes time

    found = []
    for task in Path(f"/proc/{process}/task").glob("*/children"):
        with suppress(OSError):
            for child in map(int, task.read_text(encoding="ascii").split()):
                found += [*_descendants(child), child]
    return found

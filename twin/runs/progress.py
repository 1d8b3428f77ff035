"""Progress of long work: to a function of the caller's, as bars on a terminal, as lines elsewhere.

Unless somebody asks, bars appear on a terminal after two seconds, and nothing appears elsewhere.
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Timer
from typing import Any, ParamSpec, TypeVar

from twin.runs.stages import Progress

P = ParamSpec("P")
T = TypeVar("T")

PATIENCE = 2.0  # s before a bar appears for work that nobody asked to be told about
# share of the work after which the time left is told; chosen by us: it is within a factor of two then
_KNOWN = 0.1
_told: ContextVar[bool] = ContextVar("told", default=False)


def silent(stage: str, fraction: float, message: str = "") -> None:
    """Progress that shows nothing."""


@contextmanager
def told_to(progress: Progress) -> Iterator[Progress]:
    """Within this, work inside draws no bars of its own: the terminal has one already, or shall have none."""
    token = _told.set(True)
    try:
        yield progress
    finally:
        _told.reset(token)


@contextmanager
def default_progress(progress: Progress | bool | None = None) -> Iterator[Progress]:
    """The caller's own progress; True: bars on standard error in a terminal, else lines; False: nothing.

    None: bars on a terminal if the work takes longer than PATIENCE, and nothing elsewhere.
    """
    terminal = sys.stderr.isatty()
    if progress is True and not terminal:
        progress = Lines()
    if progress is True or (progress is None and terminal and not _told.get()):
        with Bars(0.0 if progress else PATIENCE) as bars, told_to(bars):
            yield bars
    else:
        with told_to(progress or silent) as chosen:
            yield chosen


def shows_bar(stage: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """A bar of this name for a function whose end can't be foretold: it runs until the function returns."""

    def wrap(function: Callable[P, T]) -> Callable[P, T]:
        @functools.wraps(function)
        def run(*args: P.args, **kwargs: P.kwargs) -> T:
            with default_progress() as progress:
                progress(stage, 0.0)
                done = function(*args, **kwargs)
                progress(stage, 1.0)
                return done

        return run

    return wrap


class Lines:
    """A line on standard error for every stage that is done."""

    def __call__(self, stage: str, fraction: float, message: str = "") -> None:
        if fraction >= 1.0:
            sys.stderr.write(f"{stage:<12} {message}\n")
            sys.stderr.flush()


class Counted:
    """Adds to what a progress is told the number of the stage and about how much time is left.

    Args:
        progress: that is told.
        weights: stage -> time that it takes, in any unit; all stages, in their order.
        clock: seconds.

    Stages that come from the cache, whose first report is that they are done, take no time.
    """

    def __init__(
        self,
        progress: Progress,
        weights: Mapping[str, float],
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._progress, self._clock = progress, clock
        self._weights, self._numbers = dict(weights), {name: k for k, name in enumerate(weights, 1)}
        self._done: dict[str, float] = {}
        self._began: float | None = None

    def __call__(self, stage: str, fraction: float, message: str = "") -> None:
        if stage in self._numbers:
            if stage not in self._done and fraction >= 1.0:
                del self._weights[stage]
            elif self._began is None:
                self._began = self._clock()
            self._done[stage] = fraction
            told = (message, f"{self._numbers[stage]} of {len(self._numbers)}", self._left())
            message = ", ".join(text for text in told if text)
        self._progress(stage, fraction, message)

    def _left(self) -> str:
        done = sum(self._weights.get(name, 0.0) * share for name, share in self._done.items())
        whole = sum(self._weights.values())
        if self._began is None or done < _KNOWN * whole or done >= whole:
            return ""
        seconds = (self._clock() - self._began) * (whole / done - 1.0)
        return f"about {seconds:.0f} s left" if seconds < 90 else f"about {seconds / 60:.0f} min left"


class Bars:
    """A rich bar per stage on standard error after `after` seconds; without fractions of 0..1 it pulses."""

    def __init__(self, after: float = 0.0) -> None:
        from rich.console import Console as Rich
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        columns = (
            SpinnerColumn(finished_text="[green]✓[/]"),
            TextColumn("{task.description:<12}"),
            BarColumn(bar_width=30),
            TimeElapsedColumn(),
            TextColumn("[dim]{task.fields[message]}"),
        )
        self._bars = Progress(*columns, console=Rich(stderr=True))
        self._tasks: dict[str, Any] = {}
        self._start = Timer(after, self._bars.start)
        self._start.daemon = True

    def __enter__(self) -> Bars:
        if self._start.interval > 0:
            self._start.start()
        else:
            self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._start.cancel()
        if self._start.ident is not None:
            self._start.join()  # or it could start the bars after they were stopped
        self._bars.stop()

    def __call__(self, stage: str, fraction: float, message: str = "") -> None:
        from rich.markup import escape

        if stage not in self._tasks:
            self._tasks[stage] = self._bars.add_task(stage, total=None, message="")
        known = fraction > 0
        self._bars.update(
            self._tasks[stage], total=1.0 if known else None, completed=fraction, message=escape(message)
        )

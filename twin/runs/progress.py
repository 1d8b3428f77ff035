"""How long work tells how far it is: to whom it is told to, else, on a terminal, by a bar after two seconds."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Timer
from typing import Any, ParamSpec, TypeVar

from twin.runs.stages import Progress

P = ParamSpec("P")
T = TypeVar("T")

PATIENCE = 2.0  # s before a bar appears for work that nobody asked to be told about
_told: ContextVar[bool] = ContextVar("told", default=False)


def silent(stage: str, fraction: float, message: str = "") -> None:
    """Progress that shows nothing."""


@contextmanager
def told_to(progress: Progress) -> Iterator[Progress]:
    """While this lasts, work inside draws no bars of its own: the terminal has one already, or shall have none."""
    token = _told.set(True)
    try:
        yield progress
    finally:
        _told.reset(token)


@contextmanager
def default_progress(progress: Progress | None = None) -> Iterator[Progress]:
    """The caller's own progress; without one, bars on standard error if that is a terminal and the work takes longer than
    PATIENCE, and nothing elsewhere."""
    if progress is not None or _told.get() or not sys.stderr.isatty():
        with told_to(progress or silent) as chosen:
            yield chosen
    else:
        with Bars(PATIENCE) as bars, told_to(bars):
            yield bars


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


class Bars:
    """One rich progress bar per stage, drawn on standard error once `after` seconds are over; without fractions between 0 and
    1 it pulses."""

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

"""What the command line shows: progress on stderr, results on stdout."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from twin.report.sections import MARKS, Table
from twin.stages import Progress


@dataclass(frozen=True)
class Outcome:
    """What a verb did: `ok` is False when a check failed or a goal was missed; `data` holds JSON types. `problem` is
    one line about an environment that is not fit, which makes the exit code 1."""

    data: dict[str, Any]
    tables: Sequence[Table] = ()
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    ok: bool = True
    problem: str = ""


@dataclass
class Console:
    """Terminal output. `quiet` shows no progress (for --json)."""

    quiet: bool = False
    _done: list[str] = field(default_factory=list)

    @contextmanager
    def progress(self) -> Iterator[Progress]:
        """A bar per stage on a terminal, a line per finished stage elsewhere."""
        if self.quiet:
            yield _silent
        elif sys.stderr.isatty():
            with _Bars() as bars:
                yield bars
        else:
            yield _Lines()

    def show(self, outcome: Outcome) -> None:
        """Tables, notes and warnings."""
        from rich.console import Console as Rich
        from rich.markup import escape
        from rich.table import Table as RichTable

        # Piped output has no width of its own; a generous one keeps rows whole.
        rich = Rich(width=None if sys.stdout.isatty() else 140, highlight=False)
        for table in outcome.tables:
            drawn = RichTable(title=escape(table.title), title_justify="left", title_style="bold")
            for column in table.columns:
                drawn.add_column(escape(column))
            for row in table.rows:
                drawn.add_row(*(_mark(escape(cell)) for cell in row))
            rich.print(drawn)
        for warning in outcome.warnings:
            rich.print(f"[yellow]warning:[/] {escape(warning)}", soft_wrap=True)
        for note in outcome.notes:
            rich.print(escape(note), soft_wrap=True)


def _mark(cell: str) -> str:
    colors = {"good": "green", "bad": "red"}
    return f"[{colors[MARKS[cell]]}]{cell}[/]" if cell in MARKS else cell


def _silent(stage: str, fraction: float, message: str = "") -> None:
    """Progress that shows nothing."""


class _Lines:
    def __call__(self, stage: str, fraction: float, message: str = "") -> None:
        if fraction >= 1.0:
            sys.stderr.write(f"{stage:<12} {message}\n")
            sys.stderr.flush()


class _Bars:
    """One rich progress bar per stage; without fractions between 0 and 1 it pulses."""

    def __init__(self) -> None:
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

    def __enter__(self) -> _Bars:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def __call__(self, stage: str, fraction: float, message: str = "") -> None:
        from rich.markup import escape

        if stage not in self._tasks:
            self._tasks[stage] = self._bars.add_task(stage, total=None, message="")
        known = fraction > 0
        self._bars.update(
            self._tasks[stage], total=1.0 if known else None, completed=fraction, message=escape(message)
        )

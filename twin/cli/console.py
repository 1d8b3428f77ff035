"""What the command line shows: progress on stderr, results on stdout."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from twin.report.sections import MARKS, Table
from twin.runs.progress import Bars, Lines, silent, told_to
from twin.runs.stages import Progress


@dataclass(frozen=True)
class Outcome:
    """What a verb did: `ok` is False when a check failed or a goal was missed; `data` holds JSON types.
    `problem` is one line about an environment that makes the exit code 1. `first` is the first line that is
    shown: the verdict on the twin. `doubt` is one line about why `ok` is False, where no table tells."""

    data: dict[str, Any]
    tables: Sequence[Table] = ()
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    ok: bool = True
    problem: str = ""
    first: str = ""
    doubt: str = ""


@dataclass
class Console:
    """Terminal output. `quiet` shows no progress (for --json)."""

    quiet: bool = False
    _done: list[str] = field(default_factory=list)

    @contextmanager
    def progress(self) -> Iterator[Progress]:
        """A bar per stage on a terminal, a line per finished stage elsewhere."""
        if self.quiet:
            with told_to(silent) as progress:
                yield progress
        elif sys.stderr.isatty():
            with Bars() as bars, told_to(bars):
                yield bars
        else:
            with told_to(Lines()) as progress:
                yield progress

    def show(self, outcome: Outcome) -> None:
        """The first line, tables, warnings and notes."""
        from rich.console import Console as Rich
        from rich.markup import escape
        from rich.table import Table as RichTable

        # Piped output has no width of its own; a generous one keeps rows whole.
        rich = Rich(width=None if sys.stdout.isatty() else 140, highlight=False)
        if outcome.first:
            rich.print(escape(outcome.first), soft_wrap=True)
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

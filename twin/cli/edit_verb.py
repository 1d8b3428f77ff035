"""The verb `edit` of the command line: changes of a twin by its user, listed, made and taken back."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from twin.cli.console import Console, Outcome
from twin.cli.physics_verbs import told_of_files
from twin.cli.step import judged, page, run_folder
from twin.edits.edit import Edit, shown
from twin.errors import InputError
from twin.report.sections import Table
from twin.storage import load


def edit(
    console: Console,  # noqa: ARG001
    run: Path,
    assignments: Sequence[str],
    part: str | None,
    why: str,
    undo: int | None,
) -> Outcome:
    """Carry out `twin edit RUN`."""
    from twin import edits

    place = run_folder(run)
    if assignments and undo is not None:
        raise InputError("edits are made or taken back, not both", "leave --undo or WHAT=VALUE out")
    if not assignments and undo is None:
        twin = load(place)
        return judged(_listed(edits.read(place, edits.found_twin(place)), "edits"), twin)
    with page(place):
        twin = load(place)
        if undo is not None:
            rows, made = edits.undo(place, undo)
        else:
            name = part if part is not None else _only([p.name for p in twin.parts], assignments)
            rows = [edits.edit_of(twin, name, text, why) for text in assignments]
            rows.sort(key=lambda e: e.what == "name")  # the others name the part as it is called now
            made = edits.add(place, rows)
    now = load(place)
    outcome = _listed(
        rows, "taken back" if undo is not None else "what changed", told_of_files(place, run, now.name)
    )
    return judged(Outcome(outcome.data, outcome.tables, outcome.notes, made.warnings), now)


def _only(names: Sequence[str], assignments: Sequence[str]) -> str:
    """The part that is meant where none is named: the only one; the twin itself for a verdict."""
    if len(names) == 1:
        return names[0]
    if all(a.partition("=")[0] == "verdict" for a in assignments):
        return ""
    raise InputError("which part is not clear", f"name it with --part; parts: {', '.join(names) or 'none'}")


def _listed(rows: Sequence[Edit], title: str, notes: Sequence[str] = ()) -> Outcome:
    cells = [
        [e.part or "the twin", e.what, "" if e.was is None else shown(e.was), shown(e.to), e.unit, e.why]
        for e in rows
    ]
    tables = [Table(title, ["part", "what", "before", "now", "unit", "why"], cells)] if rows else []
    told = list(notes) if rows else ["no edits"]
    return Outcome({"edits": [e.row for e in rows]}, tables, told)

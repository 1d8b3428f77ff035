"""The verb `physics` of the command line: shows, sets and estimates what parts weigh and how they resist."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from twin.console import Console, Outcome
from twin.errors import InputError
from twin.physics_edit import Change, Edited, given, set_physics
from twin.physics_options import UNITS
from twin.physics_text import described
from twin.report.sections import Table
from twin.scene import Part, Twin
from twin.steps import run_folder
from twin.storage import load, save_values

_FILES = {"urdf": ".urdf", "mjcf": ".xml", "usd": ".usda"}


def physics(console: Console, action: str, **options: Any) -> Outcome:
    """Carry out `twin physics ACTION`."""
    return _ACTIONS[action](console, **options)


def show(console: Console, run: Path, part: str | None) -> Outcome:  # noqa: ARG001  (same shape as the others)
    """Every quantity with interval and source."""
    twin = load(run)
    parts = [_part(twin, part)] if part is not None else list(twin.parts)
    rows = [
        [p.name if k == 0 else "", *row]
        for p in parts
        for k, row in enumerate(described(p) or [("mass", "not known yet", "run twin export")])
    ]
    tables = [Table(f"{twin.name}: physics", ["part", "quantity", "value (interval)", "source"], rows)]
    return Outcome({"parts": {p.name: _data(p) for p in parts}}, tables)


def set_values(
    console: Console,  # noqa: ARG001
    run: Path,
    part: str | None,
    material: str | None,
    measured: bool,
    note: str,
    **numbers: Any,
) -> Outcome:
    """Numbers from the user into twin.json."""
    twin = load(run)
    values = {
        name: given(name, numbers[name], numbers[f"{name}_interval"], measured, note)
        for name in UNITS
        if numbers[name] is not None
    }
    lonely = [name for name in UNITS if numbers[name] is None and numbers[f"{name}_interval"]]
    if lonely:
        raise InputError(f"--{lonely[0]}-interval was given without --{lonely[0]}", "give both")
    if not values and material is None:
        options = " ".join(f"--{name}" for name in UNITS)
        raise InputError("there is nothing to set", f"give at least one of {options} --material")
    edited = set_physics(twin, _part(twin, part).id, values, material)
    return keep(run, edited, _part(twin, part).name)


def keep(run: Path, edited: Edited, name: str, notes: Sequence[str] = ()) -> Outcome:
    """Write the changed twin and tell what changed, and which files are now of an earlier twin."""
    save_values(edited.twin, run)
    place = run_folder(run)
    stale = [f for f, s in _FILES.items() if (place / "export" / f / f"{edited.twin.name}{s}").is_file()]
    told = list(notes)
    if stale:
        told.append(
            f"{', '.join(stale)} in {place / 'export'} are of the earlier twin: `twin export {run}` writes them again"
        )
    if any((place / "replay").glob("*/*/report.json")):
        told.append(f"so are the replays: `twin replay {run}` plans them again")
    if (place / "report.html").is_file():
        from twin.report import render

        render(place)
    rows = [[c.name, c.before or "none", c.after, c.source] for c in edited.changes]
    tables = [Table(f"{name}: what changed", ["quantity", "before", "now", "source"], rows)] if rows else []
    if not rows:
        told.insert(0, f"{name}: nothing changed")
    data = {"part": name, "changes": [_change(c) for c in edited.changes], "stale": stale}
    return Outcome(data, tables, told, edited.warnings)


def _change(c: Change) -> dict[str, Any]:
    return {"quantity": c.name, "before": c.before, "after": c.after, "source": c.source}


def _part(twin: Twin, name: str | None) -> Part:
    if name is not None:
        return twin.part(int(name) if name.isdecimal() else name)
    if len(twin.parts) != 1:
        names = ", ".join(p.name for p in twin.parts) or "none"
        raise InputError("which part is not clear", f"name it with --part; parts: {names}")
    return twin.parts[0]


def _data(part: Part) -> dict[str, Any]:
    """The numbers as JSON types, in the words of twin.json."""
    from twin.storage import part_document

    document = part_document(part)
    return {k: document[k] for k in ("inertial", "physics")}


_ACTIONS: Mapping[str, Callable[..., Outcome]] = {"show": show, "set": set_values}

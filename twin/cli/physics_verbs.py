"""The verb `physics` of the command line: shows, sets and estimates what parts weigh and how they resist."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from twin.cli.console import Console, Outcome
from twin.cli.step import run_folder
from twin.cli.table import OPEN_RECORDING, named
from twin.errors import InputError
from twin.physics.edit import Change, Edited, given, set_physics
from twin.physics.materials import read_materials
from twin.physics.text import described
from twin.report.sections import Table
from twin.runs.manifest import opened_with
from twin.runs.run_lock import claimed
from twin.scene import Part, Twin
from twin.storage import load, update
from twin.units import UNITS

_FILES = {"urdf": ".urdf", "mjcf": ".xml", "usd": ".usda"}


def physics(console: Console, action: str, **options: Any) -> Outcome:
    """Carry out `twin physics ACTION`."""
    run = run_folder(options["run"])
    with claimed(run) if action != "show" and run.is_dir() else nullcontext():
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
    chosen = _part(twin, part)
    edited = set_physics(twin, chosen.id, values, material)
    from twin.edits import (  # imports what takes a second, which a wrong word needs not wait for
        KINDS,
        Edit,
        add,
    )

    made = [Edit("material", chosen.name, material, why=note)] if material is not None else []
    for name, quantity in values.items():
        told = numbers[f"{name}_interval"]
        unit = KINDS[name].unit(chosen)
        made.append(
            Edit(
                name,
                chosen.name,
                quantity.value,
                KINDS[name].now(chosen),
                unit,
                note,
                tuple(told) if told else None,
                measured,
            )
        )
    warnings = [*edited.warnings, *add(run_folder(run), made).warnings]
    rows = [(chosen.name, c) for c in edited.changes]
    return _told(run, replace(edited, warnings=tuple(warnings)), rows)


def catch(
    console: Console,  # noqa: ARG001
    run: Path,
    part: str | None,
    hold: str | None,
    log: Path | None,
    typical: bool,
    none: bool,  # noqa: ARG001  (what is left when it is no other)
    lever: float | None,
    note: str,
    **stated: Any,
) -> Outcome:
    """A catch into twin.json, or out of it. stated: hold_interval, width and measured, of `hold`."""
    from twin.physics.catches import logged_catch, set_catch, stated_catch, typical_catch

    told = [f"--{k.replace('_', '-')}" for k, v in stated.items() if v and hold is None]
    told += ["--lever"] if lever is not None and log is None else []
    if told:
        raise InputError(f"{told[0]} says nothing here", "--lever goes with --log, the others with --hold")
    twin = load(run)
    chosen = _part(twin, part)
    if chosen.physics is None:
        raise InputError(
            f"{chosen.name} has no mass and friction yet", "run twin export, which fills them in"
        )
    found = None
    if hold is not None:
        found = stated_catch(chosen, hold, stated.pop("hold_interval"), note=note, **stated)
    elif log is not None:
        found = logged_catch(chosen, log, lever, note)
    elif typical:
        found = typical_catch(chosen)
    edited = set_catch(twin, chosen.id, found)
    again = {chosen.id: lambda t: set_catch(t, chosen.id, found).twin}
    return keep(run, edited, [(chosen.name, c) for c in edited.changes], again=again)


def estimate(
    console: Console,
    run: Path,
    part: str | None,
    recording: Path | None,
    model: str | None,
    description: str,
    dry_run: bool,
    refresh: bool,
) -> Outcome:
    """Ask a vision-language model about parts. The one verb that sends something over the network."""
    from twin.vlm.answer import INSTRUCTIONS, describe, read_physical
    from twin.vlm.cache import ask_once
    from twin.vlm.client import Question, endpoint_from_environment
    from twin.vlm.estimate import apply, body_of
    from twin.vlm.picture import part_picture

    twin, table = load(run), read_materials()
    endpoint = None if dry_run else endpoint_from_environment(model)
    frame = None if recording is None else _frames_of(recording, twin, run_folder(run))
    notes: list[str] = []
    warnings: list[str] = []
    rows: list[tuple[str, Change]] = []
    again: dict[int, Callable[[Twin], Twin]] = {}
    with console.progress() as progress:
        for p in [_part(twin, part)] if part is not None else list(twin.parts):
            picture = part_picture(twin, p, run_folder(run), frame)
            text = describe(p, body_of(p.mesh, table).edges, description, picture.origin, picture.mark, table)
            question = Question(INSTRUCTIONS, text, (picture.jpeg,))
            sent = f"{picture.origin} ({len(picture.jpeg) / 1000:.0f} kB) and {len(text)} characters about {p.name}"
            if endpoint is None:
                notes += [f"would send {sent}:", text]
                continue
            progress(f"ask {p.name}", 0.0, f"{sent} to {endpoint.place}, model {endpoint.model}")
            folder = run_folder(run) / "stages" / "vlm"
            answer = ask_once(question, endpoint, read_physical, folder, refresh)
            told = "taken from an earlier answer to" if answer.cached else "sent to"
            progress(f"ask {p.name}", 1.0, f"{sent} {told} {endpoint.place}, model {endpoint.model}")
            edited = apply(twin, p.id, answer.value, endpoint.model, table)
            twin, a = edited.twin, answer.value
            again[p.id] = partial(_estimated, number=p.id, answer=answer.value, model=endpoint.model)
            warnings += edited.warnings
            rows += [(p.name, c) for c in edited.changes]
            notes.append(f"{p.name}: {a.name}, {a.shape} of {a.material}, {a.mass:.3g} kg: {a.notes}")
    if endpoint is None:
        return Outcome({"sent": False}, notes=[*notes, "nothing was sent"])
    return keep(run, Edited(twin, (), tuple(warnings)), rows, notes, again)


def _estimated(twin: Twin, number: int, answer: Any, model: str) -> Twin:
    from twin.vlm.estimate import apply

    return apply(twin, number, answer, model, read_materials()).twin


def _frames_of(path: Path, twin: Twin, run: Path) -> Callable[[int], Any]:
    """Colour pictures of the twin's recording."""
    recording = named(OPEN_RECORDING)(path, **opened_with(run))
    if twin.recorded is not None and recording.fingerprint != twin.recorded.fingerprint:
        raise InputError(f"{path} is not the recording of this twin", f"give {twin.recorded.source}")
    read: Callable[[int], Any] = recording.color
    return read


def keep(
    run: Path,
    edited: Edited,
    changes: Sequence[tuple[str, Change]],
    notes: Sequence[str] = (),
    again: Mapping[int, Callable[[Twin], Twin]] | None = None,
) -> Outcome:
    """Write the changed twin and tell what changed, and which files are now of an earlier twin.

    again: by a part's id, the change of a twin that has mass and friction: it is made of the twin without the
    user's edits as well, so that edits made anew don't lose it.
    """
    update(load(run), edited.twin, run)
    from twin.edits import found_folder
    from twin.physics import with_physics

    aside = found_folder(run_folder(run))
    if aside != run_folder(run) / "twin":
        before = load(aside)
        after = with_physics(before)
        for number in (again or {}).keys() & {p.id for p in before.parts}:
            after = (again or {})[number](after)
        update(before, after, aside)
    return _told(run, edited, changes, notes)


def _told(
    run: Path, edited: Edited, changes: Sequence[tuple[str, Change]], notes: Sequence[str] = ()
) -> Outcome:
    """What changed, and which files are now of an earlier twin."""
    place = run_folder(run)
    told = [*notes, *told_of_files(place, run, edited.twin.name)]
    if (place / "report.html").is_file():
        from twin.page import render

        render(place)
    rows = [[part, c.name, c.before or "none", c.after, c.source] for part, c in changes]
    if not rows:
        told.insert(0, "nothing changed")
    tables = [Table("what changed", ["part", "quantity", "before", "now", "source"], rows)] if rows else []
    data = {
        "changes": [{"part": part, **_change(c)} for part, c in changes],
        "stale": stale_formats(place, edited.twin.name),
    }
    return Outcome(data, tables, told, edited.warnings)


def stale_formats(place: Path, name: str) -> list[str]:
    """Formats of which the run has a file, which is of an earlier twin."""
    return [f for f, s in _FILES.items() if (place / "export" / f / f"{name}{s}").is_file()]


def told_of_files(place: Path, run: Path, name: str) -> list[str]:
    """A line for exports and for replays of an earlier twin that the run holds."""
    told = []
    if stale := stale_formats(place, name):
        told.append(
            f"{', '.join(stale)} in {place / 'export'} are of the earlier twin: `twin export {run}` writes them again"
        )
    if any((place / "replay").glob("*/*/report.json")):
        told.append(f"so are the replays: `twin replay {run}` plans them again")
    return told


def _change(c: Change) -> dict[str, Any]:
    return {"quantity": c.name, "before": c.before, "after": c.after, "source": c.source}


def _part(twin: Twin, name: str | None) -> Part:
    if name is not None:
        return twin.part(name)
    if len(twin.parts) != 1:
        names = ", ".join(p.name for p in twin.parts) or "none"
        raise InputError("which part is not clear", f"name it with --part; parts: {names}")
    return twin.parts[0]


def _data(part: Part) -> dict[str, Any]:
    """The numbers as JSON types, in the words of twin.json."""
    from twin.storage.document import part_document

    document = part_document(part)
    return {k: document[k] for k in ("inertial", "physics")}


_ACTIONS: Mapping[str, Callable[..., Outcome]] = {
    "show": show,
    "set": set_values,
    "catch": catch,
    "estimate": estimate,
}

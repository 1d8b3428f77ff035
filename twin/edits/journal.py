"""RUN/edits.json: the changes that a user made to the run's twin, and the twin as it is with them.

The twin as it was found stays beside it in RUN/twin_found/; RUN/twin/ is that with all edits made, so that an
edit that is taken back leaves nothing behind.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from twin.edits.edit import SAID, Edit, edit_from
from twin.edits.kinds import KINDS, applied
from twin.errors import FuntwinError, InputError
from twin.files.atomic import staging
from twin.files.text import write_text
from twin.runs.manifest import EDITS, FOUND
from twin.scene import Twin
from twin.storage import digest, keep_aside, load, save

_FORMAT = "funtwin-edits/1"


@dataclass(frozen=True)
class Made:
    """A twin with edits, and those that can't be made of it, each with the reason."""

    twin: Twin
    unfit: tuple[tuple[Edit, str], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def warnings(self) -> list[str]:
        """A line for each note and each edit that doesn't fit."""
        return [*self.notes, *(f"the edit {edit} does not fit any more: {why}" for edit, why in self.unfit)]


def made(found: Twin, edits: Sequence[Edit]) -> Made:
    """A twin as it was found, with edits made in order. Provenance `edits` holds those that fit."""
    twin, unfit, fit = found, [], []
    heard = found.provenance.get("said", [])
    for edit in edits:
        if edit.what == SAID:
            if edit.to not in heard:
                unfit.append((edit, "`twin reconstruct` has not heard it yet"))
            continue
        try:
            twin = applied(twin, edit)
        except FuntwinError as e:
            unfit.append((edit, e.problem))
        else:
            fit.append(edit.row)
    if fit or "edits" in found.provenance:
        provenance = {k: v for k, v in twin.provenance.items() if k != "edits"}
        twin = replace(twin, provenance=provenance | ({"edits": fit} if fit else {}))
    return Made(twin, tuple(unfit))


def read(run: Path, twin: Twin) -> list[Edit]:
    """The edits of a run whose twin is this; none where there is no file.

    Raises InputError for a file that is no list of edits, and for one of another twin, by its name.
    """
    path, told = run / EDITS, _document(run / EDITS)
    if told is None:
        return []
    if told.get("recording", "") != _recording(twin) or (
        not _recording(twin) and told.get("twin") != twin.name
    ):
        other = str(told.get("twin", "?"))[:60]
        raise InputError(
            f"{path} is of another twin, {other!r}: this one is {twin.name!r}", "move it away, or to that run"
        )
    return [edit_from(row, KINDS, f"{path}, edit {k}") for k, row in enumerate(told["edits"], 1)]


def said_before(run: Path, recording: str) -> list[str]:
    """What the user said of a recording, by its fingerprint, as the command line takes it: of the run's file
    of edits. Nothing where there is none, or one of another recording.

    Raises InputError for a file that is no list of edits.
    """
    path, told = run / EDITS, _document(run / EDITS)
    if told is None or told.get("recording", "") != recording:
        return []
    rows = [edit_from(row, KINDS, f"{path}, edit {k}") for k, row in enumerate(told["edits"], 1)]
    return [e.to for e in rows if e.what == SAID]


def with_said(edits: Sequence[Edit], said: Sequence[str]) -> list[Edit]:
    """The edits with these texts as the user's word on the recording, those that are new at the end."""
    before = [e.to for e in edits if e.what == SAID]
    kept = [e for e in edits if e.what != SAID or e.to in said]
    return [*kept, *(Edit(SAID, "", text) for text in said if text not in before)]


def _document(path: Path) -> dict[str, Any] | None:
    """The file of edits; None where there is none."""
    if not path.is_file():
        return None
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as e:
        raise InputError(f"{path} can't be read: {e}", "mend it, or move it away") from e
    if not isinstance(told, dict) or told.get("format") != _FORMAT or not isinstance(told.get("edits"), list):
        raise InputError(f"{path} is no list of edits", f'it begins with "format": "{_FORMAT}"')
    return told


def write(run: Path, twin: Twin, edits: Sequence[Edit]) -> None:
    """Write them, one a line; without any the file goes."""
    if not edits:
        (run / EDITS).unlink(missing_ok=True)
        return
    rows = ",\n".join(f"  {json.dumps(e.row, allow_nan=False, ensure_ascii=False)}" for e in edits)
    head = {"format": _FORMAT, "twin": twin.name, "recording": _recording(twin)}
    lines = "".join(f' "{key}": {json.dumps(value)},\n' for key, value in head.items())
    write_text(run / EDITS, f'{{\n{lines} "edits": [\n{rows}\n ]\n}}\n')


def add(run: Path, edits: Sequence[Edit]) -> Made:
    """Make edits of a run's twin, after those that it has.

    Raises what an edit raises that can't be made; then nothing has changed.
    """
    found = _own(run)
    before = read(run, found)
    twin = made(found, before).twin
    for edit in edits:
        twin = applied(twin, edit)
    return keep(run, found, [*before, *edits], kept_aside(run))


def undo(run: Path, count: int = 1) -> tuple[list[Edit], Made]:
    """Take the last edits back: these, the last one first, and the twin without them.

    Raises InputError for more than there are.
    """
    found = _own(run)
    edits = read(run, found)
    if not 1 <= count <= len(edits):
        has = f"{len(edits)} edit{'s' * (len(edits) != 1)}" if edits else "no edits"
        raise InputError(f"{run} has {has}: {count} can't be taken back", "give fewer")
    undone = edits[: -count - 1 : -1]
    result = keep(run, found, edits[:-count], kept_aside(run))
    again = [
        f"it was made with {e.to}: `twin reconstruct` makes it without" for e in undone if e.what == SAID
    ]
    return undone, replace(result, notes=(*result.notes, *again))


def keep(run: Path, found: Twin, edits: Sequence[Edit], by_hand: Path | None = None) -> Made:
    """Write a twin with edits: what was found into RUN/twin_found/, the edited one into RUN/twin/.

    by_hand: from `kept_aside`, to be told.
    """
    result = made(found, edits)
    if by_hand is not None:
        note = f"the twin was changed beside its edits: it is kept in {by_hand}"
        result = replace(result, notes=(note,))
    aside = run / FOUND
    changed = _changes(edits)
    if changed and not (aside / "twin.json").is_file():
        _linked(run / "twin", aside)
    if changed or aside.is_dir():
        save(result.twin, run / "twin")
    write(run, found, edits)
    if not changed:
        shutil.rmtree(aside, ignore_errors=True)
    return result


def _changes(edits: Sequence[Edit]) -> bool:
    """Whether edits change a twin: what is said of a recording does not."""
    return any(e.what != SAID for e in edits)


def settled(run: Path) -> Made | None:
    """The run's twin with the edits of RUN/edits.json, made now where they are not made yet; None where the
    twin stands as the file says, or there is neither."""
    there = run / "twin" / "twin.json"
    if not there.is_file() or not ((run / EDITS).is_file() or (run / FOUND).is_dir()):
        return None
    found = found_twin(run)
    edits = read(run, found)
    result = made(found, edits)
    if result.twin.provenance.get("edits") == load(run).provenance.get("edits") and not (
        not _changes(edits) and (run / FOUND).is_dir()
    ):
        return None
    return keep(run, found, edits, kept_aside(run))


def kept_aside(run: Path) -> Path | None:
    """A copy of a run's twin, where somebody changed it beside its edits, which making them anew would lose;
    else None."""
    if not (run / FOUND / "twin.json").is_file():
        return None
    there = load(run)
    rows = there.provenance.get("edits", [])
    known = [edit_from(row, KINDS, f"{run / 'twin'}, provenance, edit {k}") for k, row in enumerate(rows, 1)]
    same = digest(made(found_twin(run), known).twin) == digest(there)
    return None if same else keep_aside(run / "twin")


def found_folder(run: Path) -> Path:
    """Where a run's twin lies as it was found: RUN/twin_found where there are edits, else RUN/twin."""
    aside = run / FOUND
    return aside if (aside / "twin.json").is_file() else run / "twin"


def found_twin(run: Path) -> Twin:
    """The twin of a run as it was found, without edits."""
    return load(found_folder(run))


def _own(run: Path) -> Twin:
    if not (run / "twin" / "twin.json").is_file():
        raise InputError(f"{run} holds no twin/twin.json, beside which edits are kept", "give the run folder")
    return found_twin(run)


def _recording(twin: Twin) -> str:
    return "" if twin.recorded is None else twin.recorded.fingerprint


def _linked(folder: Path, aside: Path) -> None:
    """A copy of a twin's folder: files are linked, and replacing one leaves the other's."""
    with staging(aside) as staged:
        shutil.copytree(folder, staged, symlinks=True, copy_function=os.link, dirs_exist_ok=True)
        staged.rename(aside)


def edit_of(twin: Twin, part: str, assignment: str, why: str = "", **more: Any) -> Edit:
    """The edit that a text such as "upper=92deg" means of a part, or, with an empty name, of the twin.

    Raises InputError for what can't be edited and for a text that is no value of it.
    """
    what, equals, text = assignment.partition("=")
    kind = KINDS.get(what)
    if kind is None:
        raise InputError(f"{what!r} can't be edited", f"what can: {', '.join(KINDS)}")
    if bool(equals) == kind.alone:
        wanted = what if kind.alone else f"{what}=VALUE"
        raise InputError(f"{assignment!r} is no edit", f"write {wanted}: {kind.help}")
    if not part:
        if not kind.whole:
            raise InputError(f"{what} is of a part, and none is named", "name it with --part")
        level = None if twin.verdict is None else twin.verdict.level
        return Edit(what, "", text, level, "", why)
    one = twin.part(part)
    return Edit(what, one.name, kind.read(twin, one, text), kind.now(one), kind.unit(one), why, **more)

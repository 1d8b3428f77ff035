"""What can be edited: how a user's text is read, what stands there now, and how the twin changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from twin.edits.edit import Edit
from twin.edits.joints import with_axis, with_closed, with_limit, with_pivot
from twin.edits.parts import merged, removed, split, with_name
from twin.edits.unfit import Unfit
from twin.edits.values import SNAPS, axis_of, number_of, point_of, state_of
from twin.edits.worth import overruled
from twin.errors import InputError
from twin.physics.edit import given, set_physics
from twin.scene import Part, Revolute, Twin
from twin.units import UNITS


@dataclass(frozen=True)
class Kind:
    """How one thing is edited.

    help: for the command line. read: the value of a user's text. now: what stands there. apply: the twin with
    it. unit: of the value, by the part. alone: whether it needs no value. whole: whether it may be of the
    twin as a whole.
    """

    help: str
    read: Callable[[Twin, Part, str], Any]
    now: Callable[[Part], Any]
    apply: Callable[[Twin, Part, Edit], Twin]
    unit: Callable[[Part], str] = lambda _: ""
    alone: bool = False
    whole: bool = False


def _state_unit(part: Part) -> str:
    return "rad" if part.joint.kind == "revolute" else "m"


def _floats(values: Any) -> list[float]:
    return [float(v) for v in values]


def _limit(what: str) -> Kind:
    return Kind(
        f"{what} limit of the joint, from the closed state, such as {'92deg or 0.4' if what == 'upper' else '-2deg'}",
        lambda _, part, text: state_of(part, what, text),
        lambda part: float(getattr(part.joint, what)),
        lambda twin, part, e: with_limit(twin, part, what, _number(e)),
        _state_unit,
    )


def _quantity(what: str) -> Kind:
    def now(part: Part) -> float | None:
        owner = part.inertial if what == "mass" else part.physics
        return None if owner is None else float(getattr(owner, what).value)

    def apply(twin: Twin, part: Part, e: Edit) -> Twin:
        quantity = given(what, _number(e), e.interval, e.measured, e.why)
        return set_physics(twin, part.id, {what: quantity}).twin

    def unit(part: Part) -> str:
        per = {"mass": ("kg", "kg"), "friction": ("", ""), "damping": ("N m s/rad", "N s/m")}
        return per.get(what, ("N m", "N"))[part.joint.kind == "prismatic"]

    return Kind(f"{what}, {UNITS[what]}", lambda _, __, text: number_of(what, text), now, apply, unit)


def _pivot(part: Part) -> list[float] | None:
    return _floats(part.joint.pivot) if isinstance(part.joint, Revolute) else None


def _one_line(what: str) -> Callable[[Twin, Part, str], str]:
    def read(_: Twin, __: Part, text: str) -> str:
        if not text.strip() or not text.isprintable():
            raise InputError(f"{what} = {text!r} is no line of text", "write one")
        return text.strip()

    return read


def _trusted(_: Twin, __: Part, text: str) -> str:
    if text != "trusted":
        raise InputError(f"verdict = {text!r}: a user's word is that it is right", "write verdict=trusted")
    return text


def _overruled(twin: Twin, part: Part | None, e: Edit) -> Twin:
    if not e.why.strip():
        raise InputError("a verdict is overruled for a reason", "say it with --why")
    return overruled(twin, part, e.why)


def _number(e: Edit) -> float:
    if isinstance(e.to, bool) or not isinstance(e.to, (int, float)) or not np.isfinite(e.to):
        raise InputError(f"{e.what} is a number, not {e.to!r:.40}", "write one")
    return float(e.to)


def _vector(e: Edit, value: Any) -> Any:
    a = np.asarray(value, np.float64) if isinstance(value, list) and len(value) == 3 else np.full(3, np.nan)
    if not np.all(np.isfinite(a)):
        raise InputError(f"{e.what} is three numbers, not {value!r:.40}", "write them in brackets")
    return a


def _before(e: Edit) -> Any:
    """The vector that it was; of an edit that does not say it, what it is to be."""
    return _vector(e, e.to if e.was is None else e.was)


KINDS: Mapping[str, Kind] = {
    "upper": _limit("upper"),
    "lower": _limit("lower"),
    "closed": Kind(
        "the state, as it is counted now, in which it is closed",
        lambda _, part, text: state_of(part, "closed", text),
        lambda _: 0.0,
        lambda twin, part, e: with_closed(twin, part, _number(e)),
        _state_unit,
    ),
    "axis": Kind(
        f"direction of the joint: {', '.join(SNAPS)}, or X,Y,Z",
        axis_of,
        lambda part: _floats(part.joint.axis),
        lambda twin, part, e: with_axis(twin, part, _vector(e, e.to), _before(e)),
    ),
    "pivot": Kind(
        "a point X,Y,Z of the hinge's axis, m in the twin's world",
        lambda _, __, text: point_of("pivot", text),
        _pivot,
        lambda twin, part, e: with_pivot(twin, part, _vector(e, e.to), _before(e)),
        lambda _: "m",
    ),
    "name": Kind(
        "what the part is called",
        _one_line("name"),
        lambda part: part.name,
        lambda twin, part, e: with_name(twin, part, str(e.to)),
    ),
    "removed": Kind(
        "it is no part: it stands still",
        lambda *_: True,
        lambda _: None,
        lambda twin, part, _: removed(twin, part),
        alone=True,
    ),
    "merged": Kind(
        "the part of which it is a piece",
        _one_line("merged"),
        lambda _: None,
        lambda twin, part, e: merged(twin, part, twin.part(str(e.to))),
    ),
    "split": Kind(
        "a point X,Y,Z on the connected piece of it that is a part of its own, m in the twin's world",
        lambda _, __, text: point_of("split", text),
        lambda _: None,
        lambda twin, part, e: split(twin, part, _vector(e, e.to)),
        lambda _: "m",
    ),
    "verdict": Kind(
        "trusted, with --why",
        _trusted,
        lambda part: part.verdict.level if part.verdict is not None else None,
        _overruled,
        whole=True,
    ),
    **{what: _quantity(what) for what in UNITS},
    "material": Kind(
        "a material of assets/materials.toml",
        _one_line("material"),
        lambda part: None if part.physics is None else part.physics.density.source,
        lambda twin, part, e: set_physics(twin, part.id, {}, str(e.to)).twin,
    ),
}


def applied(twin: Twin, edit: Edit) -> Twin:
    """The twin with an edit made.

    Raises Unfit where the twin is not as it was, SceneError and InputError for a value that can't be.
    """
    kind = KINDS[edit.what]
    if not edit.part:
        if not kind.whole:
            raise InputError(f"{edit.what} is of a part, and none is named", "name it with --part")
        return kind.apply(twin, None, edit)  # type: ignore[arg-type]
    names = {p.name for p in twin.parts}
    if edit.what == "name" and edit.part not in names and edit.to in names:
        return twin  # a new reconstruction gave it the name that it had
    found = next((p for p in twin.parts if p.name == edit.part), None)
    if found is None:
        raise Unfit(f"there is no part {edit.part!r}")
    if edit.unit and edit.unit != kind.unit(found):
        raise Unfit(f"it is a {found.joint.kind} joint now, and {edit.unit} is no unit of it")
    return kind.apply(twin, found, edit)

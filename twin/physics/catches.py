"""Catches that a user asks for: a measured or stated force, a log's, other furniture's; none by default."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from twin import geometry as geo
from twin.errors import InputError
from twin.files.paths import AnyPath
from twin.physics.edit import Edited, changes, followed, given, with_part
from twin.physics.force_log import along_joint, fit_catch, measured_catch, read_force_log
from twin.physics.materials import MaterialTable, read_materials
from twin.physics.parts import physics_of
from twin.quantities import Catch, Quantity
from twin.scene import Part, Revolute, Twin
from twin.units import ANGLES, LENGTHS, number_and_unit

AT_HANDLE = 0.010  # m; chosen by us: magnets and rollers of furniture let go within about as much
# rad, m; chosen by us: what holds farther out is a spring, not a catch
WIDEST = {"revolute": 0.6, "prismatic": 0.2}
_LEVER = 0.01  # m; chosen by us: nearer to the hinge nobody pulls
_ROUNDING = 1e-9  # rad, m
# unit -> size, and whether it is meant at the handle of a hinge
_UNITS: Mapping[str, Mapping[str, tuple[float, bool]]] = {
    "force": {"N": (1.0, True), "kN": (1e3, True), "Nm": (1.0, False)},
    "width": {k: (v, False) for k, v in ANGLES.items()} | {k: (v, True) for k, v in LENGTHS.items()},
}  # fmt: skip


def lever_of(part: Part) -> float | None:
    """Distance (m) from a hinge to where the hand held the part; None of a slide, or if not known."""
    if not isinstance(part.joint, Revolute) or part.contact is None:
        return None
    lever = float(geo.point_line_distance(part.contact.point, part.joint.pivot, part.joint.axis))
    return lever if lever > _LEVER else None


def read_amount(text: str, quantity: str, part: Part) -> float:
    """A force (N m of a hinge, N of a slide) or width (rad, m) as written: 24N, 7.2Nm, 3deg, 10mm; or bare.

    Args:
        text: number and unit.
        quantity: "force" or "width".
        part: that has the catch; N and mm of a hinge are meant where the hand held it.

    Raises InputError for other texts, another joint's unit, or where the hand's place is not known.
    """
    hinge = part.joint.kind == "revolute"
    known = {k: u for k, u in _UNITS[quantity].items() if hinge or u[1]}
    value, unit = number_and_unit(text)
    if math.isnan(value) or (unit and unit not in known):
        raise InputError(
            f"the {quantity} {text!r} of {part.name}'s catch is not understood",
            f"give a number and {', '.join(known)}",
        )
    size, at_handle = known[unit] if unit else (1.0, False)
    if not (hinge and at_handle):
        return value * size
    lever = lever_of(part)
    if lever is None:
        other = "Nm" if quantity == "force" else "deg"
        raise InputError(
            f"where {part.name} is held is not known, so {text!r} tells nothing of its hinge",
            f"give it in {other}",
        )
    return value * size * lever if quantity == "force" else value * size / lever


def stated_catch(
    part: Part,
    force: str,
    interval: tuple[str, str] | None = None,
    width: str | None = None,
    measured: bool = False,
    note: str = "",
) -> Catch:
    """A catch from what a user wrote, see `read_amount`.

    Args:
        part: that has it.
        force: that has to be overcome beside friction.
        interval: low and high end of the force.
        width: how far from closed it acts; 10 mm of the hand's way by default.
        measured: on this part; else it is only stated.
        note: where it comes from, for people.
    """
    low_high = (
        None
        if interval is None
        else (read_amount(interval[0], "force", part), read_amount(interval[1], "force", part))
    )
    unit, of_width = ("N m", "rad") if part.joint.kind == "revolute" else ("N", "m")
    strong = given("the force of a catch", read_amount(force, "force", part), low_high, measured, note, unit)
    if width is not None:
        wide = given(
            "the width of a catch", read_amount(width, "width", part), None, measured, note, of_width
        )
        return Catch(strong, wide)
    lever = lever_of(part) or 1.0
    if part.joint.kind == "revolute" and lever_of(part) is None:
        raise InputError(f"how far {part.name}'s catch acts is not known", "give --width, e.g. 3deg")
    reach = AT_HANDLE / lever
    source = f"default: {1e3 * AT_HANDLE:g} mm of the hand's way, chosen by us"
    return Catch(strong, Quantity(reach, source, (0.2 * reach, 2 * reach)))


def typical_catch(part: Part, table: MaterialTable | None = None) -> Catch:
    """What other furniture with such a joint is held by. Raises InputError where nobody measured one."""
    table = read_materials() if table is None else table
    if part.joint.kind not in table.catches:
        raise InputError(
            f"no catch of a {part.joint.kind} joint was ever measured here",
            "give its force with --hold, e.g. 15N",
        )
    return table.catches[part.joint.kind]


def logged_catch(part: Part, path: AnyPath, lever: float | None = None, note: str = "") -> Catch:
    """The catch in a log of forces.

    Args:
        part: that was opened.
        path: of the log, see `read_force_log`.
        lever: m from the hinge to where the force was taken; by default where the hand held the part.
        note: kept with it, for people.

    Raises InputError: a log that can't be read or shows no catch, or a lever that is none.
    """
    if lever is not None and not (math.isfinite(lever) and lever > _LEVER):
        raise InputError(f"--lever must be more than {1e3 * _LEVER:g} mm, got {lever:g}", "give it in m")
    log = read_force_log(path)
    state, force = along_joint(log, part.joint.kind, lever if lever is not None else lever_of(part))
    try:
        return measured_catch(log, fit_catch(state, force), part.joint.kind, note)
    except InputError as e:
        raise InputError(f"{path}: {e.problem}", e.remedy) from e


def require_catch(part: Part) -> None:
    """Raises InputError for a catch that the joint has no place for."""
    joint, catch = part.joint, None if part.physics is None else part.physics.catch
    if catch is None:
        return
    unit = "rad" if joint.kind == "revolute" else "m"
    width = catch.width.value
    if joint.lower < -_ROUNDING:
        raise InputError(
            f"{part.name} also moves to {joint.lower:.3g} {unit}, the other way than it opens",
            "a catch holds a part that is closed at a stop",
        )
    if width >= min(joint.upper, WIDEST[joint.kind]):
        raise InputError(
            f"the catch of {part.name} acts over {width:.3g} {unit}; the part opens to {joint.upper:.3g} {unit}",
            f"give a --width below that, and {WIDEST[joint.kind]:g} {unit}",
        )


def set_catch(twin: Twin, key: int | str, catch: Catch | None, table: MaterialTable | None = None) -> Edited:
    """The twin with a catch on one part, in place of the one it had; None takes it away.

    Args:
        twin: to be changed.
        key: name or id of the part.
        catch: its catch.
        table: the table of materials, by default assets/materials.toml.

    Raises SceneError: no such part, or one without friction. InputError: a catch with no place.
    """
    table = read_materials() if table is None else table
    old = twin.part(key)
    new = replace(old, physics=replace(physics_of(old), catch=catch))
    require_catch(new)
    edited = with_part(twin, new, table)
    new = edited.part(old.id)
    return Edited(edited, changes(old, new), followed(twin, edited, new))

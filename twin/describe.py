"""How scene types show themselves: a `repr` line, a notebook table. Numbers are rounded, arrays counted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, cast

import numpy as np

if TYPE_CHECKING:  # the types show themselves by what stands here, so they stand above it
    from twin.inferred import Completion, Inferred, Interior
    from twin.joint import Joint, Revolute
    from twin.quantities import Inertial, PartPhysics, Quantity
    from twin.scene import Box, ContactPath, Mesh, Motion, Part, Recorded, StaticPart, Trajectory, Twin

_MOST = 6  # parts that a line or provenance names; a table has them all
_COLUMNS = ("part", "on", "joint", "range", "± 1 σ", "mass", "faces")


def line(thing: object) -> str:
    """The type and what matters of its value, in one line."""
    told = next((_LINES[c.__name__] for c in type(thing).__mro__ if c.__name__ in _LINES), None)
    return f"<{type(thing).__name__}>" if told is None else told(thing)


def _mesh(mesh: Mesh) -> str:
    size = f", {_lengths(np.ptp(mesh.vertices, axis=0))} m" if len(mesh.vertices) else ""
    colors = ", coloured" if mesh.colors is not None else ""
    return f"<Mesh: {len(mesh.faces)} faces, {len(mesh.vertices)} vertices{size}{colors}>"


def _box(box: Box) -> str:
    return f"<Box: {_lengths(box.size)} m at {_vector(box.T_world_box[:3, 3])} m>"


def _joint(joint: Joint) -> str:
    sigma = sigma_text(joint)
    place = f" through {_vector(cast('Revolute', joint).pivot)} m" if joint.kind == "revolute" else ""
    told = f"{range_text(joint)}, axis {_vector(joint.axis)}{place}{f', {sigma}' if sigma else ''}"
    return f"<{type(joint).__name__}: {told}>"


def _motion(motion: Motion) -> str:
    if not len(motion.frames):
        return "<Motion: none measured>"
    spans = f", {len(motion.intervals)} interactions" if motion.intervals else ""
    moved = f"{motion.state.min():z.3g} to {motion.state.max():z.3g}"
    return f"<Motion: {len(motion.frames)} frames, state {moved}{spans}, residual {1000 * motion.residual:.2g} mm>"


def _contact(contact: ContactPath) -> str:
    where = f"at {_vector(contact.point)} m, {1000 * contact.width:.0f} mm wide"
    return f"<ContactPath: {where}, in {len(contact.frames)} frames; {contact.source!r}>"


def _static(static: StaticPart) -> str:
    return f"<StaticPart {static.name!r}: {len(static.mesh.faces)} faces, {len(static.collision)} shapes>"


def _part(part: Part) -> str:
    return f"<Part {part.id} {part.name!r}: {_part_text(part)}>"


def _trajectory(cameras: Trajectory) -> str:
    seconds = f"{cameras.times[0]:.2f} to {cameras.times[-1]:.2f} s"
    return f"<Trajectory: {len(cameras.frames)} camera poses, {seconds}>"


def _recorded(recorded: Recorded) -> str:
    return f"<Recorded: {recorded.source!r}, {recorded.frames} frames, {recorded.fingerprint[:8]}>"


def _inertial(inertial: Inertial) -> str:
    return f"<Inertial: {_number(inertial.mass)} kg at {_vector(inertial.com)} m; {inertial.mass.source}>"


def _physics(physics: PartPhysics) -> str:
    told = ", ".join(f"{name} {_number(quantity)}" for name, quantity in physics.numbers.items())
    if physics.catch is not None:
        told += f", catch {_number(physics.catch.force)} within {_number(physics.catch.width)}"
    return f"<PartPhysics: {told}>"


def _inferred(piece: Inferred) -> str:
    return f"<Inferred {piece.name!r}: {piece.role}, {piece.basis}, {len(piece.mesh.faces)} faces; {piece.reason}>"


def _interior(interior: Interior) -> str:
    return f"<Interior {interior.name!r}: {_lengths(interior.box.size)} m>"


def _completion(completion: Completion) -> str:
    assumed = f", {len(completion.assumed)} of them assumed" if completion.assumed else ""
    return f"<Completion: {len(completion.pieces)} pieces{assumed}, {len(completion.shapes)} shapes>"


def _twin(twin: Twin) -> str:
    named = [f"{p.name}: {joint_text(p.joint)}" for p in twin.parts[:_MOST]]
    more = [f"and {len(twin.parts) - _MOST} more"] if len(twin.parts) > _MOST else []
    parts = "; ".join([*named, *more]) or "no moving part"
    worth = f"; {twin.verdict.level}" if twin.verdict is not None else ""
    return f"<Twin {twin.name!r}: {twin.static.name} ({len(twin.static.mesh.faces)} faces); {parts}{worth}>"


# By the names of the types, whose subclasses tell the same.
_LINES: dict[str, Callable[[Any], str]] = {
    "Mesh": _mesh,
    "Box": _box,
    "Joint": _joint,
    "Motion": _motion,
    "ContactPath": _contact,
    "StaticPart": _static,
    "Part": _part,
    "Trajectory": _trajectory,
    "Recorded": _recorded,
    "Inferred": _inferred,
    "Interior": _interior,
    "Completion": _completion,
    "Inertial": _inertial,
    "PartPhysics": _physics,
    "Twin": _twin,
}


def html(thing: Twin | Part) -> str:
    """A table of the part, or of the twin's parts, complete in itself; texts of the user's are escaped."""
    if type(thing).__name__ == "Part":
        part = cast("Part", thing)
        return _table(
            f"part {part.name}", [_row(part, "static" if part.parent is None else f"part {part.parent}")]
        )
    thing = cast("Twin", thing)
    parents = {p.id: p.name for p in thing.parts}
    rows = [_row(p, thing.static.name if p.parent is None else parents[p.parent]) for p in thing.parts]
    title = f"twin {thing.name}: {thing.static.name}, {len(thing.static.mesh.faces):,} faces"
    return _table(title, rows)


def joint_text(joint: Joint) -> str:
    """Type, range with its unit and, where it is known, one standard deviation."""
    sigma = sigma_text(joint)
    return f"{joint.kind}, {range_text(joint)}{f', {sigma}' if sigma else ''}"


def range_text(joint: Joint) -> str:
    """The range in the units that people use: degrees or metres."""
    if joint.kind == "revolute":
        return f"{np.rad2deg(joint.lower):z.1f} to {np.rad2deg(joint.upper):.1f}°"
    return f"{joint.lower:z.3f} to {joint.upper:.3f} m"


def sigma_text(joint: Joint) -> str:
    """One standard deviation of axis, pivot and state; empty where nobody estimated it."""
    s = joint.sigma
    if s is None:
        return ""
    turning = joint.kind == "revolute"
    pivot = f", pivot ± {1000 * s.pivot:.1f} mm" if s.pivot is not None else ""
    state = f"{np.rad2deg(s.state):.1f}°" if turning else f"{1000 * s.state:.1f} mm"
    return f"axis ± {np.rad2deg(s.axis):.2f}°{pivot}, state ± {state}"


def _part_text(part: Part) -> str:
    mass = f", {_number(part.inertial.mass)} kg" if part.inertial is not None else ""
    on = f", on part {part.parent}" if part.parent is not None else ""
    worth = f", {part.verdict.level}" if part.verdict is not None else ""
    return f"{joint_text(part.joint)}, {len(part.mesh.faces)} faces{mass}{on}{worth}"


def _row(part: Part, on: str) -> tuple[str, ...]:
    mass = f"{_number(part.inertial.mass)} kg" if part.inertial is not None else ""
    joint = part.joint
    told = (range_text(joint), sigma_text(joint), mass, f"{len(part.mesh.faces):,}")
    return (part.name, on, joint.kind, *told)


def _table(title: str, rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(c)}</th>" for c in _COLUMNS)
    body = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in rows)
    return f"<table><caption>{escape(title)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _number(quantity: Quantity) -> str:
    low, high = quantity.interval
    return f"{quantity.value:.3g} ({low:.3g} to {high:.3g})"


def _vector(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> str:
    return f"({', '.join(f'{v:z.3f}' for v in values)})"


def _lengths(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> str:
    return " x ".join(f"{v:.3f}" for v in values)

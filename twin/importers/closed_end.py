"""Where a joint of a file is closed, which way it opens, and how much of its range the twin keeps.

In a twin state 0 is closed and opening is positive; a file says neither. In order: the user's word, a
keyframe of the file named closed or open, the end of the range near the rest pose. Where none of them tells,
the part is closed at rest and opens to both sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.errors import InputError
from twin.importers.groups import Surroundings
from twin.importers.source import Closed, SourceJoint

# Share of the range. A rest pose this near to an end is closed there, and travel behind the closed pose
# that is no longer than this is slack: LIBERO's drawers have 3 and 6 %, joints that open to both sides more.
_NEAR = 0.15
# m, chosen by us: a part with visuals so much deeper in others than at rest is not closed but inside.
_DEEPER = 1e-3
# Share. What opens leaves its furniture: the convex hull of both is smallest when it is closed. In the
# collections of benchmarks/imports.py the hull shrinks to 0.26..0.68 where doors, drawers and lids close, and
# to no less than 0.79 where buttons, levers and handles are pressed from rest; this is the middle.
_LESS = 0.73


@dataclass(frozen=True)
class Travel:
    """What a twin takes of a joint's range, in the file's own coordinate, m or rad.

    closed: state 0 of the twin. lower, upper: the range that is kept. opens: 1 where the coordinate grows in
    opening, else -1. source: who says so. doubt: what the user should know of the choice; empty where closed
    is an end of the range.
    """

    closed: float
    lower: float
    upper: float
    opens: float
    source: str
    doubt: str = ""


@dataclass(frozen=True)
class _Choice:
    """A closed pose and why; `doubt`: a clause. `two_sided`: nothing says that travel behind it is slack."""

    at: float
    source: str
    doubt: str = ""
    two_sided: bool = False


def travel_of(
    file: str,
    span: tuple[float, float],
    closed: Closed | None,
    near: Surroundings,
    whole_range: bool = False,
) -> Travel:
    """The travel of a joint.

    Args:
        file: the file's name, for `source`.
        span: lower and upper end of the range.
        closed: what the user says, None where nothing.
        near: the part of the joint among the others.
        whole_range: the user says both, range and closed pose: all of the range is kept.

    Raises:
        InputError: the user's closed pose is outside the range.
    """
    joint, (low, high) = near.joint, span
    if closed is not None:
        choice = _Choice(_asked(joint.name, closed, span), "given by the user")
    elif joint.closed is not None:
        choice = _Choice(_clipped(joint.closed, span), f"the keyframe of {file} that closes it")
    else:
        choice = _from_rest(file, span, near)
    opens = _opens(choice.at, joint, span)
    behind = choice.at - low if opens > 0 else high - choice.at
    clauses = [choice.doubt] if choice.doubt else []
    if behind > 0:
        end = low if opens > 0 else high
        if whole_range or choice.two_sided or behind > _NEAR * (high - low):
            clauses.append(f"it opens to both sides, {low:g} to {high:g}")
        else:
            clauses.append(f"the travel from {choice.at:g} to {end:g} is cut off")
            low, high = (choice.at, high) if opens > 0 else (low, choice.at)
    doubt = ""
    if clauses:
        doubt = f"joint {joint.name!r} is closed at {choice.at:g}, {choice.source}: {'; '.join(clauses)}"
        doubt += (
            "" if closed is not None else f"; say otherwise with --closed {joint.name}=lower|upper|NUMBER"
        )
    return Travel(choice.at, low, high, opens, choice.source, doubt)


def _asked(name: str, closed: Closed, span: tuple[float, float]) -> float:
    low, high = span
    at = {"lower": low, "upper": high}.get(closed, np.nan) if isinstance(closed, str) else float(closed)
    if not low <= at <= high:
        raise InputError(
            f"joint {name!r} can't be closed at {closed!r}",
            f"give lower, upper or a number from {low:g} to {high:g}",
        )
    return at


def _from_rest(file: str, span: tuple[float, float], near: Surroundings) -> _Choice:
    """Closed at the end next to the rest pose; at rest where that end is inside of others or none is near."""
    joint, (low, high) = near.joint, span
    rest = _clipped(joint.rest, span)
    end = low if rest - low <= high - rest else high
    if joint.open is not None:
        end = low if joint.open - low > high - joint.open else high
    elif abs(rest - end) > _NEAR * (high - low):
        return _Choice(
            rest,
            f"the rest pose of {file}",
            f"which end is closed is not known, for its rest pose is near neither end of {low:g} to {high:g}",
            two_sided=True,
        )
    depth = 0.0 if rest == end else near.deeper(rest, end)
    if depth > _DEEPER:
        return _Choice(
            rest,
            f"the rest pose of {file}",
            f"at its end {end:g} it would be {1000 * depth:.3g} mm or more inside others",
        )
    source = (
        f"the rest pose of {file}"
        if joint.rest == end
        else f"the end of the range in {file} next to its rest pose"
    )
    return _Choice(end, source, "" if joint.open is not None else _smaller(end, low + high - end, near))


def _smaller(end: float, other: float, near: Surroundings) -> str:
    """Why the other end may be the closed one; empty where nothing says so."""
    less, here = near.bulk(other), near.bulk(end)
    if not less < _LESS * here:
        return ""
    return f"at its other end, {other:g}, it and what it hangs on take {less / here:.0%} of the room"


def _opens(at: float, joint: SourceJoint, span: tuple[float, float]) -> float:
    """The sign of opening: towards the keyframe that opens the joint, else the longer way."""
    if joint.open is not None and _clipped(joint.open, span) != at:
        return float(np.sign(_clipped(joint.open, span) - at))
    return 1.0 if span[1] - at >= at - span[0] else -1.0


def _clipped(position: float, span: tuple[float, float]) -> float:
    return float(np.clip(position, *span))

"""Why a plan is refused or a replay failed: the words of each cause.

Who wants to know what happened asks for the `type`; who counts causes counts `kind`, which leaves the numbers
out.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from twin.cause import Cause, Numbers, Words
from twin.errors import PlanningError


def reason(type: str, *values: Any) -> Cause:
    """The cause of a type in `REASONS` by its numbers. Raises as `Cause.told`."""
    return Cause.told(REASONS, type, *values)


class RefusedError(PlanningError):
    """A path or trajectory can't be, for `reason`."""

    def __init__(self, reason: Cause) -> None:
        super().__init__(reason.text)
        self.reason = reason


def reason_of(error: PlanningError) -> Cause:
    """What an error of planning says."""
    return error.reason if isinstance(error, RefusedError) else reason("Unlawful", error.problem)


def _unreachable(n: Numbers) -> str:
    reach = "reach {short:.2f} m short" if n["short"] >= 0.01 else "tool {short:.0f mm} off"
    joints = " ({stopped})" if n["stopped"] else ""
    return f"unreachable at state {{state:.2f}} {{unit}}: {reach}, hand {{turned:.0f deg}} off{joints}"


def _reconfigures(n: Numbers) -> str:
    return "{kind}" if n["jump"] is None else "{kind} (one joint jumps by {jump:.1f} rad)"


def _weak(n: Numbers) -> str:
    what = f"arm{' and part' if n['loaded'] else ''} take {{needed:.1f}} N m at rest"
    return f"{{kind}} at state {{state:.2f}}: {what}, {{usable:.1f}} of {{limit:.0f}} N m may be used"


def _stuck(n: Numbers) -> str:
    return "{pressed[0]} pressed against {pressed[1]}" if n["pressed"] else "the part did not follow the hand"


# Lengths in m, angles in rad, times in s, torques in N m (N for a slide); a state in the joint's unit.
REASONS: Mapping[str, Words] = {
    "NoRoom": Words("", "the pedestal would stand in the static scene or be shut in by it", "{kind}"),
    # short, turned: by which the arm misses the tool pose; stopped: joints at a limit
    "Unreachable": Words("state unit short turned stopped", "unreachable", _unreachable),
    # jump: of one joint; None where it was not measured
    "Reconfigures": Words("jump", "the arm would have to reconfigure on the way", _reconfigures),
    "InCollision": Words(
        "bodies state depth",
        "{bodies} would meet",
        "{kind} at state {state:.2f} ({depth:.0f mm} deep)",
    ),
    "TooWeak": Words("joint state loaded needed usable limit", "{joint} is too weak", _weak),
    # problem: what the trajectory's type refuses
    "Unlawful": Words("problem", "a trajectory that leaves the robot's limits", "{problem}"),
    # touching: how many of the two fingers touch the part
    "NotGripped": Words(
        "touching", "the fingers did not get hold of the part", "{kind} ({touching:.0f} of 2 touch it)"
    ),
    "AtTorqueLimit": Words(
        "joint limit unit time",
        "{joint} is at its torque limit",
        "{kind} of {limit:.0f} {unit} at {time:.1f} s",
    ),
    "BeyondJointLimit": Words(
        "beyond", "a joint goes beyond its limit", "a joint goes {beyond:.3f} rad beyond its limit"
    ),
    "LostPart": Words("state", "the hand lost the part", "{kind} at state {state:.2f}"),
    # done: "opened" or "closed"; peak, final: shares of the way
    "CameBack": Words(
        "done peak final",
        "the part {done} and came back",
        "the part {done} {peak:.2f} of the way and ended at {final:.2f}",
    ),
    "ClosedByItself": Words(
        "peak final",
        "let go, and its own weight closed it",
        "let go at {peak:.2f} of the range, its own weight closed it to {final:.2f}",
    ),
    # pressed: the two bodies that pressed against each other, None where none did
    "Stuck": Words(
        "done peak pressed",
        lambda n: f"{{done}} a part of the way; {_stuck(n)}",
        lambda n: f"{{done}} {{peak:.2f}} of the way; {_stuck(n)}",
    ),
    "IntoScene": Words(
        "body depth time",
        "{body} goes into the static scene",
        "{body} goes {depth:.1f mm} into the static scene at {time:.1f} s",
    ),
    "Slipped": Words("slip", "the grip slipped", "{kind} by {slip:.0f mm}"),
    "StillMoving": Words("", "still moving at the end", "{kind}"),
}

"""Why a plan is refused or a replay failed: one type for each cause, which alone writes its text.

Who wants to know what happened asks for the type; who counts causes counts `kind`, which leaves the numbers out.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from twin.errors import PlanningError


@dataclass(frozen=True)
class Reason(ABC):
    """One cause."""

    @property
    @abstractmethod
    def text(self) -> str:
        """What happened, with its numbers."""

    @property
    @abstractmethod
    def kind(self) -> str:
        """What happened, without numbers: equal for causes that are alike."""


class RefusedError(PlanningError):
    """A path or trajectory can't be, for `reason`."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason


# ---- of planning


@dataclass(frozen=True)
class NoRoom(Reason):
    """The base has no place."""

    @property
    def text(self) -> str:
        return "the pedestal would stand in the static scene or be shut in by it"

    kind = text


@dataclass(frozen=True)
class Unreachable(Reason):
    """The arm misses the tool pose at `state` (in `unit`) by `short` m and `turned` rad; stopped: joints at a limit."""

    state: float
    unit: str
    short: float
    turned: float
    stopped: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        reach = (
            f"reach {self.short:.2f} m short"
            if self.short >= 0.01
            else f"tool {1000 * self.short:.0f} mm off"
        )
        joints = f" ({', '.join(self.stopped)})" if self.stopped else ""
        off = f"{reach}, hand {np.rad2deg(self.turned):.0f} deg off"
        return f"unreachable at state {self.state:.2f} {self.unit}: {off}{joints}"

    @property
    def kind(self) -> str:
        return "unreachable"


@dataclass(frozen=True)
class Reconfigures(Reason):
    """The arm would jump to another configuration on the way. jump: rad, of one joint; None where it was not measured."""

    jump: float | None = None

    @property
    def text(self) -> str:
        told = "" if self.jump is None else f" (one joint jumps by {self.jump:.1f} rad)"
        return f"the arm would have to reconfigure on the way{told}"

    @property
    def kind(self) -> str:
        return "the arm would have to reconfigure on the way"


@dataclass(frozen=True)
class InCollision(Reason):
    """Two bodies would overlap by `depth` m at a state of the part."""

    bodies: str
    state: float
    depth: float

    @property
    def text(self) -> str:
        return f"{self.bodies} would meet at state {self.state:.2f} ({1000 * self.depth:.0f} mm deep)"

    @property
    def kind(self) -> str:
        return f"{self.bodies} would meet"


@dataclass(frozen=True)
class TooWeak(Reason):
    """A joint can't hold what it must at `state`: needed, usable and limit in N m (N for a slide)."""

    joint: str
    state: float
    loaded: bool
    needed: float
    usable: float
    limit: float

    @property
    def text(self) -> str:
        what = f"arm{' and part' if self.loaded else ''} take {self.needed:.1f} N m at rest"
        may = f"{self.usable:.1f} of {self.limit:.0f} N m may be used"
        return f"{self.joint} is too weak at state {self.state:.2f}: {what}, {may}"

    @property
    def kind(self) -> str:
        return f"{self.joint} is too weak"


@dataclass(frozen=True)
class Unlawful(Reason):
    """A trajectory came out that its type refuses: a joint beyond a limit, or too fast."""

    problem: str

    @property
    def text(self) -> str:
        return self.problem

    @property
    def kind(self) -> str:
        return "a trajectory that leaves the robot's limits"


def reason_of(error: PlanningError) -> Reason:
    """What an error of planning says."""
    return error.reason if isinstance(error, RefusedError) else Unlawful(error.problem)


# ---- of replays


@dataclass(frozen=True)
class NotGripped(Reason):
    """The fingers closed beside the part; touching: how many of the two touch it."""

    touching: float

    @property
    def text(self) -> str:
        return f"{self.kind} ({self.touching:.0f} of 2 touch it)"

    @property
    def kind(self) -> str:
        return "the fingers did not get hold of the part"


@dataclass(frozen=True)
class AtTorqueLimit(Reason):
    """A joint is at its limit, in `unit`, at `time` s."""

    joint: str
    limit: float
    unit: str
    time: float

    @property
    def text(self) -> str:
        return f"{self.joint} is at its torque limit of {self.limit:.0f} {self.unit} at {self.time:.1f} s"

    @property
    def kind(self) -> str:
        return f"{self.joint} is at its torque limit"


@dataclass(frozen=True)
class BeyondJointLimit(Reason):
    """A joint is `beyond` rad out of its range."""

    beyond: float

    @property
    def text(self) -> str:
        return f"a joint goes {self.beyond:.3f} rad beyond its limit"

    @property
    def kind(self) -> str:
        return "a joint goes beyond its limit"


@dataclass(frozen=True)
class LostPart(Reason):
    """The hand no longer touches the part from `state` on."""

    state: float

    @property
    def text(self) -> str:
        return f"the hand lost the part at state {self.state:.2f}"

    @property
    def kind(self) -> str:
        return "the hand lost the part"


@dataclass(frozen=True)
class CameBack(Reason):
    """The part was brought to the goal and did not stay there. done: "opened" or "closed"; peak, final: shares of the way."""

    done: str
    peak: float
    final: float

    @property
    def text(self) -> str:
        return f"the part {self.done} {self.peak:.2f} of the way and ended at {self.final:.2f}"

    @property
    def kind(self) -> str:
        return f"the part {self.done} and came back"


@dataclass(frozen=True)
class ClosedByItself(Reason):
    """The part was let go at `peak` of its range and its weight closed it to `final`."""

    peak: float
    final: float

    @property
    def text(self) -> str:
        return f"let go at {self.peak:.2f} of the range, its own weight closed it to {self.final:.2f}"

    @property
    def kind(self) -> str:
        return "let go, and its own weight closed it"


@dataclass(frozen=True)
class Stuck(Reason):
    """The part was not brought to the goal; pressed: the two bodies that pressed against each other, if any did."""

    done: str
    peak: float
    pressed: tuple[str, str] | None

    @property
    def text(self) -> str:
        return f"{self.done} {self.peak:.2f} of the way; {self._why}"

    @property
    def kind(self) -> str:
        return f"{self.done} a part of the way; {self._why}"

    @property
    def _why(self) -> str:
        if self.pressed is None:
            return "the part did not follow the hand"
        return f"{self.pressed[0]} pressed against {self.pressed[1]}"


@dataclass(frozen=True)
class IntoScene(Reason):
    """A body goes `depth` m into the static scene at `time` s."""

    body: str
    depth: float
    time: float

    @property
    def text(self) -> str:
        return f"{self.body} goes {1000 * self.depth:.1f} mm into the static scene at {self.time:.1f} s"

    @property
    def kind(self) -> str:
        return f"{self.body} goes into the static scene"


@dataclass(frozen=True)
class Slipped(Reason):
    """The grip slipped by `slip` m."""

    slip: float

    @property
    def text(self) -> str:
        return f"the grip slipped by {1000 * self.slip:.0f} mm"

    @property
    def kind(self) -> str:
        return "the grip slipped"


@dataclass(frozen=True)
class StillMoving(Reason):
    """The part moves at the end."""

    @property
    def text(self) -> str:
        return "still moving at the end"

    kind = text

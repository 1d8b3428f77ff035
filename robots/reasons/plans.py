"""Why a plan is refused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.reasons.reason import Reason, RefusedError
from twin.errors import PlanningError


@dataclass(frozen=True)
class NoRoom(Reason):
    """The base has no place."""

    @property
    def text(self) -> str:
        return "the pedestal would stand in the static scene or be shut in by it"

    kind = text


@dataclass(frozen=True)
class Unreachable(Reason):
    """The arm misses the tool pose at `state` (in `unit`) by `short` m, `turned` rad; stopped: at limits."""

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
    """The arm would jump to another configuration on the way. jump: rad, of one joint, or None."""

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

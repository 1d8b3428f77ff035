"""Why a replay failed."""

from __future__ import annotations

from dataclasses import dataclass

from robots.reasons.reason import Reason


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
    """The part was brought to the goal and did not stay. done: "opened" or "closed"; peak, final: shares."""

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
    """The part was not brought to the goal; pressed: the two bodies that pressed on each other, if any."""

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

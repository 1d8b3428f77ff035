"""Why the motion of a part is doubted."""

from __future__ import annotations

from dataclasses import dataclass

from twin.verdict.reason import CUT, POINT_AT_IT, Reason


@dataclass(frozen=True)
class AxisUnsure(Reason):
    """The axis may be tilted by `sigma_deg` (one standard deviation), more than `limit_deg`."""

    sigma_deg: float
    limit_deg: float

    @property
    def text(self) -> str:
        return f"its axis is known to ± {self.sigma_deg:.2f}° only (at most {self.limit_deg:g}°)"

    @property
    def kind(self) -> str:
        return "its axis is unsure"

    @property
    def help(self) -> str:
        return f"open it farther and slower, with all of it in view, or {POINT_AT_IT}, or its type with --type hinge|slide"


@dataclass(frozen=True)
class PivotUnsure(Reason):
    """The place of a hinge may be off by `sigma_m` (one standard deviation), more than `limit_m`."""

    sigma_m: float
    limit_m: float

    @property
    def text(self) -> str:
        return (
            f"its hinge is known to ± {1000 * self.sigma_m:.1f} mm only (at most {1000 * self.limit_m:g} mm)"
        )

    @property
    def kind(self) -> str:
        return "the place of its hinge is unsure"

    @property
    def help(self) -> str:
        return f"open it farther, with all of it in view, or say --type slide if it is none, or {POINT_AT_IT}"


@dataclass(frozen=True)
class RangeUnsure(Reason):
    """The range (deg or mm, see `unit`) is less than `limit` times one standard deviation of a state."""

    range: float
    sigma: float
    unit: str
    limit: float

    @property
    def text(self) -> str:
        told = f"its range of {self.range:.1f} {self.unit} is known to ± {self.sigma:.2f} {self.unit}"
        return f"{told} (at least {self.limit:g} times that)"

    @property
    def kind(self) -> str:
        return "its range is hardly more than its error"

    @property
    def help(self) -> str:
        return f"open it farther, or {CUT}, or {POINT_AT_IT}"


@dataclass(frozen=True)
class TooShort(Reason):
    """The range (deg or mm, see `unit`) is less than `limit`, whatever its error: rattling goes as far."""

    range: float
    unit: str
    limit: float

    @property
    def text(self) -> str:
        return f"it moves by {self.range:.1f} {self.unit} only (at least {self.limit:g} {self.unit})"

    @property
    def kind(self) -> str:
        return "it hardly moves"

    @property
    def help(self) -> str:
        return f"open it farther, or {POINT_AT_IT}"


@dataclass(frozen=True)
class CreepsAtRest(Reason):
    """The state changes by `creep` (deg or mm, see `unit`), more than `limit`, in frames of rest."""

    creep: float
    unit: str
    limit: float

    @property
    def text(self) -> str:
        return f"its state changes by {self.creep:.1f} {self.unit} while it rests (at most {self.limit:g} {self.unit})"

    @property
    def kind(self) -> str:
        return "its state changes while it rests"

    @property
    def help(self) -> str:
        return f"keep all of it in view from rest to rest, or {CUT}"


@dataclass(frozen=True)
class ClosedEndUnsure(Reason):
    """What decides which end of the travel is closed differs by `margin` (a share), less than `limit`."""

    margin: float
    limit: float

    @property
    def text(self) -> str:
        told = f"what tells its closed end from the open one differs by {100 * self.margin:z.0f} %"
        return f"{told} (at least {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "which end of its travel is the closed one is a guess"

    @property
    def help(self) -> str:
        return f"close it in the recording, with what surrounds it in view, or {CUT}"


@dataclass(frozen=True)
class CamerasDrift(Reason):
    """Between `frame` and `other`, most of what should stand still differs in depth by `off_m`, more than
    `limit_m`: the path is wrong, or what moved and was missed fills the view."""

    frame: int
    other: int
    off_m: float
    limit_m: float

    @property
    def text(self) -> str:
        told = f"frames {self.frame} and {self.other} see the room {1000 * self.off_m:.0f} mm apart"
        return f"{told} (at most {1000 * self.limit_m:g} mm)"

    @property
    def kind(self) -> str:
        return "the path of the camera is wrong, or something that fills the view moved unnoticed"

    @property
    def help(self) -> str:
        return f"move the camera slower, from farther away, with more of the room in view, or {CUT}"


@dataclass(frozen=True)
class NoUncertainty(Reason):
    """Nothing says how well the joint is known."""

    @property
    def text(self) -> str:
        return self.kind

    @property
    def kind(self) -> str:
        return "nothing says how well its joint is known"

    @property
    def help(self) -> str:
        return f"open it farther, with all of it in view, or {POINT_AT_IT}"


@dataclass(frozen=True)
class WithinDrift(Reason):
    """The part travels by `travel_m`, less than `limit` times what the static scene seems to (`drift_m`)."""

    travel_m: float
    drift_m: float
    limit: float

    @property
    def text(self) -> str:
        seems = f"what stands still seems to move by {1000 * self.drift_m:.1f} mm meanwhile"
        return f"it moves by {1000 * self.travel_m:.0f} mm, and {seems} (at most 1/{self.limit:g} of it)"

    @property
    def kind(self) -> str:
        return "it hardly moves more than what stands still seems to"

    @property
    def help(self) -> str:
        return f"move the camera slower, keep more of the room in view, or {CUT}"


@dataclass(frozen=True)
class NeverRests(Reason):
    """The part moves in `share` of the frames, more than `limit`."""

    share: float
    limit: float

    @property
    def text(self) -> str:
        return f"it moves in {100 * self.share:.0f} % of the frames (at most {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "it never rests"

    @property
    def help(self) -> str:
        return f"record a second of rest before and after the opening, or {POINT_AT_IT}"

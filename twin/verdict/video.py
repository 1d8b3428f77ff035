"""Why a part is doubted by what the video shows of its motion."""

from __future__ import annotations

from dataclasses import dataclass

from twin.verdict.reason import CUT, POINT_AT_IT, Reason


@dataclass(frozen=True)
class SeenThrough(Reason):
    """As it moves, `share` of its pixels, over `limit`, are seen beyond the twin there, most in `frame`."""

    frame: int
    share: float
    limit: float

    @property
    def text(self) -> str:
        told = f"as it moves, {100 * self.share:.1f} % of its pixels are seen through"
        return f"{told}, most in frame {self.frame} (at most {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "as it moves, it is seen through"

    @property
    def help(self) -> str:
        return f"open it slower, with all of it in view, or {POINT_AT_IT}"


@dataclass(frozen=True)
class MotionUnexplained(Reason):
    """`share` of what moves to another depth than at rest, more than `limit`, is not at the twin's either."""

    share: float
    limit: float

    @property
    def text(self) -> str:
        told = (
            f"{100 * self.share:.0f} % of what changes as it moves does not look like the twin in its state"
        )
        return f"{told} (at most {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "what changes as it moves does not look like the twin"

    @property
    def help(self) -> str:
        return f"open one part at a time, slowly, or {POINT_AT_IT}"


@dataclass(frozen=True)
class MotionUnseen(Reason):
    """As it moves, `share` of its pixels, less than `limit`, leave the depth of rest for the twin's."""

    share: float
    limit: float

    @property
    def text(self) -> str:
        told = f"as it moves, {100 * self.share:.1f} % of its pixels are seen to come nearer or to go farther"
        return f"{told} (at least {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "its surface is hardly seen to move"

    @property
    def help(self) -> str:
        return f"open it farther, seen from where it comes towards the camera or goes away from it, or {POINT_AT_IT}"


@dataclass(frozen=True)
class HalvesDisagree(Reason):
    """The joints of the first and the second half of its motion differ by `axis_deg`, more than
    `axis_limit_deg`, or their hinges are `pivot_m` apart, more than `pivot_limit_m`; 0 if not known."""

    axis_deg: float
    axis_limit_deg: float
    pivot_m: float
    pivot_limit_m: float

    @property
    def text(self) -> str:
        if self.axis_deg > self.axis_limit_deg:
            return (
                f"{self.kind}: their axes differ by {self.axis_deg:.1f}° (at most {self.axis_limit_deg:g}°)"
            )
        apart = f"their hinges are {1000 * self.pivot_m:.0f} mm apart"
        return f"{self.kind}: {apart} (at most {1000 * self.pivot_limit_m:g} mm)"

    @property
    def kind(self) -> str:
        return "the halves of its motion show different joints"

    @property
    def help(self) -> str:
        return f"open it slower, with all of it in view all the time, or {CUT}, or {POINT_AT_IT}"


@dataclass(frozen=True)
class TracksDisagree(Reason):
    """The part's own tracks tell an axis that is `axis_deg` away, more than `limit_deg`, or, in both halves
    of its motion alike, a hinge that is `pivot_m` away, more than `pivot_limit_m`; 0 if not known."""

    axis_deg: float
    limit_deg: float
    pivot_m: float = 0.0
    pivot_limit_m: float = 0.0

    @property
    def text(self) -> str:
        if self.pivot_m > self.pivot_limit_m:
            away = f"a hinge {1000 * self.pivot_m:.0f} mm away in both halves of its motion"
            return f"its tracks tell {away} (at most {1000 * self.pivot_limit_m:g} mm)"
        return f"its tracks tell an axis {self.axis_deg:.1f}° away (at most {self.limit_deg:g}°)"

    @property
    def kind(self) -> str:
        return "its tracks tell another joint"

    @property
    def help(self) -> str:
        return f"open it farther, with all of it and its borders in view, or {POINT_AT_IT}"

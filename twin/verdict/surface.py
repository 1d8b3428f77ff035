"""Why the surface and the labels of a part are doubted."""

from __future__ import annotations

from dataclasses import dataclass

from twin.verdict.reason import CUT, POINT_AT_IT, Reason


@dataclass(frozen=True)
class HandWhereNobodyIs(Reason):
    """`share` of a labelled frame, more than `limit`, is labelled hand and is none: it keeps its place
    without reaching in, or has the twin's depth at an end of the recording."""

    frame: int
    share: float
    limit: float

    @property
    def text(self) -> str:
        told = f"{100 * self.share:.1f} % of frame {self.frame} is labelled hand, but stands still or lies on the twin"
        return f"{told} (at most {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "what stands still is taken for a hand"

    @property
    def help(self) -> str:
        return f"record a second of rest without the hand before and after, or {POINT_AT_IT}"


@dataclass(frozen=True)
class HandMovesNothing(Reason):
    """From the frame `first` to `last` a hand is in view, and no part of the twin moves."""

    first: int
    last: int

    @property
    def text(self) -> str:
        return f"a hand is in view from frame {self.first} to {self.last}, and nothing in the twin moves: what it moved may be missing"

    @property
    def kind(self) -> str:
        return "a hand is in view and nothing in the twin moves"

    @property
    def help(self) -> str:
        return f"{CUT}, or {POINT_AT_IT}"


@dataclass(frozen=True)
class NoSurface(Reason):
    """The part has no mesh."""

    @property
    def text(self) -> str:
        return self.kind

    @property
    def kind(self) -> str:
        return "it has no surface"

    @property
    def help(self) -> str:
        return f"keep more of the part in view while it moves, or {POINT_AT_IT}"


@dataclass(frozen=True)
class SmallSurface(Reason):
    """The part's surface has `area_m2`, less than `limit_m2`."""

    area_m2: float
    limit_m2: float

    @property
    def text(self) -> str:
        return f"its surface has {1e4 * self.area_m2:.1f} cm² only (at least {1e4 * self.limit_m2:g} cm²)"

    @property
    def kind(self) -> str:
        return "its surface is tiny"

    @property
    def help(self) -> str:
        return f"keep more of the part in view while it moves, or {POINT_AT_IT}"


@dataclass(frozen=True)
class SurfaceUnseen(Reason):
    """`share` of the surface, less than `limit`, was seen to move with the part; `untold` is undecided."""

    share: float
    untold: float
    limit: float

    @property
    def text(self) -> str:
        told = f"{100 * self.share:.0f} % of its surface was seen to move with it, {100 * self.untold:.0f} % not told"
        return f"{told} (at least {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "hardly any of its surface was seen to move"

    @property
    def help(self) -> str:
        return f"keep the whole part in view before, while and after it moves, or {POINT_AT_IT}"


@dataclass(frozen=True)
class SurfaceContradicted(Reason):
    """`share` of the surface, over `limit`, is seen through where the part goes, or stays where it left."""

    share: float
    limit: float

    @property
    def text(self) -> str:
        told = f"{100 * self.share:.0f} % of its surface is seen not to move with it"
        return f"{told} (at most {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "some of its surface is not the part's"

    @property
    def help(self) -> str:
        return f"{POINT_AT_IT}, or {CUT}"


@dataclass(frozen=True)
class FewLabels(Reason):
    """`frames` of `labelled` label images show the part, less than `limit`."""

    frames: int
    labelled: int
    limit: int

    @property
    def text(self) -> str:
        if not self.frames:
            return f"none of {self.labelled} labelled frames shows it"
        return f"{self.frames} of {self.labelled} labelled frames show it (at least {self.limit})"

    @property
    def kind(self) -> str:
        return "hardly any labelled frame shows it"

    @property
    def help(self) -> str:
        return f"keep the part in view, before and after it moves too, or {POINT_AT_IT}"


@dataclass(frozen=True)
class Unexplained(Reason):
    """Where nobody moves, `share` of the picture of `frame`, over `limit`, misses the twin's depth."""

    frame: int
    share: float
    limit: float

    @property
    def text(self) -> str:
        told = f"{100 * self.share:.1f} % of frame {self.frame} has another depth than the twin in its state there"
        return f"{told} (at most {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "the twin does not explain what changed"

    @property
    def help(self) -> str:
        return f"{POINT_AT_IT}; what stands elsewhere afterwards must be a part, or stay where it was"


@dataclass(frozen=True)
class AlongItself(Reason):
    """Depth alone tells the joint, and the part moves along its own surface: a share `across` of its area,
    less than `limit`, moves across itself. How far the rest went, only its borders show."""

    across: float
    limit: float

    @property
    def text(self) -> str:
        told = f"it slides along its own surface ({100 * self.across:.0f} % of it moves across itself, at least {100 * self.limit:g} %)"
        return f"{told}, which has too little texture to tell how far"

    @property
    def kind(self) -> str:
        return "it slides along its own surface and has no texture"

    @property
    def help(self) -> str:
        return f"stick something with a pattern on it, with its borders in view, or {POINT_AT_IT}"


@dataclass(frozen=True)
class LabelledElsewhere(Reason):
    """In `frame`, at one end of its travel, a `share` of the pixels that are labelled as it or should show it
    are both, less than `limit`."""

    frame: int
    share: float
    limit: float

    @property
    def text(self) -> str:
        told = f"in frame {self.frame} its labels and its place in the twin share only {100 * self.share:.0f} % of their pixels"
        return f"{told} (at least {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "it is labelled elsewhere than the twin has it"

    @property
    def help(self) -> str:
        return f"keep all of it in view where it is open and where it is closed, or {POINT_AT_IT}"


@dataclass(frozen=True)
class BareBorder(Reason):
    """At rest, in `frame`, a `share` of its border with the static scene, over `limit`, shows no edge."""

    frame: int
    share: float
    limit: float

    @property
    def text(self) -> str:
        told = f"{100 * self.share:.0f} % of its border in frame {self.frame} is no edge, in colour or depth"
        return f"{told} (at most {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "its border is no edge: a piece of it, or of what is beside it, is labelled wrong"

    @property
    def help(self) -> str:
        return f"light it so that its gaps show, open it farther, or {POINT_AT_IT}"


@dataclass(frozen=True)
class StaticSeenThrough(Reason):
    """A `share` of the picture of `frame`, more than `limit`, is seen beyond the twin's static scene."""

    frame: int
    share: float
    limit: float

    @property
    def text(self) -> str:
        told = f"{100 * self.share:.1f} % of frame {self.frame} is farther than what never moves in the twin"
        return f"{told} (at most {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "what should never move is seen through"

    @property
    def help(self) -> str:
        return f"open one part at a time, from rest to rest, with all of it in view, or {POINT_AT_IT}"

"""All reasons, one type for each cause, which alone writes its text: against a part's motion (`motion.py`,
`video.py`), its surface (`surface.py`), and against the twin.

To add one: a type, its name in `REASONS`, and the function that tells it by its evidence in `recon/verdict/`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from twin.verdict.motion import (
    AxisUnsure,
    CamerasDrift,
    ClosedEndUnsure,
    CreepsAtRest,
    NeverRests,
    NoUncertainty,
    PivotUnsure,
    RangeUnsure,
    TooShort,
    WithinDrift,
)
from twin.verdict.reason import CUT, POINT_AT_IT, Level, Reason
from twin.verdict.surface import (
    AlongItself,
    BareBorder,
    FewLabels,
    HandMovesNothing,
    HandWhereNobodyIs,
    LabelledElsewhere,
    NoSurface,
    SmallSurface,
    StaticSeenThrough,
    SurfaceContradicted,
    SurfaceUnseen,
    Unexplained,
)
from twin.verdict.video import HalvesDisagree, MotionUnexplained, MotionUnseen, SeenThrough, TracksDisagree


@dataclass(frozen=True)
class NothingArticulated(Reason):
    """No part was found that stands up; free: how many things moved by no joint, a hand among them."""

    free: int

    @property
    def text(self) -> str:
        things = f"{self.free} thing{'s' * (self.free != 1)} moved freely" if self.free else "nothing moved"
        return f"{self.kind}; {things}"

    @property
    def kind(self) -> str:
        return "nothing articulated was found"

    @property
    def help(self) -> str:
        return f"record a part being opened, from rest to rest, or {POINT_AT_IT}, or {CUT}"


@dataclass(frozen=True)
class UpUnsure(Reason):
    """Which way is up: the odds of the direction that was taken against the second one, less than `limit`; 1
    where there is no second. taken, other: directions in the first camera's axes, as --up takes them."""

    odds: float
    limit: float
    taken: str
    other: str

    @property
    def text(self) -> str:
        if not self.other:
            return f"{self.kind}: too little is seen of floors and walls, and it is taken from how the camera is held"
        return f"{self.kind}: {self.taken} has odds of {self.odds:.1f} against {self.other} (at least {self.limit:g})"

    @property
    def kind(self) -> str:
        return "up is unsure"

    @property
    def help(self) -> str:
        says = f"--up {self.taken} or --up {self.other}" if self.other else "--up X,Y,Z"
        return f"say which way is up in the first picture with {says} (x right, y down, z forward)"


@dataclass(frozen=True)
class MovesWithDoubted(Reason):
    """An untrusted part moves with this one: in `share` of the frames in which either moves, over `limit`."""

    share: float
    limit: float

    @property
    def text(self) -> str:
        told = f"what is not trusted moves in {100 * self.share:.0f} % of the frames in which either does"
        return f"{told} (at most {100 * self.limit:g} %)"

    @property
    def kind(self) -> str:
        return "something that is not trusted moves when it does"

    @property
    def help(self) -> str:
        return f"open one part at a time, all of it in view, or {POINT_AT_IT}"


@dataclass(frozen=True)
class ManyDoubts(Reason):
    """More than `limit` reasons, `count`, each only doubtful alone. said, cure: of the first."""

    count: int
    limit: int
    said: str
    cure: str

    @classmethod
    def told(cls, doubts: Sequence[Reason], limit: int) -> ManyDoubts:
        """The refusal that these doubts add up to."""
        return cls("refused", len(doubts), limit, doubts[0].text, doubts[0].help)

    @property
    def text(self) -> str:
        return f"{self.count} reasons speak against it (at most {self.limit}), the first: {self.said}"

    @property
    def kind(self) -> str:
        return "too many reasons speak against it"

    @property
    def help(self) -> str:
        return self.cure


@dataclass(frozen=True)
class OfPart(Reason):
    """A reason against one part, told of its twin. of: the type of that reason; said, sort, cure: its text,
    kind and help; written: whether the part is in the twin, which no refused one is."""

    part: str
    written: bool
    of: str
    said: str
    sort: str
    cure: str

    @classmethod
    def told(cls, part: str, reason: Reason, level: Level, written: bool = True) -> OfPart:
        """The reason against the part of this name, with the level that it gives to the twin."""
        return cls(level, part, written, type(reason).__name__, reason.text, reason.kind, reason.help)

    @property
    def text(self) -> str:
        return f"{self.part}{'' if self.written else ', refused and not written'}: {self.said}"

    @property
    def kind(self) -> str:
        return f"a {'part' if self.written else 'refused part'}: {self.sort}"

    @property
    def help(self) -> str:
        return self.cure


@dataclass(frozen=True)
class OfRecording(Reason):
    """A fault of the recording. finding: its type in the inspection; said, sort, cure: text, kind, help."""

    finding: str
    said: str
    sort: str
    cure: str

    @property
    def text(self) -> str:
        return self.said

    @property
    def kind(self) -> str:
        return self.sort

    @property
    def help(self) -> str:
        return f"{self.cure}, or {CUT}"


# By the names under which twin.json has them: a name that was given stays.
REASONS: dict[str, type[Reason]] = {
    c.__name__: c
    for c in (
        AxisUnsure,
        PivotUnsure,
        RangeUnsure,
        TooShort,
        NoUncertainty,
        WithinDrift,
        NeverRests,
        ClosedEndUnsure,
        CreepsAtRest,
        CamerasDrift,
        HandWhereNobodyIs,
        HandMovesNothing,
        NoSurface,
        SmallSurface,
        SurfaceUnseen,
        SurfaceContradicted,
        AlongItself,
        BareBorder,
        LabelledElsewhere,
        StaticSeenThrough,
        Unexplained,
        SeenThrough,
        MotionUnexplained,
        MotionUnseen,
        HalvesDisagree,
        TracksDisagree,
        FewLabels,
        ManyDoubts,
        MovesWithDoubted,
        NothingArticulated,
        UpUnsure,
        OfPart,
        OfRecording,
    )
}

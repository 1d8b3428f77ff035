"""Scores of a walk: a recording of minutes in which several parts are handled, each perhaps several times.

`recon.evaluation.walks.walk_scores` makes them. Every score holds its counts, so that the rates of several
walks follow from sums. Definitions: docs/metrics.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

# A mis-solved part has a counterpart on its surface whose axis is wrong.
WalkCause = Literal["missed", "mis-solved", "type", "axis", "path", "labels"]
Role = Literal["match", "double", "mis-solved", "invented"]


def share(good: int, of: int, of_nothing: float = 1.0) -> float:
    """A rate; `of_nothing` where there is nothing to count."""
    return good / of if of else of_nothing


@dataclass(frozen=True)
class IntervalCounts:
    """Interactions: true and found ones; `hits` are pairs of one part at a temporal IoU of .5 or more."""

    hits: int = 0
    true: int = 0
    found: int = 0

    def __add__(self, other: IntervalCounts) -> IntervalCounts:
        return IntervalCounts(self.hits + other.hits, self.true + other.true, self.found + other.found)

    @property
    def precision(self) -> float:
        """Share of the found interactions that hit; 0 without one, unless there was none to find."""
        return share(self.hits, self.found, float(self.true == 0))

    @property
    def recall(self) -> float:
        """Share of the true interactions that are hit."""
        return share(self.hits, self.true)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall."""
        return share(2 * self.hits, self.true + self.found)


@dataclass(frozen=True)
class StateCounts:
    """Posed frames by what the twin says of a part's state in them.

    right: within 5 deg or 2 cm of the truth. unknown: without a state, which is not right. opened: frames in
    which the part is truly not closed, and of these the right and the unknown ones.
    """

    frames: int = 0
    right: int = 0
    unknown: int = 0
    opened: int = 0
    opened_right: int = 0
    opened_unknown: int = 0

    def __add__(self, other: StateCounts) -> StateCounts:
        return StateCounts(
            self.frames + other.frames,
            self.right + other.right,
            self.unknown + other.unknown,
            self.opened + other.opened,
            self.opened_right + other.opened_right,
            self.opened_unknown + other.opened_unknown,
        )


@dataclass(frozen=True)
class TruePartScore:
    """A true part: the part of the twin that it is found as, and why it is not right.

    found: name in the twin, None for a part that isn't found. cause: None for a part that is right. trusted:
    whether the twin calls the found part trusted. axis_deg, path_mm: None where nothing compares, as of a
    part that isn't found. miou: None where no frame shows the part. Of a part that isn't found, no
    interaction is hit and no state is right.
    """

    name: str
    found: str | None
    cause: WalkCause | None
    trusted: bool
    axis_deg: float | None
    path_mm: float | None
    miou: float | None
    intervals: IntervalCounts
    states: StateCounts

    @property
    def right(self) -> bool:
        return self.cause is None


@dataclass(frozen=True)
class FoundPartScore:
    """A part of the twin: its role, and the true part `of` which it is one (None if invented)."""

    name: str
    role: Role
    of: str | None
    trusted: bool
    intervals: int


@dataclass(frozen=True)
class LocalErrors:
    """Errors of relative poses inside the true interactions, one entry a pair of frames: mm and deg.

    pairs: how many there are in the truth; a pair without both poses in one piece has no entry.
    """

    mm: tuple[float, ...] = ()
    deg: tuple[float, ...] = ()
    pairs: int = 0

    def __add__(self, other: LocalErrors) -> LocalErrors:
        return LocalErrors(self.mm + other.mm, self.deg + other.deg, self.pairs + other.pairs)

    def quantile(self, q: float) -> tuple[float, float] | None:
        """The quantile `q` (0..1) in mm and in deg, None without a pair."""
        if not self.mm:
            return None
        return float(np.quantile(self.mm, q)), float(np.quantile(self.deg, q))


@dataclass(frozen=True)
class PieceScore:
    """A piece of the path, from its first to its last frame, aligned for itself: posed frames, ATE, the true
    way of the camera (m)."""

    first: int
    last: int
    frames: int
    ate_mm: float
    way_m: float


@dataclass(frozen=True)
class LoopCounts:
    """Places seen again that a path was closed with, and how many are off by more than 5 cm or 3 deg."""

    accepted: int = 0
    false: int = 0

    def __add__(self, other: LoopCounts) -> LoopCounts:
        return LoopCounts(self.accepted + other.accepted, self.false + other.false)


@dataclass(frozen=True)
class PoseCounts:
    """Frames of the recording: with a pose, or without one in a gap that the twin names."""

    frames: int = 0
    posed: int = 0
    named: int = 0

    def __add__(self, other: PoseCounts) -> PoseCounts:
        return PoseCounts(self.frames + other.frames, self.posed + other.posed, self.named + other.named)

    @property
    def neither(self) -> int:
        """Frames without a pose that no gap tells of."""
        return self.frames - self.posed - self.named


@dataclass(frozen=True)
class WalkScores:
    """A twin of a walk against the truth.

    parts: one for each true part. found: one for each part of the twin. pieces: one, unless the path was left
    in pieces.
    """

    name: str
    parts: tuple[TruePartScore, ...]
    found: tuple[FoundPartScore, ...]
    pieces: tuple[PieceScore, ...]
    local: LocalErrors
    poses: PoseCounts

    @property
    def matched(self) -> tuple[TruePartScore, ...]:
        """True parts that are found."""
        return tuple(p for p in self.parts if p.found is not None)

    @property
    def right(self) -> int:
        """How many true parts are right."""
        return sum(p.right for p in self.parts)

    def count(self, role: Role, trusted: bool | None = None) -> int:
        """How many parts of the twin have a role, trusted or not."""
        return sum(f.role == role and trusted in (None, f.trusted) for f in self.found)

    @property
    def room_right(self) -> bool:
        """Whether every true part is right, none doubled, none invented."""
        wrong = self.count("double") + self.count("invented")
        return self.right == len(self.parts) and wrong == 0

    @property
    def intervals(self) -> IntervalCounts:
        """All true interactions, and all that the twin lists."""
        others = sum(f.intervals for f in self.found if f.role != "match")
        return total_intervals(p.intervals for p in self.parts) + IntervalCounts(found=others)

    @property
    def intervals_matched(self) -> IntervalCounts:
        """Interactions of the parts that are found."""
        return total_intervals(p.intervals for p in self.matched)

    @property
    def states(self) -> StateCounts:
        """States of all true parts; of one that isn't found, none is right."""
        return total_states(p.states for p in self.parts)

    @property
    def states_matched(self) -> StateCounts:
        """States of the parts that are found."""
        return total_states(p.states for p in self.matched)

    def nameless(self) -> WalkScores:
        """The scores without names, for records that nobody shall recognise a recording by."""
        return replace(
            self,
            name="",
            parts=tuple(replace(p, name="", found=None if p.found is None else "") for p in self.parts),
            found=tuple(replace(f, name="", of=None if f.of is None else "") for f in self.found),
        )

    def as_dict(self) -> dict[str, Any]:
        """JSON types only, everything: `from_dict` reads it."""
        return asdict(self)

    @staticmethod
    def from_dict(data: Mapping[str, Any]) -> WalkScores:
        """The scores that `as_dict` wrote."""
        parts = (
            {**p, "intervals": IntervalCounts(**p["intervals"]), "states": StateCounts(**p["states"])}
            for p in data["parts"]
        )
        local = data["local"]
        return WalkScores(
            data["name"],
            tuple(TruePartScore(**p) for p in parts),
            tuple(FoundPartScore(**f) for f in data["found"]),
            tuple(PieceScore(**p) for p in data["pieces"]),
            LocalErrors(tuple(local["mm"]), tuple(local["deg"]), local["pairs"]),
            PoseCounts(**data["poses"]),
        )


def total_intervals(counts: Iterable[IntervalCounts]) -> IntervalCounts:
    """The sum of counts."""
    return sum(counts, IntervalCounts())


def total_states(counts: Iterable[StateCounts]) -> StateCounts:
    """The sum of counts."""
    return sum(counts, StateCounts())

"""The verdict on each part: every piece of evidence is asked, and all reasons that it gives stand."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.contact.finish_parts import FinishedPart
from recon.fusion.fuse import FusedScene
from recon.interaction.interaction import Interaction, cameras_of, during, frames_of
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from recon.verdict.evidence import PartEvidence, SceneEvidence
from recon.verdict.in_motion import moving_rows
from recon.verdict.of_parts import OF_PARTS
from recon.verdict.of_scenes import nothing_articulated
from twin.runs.keys import Stage
from twin.scene import Mesh, Trajectory
from twin.verdict import LEVELS, Reason, Verdict, reason

VERDICT = Stage("verdict", 34, ())
# What a missed part makes wrong: beside a right one it is a doubt about the scene, told up to four times
OF_THE_SCENE = ("HandWhereNobodyIs", "HandMovesNothing", "Unexplained", "StaticSeenThrough")
# What a short motion leaves unsure: sigmas of one fit, which grow together
OF_THE_FIT = ("AxisUnsure", "PivotUnsure", "RangeUnsure")
# Reasons that each make doubtful, those of the scene together one of them, and those of the fit. Of 18 open
# right parts that are doubted twelve have one of them, three two and three three; of eight open negatives
# that are refused for nothing else all have four and more. By us, on recordings that were looked at
MOST_DOUBTS = 3
# Probability of the closed end from which all cues together outweigh one that contradicts another. Of 20
# parts of open recordings, looked at, those with the wrong end reach .96 at most.
CLOSED_SURE = 0.98
# Of the frames in which either of two parts moves, those in which both do: a hand opens one part. By us
TOGETHER = 0.5
# Numbers of reasons that are frames.
_FRAMES = {"frame", "other", "first", "last"}


@dataclass(frozen=True)
class Judged:
    """The verdict on each part by id, those without a surface too, and the reasons against the scene."""

    parts: Mapping[int, Verdict]
    scene: tuple[Reason, ...]


@dataclass(frozen=True)
class Fault:
    """A reason against what is made of a recording. frame: after which alone it lies; None: all over it."""

    reason: Reason
    frame: int | None = None

    def touches(self, windows: Sequence[tuple[int, int]]) -> bool:
        """Whether it lies in one of a part's windows, of which a part of a clip has none."""
        return self.frame is None or not windows or any(a <= self.frame < b for a, b in windows)


def judge(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    interactions: Sequence[Interaction],
    parts: Sequence[MovingPart],
    fused: FusedScene,
    finished: Sequence[FinishedPart],
    faults: Sequence[Fault] = (),
) -> Judged:
    """Judge each part as it would be written, and the scene.

    interactions: in which the parts, by their ids, were found. parts: merged and refined. finished: those of
    them that have a surface, counted from their closed end. faults: what the recording's inspection says
    against what is made of it, a frame's fault against the parts handled in its windows.

    A part is worth what its interactions show together: see `of_looks`.
    """
    told = _Told(recording, cameras, labels, parts, fused, finished)
    looks: dict[int, list[Verdict]] = {}
    for interaction in interactions:
        for k, verdict in told.verdicts(interaction).items():
            looks.setdefault(k, []).append(verdict)
    best = {k: of_looks(verdicts) for k, verdicts in looks.items()}
    # What is wrong with the recording comes first: it may be the cause of all else.
    windows = {p.id: p.windows for p in parts}
    verdicts = {
        k: Verdict((*(f.reason for f in faults if f.touches(windows.get(k, ()))), *best[k].reasons))
        for k in sorted(best)
    }
    every = tuple(f.reason for f in faults)
    if any(v.level != "refused" for v in verdicts.values()):
        return Judged(verdicts, (*every, *_missed(interactions)))
    refusing = (replace(reason, level="refused") for reason in every)
    return Judged(verdicts, (*refusing, nothing_articulated([i.found.movers for i in interactions])))


def _missed(interactions: Sequence[Interaction]) -> list[Reason]:
    """A doubt about the scene for each window in which something is handled and no part was found."""
    empty = [i.window.handled for i in interactions if not i.parts]
    return [reason("HandMovesNothing", "doubtful", *handled) for handled in empty if handled is not None]


def of_looks(verdicts: Sequence[Verdict]) -> Verdict:
    """The verdict on a part by those of all interactions with it: the best of them, as another look adds no
    doubt.

    Many doubts refuse what may be none. What two interactions show, by one joint and one surface, is a part,
    if in both nothing but doubts speaks against it.
    """
    best = max(verdicts, key=lambda v: (-LEVELS.index(v.level), -len(v.reasons)))
    without = [tuple(r for r in v.reasons if r.type != "ManyDoubts") for v in verdicts]
    doubted = [reasons for reasons in without if all(r.level == "doubtful" for r in reasons)]
    if best.level == "refused" and len(doubted) > 1:
        return Verdict(min(doubted, key=len))
    return best


@dataclass(frozen=True, eq=False)
class _Told:
    """All parts as they would be written, to be judged interaction by interaction."""

    recording: Recording
    cameras: Trajectory
    labels: Mapping[int, NDArray[np.uint8]]
    parts: Sequence[MovingPart]
    fused: FusedScene
    finished: Sequence[FinishedPart]

    def verdicts(self, interaction: Interaction) -> Mapping[int, Verdict]:
        """The verdict on each part that an interaction handles, by id."""
        window, found = interaction.window, interaction.found
        handled = {p.id for p in interaction.parts}
        written = {
            f.moving.id: (f.moving, f.mesh) for f in (_on_what_stands(f, handled) for f in self.finished)
        }
        closed = {f.moving.id: (f.closed_margin, f.closed_probability) for f in self.finished}
        told: list[tuple[MovingPart, Mesh | None]] = [
            (during(part, window), mesh) for part, mesh in (written.get(p.id, (p, None)) for p in self.parts)
        ]
        told = [(part, mesh) for part, mesh in told if part.id in handled or part.is_somewhere]
        recording, cameras = frames_of(self.recording, window), cameras_of(self.cameras, window)
        labels = {f - window.first: i for f, i in self.labels.items() if window.first <= f <= window.last}
        scene = SceneEvidence(recording, cameras, labels, found, self.fused.static, told)
        mine = [(part, mesh) for part, mesh in told if part.id in handled]
        alone = {
            part.id: verdict_on(
                PartEvidence(scene, part, mesh, tracks, *closed.get(part.id, ())), window.first
            )
            for (part, mesh), tracks in zip(mine, found.of([part for part, _ in mine]), strict=True)
        }
        return _beside_doubted([part for part, _ in mine], alone)


def _on_what_stands(part: FinishedPart, handled: Collection[int]) -> FinishedPart:
    """A part that is handled on a carrier that is not: a part of the static scene."""
    carrier = part.moving.carrier
    stands = carrier is not None and carrier.id not in handled and part.moving.id in handled
    return part.standing() if stands else part


def _beside_doubted(parts: Sequence[MovingPart], verdicts: Mapping[int, Verdict]) -> Mapping[int, Verdict]:
    """The verdicts, with a doubt for each part that moves when one does that is not trusted: either may have
    taken what moved of the other, or both are one."""
    moving = {p.id: set(p.motion.frames[moving_rows(p)]) for p in parts}
    doubted = [p.id for p in parts if verdicts[p.id].level != "trusted"]
    out = dict(verdicts)
    for k in (p.id for p in parts if verdicts[p.id].level != "refused"):
        others = (o for o in doubted if o != k)
        common = (len(moving[k] & moving[o]) / max(len(moving[k] | moving[o]), 1) for o in others)
        share = max(common, default=0.0)
        if share > TOGETHER:
            out[k] = _added_up(
                (*verdicts[k].reasons, reason("MovesWithDoubted", "doubtful", share, TOGETHER))
            )
    return out


def verdict_on(evidence: PartEvidence, first: int = 0) -> Verdict:
    """All reasons against one part. first: of the evidence's frames, as the recording counts.

    A closed end that one cue leaves unsure is no reason where all cues together are sure of it and nothing
    else speaks against the part: of what was missed or labelled wrong they tell another surface's closed end.
    """
    reasons = tuple(_later(r, first) for ask in OF_PARTS if (r := ask(evidence)) is not None)
    if evidence.closed_probability >= CLOSED_SURE and all(r.type == "ClosedEndUnsure" for r in reasons):
        return Verdict()
    return _added_up(reasons)


def _added_up(reasons: tuple[Reason, ...]) -> Verdict:
    """These reasons, and that they are too many where none of them is enough to refuse."""
    alike = [[r for r in reasons if r.type in types] for types in (OF_THE_SCENE, OF_THE_FIT)]
    doubts = [r for r in reasons if all(r not in same[1:] for same in alike)]
    if len(doubts) > MOST_DOUBTS and all(r.level == "doubtful" for r in reasons):
        first, told = doubts[0], (len(doubts), MOST_DOUBTS)
        return Verdict((reason("ManyDoubts", "refused", *told, first.text, first.help), *reasons))
    return Verdict(reasons)


def _later(told: Reason, first: int) -> Reason:
    """A reason whose frames count from `first`, in the recording's frames."""
    if not first or not _FRAMES & told.numbers.keys():
        return told
    numbers = {k: v + first if k in _FRAMES else v for k, v in told.numbers.items()}
    return reason(told.type, told.level, *numbers.values())

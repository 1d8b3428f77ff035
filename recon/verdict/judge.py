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
from recon.verdict.doubt import Doubt, above
from recon.verdict.evidence import PartEvidence, SceneEvidence
from recon.verdict.in_motion import moving_rows
from recon.verdict.of_parts import OF_PARTS
from recon.verdict.of_scenes import nothing_articulated
from recon.verdict.posterior import TRUSTED, probability, verdict_of
from twin.runs.keys import Stage
from twin.scene import Mesh, Trajectory
from twin.verdict import Reason, Verdict, reason

VERDICT = Stage("verdict", 48, ())
# Of the frames in which either of two parts moves, those in which both do: a hand opens one part. Right parts
# of open recordings (looked at): 0 to .08 in 14, .28 in one; one part that was found as two: .44 to .79.
TOGETHER = 0.3
# Numbers of reasons that are frames.
_FRAMES = {"frame", "other", "first", "last"}


@dataclass(frozen=True)
class Judged:
    """The verdict on each part by id, those without a surface too, and the reasons against the scene.

    amounts: of the doubts about each part by their type, as the posterior counts them.
    """

    parts: Mapping[int, Verdict]
    scene: tuple[Reason, ...]
    amounts: Mapping[int, Mapping[str, float]]


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
    looks: dict[int, list[Sequence[Doubt]]] = {}
    missed: list[Reason] = []
    for interaction in interactions:
        scene = told.scene(interaction)
        missed += _missed(scene, interaction)
        for k, doubts in told.doubts(scene, interaction).items():
            looks.setdefault(k, []).append(doubts)
    best = {k: of_looks(doubts) for k, doubts in looks.items()}
    amounts = {k: {d.reason.type: d.amount for d in clearest(doubts)} for k, doubts in looks.items()}
    # What is wrong with the recording comes first: it may be the cause of all else.
    windows = {p.id: p.windows for p in parts}
    verdicts = {
        k: replace(
            best[k],
            reasons=(*(f.reason for f in faults if f.touches(windows.get(k, ()))), *best[k].reasons),
        )
        for k in sorted(best)
    }
    every = tuple(f.reason for f in faults)
    if any(v.level != "refused" for v in verdicts.values()):
        return Judged(verdicts, (*every, *missed), amounts)
    refusing = (replace(reason, level="refused") for reason in every)
    nothing = nothing_articulated([i.found.movers for i in interactions])
    return Judged(verdicts, (*refusing, nothing), amounts)


def _missed(scene: SceneEvidence, interaction: Interaction) -> list[Reason]:
    """A doubt about the scene where a hand visits it for longer than what was found explains."""
    window = interaction.window
    if interaction.parts:
        visit = scene.idle_visit
        handled = None if visit is None else (visit[0] + window.first, visit[1] + window.first)
    else:
        handled = window.handled
    return [] if handled is None else [reason("HandMovesNothing", "doubtful", *handled)]


def clearest(looks: Sequence[Sequence[Doubt]]) -> Sequence[Doubt]:
    """The doubts about a part in the interaction that shows it best: another look adds no doubt."""
    return max(looks, key=lambda doubts: (probability(doubts), -len(doubts)))


def of_looks(looks: Sequence[Sequence[Doubt]]) -> Verdict:
    """The verdict on a part by the doubts in each of its interactions: that of the clearest.

    What two interactions show, by one joint and one surface, is a part, if nothing surely refuses it in both.
    """
    told = verdict_of(clearest(looks))
    if told.level == "refused" and sum(probability(doubts) > 0.0 for doubts in looks) > 1:
        return replace(told, reasons=tuple(r.at_level("doubtful") for r in told.reasons))
    return told


@dataclass(frozen=True, eq=False)
class _Told:
    """All parts as they would be written, to be judged interaction by interaction."""

    recording: Recording
    cameras: Trajectory
    labels: Mapping[int, NDArray[np.uint8]]
    parts: Sequence[MovingPart]
    fused: FusedScene
    finished: Sequence[FinishedPart]

    def scene(self, interaction: Interaction) -> SceneEvidence:
        """What an interaction's window shows, with all parts that stand somewhere then."""
        window, handled = interaction.window, {p.id for p in interaction.parts}
        written = {
            f.moving.id: (f.moving, f.mesh) for f in (_on_what_stands(f, handled) for f in self.finished)
        }
        told: list[tuple[MovingPart, Mesh | None]] = [
            (during(part, window), mesh) for part, mesh in (written.get(p.id, (p, None)) for p in self.parts)
        ]
        told = [(part, mesh) for part, mesh in told if part.id in handled or part.is_somewhere]
        recording, cameras = frames_of(self.recording, window), cameras_of(self.cameras, window)
        labels = {f - window.first: i for f, i in self.labels.items() if window.first <= f <= window.last}
        return SceneEvidence(recording, cameras, labels, self.fused.static, told)

    def doubts(self, scene: SceneEvidence, interaction: Interaction) -> Mapping[int, Sequence[Doubt]]:
        """The doubts about each part that an interaction handles, by id."""
        handled = {p.id for p in interaction.parts}
        closed = {f.moving.id: f.closed for f in self.finished}
        mine = [(part, mesh) for part, mesh in scene.parts if part.id in handled]
        alone = {
            part.id: doubts_about(
                PartEvidence(scene, part, mesh, closed.get(part.id)), interaction.window.first
            )
            for part, mesh in mine
        }
        return beside_doubted([part for part, _ in mine], alone)


def _on_what_stands(part: FinishedPart, handled: Collection[int]) -> FinishedPart:
    """A part that is handled on a carrier that is not: a part of the static scene."""
    carrier = part.moving.carrier
    stands = carrier is not None and carrier.id not in handled and part.moving.id in handled
    return part.standing() if stands else part


def beside_doubted(
    parts: Sequence[MovingPart], doubts: Mapping[int, Sequence[Doubt]]
) -> Mapping[int, Sequence[Doubt]]:
    """The doubts by part, with one for each part that moves when one does that is not trusted: either may
    have taken what moved of the other, or both are one."""
    moving = {p.id: set(p.motion.frames[moving_rows(p)]) for p in parts}
    unsure = [p.id for p in parts if probability(doubts[p.id]) < TRUSTED]
    out = dict(doubts)
    for k in moving:
        others = (o for o in unsure if o != k)
        common = (len(moving[k] & moving[o]) / max(len(moving[k] | moving[o]), 1) for o in others)
        more = above("MovesWithDoubted", max(common, default=0.0), TOGETHER)
        out[k] = (*doubts[k], *(() if more is None else (more,)))
    return out


def doubts_about(evidence: PartEvidence, first: int = 0) -> tuple[Doubt, ...]:
    """All doubts about one part. first: of the evidence's frames, as the recording counts."""
    told = (doubt for ask in OF_PARTS if (doubt := ask(evidence)) is not None)
    return tuple(replace(d, reason=_later(d.reason, first)) for d in told)


def _later(told: Reason, first: int) -> Reason:
    """A reason whose frames count from `first`, in the recording's frames."""
    if not first or not _FRAMES & told.numbers.keys():
        return told
    numbers = {k: v + first if k in _FRAMES else v for k, v in told.numbers.items()}
    return reason(told.type, told.level, *numbers.values())

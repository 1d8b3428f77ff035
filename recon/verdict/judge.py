"""The verdict on each part: every piece of evidence is asked, and all reasons that it gives stand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.contact.finish_parts import FinishedPart
from recon.fusion.fuse import FusedScene
from recon.parts.find_parts import FoundParts
from recon.parts.moving_part import MovingPart
from recon.recording import Recording
from recon.verdict.evidence import PartEvidence, SceneEvidence
from recon.verdict.of_parts import OF_PARTS
from recon.verdict.of_scenes import nothing_articulated
from twin.runs.keys import Stage
from twin.scene import Trajectory
from twin.verdict import Reason, Verdict

VERDICT = Stage("verdict", 5, ())


@dataclass(frozen=True)
class Judged:
    """The verdict on each found part by its id, those without a surface too, and the reasons against the scene."""

    parts: Mapping[int, Verdict]
    scene: tuple[Reason, ...]


def judge(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    found: FoundParts,
    parts: Sequence[MovingPart],
    fused: FusedScene,
    finished: Sequence[FinishedPart],
) -> Judged:
    """Judge each part as it would be written, and the scene.

    parts: those of `found`, refined. finished: those of them that have a surface, counted from their closed end.
    """
    written = {f.moving.id: (f.moving, f.mesh) for f in finished}
    margins = {f.moving.id: f.closed_margin for f in finished}
    told = [written.get(p.id, (p, None)) for p in parts]
    scene = SceneEvidence(recording, cameras, labels, found, fused.static, told)
    verdicts = {
        part.id: verdict_on(PartEvidence(scene, part, mesh, tracks, margins.get(part.id)))
        for (part, mesh), tracks in zip(told, found.parts, strict=True)
    }
    none = all(v.level == "refused" for v in verdicts.values())
    return Judged(verdicts, (nothing_articulated(found.movers),) if none else ())


def verdict_on(evidence: PartEvidence) -> Verdict:
    """All reasons against one part."""
    reasons = (ask(evidence) for ask in OF_PARTS)
    return Verdict(tuple(r for r in reasons if r is not None))

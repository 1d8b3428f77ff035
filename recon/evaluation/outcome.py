"""How a twin did by part: success or the cause of failure, from the truth. For rates over recordings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from recon.evaluation.scores import (
    CameraErrors,
    JointErrors,
    camera_errors,
    joint_errors,
    label_scores,
    match_parts,
)
from recon.evaluation.truth import Truth, TruthPart
from twin.geometry import Array, line_angle, rotate
from twin.scene import Part, Twin

Cause = Literal["cameras", "missed", "type", "axis", "path", "labels"]
JointCause = Literal["type", "axis", "path"]
# What takes a path aside: closed and open end exchanged, the cameras, the hinge's place, or else the states
Aside = Literal["closed end", "cameras", "hinge", "states"]

# success@5 deg/2 cm: right type, axis, RMSE of the handle's path over the true moving frames, mask.
AXIS_DEG = 5.0
PATH_MM = 20.0
PART_MIOU = 0.7
LOST_MM = 30.0  # ATE of cameras that are lost, six times the goal of `twin evaluate`; chosen by us
UP_DEG = 5.0
# An invented part matches no true one: against each its axis is so far off or its mask so wrong.
INVENTED_AXIS_DEG = 15.0
INVENTED_MIOU = 0.2


@dataclass(frozen=True)
class PartOutcome:
    """A true part: why it failed, None for a success; whether the twin calls it trusted; by which types of
    reason it doesn't; and for the cause "path" what took it aside."""

    cause: Cause | None
    trusted: bool
    doubts: tuple[str, ...] = ()
    aside: Aside | None = None


@dataclass(frozen=True)
class Outcome:
    """parts: one for each true part. invented: of the parts of the twin that are none, whether each is
    trusted. up_right: whether up is within UP_DEG. doubtful: parts of the twin that are neither trusted nor
    refused. refused: types of the reasons against parts that the twin leaves out, each once a part.
    up_doubted: whether the twin says that up may be wrong.
    """

    parts: tuple[PartOutcome, ...]
    invented: tuple[bool, ...]
    up_right: bool
    doubtful: int
    refused: tuple[str, ...] = ()
    up_doubted: bool = False


def outcome(twin: Twin, truth: Truth) -> Outcome:
    """Judge every true part and every part of the twin. Raises InputError when the twin has no cameras."""
    if twin.cameras is None:
        return Outcome(tuple(PartOutcome("cameras", False) for _ in truth.parts), (), False, 0)
    cameras = camera_errors(twin.cameras, truth)
    T, lost = cameras.T_truth_recon, cameras.ate_mm > LOST_MM
    pairs = match_parts([(p.joint, p.motion) for p in twin.parts], T, truth)
    parts = []
    for i, true in enumerate(truth.parts):
        found = twin.parts[pairs[i]] if i in pairs else None
        cause = "cameras" if lost else _cause(found, true, truth, twin, T)
        doubts = () if found is None or found.verdict is None else found.verdict.reasons
        kinds = tuple(sorted({r.type for r in doubts}))
        aside = _aside(found, true, truth, cameras) if found is not None and cause == "path" else None
        parts.append(PartOutcome(cause, found is not None and is_trusted(found), kinds, aside))
    matched = set(pairs.values())
    invented = [
        is_trusted(p)
        for j, p in enumerate(twin.parts)
        if j not in matched and not _is_some_part(p, truth, twin, T)
    ]
    doubtful = sum(not is_trusted(p) for p in twin.parts)
    said = () if twin.verdict is None else twin.verdict.reasons
    up_doubted = any(r.type == "UpUnsure" for r in said)
    return Outcome(
        tuple(parts), tuple(invented), cameras.up_deg <= UP_DEG, doubtful, _refused(twin), up_doubted
    )


def _refused(twin: Twin) -> tuple[str, ...]:
    """Types of the reasons against parts that are not written, each once a part."""
    told = () if twin.verdict is None else twin.verdict.reasons
    against = [r.numbers for r in told if r.type == "OfPart" and not r.numbers["written"]]
    return tuple(of for _, of in sorted({(n["part"], n["of"]) for n in against}))


def is_trusted(part: Part) -> bool:
    """Whether the twin calls a part trusted. Without a verdict (an older twin) no one warns: trusted."""
    return part.verdict is None or part.verdict.level == "trusted"


def success(joint: JointErrors | None, miou: float | None) -> bool:
    """success@5 deg/2 cm of a part with a mask of this mean IoU."""
    return joint is not None and joint_cause(joint) is None and miou is not None and miou >= PART_MIOU


def _cause(found: Part | None, true: TruthPart, truth: Truth, twin: Twin, T: Array) -> Cause | None:
    if found is None:
        return "missed"
    cause = joint_cause(joint_errors(found.joint, found.motion, T, truth, true))
    return cause or ("labels" if _miou(found, true, truth, twin) < PART_MIOU else None)


def joint_cause(errors: JointErrors) -> JointCause | None:
    """Why a joint and its motion fail success@5 deg/2 cm, None if they don't."""
    if not errors.type_right:
        return "type"
    if errors.axis_deg is None or errors.axis_deg > AXIS_DEG:
        return "axis"
    if errors.handle_rmse_mm is None or errors.handle_rmse_mm > PATH_MM:
        return "path"
    return None


def _aside(found: Part, true: TruthPart, truth: Truth, cameras: CameraErrors) -> Aside:
    """What takes the path of a part with the right type and axis aside: cameras and hinge where they alone do
    by half of what is allowed, the farther one."""
    errors = joint_errors(found.joint, found.motion, cameras.T_truth_recon, truth, true)
    if not errors.closed_right:
        return "closed end"
    hinge = 2.0 * float(np.sin(0.5 * min(true.travel, np.pi))) * (errors.pivot_line_mm or 0.0)
    farther: Aside = "hinge" if hinge > cameras.ate_mm else "cameras"
    return farther if max(hinge, cameras.ate_mm) > 0.5 * PATH_MM else "states"


def _miou(found: Part, true: TruthPart, truth: Truth, twin: Twin) -> float:
    score = label_scores(twin.labels, truth, {true.id: found.id}).get(true.id)
    return 0.0 if score is None or score.miou is None else score.miou


def _is_some_part(found: Part, truth: Truth, twin: Twin, T: Array) -> bool:
    """Whether a part of the twin is one of the true ones, found twice."""
    axis = rotate(T, found.joint.axis)
    return any(
        np.degrees(line_angle(axis, true.joint.axis)) <= INVENTED_AXIS_DEG
        and _miou(found, true, truth, twin) >= INVENTED_MIOU
        for true in truth.parts
    )

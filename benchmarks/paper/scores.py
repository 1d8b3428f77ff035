"""What one method's answer to one clip is worth, by the definitions of docs/metrics.md.

Sign and zero of the states are fitted to the truth once, as there: which end is closed is not compared here.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.paper.chain import Answer
from recon.evaluation import metrics
from recon.evaluation.metrics import state_error
from recon.evaluation.scores import camera_errors, joint_errors, label_scores, match_parts
from recon.evaluation.truth import Truth, TruthPart
from recon.interaction.parts.moving_part import MovingPart
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Motion

_DIGITS = 6
# what is charged where there is no part or no right type; docs/metrics.md
_AXIS_DEG, _PIVOT_MM = 90.0, 1000.0


def scored(answer: Answer, truth: Truth) -> dict[str, Any]:
    """Measures of the one true part, failures charged; "found" and "type" tell which are.

    axis deg, pivot mm (hinges), state deg or mm, add, add_s: shares of moving frames, miou: None where the
    method labels nothing; ate mm, rpe mm, rpe_deg; extra: parts beside the matched one.
    """
    part, cameras = truth.parts[0], camera_errors(answer.cameras, truth)
    T = cameras.T_truth_recon
    told = [(p.joint, replace(p.motion, intervals=())) for p in answer.parts]
    pair = match_parts(told, T, truth).get(0)
    hinge = part.joint.kind == "revolute"
    travel = float(np.degrees(part.travel)) if hinge else 1e3 * part.travel
    out: dict[str, Any] = {
        "kind": part.joint.kind, "found": pair is not None, "type": False, "axis": _AXIS_DEG,
        "pivot": _PIVOT_MM if hinge else None, "state": travel, "add": 0.0, "add_s": 0.0,
        "miou": None if answer.labels is None else 0.0, "extra": max(len(answer.parts) - 1, 0),
        "ate": cameras.ate_mm, "rpe": cameras.rpe_mm, "rpe_deg": cameras.rpe_deg,
    }  # fmt: skip
    if pair is not None:
        out |= _of_part(answer, answer.parts[pair], T, truth)
    return {k: round(v, _DIGITS) if isinstance(v, float) else v for k, v in out.items()}


def _of_part(answer: Answer, found: MovingPart, T: Array, truth: Truth) -> dict[str, Any]:
    part = truth.parts[0]
    joint, motion = _anchored(found.joint, found.motion, part)
    errors = joint_errors(joint, motion, T, truth, part)
    out: dict[str, Any] = {"type": errors.type_right, "add": errors.add or 0.0, "add_s": errors.add_s or 0.0}
    known = {"axis": errors.axis_deg, "pivot": errors.pivot_mm, "state": errors.state}
    out |= {k: float(v) for k, v in known.items() if v is not None}  # none of a wrong type
    if answer.free is not None:
        out |= _of_poses(*answer.free, T, part)
    if answer.labels is not None:
        scores = label_scores(answer.labels, truth, {part.id: found.id})
        out["miou"] = scores[part.id].miou or 0.0
    return out


def _anchored(joint: Joint, motion: Motion, part: TruthPart) -> tuple[Joint, Motion]:
    """The joint with its sign and the zero of its states as the truth has them."""
    true, state = part.states[motion.frames] - part.closed, motion.state
    if joint.kind == part.joint.kind:
        _, sign = state_error(true, state)
        shift = float(np.median(sign * state - true))
    else:
        sign = 1 if metrics.same_direction(true, state) else -1
        shift = float(sign * state[np.argmin(true)])
    state = sign * state - shift
    low, high = min(float(state.min()), 0.0), max(float(state.max()), 0.0)
    turned = replace(joint, axis=sign * joint.axis, lower=low, upper=high, covariance=None, sigma=None)
    return turned, replace(motion, state=state)


def _of_poses(frames: Array, poses: Array, T: Array, part: TruthPart) -> dict[str, Any]:
    """ADD and ADD-S of free poses, set at rest at the frame of theirs that is truly the most closed."""
    points = part.mesh.vertices[:: max(1, len(part.mesh.vertices) // 2000)]
    limit = metrics.ADD_SHARE * metrics.diameter(points)
    first = int(np.argmin(part.states[frames]))
    true = part.joint.poses(part.states[frames])
    world = T @ poses @ geo.invert_pose(poses[first]) @ geo.invert_pose(T) @ true[first]
    moving = np.flatnonzero(np.isin(frames, part.moving_frames))
    apart = np.array([metrics.vertex_distances(points, true[k], world[k]) for k in moving]).reshape(-1, 2)
    total = max(len(part.moving_frames), 1)
    return {
        "add": float((apart[:, 0] < limit).sum() / total),
        "add_s": float((apart[:, 1] < limit).sum() / total),
    }

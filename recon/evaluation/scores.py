"""Scores of cameras, labels and joints against the truth, each usable before a whole twin exists.

Values are None where there is nothing to measure; `recon.evaluation.evaluate` charges those.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from recon.evaluation import metrics
from recon.evaluation.metrics import DistanceField
from recon.evaluation.truth import Truth, TruthPart
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import HAND_LABEL, Joint, Motion, Part, Revolute, Trajectory

MIN_PIXEL_SHARE = 0.004  # chosen by us: 1200 pixels at 640x480; fewer say little about a mask


@dataclass(frozen=True, eq=False)
class CameraErrors:
    """Cameras after the alignment T_truth_recon (4, 4): ATE and RPE in mm, deg; up error in deg, share."""

    T_truth_recon: Array
    ate_mm: float
    rpe_mm: float
    rpe_deg: float
    up_deg: float
    share: float


def camera_errors(trajectory: Trajectory, truth: Truth) -> CameraErrors:
    """Align the worlds by the cameras and compare them. Raises InputError when no frame is in the truth."""
    if truth.cameras is None:
        raise InputError(f"{truth.folder} tells no cameras", "compare what needs none")
    known = truth.cameras.frames
    common = np.intersect1d(trajectory.frames, known[(known >= 0) & (known < truth.frames)])
    if len(common) == 0:
        raise InputError(
            f"the cameras' frames {trajectory.frames[0]}..{trajectory.frames[-1]} are not in the truth of "
            f"{truth.frames} frames",
            "give the truth of the same recording",
        )
    found = trajectory.T_world_cam[np.isin(trajectory.frames, common)]
    true = truth.cameras.T_world_cam[np.isin(known, common)]
    T = metrics.align_worlds(true, found)
    aligned = T @ found
    rpe_m, rpe_rad = metrics.relative_pose_error(true, aligned)
    return CameraErrors(
        T_truth_recon=T,
        ate_mm=1e3 * metrics.absolute_trajectory_error(true, aligned),
        rpe_mm=1e3 * rpe_m,
        rpe_deg=float(np.degrees(rpe_rad)),
        up_deg=float(np.degrees(geo.angle_between(T[:3, 2], [0.0, 0.0, 1.0]))),
        share=len(common) / len(known),
    )


@dataclass(frozen=True)
class LabelScore:
    """Masks of one thing: mean IoU over `frames` frames that show it, and the mean share of pixels wrongly
    given to it over the `other_frames` (0 without such a frame)."""

    miou: float | None
    frames: int
    false_share: float
    other_frames: int


def label_scores(
    labels: Mapping[int, NDArray[np.uint8]], truth: Truth, ids: Mapping[int, int] | None = None
) -> dict[int, LabelScore]:
    """Scores by true label: every part's id and 255, the hand.

    Args:
        labels: frame -> (H, W) uint8.
        ids: the label that a true part id has there; by default the same number. A part that is not in
            `ids` is scored with an empty mask.
    """
    wanted = [p.id for p in truth.parts] + [HAND_LABEL]
    names = {k: k for k in wanted} if ids is None else {**ids, HAND_LABEL: HAND_LABEL}
    shown: dict[int, list[float]] = {k: [] for k in wanted}
    false: dict[int, list[float]] = {k: [] for k in wanted}
    for frame in sorted(set(labels) & set(truth.labels)):
        true, found = truth.labels[frame], labels[frame]
        if true.shape != found.shape:
            raise InputError(
                f"labels of frame {frame} are {found.shape[1]}x{found.shape[0]}, the truth's "
                f"{true.shape[1]}x{true.shape[0]}",
                "label at the resolution of the colour images",
            )
        for k in wanted:
            is_true = true == k
            is_found = found == names[k] if k in names else np.zeros_like(is_true)
            if np.count_nonzero(is_true) >= MIN_PIXEL_SHARE * true.size:
                shown[k].append(metrics.iou(is_true, is_found))
            else:
                false[k].append(float(np.count_nonzero(is_found & ~is_true) / true.size))
    return {
        k: LabelScore(
            float(np.mean(shown[k])) if shown[k] else None,
            len(shown[k]),
            float(np.mean(false[k])) if false[k] else 0.0,
            len(false[k]),
        )
        for k in wanted
    }


@dataclass(frozen=True)
class JointErrors:
    """A joint and its motion against a true part. None where nothing compares (wrong type, no states).

    Angles in deg, lengths in mm, `state` and `range` in deg or mm by the true type. screw_path_deg: median
    angle between true and found velocity of the handle. add, add_s: share of moving frames with the part's
    vertices (nearest vertices) within 10 % of its diameter; auc: area under the ADD curve to 10 cm.
    """

    type_right: bool
    axis_deg: float | None
    pivot_line_mm: float | None
    pivot_mm: float | None
    state: float | None
    range: float | None
    screw_path_deg: float | None
    handle_rmse_mm: float | None
    add: float | None
    add_s: float | None
    auc: float | None
    opening_right: bool | None
    closed_right: bool | None
    interval_iou: float
    interval_precision: float
    interval_recall: float
    state_share: float | None

    @property
    def success(self) -> bool:
        """Right type, axis within 10 deg, and the handle's path within 10 cm RMSE."""
        return (
            self.type_right
            and self.axis_deg is not None
            and self.axis_deg <= 10.0
            and self.handle_rmse_mm is not None
            and self.handle_rmse_mm <= 100.0
        )


def joint_errors(
    joint: Joint, motion: Motion, T_truth_recon: Array, truth: Truth, part: TruthPart | None = None
) -> JointErrors:
    """Compare a joint (in the reconstruction's world) and motion with a true part, by default the best."""
    found = joint.transformed(T_truth_recon)
    if part is None:
        part = truth.parts[max(match_parts([(joint, motion)], T_truth_recon, truth), default=0)]
    told = np.flatnonzero(np.isfinite(part.states))
    inside = np.isin(motion.frames, told)
    frames, states = motion.frames[inside], motion.state[inside]
    unit = 1e3 if part.joint.kind == "prismatic" else float(np.degrees(1.0))
    same = found.kind == part.joint.kind
    pivot = _pivot_errors(found, part) if same else None
    span = metrics.span_hull(motion.intervals)
    precision, recall = metrics.span_detection(part.spans, motion.intervals)
    path = _Path(found, frames, states, part) if truth.knows("states", "fronts") else None
    moving = np.intersect1d(part.moving_frames, told)
    return JointErrors(
        type_right=same,
        axis_deg=float(np.degrees(geo.line_angle(found.axis, part.joint.axis))) if same else None,
        pivot_line_mm=None if pivot is None else pivot[0],
        pivot_mm=None if pivot is None else pivot[1],
        state=unit * metrics.state_error(part.states[frames], states)[0] if same and len(frames) else None,
        range=unit * abs(found.upper - found.lower - part.travel) if same and len(told) else None,
        screw_path_deg=path.direction_deg() if path else None,
        handle_rmse_mm=path.handle_rmse_mm() if path else None,
        **(path.add_scores() if path else dict.fromkeys(("add", "add_s", "auc"))),
        opening_right=path.opening_right() if path else None,
        closed_right=_closed_right(part.states[frames], states) if len(told) else None,
        interval_iou=metrics.span_iou(part.span, span),
        interval_precision=precision,
        interval_recall=recall,
        state_share=np.count_nonzero(np.isin(frames, moving)) / max(len(moving), 1) if len(told) else None,
    )


def _closed_right(true: Array, found: Array) -> bool:
    return bool(len(true)) and metrics.same_direction(true, found)


def _pivot_errors(found: Joint, part: TruthPart) -> tuple[float, float | None] | None:
    """Pivot errors (a) line to line and (b) point nearest the part to true line, mm; None for a slide.

    (b) is None where nothing tells where the part is.
    """
    true = part.joint
    if not (isinstance(found, Revolute) and isinstance(true, Revolute)):
        return None
    apart, centre = (
        1e3 * geo.line_distance(found.pivot, found.axis, true.pivot, true.axis),
        part.closed_centre,
    )
    if centre is None:
        return apart, None
    point = geo.nearest_point_on_line(centre, found.pivot, found.axis)
    return apart, 1e3 * geo.point_line_distance(point, true.pivot, true.axis)


class _Path:
    """How the handle and the whole part move, over the moving frames that have a state."""

    def __init__(self, found: Joint, frames: NDArray[np.int64], states: Array, part: TruthPart) -> None:
        moving = np.isin(frames, part.moving_frames)
        self.frames = frames[moving]
        self.part = part
        self.T_true = part.joint.poses(part.states[self.frames]) if len(self.frames) else np.zeros((0, 4, 4))
        self.T_found = found.poses(states[moving]) @ part.T_world_closed if len(self.frames) else self.T_true
        rest = geo.transform(geo.invert_pose(part.T_world_closed), part.handle[None])[0]
        self.true_velocity = np.array([part.joint.velocity(s, rest) for s in part.states[self.frames]])
        self.found_velocity = np.array([found.velocity(s, part.handle) for s in states[moving]])
        self.rest = rest

    def _angles(self) -> Array:
        """Angles (n,) rad between the velocities; a handle on the axis has none: perpendicular."""
        moves = [np.linalg.norm(v, axis=1) > 1e-9 for v in (self.true_velocity, self.found_velocity)]
        ok = moves[0] & moves[1]
        angles = np.full(len(ok), np.pi / 2)
        angles[ok] = metrics.signed_angles(self.true_velocity[ok], self.found_velocity[ok])
        return angles

    def direction_deg(self) -> float | None:
        return float(np.degrees(np.median(self._angles()))) if len(self.frames) else None

    def opening_right(self) -> bool:
        return bool(len(self.frames)) and bool(np.median(self._angles()) < np.pi / 2)

    def handle_rmse_mm(self) -> float | None:
        if len(self.frames) == 0:
            return None
        off = geo.transform(self.T_true, self.rest[None]) - geo.transform(self.T_found, self.rest[None])
        return float(1e3 * np.sqrt(np.mean(np.sum(off**2, axis=-1))))

    def add_scores(self) -> dict[str, float]:
        """ADD, ADD-S and AUC over all moving frames; those without a state count as wrong."""
        total = max(len(self.part.moving_frames), 1)
        points = self.part.mesh.vertices[:: max(1, len(self.part.mesh.vertices) // 2000)]
        limit = metrics.ADD_SHARE * metrics.diameter(points)
        d = np.array(
            [metrics.vertex_distances(points, *pair) for pair in zip(self.T_true, self.T_found, strict=True)]
        ).reshape(-1, 2)
        return {
            "add": float(np.sum(d[:, 0] < limit) / total),
            "add_s": float(np.sum(d[:, 1] < limit) / total),
            "auc": metrics.area_under_accuracy(d[:, 0]) * len(d) / total,
        }


def match_parts(found: Sequence[tuple[Joint, Motion]], T_truth_recon: Array, truth: Truth) -> dict[int, int]:
    """Index of the true part -> the found one, by the best sum of overlap less axis error (per 90 deg).

    Only parts whose motions overlap in time can match; a motion that lists no interval may match any. Where
    the truth tells no cameras, axes can't be compared, and the overlap alone counts. Of a part that truly
    moves more than once, each motion counts; of one that moves once, the hull of what was found.
    """
    if not found or not truth.parts:
        return {}
    cost = np.zeros((len(truth.parts), len(found)))
    possible = np.zeros(cost.shape, dtype=bool)
    for i, true in enumerate(truth.parts):
        for j, (joint, motion) in enumerate(found):
            overlap = _overlap(true.spans, motion.intervals)
            axis = geo.rotate(T_truth_recon, joint.axis)
            angle = geo.line_angle(axis, true.joint.axis) if truth.cameras is not None else 0.0
            possible[i, j] = overlap > 0 or not motion.intervals
            cost[i, j] = angle / (np.pi / 2) - overlap
    rows, cols = linear_sum_assignment(np.where(possible, cost, 10.0))  # 10: worse than any possible pair
    return {int(i): int(j) for i, j in zip(rows, cols, strict=True) if possible[i, j]}


def _overlap(true: Sequence[metrics.Span], found: Sequence[metrics.Span]) -> float:
    """Temporal IoU of motions; of a single true one with the hull, since it may be found in pieces."""
    if len(true) > 1:
        return metrics.spans_iou(true, found)
    return metrics.span_iou(metrics.span_hull(true), metrics.span_hull(found))


def contact_mm(found: Part | None, true: TruthPart, T: Array) -> float | None:
    """mm by which a part's contact is farther from the grip's centre than the true surface is, closed; None
    where either is not known."""
    if found is None or found.contact is None or true.grip is None:
        return None
    grip = true.handle
    distance = float(np.linalg.norm(geo.transform(T, found.contact.point[None])[0] - grip))
    return 1e3 * max(0.0, distance - float(DistanceField(true.closed_mesh).distance(grip[None])[0]))

"""Cameras of a walk against the truth: pieces of the path, errors inside interactions, frames with a pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from recon.cameras.places import Seen
from recon.evaluation import metrics
from recon.evaluation.metrics import Span
from recon.evaluation.scores import CameraErrors, camera_errors
from recon.evaluation.truth import Truth
from recon.evaluation.walk_scores import LocalErrors, LoopCounts, PieceScore, PoseCounts
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Motion, Trajectory

# Frames between two poses that are compared; four seconds at 15 frames a second, a motion of a part.
MOST_APART = 60
# m and rad by which a place that is seen again may be off (docs/metrics.md)
_OFF_M, _OFF_RAD = 0.05, float(np.radians(3.0))


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece of a path, from its first to its last frame, and its cameras aligned for themselves; the true
    way of the camera (m) between its frames."""

    span: Span
    frames: NDArray[np.int64]
    errors: CameraErrors
    way_m: float

    @property
    def score(self) -> PieceScore:
        return PieceScore(*self.span, len(self.frames), self.errors.ate_mm, self.way_m)


def aligned_pieces(cameras: Trajectory, truth: Truth, pieces: Sequence[Span] | None) -> tuple[Piece, ...]:
    """The pieces of a path, each aligned to the truth; by default the path is one.

    Raises:
        InputError: a piece has no pose or shares a frame with another, or a pose lies in no piece.
    """
    spans = [(int(cameras.frames[0]), int(cameras.frames[-1]))] if pieces is None else sorted(pieces)
    for (_, last), (first, _) in pairwise(spans):
        if first <= last:
            raise InputError(f"two pieces of the path hold frame {first}", "give each frame to one piece")
    out = []
    for first, last in spans:
        rows = (cameras.frames >= first) & (cameras.frames <= last)
        if not rows.any():
            raise InputError(f"no frame of the piece {first}..{last} has a pose", "leave this piece out")
        path = Trajectory(cameras.frames[rows], cameras.times[rows], cameras.T_world_cam[rows])
        out.append(Piece((first, last), path.frames, camera_errors(path, truth), _way(path.frames, truth)))
    lost = np.setdiff1d(cameras.frames, np.concatenate([p.frames for p in out]) if out else [])
    if len(lost):
        raise InputError(f"frame {lost[0]} has a pose and lies in no piece", "name all pieces of the path")
    return tuple(out)


def _way(frames: NDArray[np.int64], truth: Truth) -> float:
    """m that the true camera goes between frames."""
    if truth.cameras is None:
        return 0.0
    centres = truth.cameras.T_world_cam[np.isin(truth.cameras.frames, frames), :3, 3]
    return float(np.linalg.norm(np.diff(centres, axis=0), axis=1).sum())


def loop_counts(loops: Sequence[Seen], truth: Truth) -> LoopCounts:
    """How many places seen again there are, and how many are off. Raises InputError without true cameras."""
    if truth.cameras is None:
        raise InputError(f"{truth.folder} tells no cameras", "compare what needs none")
    cameras, false = truth.cameras, 0
    for seen in loops:
        a, b = cameras.pose(seen.a), cameras.pose(seen.b)
        if a is None or b is None:
            continue
        off = geo.invert_pose(geo.invert_pose(a) @ b) @ seen.T_a_b
        false += bool(np.linalg.norm(off[:3, 3]) > _OFF_M or geo.rotation_angle(off[:3, :3]) > _OFF_RAD)
    return LoopCounts(len(loops), false)


def alignment_of(motion: Motion, pieces: Sequence[Piece]) -> Array:
    """T_truth_recon (4, 4) of the piece that holds most frames of a part's interactions, else the longest."""
    moving = metrics.span_frames(motion.intervals)
    best = max(pieces, key=lambda p: (np.count_nonzero(np.isin(moving, p.frames)), len(p.frames)))
    return best.errors.T_truth_recon


def local_errors(cameras: Trajectory, truth: Truth, pieces: Sequence[Piece]) -> LocalErrors:
    """Errors of the relative poses of any two frames of one true interaction, at most `MOST_APART` apart.

    Two frames in different pieces have no relative pose. Raises InputError when the truth tells no cameras.
    """
    if truth.cameras is None:
        raise InputError(f"{truth.folder} tells no cameras", "compare what needs none")
    known, true = truth.cameras.frames, truth.cameras.T_world_cam
    common, of_true, of_found = np.intersect1d(known, cameras.frames, assume_unique=True, return_indices=True)
    piece = np.searchsorted([p.span[0] for p in pieces], common, side="right")
    total = LocalErrors()
    for first, last in (s for part in truth.parts for s in part.spans):
        pairs = len(_pairs(known[(known >= first) & (known <= last)])[0])
        rows = np.flatnonzero((common >= first) & (common <= last))
        a, b = (rows[k] for k in _pairs(common[rows]))
        joined = piece[a] == piece[b]
        metres, radians = metrics.relative_errors(
            true[of_true], cameras.T_world_cam[of_found], a[joined], b[joined]
        )
        off = tuple((1e3 * metres).tolist()), tuple(np.degrees(radians).tolist())
        total += LocalErrors(*off, pairs)
    return total


def _pairs(frames: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Places (m,) and (m,) in frames (n,) of every two that are at most `MOST_APART` apart."""
    first, second = np.triu_indices(len(frames), 1)
    near = frames[second] - frames[first] <= MOST_APART
    return first[near], second[near]


def pose_counts(posed: NDArray[np.int64], frames: int, gaps: Sequence[Span]) -> PoseCounts:
    """Counts of `frames` frames of which `posed` (n,) have a pose; one that has is in no gap.

    Raises:
        InputError: a gap does not lie in the recording.
    """
    for first, last in gaps:
        if not 0 <= first <= last < frames:
            raise InputError(
                f"the gap {first}..{last} does not lie in {frames} frames", "give first and last frame of it"
            )
    named = np.setdiff1d(metrics.span_frames(gaps), posed)
    return PoseCounts(frames, len(posed), len(named))


def in_truth(cameras: Trajectory, truth: Truth) -> Trajectory:
    """The cameras of the truth's frames. Raises InputError when there is none."""
    rows = (cameras.frames >= 0) & (cameras.frames < truth.frames)
    if not rows.any():
        raise InputError(
            f"the cameras' frames {cameras.frames[0]}..{cameras.frames[-1]} are not in the truth of "
            f"{truth.frames} frames",
            "give the truth of the same recording",
        )
    return replace(
        cameras,
        frames=cameras.frames[rows],
        times=cameras.times[rows],
        T_world_cam=cameras.T_world_cam[rows],
    )

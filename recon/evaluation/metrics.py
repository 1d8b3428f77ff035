"""How far a reconstruction is from the truth: one small function for every measure (docs/metrics.md).

Everything is in SI units and for one pair of things; failures and units of display are
`recon.evaluation.evaluate`'s. An exact answer gives 0 (or 1) up to rounding, and nothing is ever NaN.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Mesh

Span = tuple[int, int]

# m, chosen by us: how far from its centre a camera's axes count in the alignment, about half the depth seen
LEVER = 0.3
REST_SHARE = 0.02  # chosen by us: closer to rest than this share of the travel, no eye sees the part move
SNAP = 2e-5  # m, distances below it may be rounding of single precision in a room of some metres
ADD_SHARE = 0.1  # of the part's diameter (Hinterstoisser et al., ACCV 2012)
ADD_AUC_LIMIT = 0.10  # m (Xiang et al., PoseCNN, RSS 2018)


def align_worlds(T_true_cam: Array, T_recon_cam: Array) -> Array:
    """T_true_recon (4, 4), the rigid least-squares fit of camera poses (n, 4, 4) on four points a camera.

    The points are the centre and those `LEVER` along the three axes, so that one camera is enough.
    """
    points = np.vstack([np.zeros(3), LEVER * np.eye(3)])
    source, target = (geo.transform(T, points).reshape(-1, 3) for T in (T_recon_cam, T_true_cam))
    if np.array_equal(source, target):
        return np.eye(4)
    return geo.fit_rigid(source, target)


def absolute_trajectory_error(T_true_cam: Array, T_recon_cam: Array) -> float:
    """RMSE in metres of the camera centres of aligned poses (n, 4, 4)."""
    off = T_true_cam[:, :3, 3] - T_recon_cam[:, :3, 3]
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))


def relative_pose_error(T_true_cam: Array, T_recon_cam: Array) -> tuple[float, float]:
    """RMSE in metres and radians of the motion between consecutive poses (n, 4, 4); (0, 0) for one pose."""
    if len(T_true_cam) < 2:
        return 0.0, 0.0
    frames = np.arange(len(T_true_cam))
    translation, rotation = relative_errors(T_true_cam, T_recon_cam, frames[:-1], frames[1:])
    return float(np.sqrt(np.mean(translation**2))), float(np.sqrt(np.mean(rotation**2)))


def relative_errors(
    T_true_cam: Array, T_recon_cam: Array, first: NDArray[np.int64], second: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Errors (m,) in metres and (m,) in radians of the motions from poses `first` (m,) to `second` (m,)."""
    true = geo.invert_pose(T_true_cam[first]) @ T_true_cam[second]
    recon = geo.invert_pose(T_recon_cam[first]) @ T_recon_cam[second]
    # length of the error's translation before turning to camera axes, which rounds: equal motions give 0
    translation = np.linalg.norm(recon[:, :3, 3] - true[:, :3, 3], axis=1)
    rotation = geo.rotation_angle(np.swapaxes(true[:, :3, :3], 1, 2) @ recon[:, :3, :3])
    return translation, np.asarray(rotation, dtype=np.float64)


def moving_span(states: Array, offset: int = 0) -> Span | None:
    """First and last moving frame, inclusive, of states (n,); None when nothing moves.

    The first is more than `REST_SHARE` of the travelled range from the starting state, the last as far from
    the final state. `offset` is the frame of the first state.
    """
    travel = float(np.ptp(states)) if len(states) else 0.0
    if travel <= 0.0:
        return None
    first = np.flatnonzero(np.abs(states - states[0]) > REST_SHARE * travel)
    last = np.flatnonzero(np.abs(states - states[-1]) > REST_SHARE * travel)
    if len(first) == 0 or len(last) == 0 or last[-1] <= first[0]:
        return None
    return offset + int(first[0]), offset + int(last[-1])


def span_iou(a: Span | None, b: Span | None) -> float:
    """Temporal intersection over union of two inclusive intervals of frames; 0 when one is missing."""
    if a is None or b is None:
        return 0.0
    common = max(0, min(a[1], b[1]) - max(a[0], b[0]) + 1)
    return common / ((a[1] - a[0] + 1) + (b[1] - b[0] + 1) - common)


def span_hull(spans: Sequence[Span]) -> Span | None:
    """Smallest interval that holds all of them; None without any."""
    return (min(a for a, _ in spans), max(b for _, b in spans)) if spans else None


def span_frames(spans: Sequence[Span]) -> NDArray[np.int64]:
    """Frames (n,) of all intervals, ends included, each once and in order."""
    frames = [np.arange(a, b + 1) for a, b in spans]
    return np.unique(np.concatenate(frames)) if frames else np.zeros(0, dtype=np.int64)


def spans_iou(a: Sequence[Span], b: Sequence[Span]) -> float:
    """Temporal intersection over union of the frames of all intervals on either side; 0 without any."""
    of_a, of_b = span_frames(a), span_frames(b)
    common = len(np.intersect1d(of_a, of_b))
    return common / max(len(of_a) + len(of_b) - common, 1)


def span_detection(true: Sequence[Span], found: Sequence[Span], least: float = 0.5) -> tuple[float, float]:
    """Precision and recall of intervals, matched one to one at a temporal IoU of at least `least`.

    No interval found has precision 0 unless there was none to find.
    """
    if not true or not found:
        right = float(not true and not found)
        return right, 1.0 if not true else 0.0
    hits = span_hits(true, found, least)
    return hits / len(found), hits / len(true)


def span_hits(true: Sequence[Span], found: Sequence[Span], least: float = 0.5) -> int:
    """How many pairs of intervals match one to one at a temporal IoU of at least `least`."""
    if not true or not found:
        return 0
    from scipy.optimize import linear_sum_assignment

    iou = np.array([[span_iou(t, f) for f in found] for t in true])
    rows, cols = linear_sum_assignment(-np.where(iou >= least, iou, 0.0))
    return int(np.sum(iou[rows, cols] >= least))


def state_error(true: Array, found: Array) -> tuple[float, int]:
    """Mean absolute difference of states (n,) after fixing sign and zero once, and that sign (1 or -1).

    The zero is the median difference (least mean absolute difference); equal errors go to sign 1.
    """
    best = (np.inf, 1)
    for sign in (1, -1):
        off = true - sign * found
        best = min(best, (float(np.mean(np.abs(off - np.median(off)))), sign), key=lambda e: e[0])
    return best


def same_direction(true: Array, found: Array) -> bool:
    """Whether two series of states (n,) rise and fall together; False when one does not move."""
    return float((true - true.mean()) @ (found - found.mean())) > 0.0


def signed_angles(a: Array, b: Array) -> Array:
    """Angles (n,) in radians, 0..pi, between directions (n, 3) that are not zero; exact at 0 and pi."""
    ua, ub = geo.unit(a), geo.unit(b)
    return np.asarray(
        2.0 * np.arctan2(np.linalg.norm(ua - ub, axis=1), np.linalg.norm(ua + ub, axis=1)), dtype=np.float64
    )


def diameter(points: Array) -> float:
    """Largest distance in metres between two of the points (n, 3)."""
    if len(points) < 2:
        return 0.0
    from scipy.spatial import ConvexHull, QhullError
    from scipy.spatial.distance import pdist

    try:
        corners = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):  # flat or too few: every point is its own corner
        corners = points
    return float(pdist(corners[:: max(1, len(corners) // 2000)]).max())


def vertex_distances(points: Array, T_true: Array, T_found: Array) -> tuple[float, float]:
    """Mean distance (m) of points (n, 3) under two poses: of the same point (ADD) or the nearest (ADD-S)."""
    from scipy.spatial import cKDTree

    true, found = geo.transform(T_true, points), geo.transform(T_found, points)
    nearest, _ = cKDTree(true).query(found)
    return float(np.mean(np.linalg.norm(true - found, axis=1))), float(np.mean(nearest))


def area_under_accuracy(distances: ArrayLike, limit: float = ADD_AUC_LIMIT) -> float:
    """Area, 0..1, under the share of frames with a distance below thresholds up to `limit`."""
    d = np.asarray(distances, dtype=np.float64)
    return float(np.mean(np.clip(1.0 - d / limit, 0.0, 1.0))) if d.size else 0.0


def iou(true: NDArray[np.bool_], found: NDArray[np.bool_]) -> float:
    """Intersection over union of two masks of equal shape; 1 when both are empty."""
    union = int(np.count_nonzero(true | found))
    return np.count_nonzero(true & found) / union if union else 1.0


class DistanceField:
    """A mesh that answers how far points are from it.

    In single precision: points near large thin triangles are up to 0.3 mm off, means of thousands below 1 um.
    """

    def __init__(self, mesh: Mesh) -> None:
        import open3d as o3d

        self.empty = len(mesh.faces) == 0
        self._centre = np.zeros(3) if self.empty else mesh.vertices.mean(axis=0)
        self._scene = o3d.t.geometry.RaycastingScene()
        if not self.empty:
            vertices = (mesh.vertices - self._centre).astype(np.float32)
            self._scene.add_triangles(
                o3d.core.Tensor.from_numpy(vertices), o3d.core.Tensor.from_numpy(mesh.faces.astype(np.uint32))
            )

    def distance(self, points: Array) -> Array:
        """Distances (n,) in metres of points (n, 3) to the nearest point of the surface, rounding cut to 0.

        Infinite for a surface without faces.
        """
        if self.empty:
            return np.full(len(points), np.inf)
        if len(points) == 0:
            return np.zeros(0)
        import open3d as o3d

        query = o3d.core.Tensor.from_numpy(np.ascontiguousarray(points - self._centre, dtype=np.float32))
        d = self._scene.compute_distance(query).numpy().astype(np.float64)
        return np.where(d < SNAP, 0.0, d)

    def nearest(self, points: Array) -> Array:
        """Points (n, 3) of the surface nearest to points (n, 3); the points if it has no faces."""
        if self.empty or len(points) == 0:
            return points
        import open3d as o3d

        query = o3d.core.Tensor.from_numpy(np.ascontiguousarray(points - self._centre, dtype=np.float32))
        found = self._scene.compute_closest_points(query)["points"].numpy().astype(np.float64)
        return np.asarray(found + self._centre)

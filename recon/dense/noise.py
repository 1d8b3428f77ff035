"""How far depth scatters in this very recording, measured between frames that see the same surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

from recon.dense.depth import F32, depth_sigma, look_up
from recon.recording import Intrinsics, Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.robust import MAD_SIGMA
from twin.runs.keys import Stage
from twin.runs.threads import each
from twin.scene import Trajectory

NOISE = Stage("noise", 3, ())

# Chosen by us and the same for every recording.
_WIDTH = 160  # points looked at in each row of pixels
_PAIRS = 14  # frames compared
_OTHERS = 24  # frames of which each is compared with the one that sees it most differently
_SHARED = 0.5  # of the points that both must have in view
_BINS = 8  # of depth
_FEWEST = 150  # points of a pair in a bin
# tiles across and down a picture, each about as large as a part is seen
_TILES = (4, 3)
_IN_TILE = 100  # points of a pair in a tile
# a step of 6 % of the depth within 3 px to each side is an edge: an error of its own
_SLOPE_PX = 3
_EDGE = 0.06
_WORST = 0.08  # of the depth: what differs by more has moved
_Differences = tuple[Array, Array, NDArray[np.int64]]
_TRIM = 3.0  # standard deviations beyond which a difference is no noise, but something that moved


@dataclass(frozen=True)
class DepthNoise:
    """Standard deviation of a depth reading at z: `base` + `slope` z^2, m, with all that does not belong to
    the surface: the error of the camera's pose as well, and what stays alike between successive frames. slow:
    that share of the variance, 0..1: it does not average out over frames. lost: share of the pixels without
    depth. drift: m by which all that a tile of a frame sees together lies off, along its view: the error of
    its pose, and what readings side by side share, as where an error follows depth.

    What is alike from every side of a surface, as mixed light in a corner, needs truth and is missing.
    """

    base: float
    slope: float
    slow: float
    lost: float
    drift: float = 0.0

    def measured(self, z: ArrayLike) -> Array:
        """Standard deviation, m, at depths z m, as measured."""
        return np.asarray(self.base + self.slope * np.asarray(z, dtype=float) ** 2)

    def sigma(self, z: ArrayLike) -> Array:
        """Standard deviation, m, at depths z m: as measured, at least a good sensor's (`depth_sigma`)."""
        return np.maximum(depth_sigma(z), self.measured(z))

    def of_mean(self, count: int) -> float:
        """How many times as large the error of the mean of so many readings is as it were if each were drawn
        anew: the root of the design effect (Kish 1965), of what was measured and not of the good sensor's
        noise that is reckoned with at least."""
        share = self.slow * float(self.measured(1.0) / self.sigma(1.0)) ** 2
        return float(np.sqrt(1.0 + (count - 1) * share))

    @property
    def poor(self) -> bool:
        """Whether a reading at 1 m is worse than a good sensor's: pixels' errors look like surfaces."""
        return bool(self.measured(1.0) > depth_sigma(1.0))

    @property
    def curve(self) -> F32:
        """(base, slope), for `recon.dense.depth.pixel_sigma` in compiled kernels."""
        return np.array([self.base, self.slope], np.float32)


GOOD_SENSOR = DepthNoise(0.0, 0.0, 0.0, 0.0)  # nothing beyond `depth_sigma`


def measure_noise(recording: Recording, cameras: Trajectory) -> DepthNoise:
    """Measured between pairs of frames of the cameras; what moves in them differs by more and is left out.

    Frames far apart tell all of the noise, successive ones what is drawn anew in each. Where the frames share
    too little, it is `GOOD_SENSOR` with the drop-outs.
    """
    count = len(cameras.frames)
    first = np.unique(np.linspace(0, count - 2, _PAIRS).round().astype(int)).tolist() if count > 1 else []
    found = list(each(lambda a: _three(recording, cameras, a), first))
    far, near = [f[0][:2] for f in found], [f[1][:2] for f in found]
    lost = float(np.mean([f[2] for f in found])) if found else 0.0
    depth = np.concatenate([z for z, _ in far]) if far else np.zeros(0)
    if len(depth) < _BINS * _FEWEST:
        return DepthNoise(0.0, 0.0, 0.0, lost)
    drift = _drift([f[0][1:] for f in found])
    edges = np.quantile(depth, np.linspace(0.01, 0.99, _BINS + 1))
    z = 0.5 * (edges[1:] + edges[:-1])
    total, fresh = _scatter(far, edges), _scatter(near, edges)
    known = np.isfinite(total) & (total > 0)
    if not known.any():
        return DepthNoise(0.0, 0.0, 0.0, lost, drift)
    weight = 1.0 / total[known]  # relative errors count
    rows = np.stack([weight, weight * z[known] ** 2], axis=1)
    base, slope = nnls(rows, np.ones(len(rows)))[0]
    share = (
        1.0 - float(np.nanmedian((fresh[known] / total[known]) ** 2))
        if np.isfinite(fresh[known]).any()
        else 0.0
    )
    return DepthNoise(float(base), float(slope), float(np.clip(share, 0.0, 1.0)), lost, drift)


def _three(recording: Recording, cameras: Trajectory, a: int) -> tuple[_Differences, _Differences, float]:
    """Differences of the cameras' frame a to its least similar one and to the next, and its unknown share."""
    camera, seen = recording.intrinsics, recording.depth(int(cameras.frames[a]))
    points = _points(seen, camera)
    T_other_a = geo.invert_pose(cameras.T_world_cam) @ cameras.T_world_cam[a]
    far, near = (
        _differences(geo.transform(T_other_a[b], points), recording.depth(int(cameras.frames[b])), camera)
        for b in (_most_different(points, T_other_a, a, camera), a + 1)
    )
    return far, near, float(np.mean(seen <= 0))


def _most_different(points: Array, T_other_a: Array, a: int, camera: Intrinsics) -> int:
    """The frame number in which the points (n, 3) of frame a lie farthest from where they lie in it, in
    pixels: an error that belongs to the pixel, and not to the surface, is another one there."""
    some = points[:: max(1, len(points) // 300)]
    best, most = a + 1, -1.0
    for b in np.unique(np.linspace(0, len(T_other_a) - 1, _OTHERS).round().astype(int)).tolist():
        moved = geo.transform(T_other_a[b], some)
        ahead = moved[:, 2] > 0.1
        at = camera.project(np.where(ahead[:, None], moved, [0.0, 0.0, 1.0]))
        inside = ahead & (at >= 0).all(axis=1) & (at[:, 0] < camera.width) & (at[:, 1] < camera.height)
        if b != a and inside.mean() >= _SHARED:
            shift = float(np.median(np.linalg.norm(at - camera.project(some), axis=1)[inside]))
            best, most = (b, shift) if shift > most else (best, most)
    return int(best)


def _points(depth: F32, camera: Intrinsics) -> Array:
    """Points (n, 3) m of some of a picture's pixels, off edges."""
    step = max(1, camera.width // _WIDTH)
    fine = _off_edges(depth)[step // 2 :: step, step // 2 :: step]
    y, x = (step * k + step // 2 for k in np.nonzero(fine))
    return camera.backproject(np.stack([x, y], axis=1).astype(float), depth[y, x].astype(float))


def _off_edges(depth: F32) -> NDArray[np.bool_]:
    """Pixels (h, w) within known and steady depth."""
    window = np.ones((2 * _SLOPE_PX + 1, 2 * _SLOPE_PX + 1), np.uint8)
    near, far = cv2.erode(depth, window), cv2.dilate(depth, window)
    return np.asarray((near > 0) & (far - near < _EDGE * depth))


def _differences(points: Array, depth: F32, camera: Intrinsics) -> _Differences:
    """Depth (n,) of points (m, 3) in a camera that see known and steady depth there, what is read beyond that
    (n,), m, and the tile (n,) of the picture that each falls into.

    The reading is that of the nearest pixel, carried to the point by the slope of the depth around it.
    """
    inside, x, y, seen = look_up(depth, camera, points)
    k = np.flatnonzero(inside & _off_edges(depth)[y, x])
    z, x, y, seen = points[k, 2], x[k], y[k], seen[k]
    at = camera.project(points[k])
    h, w = depth.shape
    for along, (dx, dy) in enumerate(((_SLOPE_PX, 0), (0, _SLOPE_PX))):
        a = depth[np.clip(y - dy, 0, h - 1), np.clip(x - dx, 0, w - 1)]
        b = depth[np.clip(y + dy, 0, h - 1), np.clip(x + dx, 0, w - 1)]
        seen = seen + (b - a) / (2.0 * _SLOPE_PX) * (at[:, along] - (x, y)[along])
    off = seen - z
    same = np.abs(off) < _WORST * z
    across, down = _TILES
    return z[same], off[same], (x * across // w + across * (y * down // h))[same]


def _scatter(pairs: list[tuple[Array, Array]], edges: Array) -> Array:
    """Standard deviation (B,) of one reading in each bin of depth, the median over pairs; NaN if few."""
    out = np.full((len(pairs), len(edges) - 1), np.nan)
    for p, (z, off) in enumerate(pairs):
        at = np.searchsorted(edges, z, side="right") - 1
        for k in range(len(edges) - 1):
            d = off[at == k]
            if len(d) >= _FEWEST:
                out[p, k] = _deviation(d) / np.sqrt(2.0)
    known = np.isfinite(out).any(axis=0)
    return np.array([np.nanmedian(out[:, k]) if known[k] else np.nan for k in range(out.shape[1])])


def _drift(pairs: list[tuple[Array, NDArray[np.int64]]]) -> float:
    """Root mean square over tiles of frames of what the differences (n,) of a pair have in common in a tile
    (n,), m, without what moves; half of a pair's square is each frame's."""
    tiles = range(_TILES[0] * _TILES[1])
    inside = [off[tile == k] for off, tile in pairs for k in tiles]
    common = np.array([np.median(off) for off in inside if len(off) >= _IN_TILE])
    usual = np.abs(common) <= _TRIM * MAD_SIGMA * np.median(np.abs(common)) if len(common) else common > 0
    return float(np.sqrt(0.5 * np.mean(np.square(common[usual])))) if usual.any() else 0.0


def _deviation(d: Array) -> float:
    """Robust standard deviation of differences around 0, of those within `_TRIM` of them."""
    sigma = np.inf
    for _ in range(4):
        kept = np.abs(d[np.abs(d) < _TRIM * sigma])
        if not len(kept):
            break
        sigma = MAD_SIGMA * float(np.median(kept))
    return sigma

"""Two rigid motions compete for the camera: a part's that fills the view, and the surrounding room's.

A near sliding panel may hold more tracks than the room, and then the cameras go with it. But the room reaches
farther to all sides: tracks that keep their place with the cameras and lie within the outline of others,
which move rigidly otherwise, are a part's.

FunREC, supplement 1.2: without masks of what moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.cameras.rigid import ransac_pose
from recon.tracking.tracks import Tracks
from twin import geometry as geo
from twin.geometry import Array

_GAPS = (6, 12)  # frames between which motions are compared
_EVERY = 3  # frames from one compared motion to the next
_STAY = 2.0  # standard deviations of a pair of points: less keeps its place
_LEAVE = 4.0  # standard deviations of a pair of points: more has left its place
_TRIES = 200  # rigid motions; chosen by us
_FEWEST = 20  # tracks of either motion that tell an outline
_PAIRS = 3  # pairs of frames, at least, that show both motions
# By how much their share within the others' outline exceeds the others' within theirs. On 74 open random
# recordings it is .17 to .61 where the cameras follow a part, and -1 to -.16 where they do not.
_ENCLOSED = 0.1


@dataclass(frozen=True, eq=False)
class _Pair:
    """Tracks of two frames that rest, and those that move rigidly; by how much more these enclose those."""

    staying: NDArray[np.int64]
    rival: NDArray[np.int64]
    enclosed: float


def followed_part(
    tracks: Tracks, poses: Array, posed: NDArray[np.bool_], sigma: Array, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Tracks (K,) that followed by cameras though others, moving rigidly, enclose them; or none.

    poses (T, 4, 4), those of them that are known (T,), standard deviations (T, K) m of the tracks' points.
    """
    frames = np.flatnonzero(posed)
    seen = []
    for gap in _GAPS:
        for k in range(0, len(frames) - gap, _EVERY):
            pair = _compared(tracks, poses, int(frames[k]), int(frames[k + gap]), sigma, rng)
            if pair is not None:
                seen.append(pair)
    out = np.zeros(len(tracks), dtype=bool)
    if len(seen) < _PAIRS:
        return out
    share = np.average([p.enclosed for p in seen], weights=[min(len(p.staying), len(p.rival)) for p in seen])
    if share > _ENCLOSED:
        for pair in seen:
            out[pair.staying] = True
    return out


def _compared(
    tracks: Tracks, poses: Array, a: int, b: int, sigma: Array, rng: np.random.Generator
) -> _Pair | None:
    """Both motions between two frames, None where too few tracks show them."""
    both = np.flatnonzero(tracks.visible[a] & tracks.visible[b])
    if len(both) < 2 * _FEWEST:
        return None
    at_a = geo.transform(poses[a], tracks.points_cam[a, both])
    at_b = geo.transform(poses[b], tracks.points_cam[b, both])
    spread = np.hypot(sigma[a, both], sigma[b, both])
    off = np.linalg.norm(at_a - at_b, axis=1) / spread
    left = np.flatnonzero(off > _LEAVE)
    if len(left) < _FEWEST:
        return None
    T_a_b = ransac_pose(at_b[left], at_a[left], spread[left], rng, tries=_TRIES, gate=_STAY)
    apart = np.linalg.norm(geo.transform(T_a_b, at_b) - at_a, axis=1) / spread
    rival, staying = left[apart[left] < _STAY], np.flatnonzero((off < _STAY) & (apart > _LEAVE))
    if min(len(rival), len(staying)) < _FEWEST:
        return None
    px = tracks.pixels[a, both].astype(np.float32)
    enclosed = _within(px[staying], px[rival]) - _within(px[rival], px[staying])
    return _Pair(both[staying], both[rival], enclosed)


def _within(inner: NDArray[np.float32], outer: NDArray[np.float32]) -> float:
    """Share of pixels (n, 2) within the convex hull of others (m, 2)."""
    hull = cv2.convexHull(outer)
    return float(np.mean([cv2.pointPolygonTest(hull, (float(x), float(y)), False) >= 0 for x, y in inner]))

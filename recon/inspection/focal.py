"""The focal length that a recording itself asks for, beside the one that is stated.

Static points that are seen from two places move rigidly. With a wrong focal length their depths and their
pixels contradict each other as soon as the camera turns: a turn by t swings depth into width as if by t s and
width into depth as if by t / s, where s is the ratio of the two focal lengths, and no rotation does both.
Under a mere shift of the camera nothing tells: then the check says that it can't be made.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.cameras.poses import INLIER_SIGMA
from recon.cameras.rigid import ransac_pose
from recon.dense.depth import depth_sigma
from recon.inspection.glance import Stretch
from recon.recording import Intrinsics
from recon.tracking.tracks import PIXEL_SIGMA, Tracks
from twin import geometry as geo
from twin.geometry import Array
from twin.robust import chi2_scale, geman_mcclure

# between the two frames of a pair: long enough to turn, short enough to share tracks
_GAPS_S = 0.4, 0.8, 1.6
_PAIRS = 20  # of each gap and stretch
_LEAST = 60  # tracks that a pair shares
_MOST = 300  # tracks of a pair that are used
_TRIES = 60  # rigid motions; chosen by us
_ROUNDS = 3
_BLOCKS = 6  # of the jackknife


@dataclass(frozen=True)
class FocalFit:
    """ratio: the best focal length over the stated. sigma: standard deviation, jackknifed over times."""

    ratio: float
    sigma: float


def fit_focal(stretches: list[Stretch]) -> FocalFit | None:
    """None without pairs of frames that share enough tracks."""
    found = [p for s in stretches for p in _pairs(s)]
    if len(found) < _BLOCKS:
        return None
    camera = stretches[0].small.intrinsics
    shift = np.zeros(3)
    for round_ in range(_ROUNDS):
        systems = [_system(*p, _moved(camera, shift), round_ == 0) for p in found]
        h, g = (np.array(x) for x in zip(*systems, strict=True))
        shift = shift + _solve(h, g)
    blocks = np.array_split(
        np.argsort(np.arange(len(found)) % max(1, len(found) // 3), kind="stable"), _BLOCKS
    )
    parts = [_solve(np.delete(h, b, axis=0), np.delete(g, b, axis=0))[0] for b in blocks]
    sigma = float(np.sqrt((_BLOCKS - 1) / _BLOCKS * np.sum((np.array(parts) - np.mean(parts)) ** 2)))
    return FocalFit(float(np.exp(shift[0])), sigma)


def _solve(h: Array, g: Array) -> Array:
    """Step (3,) of log focal length and centre, px, from systems of all pairs."""
    return np.linalg.solve(h.sum(axis=0) + 1e-9 * np.eye(3), g.sum(axis=0))


def _moved(camera: Intrinsics, shift: Array) -> Array:
    """(fx, fy, cx, cy) after a shift of log focal length and centre."""
    scale = float(np.exp(shift[0]))
    return camera.vector * [scale, scale, 1, 1] + [0, 0, shift[1], shift[2]]


def _pairs(stretch: Stretch) -> list[tuple[Array, Array]]:
    """(u, v, depth) of the same tracks (n, 3) in two frames, for many pairs of frames."""
    tracks: Tracks = stretch.tracks
    rng = np.random.default_rng(0)
    out = []
    for seconds in _GAPS_S:
        gap = max(1, round(seconds / stretch.seconds))
        firsts = np.arange(0, len(tracks.visible) - gap)
        for i in firsts[:: max(1, len(firsts) // _PAIRS)]:
            both = np.flatnonzero(tracks.visible[i] & tracks.visible[i + gap])
            if len(both) >= _LEAST:
                both = rng.choice(both, min(len(both), _MOST), replace=False)
                a, b = (
                    np.column_stack([tracks.pixels[k, both], tracks.points_cam[k, both, 2]])
                    for k in (i, i + gap)
                )
                out.append((a, b))
    return out


def _points(seen: Array, k: Array) -> Array:
    xy = (seen[:, :2] - k[2:]) / k[:2] * seen[:, 2:]
    return np.column_stack([xy, seen[:, 2]])


def _system(a: Array, b: Array, k: Array, first: bool) -> tuple[Array, Array]:
    """Normal equations (3, 3), (3,) of log focal length and centre from one pair, its motion eliminated."""
    pa, pb = _points(a, k), _points(b, k)
    depth = np.sqrt(depth_sigma(a[:, 2]) ** 2 + depth_sigma(b[:, 2]) ** 2)
    lateral = PIXEL_SIGMA / k[0] * np.hypot(a[:, 2], b[:, 2])
    sigma = np.hypot(depth, lateral)
    pose = ransac_pose(pa, pb, sigma, np.random.default_rng(0), tries=_TRIES, gate=INLIER_SIGMA)
    turn = pose[:3, :3]
    q = geo.transform(pose, pa)
    z = q[:, 2]
    project = np.zeros((len(q), 3, 3))  # of (u, v, depth) by the point
    project[:, 0, 0], project[:, 1, 1], project[:, 2, 2] = k[0] / z, k[1] / z, 1.0
    project[:, 0, 2], project[:, 1, 2] = -k[0] * q[:, 0] / z**2, -k[1] * q[:, 1] / z**2
    seen = np.column_stack([k[0] * q[:, 0] / z + k[2], k[1] * q[:, 1] / z + k[3], z])
    moved = np.zeros((len(q), 3, 6))
    moved[:, :, :3] = np.eye(3)
    moved[:, 0, 4], moved[:, 0, 5] = z, -q[:, 1]  # -[q]x: a turn w moves q by w x q
    moved[:, 1, 3], moved[:, 1, 5] = -z, q[:, 0]
    moved[:, 2, 3], moved[:, 2, 4] = q[:, 1], -q[:, 0]
    of_point = np.zeros((len(q), 3, 3))  # of the first frame's point by log focal length and centre
    of_point[:, 0, 0], of_point[:, 1, 0] = -pa[:, 0], -pa[:, 1]
    of_point[:, 0, 1], of_point[:, 1, 2] = -pa[:, 2] / k[0], -pa[:, 2] / k[1]
    shared = project @ (turn @ of_point)
    shared[:, 0, 0] += seen[:, 0] - k[2]
    shared[:, 1, 0] += seen[:, 1] - k[3]
    shared[:, 0, 1] += 1.0
    shared[:, 1, 2] += 1.0
    j = np.concatenate([project @ moved, shared], axis=2)
    # noise of depth reaches the pixel by the camera's motion, that of pixels hardly the depth
    ray = np.column_stack([(a[:, :2] - k[2:]) / k[:2], np.ones(len(a))])
    by_depth = np.einsum("nij,nj->ni", project, ray @ turn.T)
    sigma2 = np.column_stack([np.full(len(a), 2 * PIXEL_SIGMA**2)] * 2 + [depth_sigma(b[:, 2]) ** 2])
    sigma2 += (by_depth * depth_sigma(a[:, 2])[:, None]) ** 2
    r = b - seen
    chi2 = (r**2 / sigma2).sum(axis=1)
    w = geman_mcclure(chi2, max(chi2_scale(chi2, dof=3), 0.05) * (9.0 if first else 4.0))[:, None] / sigma2
    h = np.einsum("nki,nk,nkj->ij", j, w, j)
    g = np.einsum("nki,nk,nk->i", j, w, r)
    inverse = np.linalg.inv(h[:6, :6] + 1e-9 * np.eye(6))
    reduced = h[6:, 6:] - h[6:, :6] @ inverse @ h[:6, 6:]
    return reduced, g[6:] - h[6:, :6] @ inverse @ g[:6]

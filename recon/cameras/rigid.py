"""Rigid motions between two sets of camera points, and how far these scatter."""

from __future__ import annotations

import numpy as np

from recon.cameras.kernels import best_pose
from recon.dense.depth import depth_sigma
from twin import geometry as geo
from twin.geometry import Array
from twin.robust import geman_mcclure


def point_sigmas(points: Array, lateral: float) -> tuple[Array, Array]:
    """Lateral and axial standard deviations (...) m of camera points (..., 3); lateral: across, rad."""
    z = points[..., 2]
    return lateral * z, depth_sigma(z)


def ransac_pose(
    source: Array, target: Array, sigma: Array, rng: np.random.Generator, *, tries: int, gate: float
) -> Array:
    """Robust T_target_source from point pairs (n, 3); sigma (n,) m is that of their distance, gate: sigmas
    within which a pair agrees. MSAC (Torr and Zisserman 2000), then weighted least squares."""
    picks = rng.integers(0, len(source), size=(tries, 3))
    hypotheses = geo.fit_rigid(source[picks], target[picks])
    pose = hypotheses[best_pose(hypotheses, source, target, sigma**2, gate**2)]
    for _ in range(6):
        d2 = ((source @ pose[:3, :3].T + pose[:3, 3] - target) ** 2).sum(-1) / sigma**2
        pose = geo.fit_rigid(source, target, geman_mcclure(d2, gate**2) / sigma**2)
    return np.asarray(pose)

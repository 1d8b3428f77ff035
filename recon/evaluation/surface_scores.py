"""Scores of reconstructed surfaces against the true ones, and which part of these the recording shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.evaluation.metrics import DistanceField
from recon.evaluation.truth import Truth
from recon.recording import Recording
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.mesh import sample_surface
from twin.scene import STATIC_LABEL, Mesh

SAMPLES = 10_000  # points on a mesh
SEEN_STRIDE = 4  # every fourth pixel of every fourth row stands for the depth image
# Frames that are read at most, evenly over the recording: a minute at 15 frames a second. All depth of ten
# minutes would be 4 GB of points, of which `MAX_SEEN` are kept.
MOST_FRAMES = 900
MAX_SEEN = 200_000  # points; their share is then known to 0.1 %
SEEN_TOLERANCE = 0.008  # m, further from the true surface a depth pixel is sensor noise
COMPLETE_WITHIN = 0.010  # m


@dataclass(frozen=True)
class SurfaceErrors:
    """A reconstructed surface: mean distance to the true one (mm), share covered, Chamfer (cm)."""

    accuracy_mm: float
    completeness: float
    chamfer_cm: float


def surface_errors(mesh: Mesh, true: Mesh, seen: Array, true_points: Array) -> SurfaceErrors | None:
    """Compare a mesh with the true one, both in one frame; None for a mesh without area.

    Args:
        seen: points (n, 3) of the true surface that the recording shows.
        true_points: points (m, 3) that stand for the true surface in the Chamfer distance.
    """
    points = sampled(mesh)
    if len(points) == 0:
        return None
    surface = DistanceField(mesh)
    accuracy = float(np.mean(DistanceField(true).distance(points)))
    back = surface.distance(true_points)
    covered = surface.distance(seen) <= COMPLETE_WITHIN
    return SurfaceErrors(
        accuracy_mm=1e3 * accuracy,
        completeness=float(np.mean(covered)) if len(seen) else 1.0,
        chamfer_cm=1e2 * 0.5 * (accuracy + (float(np.mean(back)) if len(back) else 0.0)),
    )


def sampled(mesh: Mesh) -> Array:
    """`SAMPLES` points (n, 3) even over a mesh, the same for the same mesh; none for one without area."""
    return sample_surface(mesh, SAMPLES, np.random.default_rng(0))[0]


def seen_points(recording: Recording, truth: Truth) -> dict[int, Array]:
    """Points (n, 3) of the true surfaces that the recording's depth shows, by label: 1 static, part ids.

    They lie in the world at the most closed state shown, within `SEEN_TOLERANCE` of the true surface. At most
    `MOST_FRAMES` frames are read.
    """
    k, step = truth.intrinsics or recording.intrinsics, SEEN_STRIDE
    y, x = np.mgrid[step // 2 : k.height : step, step // 2 : k.width : step]
    pixels = np.stack([x, y], axis=-1).astype(np.float64)
    if truth.cameras is None:
        raise InputError(f"{truth.folder} tells no cameras", "compare what needs none")
    clouds: dict[int, list[Array]] = {STATIC_LABEL: [], **{p.id: [] for p in truth.parts}}
    labelled = sorted(truth.labels)
    for frame in labelled[:: -(-len(labelled) // MOST_FRAMES) or 1]:
        label = truth.labels[frame]
        if label.shape != (k.height, k.width):
            raise InputError(
                f"the truth's labels are {label.shape[1]}x{label.shape[0]}, the recording {k.width}x{k.height}",
                "give the truth of this recording",
            )
        label = label[step // 2 :: step, step // 2 :: step]
        depth = recording.depth(frame)[step // 2 :: step, step // 2 :: step]
        for key, cloud in clouds.items():
            mask = (label == key) & (depth > 0)
            points = k.backproject(pixels[mask], depth[mask].astype(np.float64))
            T = truth.cameras.T_world_cam[frame]
            if key != STATIC_LABEL:
                part = truth.part(key)
                T = part.T_world_closed @ geo.invert_pose(part.T_world_part[frame]) @ T
            cloud.append(geo.transform(T, points))
    surfaces = {STATIC_LABEL: truth.static, **{p.id: p.closed_mesh for p in truth.parts}}
    return {key: _on_surface(np.concatenate(cloud), surfaces[key]) for key, cloud in clouds.items() if cloud}


def _on_surface(points: Array, mesh: Mesh) -> Array:
    if len(points) > MAX_SEEN:
        points = points[np.random.default_rng(0).choice(len(points), MAX_SEEN, replace=False)]
    return points[DistanceField(mesh).distance(points) <= SEEN_TOLERANCE]

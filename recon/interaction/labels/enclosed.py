"""What lies inside a part: between the walls of a drawer, and behind its front."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32
from recon.dense.noise import DepthNoise
from recon.dense.voxels import in_hull_of, solid_core
from recon.interaction.boards.proposals import plane_of
from recon.interaction.labels.pooling import SURE, lead_of, voxel_size, world_points
from recon.interaction.labels.reference_frames import View
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.threads import each
from twin.scene import Trajectory

# All m, chosen by us.
_REACH_M = 0.1
# Thickness of a board's surface: noise and errors of its states
_SKIN = 0.012
# Thickness of a front: what a slide shows foremost
_FRONT = 0.04
# Least width and height of a front, of which half is there
_LEAST = 0.06
_CELL = 0.02
# A cabinet's depth: a front has no more behind it
DEEP = 0.6


def enclosed_by_parts(
    views: list[View],
    scores: list[F32],
    sure: list[NDArray[np.bool_]],
    cameras: Trajectory,
    parts: Sequence[MovingPart],
    camera: Intrinsics,
    noise: DepthNoise,
) -> list[NDArray[np.bool_]]:
    """Masks (2, P, h, w) of what lies in the convex hull and box of a part's sure points (its frame).

    Between the walls of a drawer that slides there is no room for anything static. Sure is what references at
    rest see through where it is now and see again where it was; scores are of the references alone. What
    surely stays while a part turns is none of it, a side panel beside a hinge. What slides in its own plane
    looks the same wherever it is before and after: its board is its own to the edges.
    """
    size = voxel_size(views, noise)
    world = list(each(lambda v: world_points(v, camera, cameras.pose(v.frame)), views))
    out = [np.zeros((len(parts), *v.depth.shape), bool) for v in views]
    near = [np.zeros_like(o) for o in out]
    for k, part in enumerate(parts):
        points: dict[int, F32] = {}
        certain: list[F32] = []
        eyes: list[Array] = []
        for v, (seen, score, moved) in enumerate(zip(views, scores, sure, strict=True)):
            pose = part.pose(seen.frame)
            if pose is None:
                continue
            inv = geo.invert_pose(pose)
            points[v] = geo.transform(inv, world[v]).astype(np.float32)
            camera_at = cameras.pose(seen.frame)
            if camera_at is not None:
                eyes.append(geo.transform(inv, camera_at[:3, 3]))
            mine = (lead_of(score, k + 1) > SURE) & moved[0]
            certain.append(points[v][mine[seen.depth > 0]])
        if not eyes:
            continue
        # A drawer's back wall is far from its front; with poor depth such pieces are more often noise.
        shell = solid_core(certain, size, reach=_REACH_M if noise.poor else np.inf)
        shell = np.concatenate([shell, *_panel(part)])
        inside = each(in_hull_of(with_box(shell, part, np.mean(eyes, axis=0))), points.values())
        for (v, p), held in zip(points.items(), inside, strict=True):
            out[v][k][views[v].depth > 0] = held
            if part.joint.kind == "revolute":  # what slides looks as if it stayed: a drawer's bottom
                out[v][k] &= ~sure[v][k + 1]
            if len(shell):
                box = (p >= shell.min(axis=0) - size) & (p <= shell.max(axis=0) + size)
                near[v][k][views[v].depth > 0] = box.all(axis=1)
    return [np.stack(pair) for pair in zip(out, near, strict=True)]


def _panel(part: MovingPart) -> list[F32]:
    """The board (m, 3) of what slides in its own plane, to either side; none of other parts."""
    if part.board is None:
        return []
    normal, _ = plane_of(part.board)
    if not part.slides_within(normal):
        return []
    return [(part.board + side * _SKIN * normal).astype(np.float32) for side in (-1.0, 1.0)]


def with_box(shell: F32, part: MovingPart, eye: Array) -> F32:
    """The shell (m, 3) of a part with what its front, if it is a drawer's, drags behind it: the same again, a
    cabinet's depth farther from the eye (3,).

    A drawer that stands open shows a floor and walls that slide within themselves and look the same before
    and after. Between its front and the cabinet nothing static has room: the front could not go back.
    """
    axis = part.joint.axis
    if part.joint.kind != "prismatic" or len(shell) < 3:
        return shell
    behind = -axis if (eye - shell.mean(axis=0)) @ axis > 0 else axis
    along = shell @ -behind
    front = shell[along > np.quantile(along, 0.99) - _FRONT]
    flat = front @ geo.orthogonal_basis(axis)[:, :2]
    low, high = flat.min(axis=0), flat.max(axis=0)
    if (high - low).min() < _LEAST:
        return shell
    cells = np.unique(np.floor((flat - low) / _CELL), axis=0)
    if len(cells) < 0.5 * np.prod(np.ceil((high - low) / _CELL)):
        return shell
    return np.concatenate([shell, (front + DEEP * behind).astype(np.float32)])

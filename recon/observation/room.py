"""Directions of the room: those of its floor and walls, by the surfaces of some pictures."""

from __future__ import annotations

import numpy as np

from recon.cameras.gravity import shown_axes
from recon.dense.depth import depth_normals
from recon.observation.pictures import Pictures
from twin.geometry import Array

# Chosen by us. Rows whose normals are used, evenly spread.
_ROWS = 10
# m; noise grows with the square of depth.
_FARTHEST_M = 5.0


def room_directions(pictures: Pictures) -> Array:
    """Unit directions (3, m), orthogonal: those of three that the surfaces show; all if they show two."""
    rows = np.unique(np.linspace(0, len(pictures.frames) - 1, _ROWS).astype(int))
    found = []
    for row in rows:
        normals = depth_normals(pictures.depth[row], pictures.camera, _FARTHEST_M)
        seen = normals[np.isfinite(normals).all(axis=-1)]
        found.append(seen @ pictures.T_world_cam[row, :3, :3].T)
    axes, known = shown_axes(np.concatenate(found))
    return axes if known.sum() >= 2 else axes[:, known]

"""Directions of the room: those of its floor, walls and fronts, by the surfaces of some pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recon.cameras.gravity import normals_of_frames, shown_axes
from recon.dense.depth import depth_normals
from recon.observation.pictures import Pictures
from recon.recording import Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Trajectory

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
    return _shown(found)


@dataclass(frozen=True, eq=False)
class Room:
    """Unit directions (3, m), orthogonal, and one standard deviation of each, rad, (m,)."""

    directions: Array
    sigma: Array

    @classmethod
    def of(cls, recording: Recording, cameras: Trajectory) -> Room:
        """Directions of the frames together, as sure as those of either half of them are near."""
        normals = normals_of_frames(recording, cameras)
        whole, middle = _shown(normals), len(normals) // 2
        halves = [h for h in (_shown(normals[:middle]), _shown(normals[middle:])) if h.shape[1]]
        if not halves:
            return cls(np.zeros((3, 0)), np.zeros(0))
        away = [[min(geo.line_angle(u, v) for v in half.T) for half in halves] for u in whole.T]
        return cls(whole, np.array([max(a) for a in away]) / np.sqrt(2.0))


def _shown(normals: Sequence[Array]) -> Array:
    """Directions (3, m) of normals (n, 3) of frames."""
    if not normals:
        return np.zeros((3, 0))
    axes, known = shown_axes(np.concatenate(normals))
    return axes if known.sum() >= 2 else axes[:, known]

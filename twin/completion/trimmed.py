"""What is drawn of a scan beside boards: no skirts, nothing that hangs over their gaps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.completion.photographed import faced
from twin.completion.shown import without_shreds
from twin.geometry import Array
from twin.scene import Box, Mesh

# m around a board within which a vertex that was put onto it lies: what arithmetic leaves.
_ON = 1e-4


def trimmed(shown: Mesh, boards: Sequence[Box], eyes: Array) -> Mesh:
    """The seen triangles without bridges between boards and, beside boards, without unfaced ones.

    A fused surface spans the gap between two fronts, and hangs a skirt from the outline of what stands before
    something else; its triangles look aside. boards: in the world. eyes (n, 3): where the cameras stood.
    """
    if not len(shown.faces):
        return shown
    on = (
        np.stack([within(b, shown.vertices, _ON) for b in boards])
        if boards
        else np.zeros((1, len(shown.vertices)), bool)
    )
    whole: NDArray[np.bool_] = np.any(geo.every(on[:, shown.faces]), axis=0)
    bridges = geo.every(np.any(on, axis=0)[shown.faces]) & ~whole
    return without_shreds(shown.of((whole | faced(shown, eyes)) & ~bridges))


def within(box: Box, points: Array, margin: float) -> NDArray[np.bool_]:
    """Which points (n, 3) lie in a box, or less than `margin` m outside it."""
    local = geo.transform(geo.invert_pose(box.T_world_box), points)
    return geo.every(np.abs(local) <= box.size / 2 + margin)

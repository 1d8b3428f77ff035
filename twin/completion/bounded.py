"""An inferred layer without what nothing bounds: an assumed handle is drawn as its blurred seen surface."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.completion.handle import BLUR
from twin.completion.shown import ON_FACE
from twin.geometry import Array
from twin.inferred import Completion, Inferred
from twin.mesh import joined
from twin.scene import Box, Mesh


def bounded(layer: Completion, seen: Mesh) -> Completion:
    """The layer with the pieces that seen surface bounds; assumed handles drawn as they were seen.

    seen: the body's seen mesh, from which `layer.shown` was taken.
    """
    kept = tuple(p for p in layer.pieces if p.basis == "evidence")
    handles = [p for p in layer.assumed if p.role == "handle"]
    others = [p for p in layer.pieces if p.role != "handle"]
    of_handle = _inside(seen.vertices, handles, BLUR) & ~_inside(seen.vertices, others, ON_FACE)
    restored = geo.every(of_handle[seen.faces])
    shown = joined([layer.shown, seen.of(restored)])
    return replace(layer, pieces=kept, shown=shown)


def _inside(points: Array, pieces: Iterable[Inferred], around: float) -> NDArray[np.bool_]:
    """Which points (n, 3) lie in a box of the pieces, or less than `around` m beside it."""
    out = np.zeros(len(points), bool)
    for box in (s for p in pieces for s in p.shapes if isinstance(s, Box)):
        local = geo.transform(geo.invert_pose(box.T_world_box), points)
        out |= geo.every(np.abs(local) < box.size / 2 + around)
    return out

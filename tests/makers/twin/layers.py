"""A completion's pieces by name, and how far they reach."""

from __future__ import annotations

import numpy as np

from twin.geometry import Array
from twin.inferred import Completion, Inferred
from twin.scene import Part, Twin

NEAR = 0.004  # m: half of the scan's spacing, by which its borders are ragged


def layer(thing: Part | Twin) -> Completion:
    found = thing.static.completion if isinstance(thing, Twin) else thing.completion
    assert found is not None
    return found


def pieces(thing: Part | Twin) -> dict[str, Inferred]:
    return {p.name: p for p in layer(thing).pieces}


def corners(piece: Inferred) -> Array:
    return np.stack([piece.mesh.vertices.min(axis=0), piece.mesh.vertices.max(axis=0)])

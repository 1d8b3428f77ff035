"""Colours where no photograph shows any: over the surface, and around the charts."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from recon.dense.depth import F32
from twin.geometry import Array
from twin.mesh import edges

PLAIN = 180.0  # of a body that no photograph shows


def over_surface(colors: F32, seen: NDArray[np.bool_], faces: NDArray[np.int32]) -> Array:
    """Colours (V, 3) of all vertices: as given where `seen`, elsewhere the neighbours' mean, evenly.

    A piece of the surface without any takes the median of those that there are.
    """
    out = colors.astype(np.float64)
    out[~seen] = np.median(out[seen], axis=0) if seen.any() else PLAIN
    ends = edges(faces)
    count = len(colors)
    ones = np.ones(2 * len(ends))
    beside = coo_array((ones, (np.r_[ends[:, 0], ends[:, 1]], np.r_[ends[:, 1], ends[:, 0]])), (count, count))
    graph = csr_array(beside)
    _, piece = connected_components(graph, directed=False)
    told = np.zeros(piece.max() + 1 if count else 0, dtype=bool)
    told[piece[seen]] = True
    unknown = np.flatnonzero(~seen & told[piece])
    if not len(unknown):
        return out
    rows = graph[unknown]
    degree = np.asarray(rows.sum(axis=1)).ravel()
    inner = csr_array(rows[:, unknown])
    known = rows[:, np.flatnonzero(seen)] @ out[seen]
    system = csr_array((degree, (np.arange(len(unknown)), np.arange(len(unknown)))), inner.shape) - inner
    out[unknown] = np.asarray(spsolve(system.tocsc(), known)).reshape(-1, 3)
    return out


def around(image: NDArray[np.uint8], filled: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The image (H, W, 3) with every texel that is not `filled` (H, W) taking the colour of the nearest that
    is, so that coarse mip levels and cubic sampling mix nothing foreign in."""
    if filled.all() or not filled.any():
        return image
    _, nearest = cv2.distanceTransformWithLabels(
        (~filled).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    source = np.zeros(int(nearest.max()) + 1, np.int64)
    source[nearest[filled]] = np.flatnonzero(filled)
    flat = image.reshape(-1, 3)
    return flat[np.where(filled.ravel(), np.arange(filled.size), source[nearest.ravel()])].reshape(
        image.shape
    )

"""A changed surface grown over its plane to edges of the full picture: the board that it is a strip of.

How strong an edge ends a board is not known, so several extents are grown; they compete.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.looks import SAME, THROUGH
from recon.interaction.boards.proposals import plane_of
from recon.interaction.boards.seeds import Seed
from recon.observation.pictures import Pictures
from recon.recording import Recording
from twin.geometry import Array

# All chosen by us. Edges end a board from so many times the strength that is usual on its seed.
_LEVELS = (1.5, 2.5, 4.0, 8.0, np.inf)
# The same of an edge that ends the plane beside an outline, and px beside it that are looked at.
_EDGE, _BESIDE = 2.5, 1
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
# The least such strength, in steps of 8-bit Lab colour: below is noise.
_NOISE = 3.0
# m, and standard deviations of noise, from the plane within which pixels lie on it.
_ON_M, _ON_SIGMAS = 0.008, 3.0
# m; a seed that is narrower is a strip. px about it in which its plane is fitted again, one after the other.
_STRIP_M, _AROUND = 0.1, (4, 10, 25)
# Share of the seed that a piece of the plane holds, if it is of the board.
_OF_SEED = 0.1
# px of gaps that are closed, at the thinned pictures' size: edges take a pixel.
_CLOSED = 7
# m by which handles stand off a board, and lie behind its plane.
_HANDLE_M, _SUNK_M = 0.07, 0.01
# Share of the seed seen through in rows in which it has left, and share of these in which what stays is seen.
_LEFT, _STAYS = 0.5, 0.3
# Two extents are one if so small a share of both is not shared.
_ALIKE = 0.06


def extents(pictures: Pictures, recording: Recording, seed: Seed, others: Sequence[Seed] = ()) -> list[Seed]:
    """The seed itself, the seed with the others of its rest that lie on its plane, since noise and arms cut
    boards up, and the boards (some, growing) that it may be a strip of."""
    depth, points = pictures.depth[seed.rest], pictures.points(seed.rest)
    sigma = pictures.noise.base + pictures.noise.slope * depth**2
    thick = np.where(depth > 0, np.maximum(_ON_M, _ON_SIGMAS * sigma), 0.0)
    normal, on = _plane(seed, points, thick)
    off = (points - on.mean(axis=0)) @ normal
    flat = np.abs(off) < thick
    eye = float(np.sign((pictures.T_world_cam[seed.rest][:3, 3] - on.mean(axis=0)) @ normal))
    handle = (depth > 0) & (eye * off > -_SUNK_M) & (eye * off < _HANDLE_M)
    edge = edges(recording, int(pictures.frames[seed.rest]), depth.shape)
    usual = max(_NOISE, float(np.median(edge[seed.mask])))
    within = flat & (edge < _EDGE * usual)
    stays = _stays(pictures, seed, flat | handle)
    pieces = [o.mask for o in others if o.rest == seed.rest and (o.mask & flat).sum() > _LEFT * o.mask.sum()]
    masks = [seed.mask, np.logical_or.reduce([seed.mask, *pieces])][: 2 if pieces else 1]
    own = seed.mask & (eye * off < _HANDLE_M)  # an arm that holds it is of one piece with it
    own = own if own.any() else seed.mask
    for level in _LEVELS:
        mask = _grown(own, flat & (edge < level * usual))
        mask = (mask & flat) | (_filled(mask) & handle) | own
        masks += [m for m in (_piece(mask & ~stays, own), mask) if not any(_alike(m, o) for o in masks)]
    return [Seed.of(pictures, seed.rest, m, _bounded(m, within)) for m in masks]


def _plane(seed: Seed, points: Array, thick: Array) -> tuple[Array, Array]:
    """Normal (3,) of the plane that a seed lies on, and points of it.

    A strip alone does not tell how its plane leans, so it is fitted again to those points (h, w, 3) that lie
    on it, within `thick` (h, w) m, ever farther around.
    """
    normal, on = plane_of(seed.points)
    width = np.linalg.svd(on - on.mean(axis=0), compute_uv=False)[1] * np.sqrt(12.0 / len(on))
    for reach in _AROUND if width < _STRIP_M else ():
        around = cv2.dilate(seed.mask.astype(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8)) > 0
        flat = np.abs((points - on.mean(axis=0)) @ normal) < thick
        normal, on = plane_of(points[_grown(seed.mask, around & flat) & (thick > 0)])
    return normal, on


def _stays(pictures: Pictures, seed: Seed, asked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels (h, w) of those asked that are still seen when the seed has left: they are not of a board that
    swings out or is pulled; of one that slides in its own plane they may be."""
    points = pictures.points(seed.rest)
    asked = asked | seed.mask
    which = seed.mask[asked]
    same, count = np.zeros(len(which), np.int64), 0
    for row in range(len(pictures.frames)):
        seen = pictures.look(points[asked], row, _ON_SIGMAS, _ON_M)
        if (seen[which] == THROUGH).mean() > _LEFT:
            same += seen == SAME
            count += 1
    out = np.zeros(seed.mask.shape, bool)
    out[asked] = same > _STAYS * count
    return out & ~seed.mask


def _piece(mask: NDArray[np.bool_], seed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The pieces of a mask that hang together with a seed by more than a pixel, and the seed."""
    opened = cv2.morphologyEx((mask | seed).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    pieces = cv2.connectedComponents(opened, connectivity=4)[1]
    of = np.unique(pieces[seed])
    return (np.isin(pieces, of[of > 0]) & mask) | seed


def _alike(mask: NDArray[np.bool_], other: NDArray[np.bool_]) -> bool:
    """Whether two extents are one."""
    return bool((mask ^ other).sum() < _ALIKE * (mask | other).sum())


def _bounded(mask: NDArray[np.bool_], within: NDArray[np.bool_]) -> float:
    """Share of a mask's outline beyond which the plane, `within` its edges (h, w), does not go on."""
    goes_on = cv2.dilate((within & ~mask).astype(np.uint8), _CROSS, iterations=_BESIDE) > 0
    outline = mask & (cv2.erode(mask.astype(np.uint8), _CROSS, borderValue=0) == 0)
    return 1.0 - float((goes_on & outline).sum()) / max(int(outline.sum()), 1)


def edges(recording: Recording, frame: int, shape: tuple[int, ...]) -> Array:
    """Greatest change of colour (h, w), 8-bit Lab a pixel of the full picture, in each thinned pixel."""
    seen = cv2.cvtColor(np.ascontiguousarray(recording.color(frame)), cv2.COLOR_RGB2LAB)
    lab = cv2.GaussianBlur(seen.astype(np.float32), (3, 3), 0.8)
    across, down = (cv2.Sobel(lab, cv2.CV_32F, *d, scale=1 / 8) for d in ((1, 0), (0, 1)))
    strength = np.sqrt((across**2 + down**2).sum(axis=-1))
    step = max(1, lab.shape[1] // shape[1])
    wide = cv2.dilate(strength, np.ones((step + 1, step + 1), np.uint8)) if step > 1 else strength
    return np.asarray(wide[::step, ::step][: shape[0], : shape[1]], np.float64)


def _grown(seed: NDArray[np.bool_], free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pieces of the free pixels that hold a share of the seed, gaps closed."""
    pieces = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]
    held = np.bincount(pieces[seed & free], minlength=int(pieces.max()) + 1)
    held[0] = 0
    mask = np.isin(pieces, np.flatnonzero(held > _OF_SEED * seed.sum())) | seed
    return cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((_CLOSED,) * 2, np.uint8)) > 0


def _filled(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """A mask without its holes."""
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    full = np.zeros(mask.shape, np.uint8)
    cv2.fillPoly(full, list(outlines), 1)
    return full > 0

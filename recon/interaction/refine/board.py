"""Doors, lids and drawer fronts are boards: two flat faces, parallel and as far apart as wood is thick.

A surfel holds the joint only as long as it is in view. A door that opens by more than a right angle shows its
front before and its inside after, and what ties the two together is the few frames between, in some of which
it is seen edge-on: a step in the state there fits all depth equally well, and depth that is biased at
outlines turns the axis by what it likes. But the step tilts one face against the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.dense.noise import DepthNoise
from recon.interaction.refine.terms import BoardTies, Terms, Tie, join
from twin import geometry as geo
from twin.geometry import Array
from twin.robust import geman_mcclure
from twin.scene import Joint, Revolute

# All chosen by us.
# Fewest surfels of a face
MIN_SURFELS = 40
# m, robust RMS of a face, or what depth's own scatter leaves
MAX_RMS = 0.006
# m, shortest face
MIN_LENGTH = 0.10
# rad: normals within so much of opposite belong to a face
MAX_TURN = np.radians(25.0)
# rad: faces that are further from parallel are no board's
MAX_TILT = np.radians(12.0)
# rad, median of a face's normals; a round body's are not within it
MAX_SPREAD = np.radians(10.0)

# What is known of hinged boards, chosen by us, m: middle, standard deviation and limits. Lids of laptops are
# 6 mm thick, doors of furniture 12 to 40, with frames and seals up to 80.
_APART = (0.025, 0.015, 0.005, 0.080)
_HINGE = (0.0, 0.025, -0.060, 0.060)  # of the face above the hinge
# m, error of the outer edge
_EDGE = 0.006
# m, largest footprint of a pixel on the edge
_COARSEST = 0.02
# m: what ends further off is another edge
_OTHER_EDGE = 0.08
# Times its distance from the end in all frames that a frame's end is off, at least
_SCATTER = 2.0
# Pieces of its length that tell the edge
_PIECES = 10
# Fewest points in a piece
_FEWEST = 8
# m from a face within which a point is on it
_ON = 0.006
# Quantile of a piece's points that is its end
_OUTER = 0.98
# m to both sides of the edge that the strip along it is wide
_STRIP = 0.03
# m beside the edge at which nothing must be before it; the nearest must be in the picture
_BESIDE = (0.02, 0.04, 0.06)
# Share of those points that must have nothing before them
_SHOWN = 0.9
# Observations of a face that tell a mean as well as all do
_MANY = 4000
# Observations of a frame's edge that do
_SEVERAL = 100

InPart = Iterable[tuple[int, Array, Array]]
# Of a frame, points (n, 3) of the part and a normal (3,): which points are in the picture, which have
# something before them, and the footprint (m) of a pixel on that plane.
Pixels = Callable[[int, Array, Array], tuple[NDArray[np.bool_], NDArray[np.bool_], float]]


@dataclass(frozen=True, eq=False)
class BoardFaces:
    """The surfels (K,) of a face and of the opposite one, where that is seen; the unit normal (3,) that both
    share (the near face's; the far one's is opposite) and their offsets along it; the direction (3,) from the
    axis to their outer edges, how flat they are (m, RMS) and their reach along the axis (m)."""

    near: NDArray[np.bool_]
    far: NDArray[np.bool_] | None
    normal: Array
    offsets: tuple[float, ...]
    outward: Array
    rms: float
    along: tuple[float, float]


def find_board(joint: Joint, points: Array, normals: Array, noise: DepthNoise) -> BoardFaces | None:
    """The board that surfels (K, 3) with their normals (part frame) lie on; None when they are none."""
    if not isinstance(joint, Revolute) or len(points) < MIN_SURFELS:
        return None
    flatness = max(MAX_RMS, float(noise.measured(1.0)))
    basis = geo.orthogonal_basis(joint.axis)[:, :2]
    turned = normals @ basis
    # faces that hold the axis' direction, not the rims that it pierces
    across = np.linalg.norm(turned, axis=1) > 0.7
    facing = basis @ _mode(turned[across])
    near = _face(points, normals, across, facing, flatness)
    if near is None:
        return None
    far = _face(points, normals, across, -facing, flatness)
    if far is not None and near[0] @ -far[0] < np.cos(MAX_TILT):
        return None
    faces = [near[1]] if far is None else [near[1], far[1]]
    normal = _normal([points[f] for f in faces], [np.ones(f.sum()) for f in faces])
    normal = normal * np.sign(normal @ near[0])
    heights = [points[f] @ normal for f in faces]
    scatter = np.concatenate([h - h.mean() for h in heights])
    outward = geo.unit(np.cross(joint.axis, normal))
    outward = outward * np.sign(np.median((points[near[1]] - joint.pivot) @ outward))
    low, high = np.quantile(points[near[1]] @ np.cross(normal, outward), (0.02, 0.98))
    return BoardFaces(
        near[1],
        None if far is None else far[1],
        normal,
        tuple(float(h.mean()) for h in heights),
        outward,
        float(np.sqrt(np.mean(scatter**2))),
        (float(low), float(high)),
    )


def _face(
    points: Array, normals: Array, across: NDArray[np.bool_], facing: Array, flatness: float
) -> tuple[Array, NDArray[np.bool_]] | None:
    """Normal (3,) and members (K,) of the flat face that faces about this way; None without one."""
    cosine = normals @ facing
    mask = across & (cosine > np.cos(MAX_TURN))
    if mask.sum() < MIN_SURFELS or np.median(cosine[mask]) < np.cos(MAX_SPREAD):
        return None
    plane = flat_face(points[mask], facing, flatness)
    if plane is None:
        return None
    members = mask.copy()
    members[mask] = plane[1]
    return plane[0], members


def _mode(directions: Array) -> Array:
    """Most frequent direction (2,) of those in a plane (n, 2): histogram of 5 degree bins over neighbours."""
    angle = np.arctan2(directions[:, 1], directions[:, 0])
    count, edges = np.histogram(angle, bins=72, range=(-np.pi, np.pi))
    smooth = count + np.roll(count, 1) + np.roll(count, -1)
    k = int(np.argmax(smooth))
    centre = 0.5 * (edges[k] + edges[k + 1])
    away = (angle - centre + np.pi) % (2 * np.pi) - np.pi
    close = away[np.abs(away) < np.radians(10.0)]
    centre += float(np.median(close)) if len(close) else 0.0
    return np.array([np.cos(centre), np.sin(centre)])


def flat_face(points: Array, normal: Array, flatness: float) -> tuple[Array, NDArray[np.bool_]] | None:
    """Unit normal (3,) of the plane of most points (n, 3), and those; None without a long, flat face."""
    offset = float(np.median(points @ normal))
    for scale in (5.0, 5.0, 2.5, 1.7, 1.0, 1.0, 1.0, 1.0):
        weight = geman_mcclure(((points @ normal - offset) / (scale * flatness)) ** 2, 1.0)
        found = _normal([points], [weight])
        normal = found * np.sign(found @ normal)
        offset = float(np.average(points @ normal, weights=weight))
    distance = points @ normal - offset
    inlier = np.abs(distance) < 2 * flatness
    if inlier.sum() < MIN_SURFELS or np.sqrt(np.mean(distance[inlier] ** 2)) > flatness:
        return None
    along = (points[inlier] - points[inlier].mean(axis=0)) @ geo.orthogonal_basis(normal)[:, :2]
    shortest = min(np.linalg.svd(along, full_matrices=False)[1])
    width = shortest / np.sqrt(len(along)) * np.sqrt(12.0)  # of an even strip
    return (normal, inlier) if width >= MIN_LENGTH else None


def _normal(faces: list[Array], weights: list[Array]) -> Array:
    """The normal (3,) that point sets (n, 3) share, each about its own weighted mean: of least scatter."""
    scatter = np.zeros((3, 3))
    for points, weight in zip(faces, weights, strict=True):
        d = points - np.average(points, axis=0, weights=weight)
        scatter += (d * weight[:, None]).T @ d
    return np.asarray(np.linalg.eigh(scatter)[1][:, 0])


def with_board(terms: Terms, board: BoardFaces, edges: Tie | None) -> Terms:
    """What surfels of a board see, with what is known of its faces.

    With two faces it counts twice, as distances to their parallel planes: all seen of a face at one offset.
    """
    side = np.full(len(terms.normals), -1)
    side[board.near] = 0
    if board.far is not None:
        side[board.far] = 1
    seen = np.flatnonzero(side[terms.term] >= 0)
    of = side[terms.term[seen]]
    faces = Terms(
        of,
        terms.frame[seen],
        terms.q[seen],
        np.hypot(terms.sigma[seen], board.rms),
        np.tile(board.normal, (2, 1)),
    )
    some = _some(faces)
    near, far = some.term == 0, some.term == 1
    # A face that no frame was found to show has no height.
    ties = [] if edges is None else [edges]
    if near.any():
        ties.append(Tie(some, near / near.sum(), *_HINGE, of_hinge=True))
    if near.any() and far.any():
        ties.append(Tie(some, near / near.sum() - far / far.sum(), *_APART))
    return replace(
        join(terms, faces) if board.far is not None else terms,
        board=BoardTies(
            side >= 0,
            board.normal,
            board.along[1] - board.along[0],
            tuple(ties),
            None if board.far is None else len(terms.normals),
        ),
    )


def _some(terms: Terms) -> Terms:
    """As many of the observations as tell a mean, evenly chosen."""
    every = slice(None, None, max(1, len(terms.term) // _MANY))
    return replace(
        terms, term=terms.term[every], frame=terms.frame[every], q=terms.q[every], sigma=terms.sigma[every]
    )


def edge_tie(
    board: BoardFaces, patches: InPart, state: Array, rests: NDArray[np.bool_], pixels: Pixels
) -> Tie | None:
    """That the board ends at the same outer edge when closed and open, None where that is not known."""
    groups: tuple[list[_Strip], list[_Strip]] = ([], [])
    middle = 0.5 * (state.min() + state.max())
    for k, x, q in patches:
        strip = _strip(board, k, x, q, pixels) if rests[k] else None
        if strip is not None:
            groups[int(state[k] > middle)].append(strip)
    if not (groups[0] and groups[1]):
        return None
    ends = [float(np.median([s.end for s in g])) for g in groups]
    # Where its frames do not agree on it, the outline is that of the labels, not the board's.
    errors = [
        float(np.median([np.hypot(s.error, _SCATTER * (s.end - end)) for s in g]))
        for g, end in zip(groups, ends, strict=True)
    ]
    gap, sigma = ends[0] - ends[1], float(np.linalg.norm(errors))
    if abs(gap) > _OTHER_EDGE:
        return None
    strips = [s for g in groups for s in g]
    side = np.repeat([0, 1], [sum(len(s.q) for s in g) for g in groups])
    share = np.where(side == 0, 1.0, -1.0) / np.bincount(side)[side]
    frame = np.concatenate([np.full(len(s.q), s.frame) for s in strips])
    q = np.concatenate([s.q for s in strips])
    # What the edges are apart follows from how far these points are.
    level = float(share @ np.concatenate([s.reach for s in strips])) - gap
    seen = Terms(np.zeros(len(q), np.int64), frame, q, np.ones(len(q)), board.outward[None])
    return Tie(seen, share, level, sigma, level - 2 * sigma, level + 2 * sigma, across=False)


@dataclass(frozen=True, eq=False)
class _Strip:
    """What a frame shows along the board's outer edge: world points (n, 3) and how far out they are (n,);
    where it ends, and how exactly that is known, m."""

    frame: int
    q: Array
    reach: Array
    end: float
    error: float


def _strip(board: BoardFaces, frame: int, x: Array, q: Array, pixels: Pixels) -> _Strip | None:
    """The strip of points (n, 3), in the part's frame and the world's, that lie on a face; None where the
    edge may be out of the picture, behind an arm or seen edge-on. It ends where most of its length does, of
    what nothing covers: below an arm the arm ends it."""
    on = np.abs((x @ board.normal)[:, None] - board.offsets).min(axis=1) < max(2 * board.rms, _ON)
    low, high = board.along
    place = np.floor((x @ np.cross(board.normal, board.outward) - low) / (high - low) * _PIECES)
    on &= (place >= 0) & (place < _PIECES)
    at, q, reach, place = x[on], q[on], x[on] @ board.outward, place[on].astype(np.int64)
    ends = np.full(_PIECES, np.nan)
    for piece in range(_PIECES):
        of = place == piece
        if of.sum() >= _FEWEST:
            ends[piece] = np.quantile(reach[of], _OUTER)
    outer = np.flatnonzero(np.abs(reach - ends[place]) < _STRIP)
    if not len(outer):
        return None
    of, over = place[outer], ends[place[outer]] - reach[outer]
    beside = np.concatenate([at[outer] + (over + far)[:, None] * board.outward for far in _BESIDE])
    inside, covered, footprint = pixels(frame, beside, board.normal)
    if footprint > _COARSEST or np.mean(inside[: len(outer)]) < _SHOWN:
        return None
    hidden = [np.bincount(of, c, _PIECES) for c in covered.reshape(len(_BESIDE), -1)]
    ends[np.max(hidden, axis=0) > (1 - _SHOWN) * np.bincount(of, minlength=_PIECES)] = np.nan
    if np.isfinite(ends).sum() < _PIECES // 2:
        return None
    end = float(np.nanmedian(ends))
    strip = np.flatnonzero(np.isfinite(ends[place]) & (np.abs(reach - end) < _STRIP))
    every = strip[:: max(1, len(strip) // _SEVERAL)]
    return _Strip(frame, q[every], reach[every], end, float(np.hypot(_EDGE, footprint)))

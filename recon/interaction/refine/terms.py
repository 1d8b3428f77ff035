"""What refinement observes, as numbers: distances of world points to the part's planes, and ties."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Revolute


@dataclass(frozen=True, eq=False)
class Terms:
    """Scalar observations: distance of a world point q to the plane of term k in the part's frame."""

    term: NDArray[np.int64]
    frame: NDArray[np.int64]  # row
    q: Array
    sigma: Array
    normals: Array  # (K, 3) of the terms
    board: BoardTies | FrontTie | PanelTie | None = None


@dataclass(frozen=True, eq=False)
class Tie:
    """What the values of some observations (n,), times `share` (n,), add up to, less the height of the hinge
    over the board where it is `of_hinge`: `middle` give or take `sigma`, and between `low` and `high`, m.
    across: whether they are heights over the board, which a tilt of its normal changes."""

    observed: Terms
    share: Array
    middle: float
    sigma: float
    low: float
    high: float
    of_hinge: bool = False
    across: bool = True


@dataclass(frozen=True, eq=False)
class BoardTies:
    """What is known of a hinged board (`refine.board`): the terms (K,) that are of its faces, their
    normal (3,), their length along the axis, m, and its ties. planes: number of the first of two further
    terms, a face each, whose normal is unknown."""

    of_faces: NDArray[np.bool_]
    normal: Array
    length: float
    ties: tuple[Tie, ...]
    planes: int | None

    @property
    def tilts(self) -> Array:
        """Directions (3, 2) that its normal may lean to."""
        return geo.orthogonal_basis(self.normal)[:, :2]


@dataclass(frozen=True, eq=False)
class FrontTie:
    """What is known of a slide's front (`refine.front`): its terms (K,), normal (3,) and size, m."""

    of_faces: NDArray[np.bool_]
    normal: Array
    length: float


@dataclass(frozen=True, eq=False)
class PanelTie:
    """What is known of a panel that slides in its own plane (`refine.panel`): its terms (K,), normal (3,) and
    size, m; the direction (3,) in that plane across its way, and the states (n,), as they were told."""

    of_faces: NDArray[np.bool_]
    normal: Array
    length: float
    across: Array
    states: Array


def join(a: Terms, b: Terms) -> Terms:
    """Both sets, sorted by term, terms of `b` numbered after those of `a`; with the board of `a`."""
    term = np.concatenate([a.term, b.term + len(a.normals)])
    order = np.argsort(term, kind="stable")
    return Terms(
        term[order],
        np.concatenate([a.frame, b.frame])[order],
        np.concatenate([a.q, b.q])[order],
        np.concatenate([a.sigma, b.sigma])[order],
        np.concatenate([a.normals, b.normals]),
        a.board,
    )


def linearise(joint: Joint, state: Array, terms: Terms) -> tuple[Array, Array]:
    """Values n.y (n,) and their derivatives (n, d + 1) by the shared unknowns and by the frame's state.

    y = T(s)^-1 q is the observed point in the part frame. All share the joint's tangent, and a board's tilts.
    """
    value, jac, y = (_of_hinge if isinstance(joint, Revolute) else _of_slide)(joint, state, terms)
    if isinstance(terms.board, PanelTie):
        # what is left of its normal along its way is error, and no evidence of how far it went
        jac[terms.term < len(terms.board.of_faces), -1] = 0.0
    if not isinstance(terms.board, BoardTies) or terms.board.planes is None:
        return value, jac
    of_planes = (terms.term >= terms.board.planes) & (terms.term < terms.board.planes + 2)
    tilts = np.where(of_planes[:, None], y @ terms.board.tilts, 0.0)
    return value, np.concatenate([jac[:, :-1], tilts, jac[:, -1:]], axis=1)


def _of_hinge(joint: Joint, state: Array, terms: Terms) -> tuple[Array, Array, Array]:
    """Values (n,), derivatives (n, 5) and points in the part frame (n, 3)."""
    assert isinstance(joint, Revolute)
    basis = np.ascontiguousarray(geo.orthogonal_basis(joint.axis)[:, :2].T)
    back = geo.exp_so3(-joint.axis * state[:, None])
    value, jac, y = _hinge(
        terms.term, terms.frame, terms.q, terms.normals, joint.axis, joint.pivot, basis, back
    )
    return np.asarray(value), np.asarray(jac), np.asarray(y)


@njit(cache=True, nogil=True)
def _hinge(term, frame, q, normals, axis, pivot, basis, back):  # type: ignore[no-untyped-def]
    """Values (n,), derivatives (n, 5) and points in the part frame (n, 3); back: the rotations (frames, 3, 3)
    of -s about the axis.

    With r = R (q - p) a tilt by b changes y by b x r - R (b x (q - p)), and n.(b x r) = b.(r x n).
    """
    value, jac, y = np.empty(len(term)), np.empty((len(term), 5)), np.empty((len(term), 3))
    m, v, r = np.empty(3), np.empty(3), np.empty(3)
    for o in range(len(term)):
        n, turn = normals[term[o]], back[frame[o]]
        for k in range(3):
            v[k] = q[o, k] - pivot[k]
        for k in range(3):
            r[k] = turn[k, 0] * v[0] + turn[k, 1] * v[1] + turn[k, 2] * v[2]
            m[k] = turn[0, k] * n[0] + turn[1, k] * n[1] + turn[2, k] * n[2]
        value[o] = 0.0
        for k in range(5):
            jac[o, k] = 0.0
        for k in range(3):
            a, b = (k + 1) % 3, (k + 2) % 3
            turned, still = r[a] * n[b] - r[b] * n[a], v[a] * m[b] - v[b] * m[a]
            y[o, k] = r[k] + pivot[k]
            value[o] += n[k] * y[o, k]
            for i in range(2):
                jac[o, i] += basis[i, k] * (turned - still)
                jac[o, 2 + i] += basis[i, k] * (n[k] - m[k])
            jac[o, 4] -= axis[k] * turned
    return value, jac, y


def _of_slide(joint: Joint, state: Array, terms: Terms) -> tuple[Array, Array, Array]:
    """Values (n,), derivatives (n, 3) and points in the part frame (n, 3)."""
    n, s = terms.normals[terms.term], state[terms.frame]
    y = terms.q - s[:, None] * joint.axis
    basis = geo.orthogonal_basis(joint.axis)[:, :2]
    columns = [-s * (n @ np.cross(b, joint.axis)) for b in basis.T]
    return (n * y).sum(axis=1), np.stack([*columns, -(n @ joint.axis)], axis=1), y

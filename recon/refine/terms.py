"""What refinement observes, as numbers: distances of world points to planes in the part's frame, and what ties them together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
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
    board: BoardTies | None = None


@dataclass(frozen=True, eq=False)
class Tie:
    """What the values of some observations (n,), times `share` (n,), add up to, less the height of the hinge over the board where it is
    `of_hinge`: `middle` give or take `sigma`, and between `low` and `high`, m. across: whether they are heights over the board, which a tilt
    of its normal changes."""

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
    """What is known of a hinged board (`recon.refine.board`): the terms (K,) that are of its faces, their normal (3,), their length along
    the axis, m, and its ties. planes: number of the first of two further terms, a face each, whose normal is unknown."""

    of_faces: NDArray[np.bool_]
    normal: Array
    length: float
    ties: tuple[Tie, ...]
    planes: int | None

    @property
    def tilts(self) -> Array:
        """Directions (3, 2) that its normal may lean to."""
        return geo.orthogonal_basis(self.normal)[:, :2]


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
    """Values n.y (n,) and their derivatives (n, d + 1) by the unknowns that all share and by the frame's own state.

    y = T(s)^-1 q is the observed point in the part frame. All share the joint's tangent, and a board's tilts where its planes are terms.
    """
    n = terms.normals[terms.term]
    s = state[terms.frame]
    basis = geo.orthogonal_basis(joint.axis)[:, :2]
    if isinstance(joint, Revolute):
        back = geo.exp_so3(-joint.axis * state[:, None])[terms.frame]
        v = terms.q - joint.pivot
        rv = np.einsum("nij,nj->ni", back, v)
        dy = [np.cross(b, rv) - np.einsum("nij,nj->ni", back, np.cross(b, v)) for b in basis.T]
        dy += [b - back @ b for b in basis.T]
        by_state = -np.cross(joint.axis, rv)
        y = rv + joint.pivot
    else:
        y = terms.q - s[:, None] * joint.axis
        dy = [-s[:, None] * np.cross(b, joint.axis) for b in basis.T]
        by_state = np.broadcast_to(-joint.axis, y.shape)
    columns = [(n * d).sum(axis=1) for d in dy]
    if terms.board is not None and terms.board.planes is not None:
        of_planes = (terms.term >= terms.board.planes) & (terms.term < terms.board.planes + 2)
        columns += [np.where(of_planes, y @ t, 0.0) for t in terms.board.tilts.T]
    return (n * y).sum(axis=1), np.stack([*columns, (n * by_state).sum(axis=1)], axis=-1)


def dof(joint: Joint) -> int:
    """Unknowns of a joint's tangent."""
    return 4 if isinstance(joint, Revolute) else 2

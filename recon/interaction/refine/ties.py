"""What is known of a hinged board, and of a drawer's front, beside what is seen, as errors of both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from recon.interaction.refine.terms import BoardTies, FrontTie, PanelTie, Terms, linearise
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Revolute

_PARALLEL = np.radians(0.1)  # of a hinge to the faces of its board, one standard deviation; chosen by us
# rad of a slide's axis to its front's normal, one standard deviation: runners have play. Chosen by us
_SQUARE = np.radians(1.0)
# rad, limit of the same. Chosen by us
_ASKEW = np.radians(3.0)
# Standard deviations of the states (m) and the axis (rad) of a panel, as a search over pixels tells them
# (`recon.interaction.boards.search`)
_TOLD_M, _TOLD_AXIS = 0.008, np.radians(2.0)


@dataclass(frozen=True, eq=False)
class BoardErrors:
    """By how much (k,), m, a joint and its states are beyond the limits of what is known, and how far from
    its middle; the derivatives (k, d + n), and standard deviations (k,). held: how many, the first, every
    step holds, so that they tell nothing of its errors. loose: the standard deviation (m) with which each of
    the others draws to its middle also within its limits, where the recording leaves it open."""

    beyond: Array
    away: Array
    rows: Array
    sigmas: Array
    held: int = 0
    loose: float = np.inf


def board_errors(joint: Joint, state: Array, terms: Terms) -> BoardErrors:
    """Errors of what is known: the hinge's axis is parallel to the faces of its board, and its ties hold."""
    board, of_joint = terms.board, joint.dof
    if isinstance(board, FrontTie):
        return _front_errors(joint, state, board)
    if isinstance(board, PanelTie):
        return _panel_errors(joint, state, board)
    if not isinstance(board, BoardTies):
        none = np.zeros(0)
        return BoardErrors(none, none, np.zeros((0, of_joint + len(state))), none)
    d = of_joint + (0 if board.planes is None else 2)
    lever = board.length / np.sqrt(12.0)
    basis = geo.orthogonal_basis(joint.axis)[:, :2]
    row = np.zeros(d + len(state))
    row[:2] = [lever * float(board.normal @ np.cross(b, joint.axis)) for b in basis.T]
    row[of_joint:d] = lever * (joint.axis @ board.tilts)[: d - of_joint]
    beyond, rows, sigmas = [lever * float(board.normal @ joint.axis)], [row], [lever * _PARALLEL]
    away = [beyond[0]]
    for tie in board.ties:
        tilting = replace(
            tie.observed, board=replace(board, planes=0 if tie.across and d > of_joint else None)
        )
        value, jac = linearise(joint, state, tilting)
        of_states = np.bincount(tie.observed.frame, tie.share * jac[:, -1], len(state))
        shared, total = np.zeros(d), float(tie.share @ value)
        shared[: jac.shape[1] - 1] = tie.share @ jac[:, :-1]
        if tie.of_hinge and isinstance(joint, Revolute):
            total -= float(board.normal @ joint.pivot)
            shared[2:4] -= board.normal @ basis
            shared[of_joint:d] -= (joint.pivot @ board.tilts)[: d - of_joint]
        beyond.append(total - float(np.clip(total, tie.low, tie.high)))
        away.append(total - tie.middle)
        rows.append(np.concatenate([shared, of_states]))
        sigmas.append(tie.sigma)
    return BoardErrors(np.array(beyond), np.array(away), np.stack(rows), np.array(sigmas), held=1)


def _front_errors(joint: Joint, state: Array, front: FrontTie) -> BoardErrors:
    """Errors of what is known of a front: the axis is along its normal, which says nothing of the states."""
    lever = front.length / np.sqrt(12.0)
    aside = geo.orthogonal_basis(front.normal)[:, :2].T
    away = lever * aside @ joint.axis
    rows = np.zeros((2, joint.dof + len(state)))
    for k, b in enumerate(geo.orthogonal_basis(joint.axis)[:, :2].T):
        rows[:, k] = lever * aside @ np.cross(b, joint.axis)
    limit = lever * float(np.sin(_ASKEW))
    beyond = away * max(0.0, 1.0 - limit / max(float(np.linalg.norm(away)), 1e-12))
    return BoardErrors(beyond, away, rows, np.full(2, lever * _SQUARE), loose=limit)


def _panel_errors(joint: Joint, state: Array, panel: PanelTie) -> BoardErrors:
    """Errors of what is known of a panel: it slides in its plane, the way and as far as was told."""
    lever, count = panel.length / np.sqrt(12.0), len(state)
    told = _TOLD_M / _TOLD_AXIS  # m, so that all errors that are not held have one standard deviation
    away = np.concatenate(
        [
            [lever * float(panel.normal @ joint.axis), told * float(panel.across @ joint.axis)],
            (state - state.mean()) - (panel.states - panel.states.mean()),
        ]
    )
    rows = np.zeros((2 + count, joint.dof + count))
    for k, b in enumerate(geo.orthogonal_basis(joint.axis)[:, :2].T):
        turned = np.cross(b, joint.axis)
        rows[:2, k] = lever * float(panel.normal @ turned), told * float(panel.across @ turned)
    rows[2:, joint.dof :] = np.eye(count) - 1.0 / count
    beyond = np.where(np.arange(len(away)) == 0, away, 0.0)
    sigmas = np.where(np.arange(len(away)) == 0, lever * _PARALLEL, _TOLD_M)
    return BoardErrors(beyond, away, rows, sigmas, held=1, loose=_TOLD_M)


def add_board(
    h: Array, g: Array, joint: Joint, state: Array, weight: Array, terms: Terms
) -> tuple[Array, Array]:
    """Normal equations `h` and `g` with what is known of a board where a joint and its states are beyond it.

    Each counts as all that was seen of its faces: biased depth at outlines is no less so if seen often.
    """
    errors = board_errors(joint, state, terms)
    broken = errors.beyond != 0
    rows, total = errors.rows[broken], _weight_of_faces(weight, terms)
    drawn = errors.rows / errors.loose
    return (
        h + total * rows.T @ rows + drawn.T @ drawn,
        g + total * rows.T @ errors.beyond[broken] + drawn.T @ (errors.away / errors.loose),
    )


def with_board_known(
    joint: Joint, state: Array, covariance: Array, terms: Terms
) -> tuple[Joint, Array, Array]:
    """Joint, states (n,) and their covariance (d + n, d + n) with what is known of a board as further
    observations (Kalman 1960): it counts where the recording says less.

    If the two disagree by more than both claim, the errors grow by Birge's ratio (1932). A panel's are there
    already (`of_panel`).
    """
    if isinstance(terms.board, PanelTie):
        return joint, state, covariance
    errors = board_errors(joint, state, terms)
    of_ties = np.sqrt(np.einsum("ki,ij,kj->k", errors.rows, covariance, errors.rows) + errors.sigmas**2)
    told = (errors.away / of_ties)[errors.held :]
    ratio = float(np.mean(told**2)) if len(told) else 1.0
    covariance = covariance * max(ratio, 1.0)
    seen = errors.rows @ covariance
    gain = np.linalg.solve(seen @ errors.rows.T + np.diag(errors.sigmas**2), seen).T
    delta = -gain @ errors.away
    left = np.eye(len(delta)) - gain @ errors.rows
    return joint.plus(delta[: joint.dof]), state + delta[-len(state) :], np.asarray(left @ covariance)


def of_panel(h: Array, joint: Joint, state: Array, terms: Terms) -> Array:
    """The normal matrix with what is known of a panel, without which it is singular: each step holds it."""
    if not isinstance(terms.board, PanelTie):
        return h
    errors = board_errors(joint, state, terms)
    weighed = errors.rows / errors.sigmas[:, None]
    return np.asarray(h + weighed.T @ weighed)


def _weight_of_faces(weight: Array, terms: Terms) -> float:
    """Sum of the weights (n,) of all that is seen of a board's faces."""
    if terms.board is None:
        return 0.0
    return float(weight[np.isin(terms.term, np.flatnonzero(terms.board.of_faces))].sum())

"""How sure a refined joint and states are: a sandwich estimator over spans, and slow camera errors."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.interaction.refine.level import with_room_known
from recon.interaction.refine.observations import Drift
from recon.interaction.refine.solver import add_priors, reduced, robust_weights
from recon.interaction.refine.terms import Terms, linearise
from recon.interaction.refine.ties import of_panel, with_board_known
from recon.observation.room import Room
from twin import geometry as geo
from twin.geometry import Array
from twin.joint import Joint, JointSigma, Revolute
from twin.robust import mad_sigma

_BLOCK = 8  # frames whose errors count as one; about half a second, the time scale of head sway
_UNKNOWN = np.array([np.pi, np.pi, 10.0, 10.0])  # rad and m, of a joint of which nothing was observed
_DRIFT_SHARES = (0.74, 0.18, 0.08)  # of the cosines, which fall like a random walk's


@dataclass(frozen=True, eq=False)
class Refined:
    """A refined joint and its states (n,). joint: without uncertainty, which covariance and sigma hold;
    residual: m; jitter: standard deviation of the state from frame to frame, m or rad."""

    joint: Joint
    state: Array
    covariance: Array
    sigma: JointSigma
    residual: float
    jitter: float


def with_uncertainty(
    joint: Joint,
    state: Array,
    start: Array,
    rests: NDArray[np.bool_],
    terms: Terms,
    left: Array,
    drift: Drift,
    room: Room | None = None,
) -> Refined:
    """Covariance of the joint's tangent and of the states, robust to errors shared within spans of frames.

    Sandwich estimator (Liang and Zeger 1986): what one bad camera pose or one leaking label does to all
    pixels of a few neighbouring frames counts once, not once a pixel. Errors that grow over the whole
    recording leave no residual; they are added as `_drift`, those that a span alone may fit as `_of_spans`,
    and what the joint has `left` to go (`refine.settling`) as an error of that size. What is known of a
    board moves joint and states where these are unsure (`refine.ties`), and so do directions of the `room`
    (`refine.level`).
    """
    if not len(terms.term):
        covariance = np.diag(_UNKNOWN[: joint.dof] ** 2)
        sigma = JointSigma.of(covariance, max(float(np.ptp(state)), 1e-3))
        return Refined(joint, state - state[0], covariance, sigma, 0.0, 0.0)
    value, jac = linearise(joint, state, terms)
    weight, mean = robust_weights(value, terms)
    d = jac.shape[1] - 1
    h, g = reduced(terms.term, terms.frame, weight, value, jac, len(state))
    h, _ = add_priors(of_panel(h, joint, state, terms), g, d, state, start, rests)
    # errors of states are told against the frame that is known best
    held = d + int(np.argmax(np.diag(h)[d:]))
    h[held, held] += 1e8 * max(1.0, float(np.abs(np.diag(h)).max()) * 1e-6)
    score = weight * (value - mean[terms.term])
    blocks = terms.frame // _BLOCK
    scores = np.zeros((int(blocks.max(initial=0)) + 1, len(h)))
    for k in range(d):
        np.add.at(scores[:, k], blocks, score * jac[:, k])
    np.add.at(scores, (blocks, d + terms.frame), score * jac[:, d])
    inverse = np.linalg.inv(h)
    pushed = scores @ inverse
    slow = _drift(joint, state, terms, weight, jac, drift) @ inverse
    spans = _of_spans(joint, state, terms, weight, value - mean[terms.term], jac, blocks) @ inverse
    whole = pushed.T @ pushed + slow.T @ slow + spans.T @ spans + inverse
    joint, state, whole = with_board_known(joint, state, whole, terms)
    if room is not None:
        joint, state, whole = with_room_known(joint, state, whole, room)
    state = state - state[0]  # counted from the first frame, whose pose is the part's frame
    covariance = whole[: joint.dof, : joint.dof] + np.outer(left, left)
    residual = np.abs(value - mean[terms.term])
    inlier = weight * terms.sigma**2 > 0.25 * np.median(weight * terms.sigma**2)
    rms = float(np.sqrt(np.mean(residual[inlier] ** 2))) if inlier.any() else 0.0
    second = np.diff(state, 2)
    noise = mad_sigma(second) / np.sqrt(6.0)
    covariance = 0.5 * (covariance + covariance.T)
    sigma = JointSigma.of(covariance, _of_a_state(whole[-len(state) :, -len(state) :]))
    return Refined(joint, state, covariance, sigma, rms, noise)


def _of_a_state(covariance: Array) -> float:
    """One standard deviation of a state, root mean square over the frames of a covariance (n, n), each state
    counted from their mean: the zero frame is free, and a hidden one would make all others unsure."""
    return float(np.sqrt(max(float(np.diag(covariance).mean() - covariance.mean()), 0.0)))


def _drift(joint: Joint, state: Array, terms: Terms, weight: Array, jac: Array, drift: Drift) -> Array:
    """Scores (modes, d + n) of unseen slow errors: cosines over the recording, six directions at the part."""
    way, turn = _moves(joint, state, terms)
    moves = np.concatenate([drift.shift * way, drift.angle * turn], axis=1)
    time = (np.arange(len(state)) + 0.5) / len(state)
    shapes = [
        np.sqrt(2.0 * share) * np.cos(np.pi * (k + 1) * time)[terms.frame]
        for k, share in enumerate(_DRIFT_SHARES)
    ]
    return _scores([shape * move for shape in shapes for move in moves.T], terms, weight, jac, len(state))


def _of_spans(
    joint: Joint,
    state: Array,
    terms: Terms,
    weight: Array,
    residual: Array,
    jac: Array,
    blocks: NDArray[np.int64],
) -> Array:
    """Scores (modes, d + n) of errors shared by a span's pixels, in three directions, as large as spans show.

    A joint that moves within one span fits that one's error without residual: the sandwich sees none.
    """
    way, _ = _moves(joint, state, terms)
    size = _shared(_beside(way, jac[:, -1], weight, terms.frame), weight, residual, blocks)
    shared = (np.where(blocks == b, size * move, 0.0) for b in np.unique(blocks) for move in way.T)
    return _scores(shared, terms, weight, jac, len(state))


def _beside(way: Array, of_state: Array, weight: Array, frame: NDArray[np.int64]) -> Array:
    """`way` (n, 3) without what the state of each frame takes for itself, of which no residual is left."""
    most = np.maximum(np.bincount(frame, weight * of_state**2), 1e-12)
    taken = [np.bincount(frame, weight * of_state * way[:, k]) / most for k in range(3)]
    return way - of_state[:, None] * np.stack(taken, axis=-1)[frame]


def _shared(way: Array, weight: Array, residual: Array, blocks: NDArray[np.int64]) -> float:
    """Root mean square, m, over spans and directions, of the shift that explains a span's residuals (n,)
    best, each counted by how much the span tells of it; `way` (n, 3) is how the residuals change by a shift
    of one."""
    square, total = 0.0, 0.0
    for b in np.unique(blocks):
        of = blocks == b
        weighed = way[of] * weight[of][:, None]
        told, along = np.linalg.eigh(weighed.T @ way[of])
        told = np.maximum(told, 1e-12)
        shift = along.T @ (weighed.T @ residual[of]) / told
        square, total = square + float(told @ shift**2), total + float(told.sum())
    return float(np.sqrt(square / total)) if total else 0.0


def _moves(joint: Joint, state: Array, terms: Terms) -> tuple[Array, Array]:
    """How much (n, 3) values change per metre along the world's axes, and per radian about them."""
    n = terms.normals[terms.term]
    if isinstance(joint, Revolute):
        n = np.einsum("nij,nj->ni", geo.exp_so3(joint.axis * state[:, None])[terms.frame], n)
    return n, np.cross(terms.q - terms.q.mean(axis=0), n)


def _scores(errors: Iterable[Array], terms: Terms, weight: Array, jac: Array, frames: int) -> Array:
    """What errors (n,) do to the normal equations' right side (d + frames,), after their terms' offsets."""
    total = np.maximum(np.bincount(terms.term, weight, len(terms.normals)), 1e-12)
    d, out = jac.shape[1] - 1, []
    for value in errors:
        mean = np.bincount(terms.term, weight * value, len(total)) / total
        score = weight * (value - mean[terms.term])
        of_states = np.bincount(terms.frame, score * jac[:, d], frames)
        out.append(np.concatenate([score @ jac[:, :d], of_states]))
    return np.stack(out)

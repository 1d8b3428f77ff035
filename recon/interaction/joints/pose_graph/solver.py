"""Part-pose graph: one joint and one state per frame from relative part motions.

The paper's parameterization and objective (FunREC, supplement 1.1, eq. 1 and 2, and 1.4, eq. 3): unknowns are
the axis (2), for a revolute joint the axis point with a . p = 0 (2), and a state per frame; consecutive
edges, loop closures with confidences l, and mu (sqrt(l) - 1)^2. The confidences leave in closed form:
l = (mu / (mu + f))^2 with cost mu f / (mu + f). The noise model differs: f is in units of the noise, whose
scale is taken from the data (median, two rounds), and mu follows from the chi-square distribution. A fixed
gate cuts good edges when the noise is larger than expected.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.interaction.joints.cholesky import solve_positive
from recon.interaction.joints.observations import Kind
from recon.interaction.joints.pose_graph.edges import PoseEdges
from recon.interaction.joints.pose_graph.screws import motion_jacobian, right_inverse, twist_of
from twin import geometry as geo
from twin.errors import ReconstructionError
from twin.geometry import Array
from twin.joint import moved_axis
from twin.robust import cauchy, chi2_scale
from twin.runs.setting import Settings, setting

_LENGTH = 0.3  # m, about half a door: how much rotation weighs against translation in the start alone
_MOST_STEPS = 30  # of one solution; it stops when the cost stands still


@dataclass(frozen=True)
class PoseGraphConfig(Settings):
    """The part's pose graph; the noise model differs from the paper's, see the head of this module."""

    mu: float = setting(
        20.0,
        "scale of the confidences in units of the noise variance; 20 puts the prune at 0.3 on the 99 % quantile of a good edge "
        "(0.826 mu = 16.8 of chi-square with 6)",
        unit="",
        above=0,
    )
    prune: float = setting(
        0.3, "loop closures below this confidence leave (the paper's)", unit="", at_least=0, below=1
    )
    rounds: int = setting(2, "rescalings of noise (two: best everywhere)", unit="rounds", at_least=0)


@dataclass(frozen=True, eq=False)
class PoseGraph:
    """Solution: kind, unit axis (3,), pivot (3,), a . p = 0 (zero when prismatic), state (N,), first 0.

    confidence (E,), kept (E,) of the given edges; scale: noise standard deviation in units of the given
    information; covariance of the joint tangent (2 or 4, `twin.scene.Joint`, at `pivot`), then the states.
    """

    kind: Kind
    axis: Array
    pivot: Array
    state: Array
    confidence: Array
    kept: NDArray[np.bool_]
    scale: float
    covariance: Array


def solve_pose_graph(
    edges: PoseEdges,
    frames: int,
    kind: Kind,
    config: PoseGraphConfig | None = None,
    start: PoseGraph | None = None,
) -> PoseGraph:
    """Solve for one joint of the given kind.

    Args:
        edges: relative motions among `frames` frames; every frame must be reached.
        start: else the closed form.

    Raises:
        ReconstructionError: too few edges, or frames that no edge reaches.
    """
    cfg = config or PoseGraphConfig()
    reached = np.zeros(frames, dtype=bool)
    reached[edges.first] = reached[edges.second] = True
    if not reached.all():
        lost = np.flatnonzero(~reached)
        raise ReconstructionError(
            f"no motion edge reaches {len(lost)} of {frames} frames, the first is {lost[0]}",
            "leave those frames out",
        )
    state = start or closed_form_start(edges, frames, kind)
    scale = _scale(edge_costs(edges, state))
    for _ in range(cfg.rounds):
        state = _minimise(edges, state, scale, cfg)
        scale = _scale(edge_costs(edges, state))
    state = _minimise(edges, state, scale, cfg)
    confidence = _confidence(edges, edge_costs(edges, state) / scale**2, cfg.mu)
    kept = (confidence >= cfg.prune) | ~edges.loop
    good = edges.take(kept)
    state = _minimise(good, state, scale, cfg)
    confidence = _confidence(edges, edge_costs(edges, state) / scale**2, cfg.mu)
    covariance = _covariance(good, state, scale, cfg)
    return replace(state, confidence=confidence, kept=kept, scale=scale, covariance=covariance)


def closed_form_start(edges: PoseEdges, frames: int, kind: Kind, rounds: int = 10) -> PoseGraph:
    """Joint and states without iteration on the manifold: log(T_parti_partj) is d_ij times one screw.

    The screw is the leading eigenvector of the logs' scatter (reweighted), the states solve a Laplacian.
    Twists are taken about the origin of the part's coordinates, which should lie near the part.
    """
    logs = geo.log_se3(edges.T_parti_partj)
    if kind == "prismatic":
        logs = logs * np.array([1.0, 1, 1, 0, 0, 0])
    unit_scale = np.array([1.0, 1, 1, _LENGTH, _LENGTH, _LENGTH])
    x = logs * unit_scale
    size = np.linalg.norm(x, axis=1)
    if size.max(initial=0.0) < 1e-12:
        raise ReconstructionError("the part's poses do not move", "give the frames in which it moves")
    weight = 1.0 / np.maximum(size, 0.05 * size.max())
    for _ in range(rounds):
        _, vectors = np.linalg.eigh((x * weight[:, None]).T @ x)
        screw = vectors[:, -1]
        away = np.linalg.norm(x - np.outer(x @ screw, screw), axis=1)
        middle = max(float(np.median(away)), 1e-9)
        weight = 1.0 / np.maximum(size, 0.05 * size.max()) / (1.0 + (away / (2.0 * middle)) ** 2)
    xi = screw / unit_scale
    norm = float(np.linalg.norm(xi[:3] if kind == "prismatic" else xi[3:]))
    if norm < 1e-9:
        raise ReconstructionError("the part's poses do not turn", "fit a prismatic joint")
    xi = xi / norm
    distance = (x @ screw) * norm
    state = _laplacian(edges, distance, cauchy((away / (2.0 * middle)) ** 2, 1.0), frames)
    axis = xi[:3] if kind == "prismatic" else xi[3:]
    pivot = np.zeros(3) if kind == "prismatic" else np.cross(axis, xi[:3])
    return PoseGraph(
        kind, axis, pivot, state, np.ones(len(edges)), np.ones(len(edges), dtype=bool), 1.0, np.zeros((0, 0))
    )


def _laplacian(edges: PoseEdges, distance: Array, weight: Array, frames: int) -> Array:
    """States (N,), first 0, with s_j - s_i = distance by least absolute error: wrong edges do not pull."""
    i, j = edges.first, edges.second
    w, ridge = weight.copy(), np.arange(frames)
    state = np.zeros(frames)
    for _ in range(20):
        matrix, right = np.zeros((frames, frames)), np.zeros(frames)
        np.add.at(matrix, (i, i), w)
        np.add.at(matrix, (j, j), w)
        np.add.at(matrix, (i, j), -w)
        np.add.at(matrix, (j, i), -w)
        np.add.at(right, j, w * distance)
        np.add.at(right, i, -w * distance)
        size = matrix.trace() / frames
        matrix[0, 0] += size
        matrix[ridge, ridge] += 1e-12 * size
        state = solve_positive(matrix, right[:, None])[:, 0]
        state -= state[0]
        error = np.abs(state[j] - state[i] - distance)
        w = weight / np.maximum(error, max(0.1 * float(np.median(error)), 1e-9))  # least absolute errors
        w /= w.max()
    return np.asarray(state)


def edge_costs(edges: PoseEdges, graph: PoseGraph) -> Array:
    """f (E,) = e^T information e of every edge."""
    e = edge_errors(edges, graph)
    return np.asarray(np.einsum("ei,eij,ej->e", e, edges.information, e))


def edge_errors(edges: PoseEdges, graph: PoseGraph) -> Array:
    """e (E, 6) = log(T_parti_partj^-1 T_i^-1 T_j)."""
    xi = twist_of(graph.kind, graph.axis, graph.pivot)
    motion = geo.exp_se3((graph.state[edges.second] - graph.state[edges.first])[:, None] * xi)
    return geo.log_se3(geo.invert_pose(edges.T_parti_partj) @ motion)


def error_jacobians(edges: PoseEdges, graph: PoseGraph) -> tuple[Array, Array, Array]:
    """Errors (E, 6), their derivatives by the joint tangent (E, 6, 2 or 4) and by d = s_j - s_i (E, 6).

    exp((d)(xi + delta)) = exp(d xi) exp(J_r(d xi) d delta), with A = ad(xi) and
    d J_r(d xi) = d I - (1 - cos d) A + (d - sin d) A^2. The log's own Jacobian is the series of J_r^-1 at e.
    """
    e = edge_errors(edges, graph)
    distance = graph.state[edges.second] - graph.state[edges.first]
    right = right_inverse(e)
    xi = twist_of(graph.kind, graph.axis, graph.pivot)
    return e, right @ motion_jacobian(graph.kind, graph.axis, graph.pivot, distance), right @ xi


@njit(cache=True, nogil=True)
def _accumulate(first, second, error, by_joint, by_distance, information, weight, frames):  # type: ignore[no-untyped-def]
    """Hessian and gradient of half the weighted cost over joint tangent and states."""
    n = by_joint.shape[2]
    hessian, gradient = np.zeros((n + frames, n + frames)), np.zeros(n + frames)
    column = np.empty((6, n + 1))
    lifted = np.empty((6, n + 1))
    for e in range(len(first)):
        if weight[e] <= 0.0:
            continue
        for i in range(6):
            for a in range(n):
                column[i, a] = by_joint[e, i, a]
            column[i, n] = by_distance[e, i]
        for i in range(6):
            for a in range(n + 1):
                total = 0.0
                for k in range(6):
                    total += information[e, i, k] * column[k, a]
                lifted[i, a] = weight[e] * total
        i_row, j_row = n + first[e], n + second[e]
        for a in range(n + 1):
            pull = 0.0
            for k in range(6):
                pull += lifted[k, a] * error[e, k]
            if a < n:
                gradient[a] += pull
            else:
                gradient[j_row] += pull
                gradient[i_row] -= pull
            for b in range(n + 1):
                value = 0.0
                for k in range(6):
                    value += lifted[k, a] * column[k, b]
                if a < n and b < n:
                    hessian[a, b] += value
                elif a < n:
                    hessian[a, j_row] += value
                    hessian[a, i_row] -= value
                    hessian[j_row, a] += value
                    hessian[i_row, a] -= value
                elif b == n:
                    hessian[i_row, i_row] += value
                    hessian[j_row, j_row] += value
                    hessian[i_row, j_row] -= value
                    hessian[j_row, i_row] -= value
    return hessian, gradient


def _confidence(edges: PoseEdges, cost: Array, mu: float) -> Array:
    return np.asarray(np.where(edges.loop, (mu / (mu + cost)) ** 2, 1.0))


def _objective(edges: PoseEdges, cost: Array, mu: float) -> float:
    return float(np.where(edges.loop, mu * cost / (mu + cost), cost).sum())


def _scale(cost: Array) -> float:
    """Noise in units of the given one, by the median of f; floored so that exact data stay finite."""
    return max(float(np.sqrt(chi2_scale(cost, dof=6))), 1e-9)


def _system(edges: PoseEdges, graph: PoseGraph, scale: float, mu: float) -> tuple[Array, Array, float]:
    error, by_joint, by_distance = error_jacobians(edges, graph)
    cost = np.einsum("ei,eij,ej->e", error, edges.information, error) / scale**2
    weight = _confidence(edges, cost, mu) / scale**2
    hessian, gradient = _accumulate(
        edges.first, edges.second, error, by_joint, by_distance, edges.information, weight, len(graph.state)
    )
    n = by_joint.shape[2]
    hessian[n, n] += float(np.trace(hessian[n:, n:]))  # the first state stays 0
    return hessian, gradient, _objective(edges, cost, mu)


def _moved(graph: PoseGraph, delta: Array) -> PoseGraph:
    n = 4 if graph.kind == "revolute" else 2
    axis, pivot = moved_axis(graph.axis, graph.pivot, delta[:n])
    state = graph.state + delta[n:]
    return replace(graph, axis=axis, pivot=pivot - axis * (axis @ pivot), state=state - state[0])


def _minimise(edges: PoseEdges, graph: PoseGraph, scale: float, config: PoseGraphConfig) -> PoseGraph:
    """Levenberg-Marquardt with the confidences in closed form."""
    damping = 1e-6
    hessian, gradient, cost = _system(edges, graph, scale, config.mu)
    for _ in range(_MOST_STEPS):
        delta = -solve_positive(hessian + damping * np.diag(np.diag(hessian)), gradient[:, None])[:, 0]
        trial = _moved(graph, delta)
        trial_cost = _objective(edges, edge_costs(edges, trial) / scale**2, config.mu)
        if trial_cost > cost * (1 + 1e-12):
            damping *= 10.0
            if damping > 1e8:
                break
            continue
        done = cost - trial_cost < 1e-6 + 1e-9 * cost
        graph, damping = trial, max(damping / 10.0, 1e-12)
        if done:
            break
        hessian, gradient, cost = _system(edges, graph, scale, config.mu)
    return graph


def _covariance(edges: PoseEdges, graph: PoseGraph, scale: float, config: PoseGraphConfig) -> Array:
    """Inverse Hessian, widened by the edges per frame: many edges share each frame's one error."""
    hessian, _, _ = _system(edges, graph, scale, config.mu)
    shared = max(1.0, len(edges) / len(graph.state))
    return np.asarray(solve_positive(hessian, np.eye(len(hessian))) * shared)

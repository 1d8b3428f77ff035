"""Joint and states of one part from its tracks by the part-pose graph (FunREC, supplement 1.4), an
alternative to bundle adjustment of the tracks themselves (`recon.interaction.joints.bundle`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from recon.interaction.joints.bundle import Bundle
from recon.interaction.joints.observations import Model, Observations, noise_sigma, residuals
from recon.interaction.joints.pose_graph.edges import PoseEdges, edges_from_tracks, graph_pairs
from recon.interaction.joints.pose_graph.solver import PoseGraph, solve_pose_graph
from twin.errors import ReconstructionError
from twin.geometry import Array

LEAST_TRACKS = 6  # that two frames share, for an edge between them (by us)
LEAST_FRAMES = 4  # of a graph that says anything about a joint (by us)
LOOPS = 10  # loop closures a frame; more changed neither axis nor states on the measured graphs
MOST_FRAMES = 120  # of the graph; the states of those between are interpolated (by us, for speed)


def pose_graph_of_tracks(obs: Observations, start: Model, sigma: float) -> Bundle:
    """The joint and states that the relative motions of the part between frames agree on.

    Args:
        obs: tracks of one part (outlying ones allowed).
        start: near the solution, as the paper starts from a least-squares fit to the tracks.
        sigma: noise of one coordinate in metres.

    Raises ReconstructionError when too few frames share tracks.
    """
    seen = obs.weight > 0
    frames = np.flatnonzero(seen.sum(0) >= LEAST_TRACKS)
    if len(frames) > MOST_FRAMES:
        frames = frames[np.unique(np.linspace(0, len(frames) - 1, MOST_FRAMES).astype(np.int64))]
    # Coordinates about the tracks, so that the axis point with a . p = 0 is the one nearest to them.
    centre = obs.points[seen].mean(0)
    points = np.where(seen[..., None], obs.points - centre, 0.0).swapaxes(0, 1)
    edges = edges_from_tracks(
        points[frames], seen.T[frames], graph_pairs(len(frames), LOOPS), sigma, least=LEAST_TRACKS
    )
    edges, linked = _largest_piece(edges, len(frames))
    if len(linked) < LEAST_FRAMES:
        raise ReconstructionError(
            f"only {len(linked)} frames share {LEAST_TRACKS} tracks of the part with others",
            "give longer tracks, or joints.method = 'bundle'",
        )
    frames = frames[linked]
    pivot = start.pivot - centre
    guess = PoseGraph(
        start.kind,
        start.axis,
        pivot - start.axis * (start.axis @ pivot) if start.kind == "revolute" else np.zeros(3),
        start.state[frames] - start.state[frames[0]],
        np.ones(len(edges)),
        np.ones(len(edges), dtype=bool),
        1.0,
        np.zeros((0, 0)),
    )
    graph = solve_pose_graph(edges, len(frames), start.kind, start=guess)
    between = _interpolation(np.arange(len(start.state)), frames)
    model = Model(start.kind, graph.axis, graph.pivot + centre, between @ graph.state)
    return _as_bundle(obs, model, graph, between, sigma)


def _largest_piece(edges: PoseEdges, frames: int) -> tuple[PoseEdges, NDArray[np.int64]]:
    """The edges among the most frames that hang together, numbered anew, and these frames."""
    link = coo_matrix((np.ones(len(edges)), (edges.first, edges.second)), (frames, frames))
    _, piece = connected_components(link, directed=False)
    linked = np.flatnonzero(piece == np.bincount(piece, minlength=1).argmax())
    number = np.full(frames, -1, dtype=np.int64)
    number[linked] = np.arange(len(linked))
    kept = edges.take(number[edges.first] >= 0)
    renumbered = PoseEdges(
        number[kept.first], number[kept.second], kept.T_parti_partj, kept.information, kept.loop
    )
    return renumbered, linked


def _interpolation(at: NDArray[np.int64], frames: NDArray[np.int64]) -> Array:
    """Matrix (T, N) that interpolates values of `frames` (N,) linearly to `at` (T,), the ends held."""
    return np.stack([np.interp(at, frames, row) for row in np.eye(len(frames))], axis=1)


def _as_bundle(obs: Observations, model: Model, graph: PoseGraph, between: Array, sigma: float) -> Bundle:
    """The graph's solution with the tracks' residuals under it."""
    n = 4 if model.kind == "revolute" else 2
    square, _, _ = residuals(obs, model, sigma)
    unknowns = 3 * len(obs.points) + between.shape[1] + n
    sigma = noise_sigma(square, obs.weight, unknowns)
    square, weight, marks = residuals(obs, model, sigma)
    carry = np.zeros((n + between.shape[0], n + between.shape[1]))
    carry[:n, :n], carry[n:, n:] = np.eye(n), between
    residual = np.where(obs.weight > 0, np.sqrt(square), np.nan)
    return Bundle(model, marks, residual, weight, sigma, lambda: carry @ graph.covariance @ carry.T)

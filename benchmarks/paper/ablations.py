"""The paper's own steps, and ablations A1 to A6 of ours: our chain with one step replaced.

The paper ablates its own chain (supplement 3.5); here the same question is put to ours. Each replacement is
made in this process alone and taken back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import HDBSCAN

from benchmarks.paper.chain import Answer, Seen, delivered, found_parts, labelled, ours, part_of, solved
from benchmarks.paper.poses import by_residual, poses_of_tracks
from recon.interaction.boards import search
from recon.interaction.joints import bundle, candidates, fit_tracks
from recon.interaction.joints.clustering import clusters
from recon.interaction.joints.config import JointConfig
from recon.interaction.joints.observations import (
    Model,
    Observations,
    pull_back,
    squared_residuals,
    weighted_means,
)
from recon.interaction.joints.pose_graph import fit_poses
from recon.interaction.joints.type_selection import TypeEvidence, TypeHint
from recon.interaction.labels import label_frames as labelling
from recon.interaction.motion.movers import Movers
from recon.interaction.parts import find_parts as finding
from recon.interaction.parts.config import MotionConfig
from recon.interaction.parts.find_parts import find_parts
from recon.interaction.parts.found import PartTracks
from recon.interaction.refine import solver, uncertainty
from recon.interaction.refine.terms import Terms
from twin.geometry import Array

_CLUSTERS, _GRAPH = MotionConfig(method="clusters"), JointConfig(method="pose_graph")
# BIC that a hinge's two further unknowns cost, at most: with a million observed coordinates
_UNKNOWNS = 2.0 * float(np.log(1e6))


def papers_steps(seen: Seen) -> Answer:
    """Motion clusters, of which the one that moves farthest is the part, and the part-pose graph (supplement
    1.4, 3.2), on our tracks and cameras; our labels by that joint, no refinement by pixels."""
    with _replaced({(finding, "reconciled_parts"): _tracks_alone}):
        found = find_parts(seen.recording, seen.tracks, seen.cameras, _CLUSTERS, _GRAPH)
    return labelled(seen, tuple(t.part for t in found.parts[:1]))


def by_residual_type(seen: Seen) -> Answer:
    """A1: the type with the smaller residual; neither evidence, nor limits of a hinge, nor a preference."""
    types = {(module, "decide"): _smaller for module in (fit_tracks, clusters, fit_poses)}
    with _replaced({**types, (search, "_SIMPLER"): 1.0}):
        return solved(seen, find_parts(seen.recording, seen.tracks, seen.cameras))


def free_poses(seen: Seen) -> Answer:
    """A2: the part's tracks as our motion stage tells them; a free pose for each frame, and a line or circle
    through these; our labels by that joint."""
    found = found_parts(seen)
    if not found.parts:
        return Answer((), {}, seen.cameras)
    frames, poses, middle = poses_of_tracks(found.movers, found.parts[0].members)
    if len(frames) < 4:
        return Answer((), {}, seen.cameras)
    part = part_of(by_residual(poses, middle), frames, seen, found.parts[0].part.motion.intervals)
    return replace(labelled(seen, (part,)), free=(frames, poses))


def plain_clusters(seen: Seen) -> Answer:
    """A3: tracks that move are clustered by where they begin and which way they go (HDBSCAN); one joint is
    fitted to the cluster that moves farthest. No boards; refinement and labels are ours."""

    def groups(movers: Movers, *_: object) -> Iterator[NDArray[np.bool_]]:
        yield _largest_cluster(movers)

    with _replaced({(finding, "_groups"): groups, (finding, "reconciled_parts"): _tracks_alone}):
        return solved(seen, find_parts(seen.recording, seen.tracks, seen.cameras, _CLUSTERS))


def unpooled(seen: Seen) -> Answer:
    """A4: each pixel is labelled by itself and its neighbours; no pooling over voxels, frames and colours."""
    with _replaced({(labelling, "pool_in_space"): _nothing, (labelling, "pool_color"): _nothing}):
        return solved(seen, found_parts(seen))


def unrefined(seen: Seen) -> Answer:
    """A5: joints and states as the search left them: no bundle of the tracks, no fit to the pixels."""

    def start(obs: Observations, model: Model, sigma: float, *_: object, **__: object) -> bundle.Bundle:
        return bundle.refine(obs, model, sigma, 0)

    with _replaced({(candidates, "refine"): start}):
        found = find_parts(seen.recording, seen.tracks, seen.cameras)
    return labelled(seen, tuple(t.part for t in found.parts))


def uniform(seen: Seen) -> Answer:
    """A6: every observation of tracks and pixels counts alike: no robust weights, no noise that grows with
    depth."""
    with _replaced({
        (bundle, "robust_weight"): lambda weight, *_: weight,
        (bundle, "residuals"): _plain_residuals,
        (solver, "robust_weights"): _alike,
        (uncertainty, "robust_weights"): _alike,
    }):  # fmt: skip
        return solved(seen, find_parts(seen.recording, seen.tracks, seen.cameras))


METHODS: dict[str, Callable[[Seen], Answer]] = {
    "ours": ours,
    "ours, as delivered": delivered,
    "paper's steps": papers_steps,
    "A1 type by residual": by_residual_type,
    "A2 free poses": free_poses,
    "A3 plain clusters": plain_clusters,
    "A4 labels not pooled": unpooled,
    "A5 no bundle, no refinement": unrefined,
    "A6 uniform weights": uniform,
}


@contextmanager
def _replaced(what: Mapping[tuple[Any, str], Any]) -> Iterator[None]:
    with ExitStack() as stack:
        for (module, name), by in what.items():
            stack.enter_context(mock.patch.object(module, name, by))
        yield


def _tracks_alone(found: list[PartTracks], *_: object) -> tuple[PartTracks, ...]:
    return tuple(found)


def _nothing(*_: object) -> None:
    return None


def _smaller(evidence: TypeEvidence, hint: TypeHint | None = None) -> tuple[str, str]:  # noqa: ARG001
    smaller = np.isfinite(evidence.radius) and evidence.delta_bic > -_UNKNOWNS
    return ("revolute" if smaller else "prismatic"), "the smaller residual"


def _largest_cluster(movers: Movers) -> NDArray[np.bool_]:
    moving = np.flatnonzero(movers.moving)
    if len(moving) < 8:
        return movers.moving
    seen = [movers.points_world[movers.visible[:, k], k] for k in moving]
    features = np.array([[*p[0], *(p[-1] - p[0])] for p in seen])
    told = HDBSCAN(min_cluster_size=6).fit_predict(features)
    mask = np.zeros_like(movers.moving)
    sizes = {k: movers.travel[moving[told == k]].sum() for k in set(told.tolist()) - {-1}}
    chosen = told == max(sizes, key=lambda k: sizes[k]) if sizes else np.ones(len(moving), bool)
    mask[moving[chosen]] = True
    return mask


def _plain_residuals(
    obs: Observations,
    model: Model,
    *_: object,
    **__: object,
) -> tuple[Array, Array, Array]:
    z = pull_back(obs.points, obs.weight, model.kind == "revolute", model.axis, model.pivot, model.state)
    marks = weighted_means(z, obs.weight)
    return squared_residuals(z, obs.weight, marks), obs.weight, marks


def _alike(value: Array, terms: Terms) -> tuple[Array, Array]:
    weight = np.full(len(value), 1.0 / float(np.median(terms.sigma)) ** 2 if len(value) else 1.0)
    count = len(terms.normals)
    total = np.bincount(terms.term, weight, count)
    return weight, np.bincount(terms.term, weight * value, count) / np.maximum(total, 1e-12)

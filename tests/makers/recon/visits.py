"""A recording of several visits to furniture: clips one after the other, each an interaction of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from recon.interaction.interaction import Interaction
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.found import FoundParts, PartTracks
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from recon.windows.windows import Window
from tests.makers.recon.cabinets import Clip
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Trajectory

COVARIANCE = np.diag([1e-4, 1e-4, 1e-6, 1e-6])


@dataclass(frozen=True, eq=False)
class Visit:
    """A clip, seen forwards or backwards, its cameras moved by a pose (4, 4); how its states count."""

    clip: Clip
    back: bool = False
    T: Array | None = None
    sign: float = 1.0


def visits_of(
    visits: Sequence[Visit], gap: int = 0, dark: bool = False
) -> tuple[Recording, Trajectory, tuple[Interaction, ...]]:
    """One recording of the visits, with `gap` frames after each that show its last one, or nothing: dark."""
    depth, color, poses, interactions = [], [], [], []
    for visit in visits:
        clip, n = visit.clip, len(visit.clip.recording)
        order = np.arange(n)[::-1] if visit.back else np.arange(n)
        T = np.eye(4) if visit.T is None else visit.T
        first = len(depth)
        depth += [clip.recording.depth(int(k)) for k in order]
        color += [clip.recording.color(int(k)) for k in order]
        poses += [T @ clip.cameras.T_world_cam[k] for k in order]
        interactions.append(_interaction(visit, first, order, T))
        for _ in range(gap):
            depth.append(np.zeros_like(depth[-1]) if dark else depth[-1])
            color.append(color[-1])
            poses.append(poses[-1])
    recording = Recording.from_arrays(
        np.stack(color), np.stack(depth), visits[0].clip.recording.intrinsics, fps=15
    )
    cameras = Trajectory(np.arange(len(depth)), recording.times, np.stack(poses))
    return recording, cameras, tuple(interactions)


def _interaction(visit: Visit, first: int, order: Array, T: Array) -> Interaction:
    """What the chain would find of a visit, without an error."""
    clip, n = visit.clip, len(order)
    joint = clip.part.joint.transformed(T)
    state = clip.part.motion.state[order] - clip.part.motion.state[order[0]]
    start = float(clip.part.motion.state[order[0]])
    joint = replace(
        joint if visit.sign > 0 else joint.reversed(), covariance=COVARIANCE[: joint.dof, : joint.dof]
    )
    moving = [(n - 1 - b, n - 1 - a) if visit.back else (a, b) for a, b in clip.part.motion.intervals]
    part = MovingPart(
        2,
        replace(joint, lower=-2.0, upper=2.0),
        replace(clip.part.motion, state=visit.sign * state, intervals=tuple(moving)),
    )
    assert np.isfinite(start)
    none = Movers(np.zeros((n, 0, 3)), np.zeros((n, 0), bool), np.zeros(0, bool), np.zeros(0, bool))
    found = FoundParts(none, (PartTracks(part, np.zeros(0, bool), "motion"),))
    labels = {int(np.flatnonzero(order == f)[0]): image for f, image in clip.labels.items()}
    return Interaction(Window(first, first + n - 1), found, (part,), dict(sorted(labels.items())))


def aside(metres: Array) -> Array:
    """A pose that moves furniture aside."""
    return geo.make_pose(translation=np.asarray(metres, float))

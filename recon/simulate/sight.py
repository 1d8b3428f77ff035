"""What a viewpoint is worth: how much of a part and its grip it sees, and how near it is to things."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.simulate.grip import Grasp
from recon.simulate.mjcf import Articulation
from recon.simulate.ray_caster import Caster
from recon.simulate.surfaces import Surface
from twin.geometry import Array, transform

NEAR_PART = 0.45  # metres that the head keeps from the part's way
NEAR_STATIC = 0.22  # metres that it keeps from furniture
STATES = 5


@dataclass(frozen=True)
class Surroundings:
    """What a viewpoint is judged by: distances to what stands still, and the part at a few states."""

    static: Caster
    at_state: tuple[Caster, ...]
    states: Array
    low: Array
    high: Array


def surroundings(
    scene: Articulation, levels: Array, still: Iterable[Surface], bounds: tuple[Array, Array]
) -> Surroundings:
    """What stands still, and the scene's part on its way through `levels` (n,), rad or m. bounds: the room's
    inner corners (3,), metres."""
    static = _caster([(s.vertices, s.faces) for s in still])
    states = np.linspace(float(levels.min()), float(levels.max()), STATES)
    moving = []
    for s in states:
        pose = scene.pose(s)
        moving.append(_caster([(transform(pose, p.vertices), p.faces) for p in scene.part]))
    return Surroundings(static, tuple(moving), states, *bounds)


def _caster(meshes: list[tuple[Array, NDArray[np.int64]]]) -> Caster:
    out = Caster()
    for vertices, faces in meshes:
        out.add(vertices, faces)
    return out


def sight(scene: Articulation, around: Surroundings, grasp: Grasp, eye: Array) -> float:
    """Share of the states in which the grip is, and of the part's points that are seen; less if bad."""
    if np.any(eye < around.low + 0.2) or np.any(eye > around.high - 0.15):
        return -2.0
    penalty = 2.0 if around.static.distance(eye) < NEAR_STATIC else 0.0
    seen = 0.0
    part = np.concatenate([s.vertices[s.faces].mean(axis=1) for s in scene.part])
    front = part[part @ grasp.outward > np.quantile(part @ grasp.outward, 0.3)][:200]
    for k, state in enumerate(around.states):
        moving = around.at_state[k]
        if moving.distance(eye) < NEAR_PART:
            penalty += 1.0
        pose = scene.pose(float(state))
        grip = transform(pose, (grasp.point + 0.03 * grasp.outward)[None])
        points = np.concatenate([grip, transform(pose, front + 0.004 * grasp.outward)])
        rays = np.concatenate([np.broadcast_to(eye, points.shape), points - eye], axis=1).astype(np.float32)
        free = np.ones(len(points), dtype=bool)
        for caster in (around.static, moving):
            free &= ~caster.blocked(rays, 0.999)
        seen += (0.6 * float(free[0]) + 0.4 * float(free[1:].mean())) / len(around.states)
    return seen - penalty

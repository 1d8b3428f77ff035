"""Up is decided once surfaces and parts are known, by all witnesses, and the world is turned accordingly.

The stages before it work in a world whose up the camera's posture alone tells: a steep view has walls for
floors there. What these stages find doesn't depend on it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.cameras.gravity import shown_axes, surface_normals
from recon.contact.up.evidence import up_evidence
from recon.contact.up.terms import log_likelihood
from recon.fusion.fuse import FusedScene
from recon.interaction.interaction import Interaction
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from recon.recording.said import Said
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.keys import Stage
from twin.scene import Trajectory
from twin.verdict import Reason, reason

UP = Stage("up", 1, ())
# Odds of the best direction against the second that clear up: one wrong in 21, if honest.
ODDS = 20.0


@dataclass(frozen=True, eq=False)
class World:
    """What stands in the world: the cameras, what was found and refined there, and the surfaces.

    interactions: with the ids of `parts`; their parts have joints and states of their own.
    """

    cameras: Trajectory
    interactions: tuple[Interaction, ...]
    parts: tuple[MovingPart, ...]
    fused: FusedScene


@dataclass(frozen=True, eq=False)
class Upright:
    """The direction (3,) of the world as it stands that is up, and why that is doubted, or None."""

    up: Array
    doubt: Reason | None = None


def find_up(
    recording: Recording,
    world: World,
    labels: Mapping[int, NDArray[np.uint8]],
    said: Said,
) -> Upright:
    """The most likely up among the world's z and the other directions of its walls and floors.

    What the user or the device says of up stands. With fewer than two such directions z stands, doubted.
    """
    z = np.array([0.0, 0.0, 1.0])
    if said.up is not None or (recording.gravity_camera0 is not None and world.cameras.pose(0) is not None):
        return Upright(z)
    axes, told = shown_axes(surface_normals(recording, world.cameras))
    if told.sum() < 2:
        if not world.parts:  # refused for that already
            return Upright(z)
        return Upright(z, reason("UpUnsure", "doubtful", 1.0, ODDS, _in_camera(z, world.cameras), ""))
    at_z = int(np.argmax(np.abs(axes[2])))
    level = [axes[:, k] for k in range(3) if k != at_z]
    candidates = [z, *level, *(-v for v in level), -z]
    seen = up_evidence(world.cameras, labels, world.parts, world.fused)
    told_by = [log_likelihood(up, seen) for up in candidates]
    best, second = np.argsort(-np.array(told_by), kind="stable")[:2]
    odds = math.exp(min(told_by[best] - told_by[second], 700.0))
    up = candidates[best]
    if odds >= ODDS:
        return Upright(up)
    other = _in_camera(candidates[second], world.cameras)
    return Upright(up, reason("UpUnsure", "doubtful", odds, ODDS, _in_camera(up, world.cameras), other))


def turned(world: World, up: Array) -> World:
    """The world with `up` (3,) as its z; the same where it is z already."""
    R = geo.rotation_between(up, [0.0, 0.0, 1.0])
    if np.array_equal(R, np.eye(3)):
        return world
    T = geo.make_pose(R)
    meshes = {k: mesh.transformed(T) for k, mesh in world.fused.parts.items()}
    return World(
        world.cameras.transformed(T),
        tuple(i.moved(T) for i in world.interactions),
        tuple(part.moved(T) for part in world.parts),
        FusedScene(world.fused.static.transformed(T), meshes),
    )


def _in_camera(up: Array, cameras: Trajectory) -> str:
    """A direction as --up takes it: in the axes of the first camera."""
    return ",".join(f"{v:.1f}".replace("-0.0", "0.0") for v in cameras.T_world_cam[0, :3, :3].T @ up)

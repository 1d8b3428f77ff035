"""A drawer below a worktop, seen from above: the world that the stages before up leave, by the truth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from recon.cameras.gravity import find_gravity
from recon.contact.up.decide import World
from recon.fusion.fuse import FusedScene
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.found import FoundParts, PartTracks
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from tests.makers.recon.cabinets import CAMERA, cast, furniture
from tests.makers.recon.judged import as_one
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import STATIC_LABEL, Motion, Trajectory

FRAMES, OPEN, NEAR = 10, 0.3, 0.75


@dataclass(frozen=True, eq=False)
class Steep:
    """A recording, its world as gravity leaves it, and the true up (3,) in that world."""

    recording: Recording
    world: World
    up: Array


def look(pitch_deg: float, target: Array) -> Array:
    """Pose (4, 4) of a level camera that looks down at a point by so many degrees, straight at the fronts."""
    p = np.radians(pitch_deg)
    z = np.array([0.0, np.cos(p), -np.sin(p)])
    x = np.array([1.0, 0.0, 0.0])
    return geo.make_pose(np.stack([x, np.cross(z, x), z], axis=1), target - NEAR * z)


@cache
def steep(pitch_deg: float, with_part: bool = True) -> Steep:
    """The drawer is pulled out in the middle of the recording."""
    joint, mesh, static, _, _ = furniture("drawer", "edge")
    state = OPEN * np.clip((np.arange(FRAMES) - 3) / 4.0, 0.0, 1.0)
    pose = look(pitch_deg, np.array([0.0, -0.1, 1.4]))
    depth = [
        cast([(STATIC_LABEL, static), (2, mesh.transformed(joint.pose(float(s))))], pose)[0] for s in state
    ]
    color = np.zeros((FRAMES, CAMERA.height, CAMERA.width, 3), np.uint8)
    recording = Recording.from_arrays(color, np.stack(depth), CAMERA, fps=15)
    frames = np.arange(FRAMES)
    start = Trajectory(frames, recording.times, np.tile(np.eye(4), (FRAMES, 1, 1)))
    guessed = geo.make_pose(find_gravity(recording, start).R_world_start)
    T = guessed @ geo.invert_pose(pose)  # the true world to the guessed one
    part = MovingPart(2, joint.transformed(T), Motion(frames, recording.times, state, ((3, 7),)))
    points = np.full((FRAMES, 1, 3), np.nan)
    points[4:] = [0.1, 0.2, 0.3]
    seen = np.isfinite(points[..., 0])
    movers = Movers(points, seen, np.ones(1, bool), np.ones(1, bool))
    parts = (part,) if with_part else ()
    found = FoundParts(movers, tuple(PartTracks(p, np.ones(1, bool), "motion") for p in parts))
    fused = FusedScene(static.transformed(T), {2: mesh.transformed(T)} if with_part else {})
    return Steep(
        recording, World(start.transformed(guessed), as_one(recording, found), parts, fused), T[:3, 2]
    )

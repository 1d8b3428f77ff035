"""The hand's path: in from below the view, around the handle, along with the part, and out again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from recon.simulate.config import SimulateConfig
from recon.simulate.grip import Grasp
from recon.simulate.hand import WRIST
from recon.simulate.mjcf import Articulation
from recon.simulate.timeline import Timeline, minimum_jerk
from twin.geometry import Array, exp_so3, make_pose, transform, unit

CLOSURES = 7  # shapes between the open and the closed hand
OUTSIDE = np.array([0.26, 0.46, 0.26])  # where the hand waits, in the camera: below and right of the view
SHOULDER = np.array([0.24, 0.50, -0.02])  # right, down, forward of the head; low, as a raised elbow hangs
STANDOFF = 0.10  # metres before the handle at which the hand lines up


@dataclass(frozen=True)
class HandMotion:
    """Per frame: T_world_hand and T_world_arm (frames, 4, 4), closure 0..1 (frames,), whether it is there."""

    T_world_hand: Array
    T_world_arm: Array
    closure: Array
    present: tuple[bool, ...]


def grip_pose(grasp: Grasp, eye: Array) -> Array:
    """T_world_hand (4, 4) at the closed part: z along the bar (thumb up, or to the left), y into the part."""
    forward = -grasp.outward
    left = np.cross([0.0, 0.0, 1.0], unit((grasp.point - eye) * [1.0, 1.0, 0.0]))
    along = grasp.bar
    if abs(along[2]) > 0.5:
        along = along * np.sign(along[2])
    elif along @ left < 0.0:
        along = -along
    return make_pose(np.stack([np.cross(forward, along), forward, along], axis=1), grasp.point)


def hand_motion(
    scene: Articulation,
    grasp: Grasp,
    timeline: Timeline,
    states: Array,
    cameras: Array,
    config: SimulateConfig,
) -> HandMotion:
    """The whole path for camera poses T_world_camera (frames, 4, 4) and part states (frames,)."""
    T_start = grip_pose(grasp, cameras[timeline.grasp, :3, 3])
    held = np.stack([_held(scene, grasp, T_start, float(s), config.wrist_turn) for s in states])
    poses = held.copy()
    closure = np.ones(timeline.frames)
    for i in range(timeline.enter, timeline.grasp):
        t = (i - timeline.enter + 0.5) / (timeline.grasp - timeline.enter)
        poses[i] = _approach(held[timeline.grasp], cameras[timeline.enter], t)
        closure[i] = minimum_jerk((t - 0.62) / 0.38)
    for i in range(timeline.release + 1, timeline.gone):
        t = (i - timeline.release) / (timeline.gone - timeline.release)
        poses[i] = _approach(held[timeline.release], cameras[timeline.gone], 1.0 - t)
        closure[i] = minimum_jerk((1.0 - t - 0.62) / 0.38)
    arms = np.stack([_arm(p, c) for p, c in zip(poses, cameras, strict=True)])
    present = tuple(timeline.enter <= i < timeline.gone for i in range(timeline.frames))
    return HandMotion(poses, arms, np.round(closure * (CLOSURES - 1)) / (CLOSURES - 1), present)


def _held(scene: Articulation, grasp: Grasp, T_start: Array, state: float, wrist_turn: float) -> Array:
    """The holding hand: its grip point stays on the bar, but it turns by `wrist_turn` of the part's angle.

    A bar across the joint's axis can't turn in the fist: then the hand turns with the part.
    """
    T_part = scene.pose(state)
    if scene.kind == "prismatic":
        return T_part @ T_start
    share = wrist_turn if abs(float(grasp.bar @ scene.axis)) > 0.7 else 1.0
    turn = exp_so3(scene.axis * state * share)
    return make_pose(turn @ T_start[:3, :3], transform(T_part, grasp.point[None])[0])


def _approach(T_grip: Array, camera: Array, t: float) -> Array:
    """Pose at share `t` of the way from outside the view (0) over the line-up point to the grip (1)."""
    outside = transform(camera, OUTSIDE[None])[0]
    before = T_grip[:3, 3] - STANDOFF * T_grip[:3, 1]
    far, near = minimum_jerk(t / 0.72), minimum_jerk((t - 0.45) / 0.55)
    position = outside + far * (before - outside) + near * (T_grip[:3, 3] - before)
    relaxed = Rotation.from_matrix(T_grip[:3, :3]) * Rotation.from_euler(
        "xyz", [-18.0, 12.0, 10.0], degrees=True
    )
    between = Slerp([0.0, 1.0], Rotation.concatenate([relaxed, Rotation.from_matrix(T_grip[:3, :3])]))
    return make_pose(between(float(far)).as_matrix(), position)


def _arm(T_world_hand: Array, camera: Array) -> Array:
    """T_world_arm: from the wrist towards the shoulder, a little bent by the hand's own direction."""
    wrist = transform(T_world_hand, WRIST[None])[0]
    forward = unit(camera[:3, 2] * [1.0, 1.0, 0.0])
    right = np.cross(forward, [0.0, 0.0, 1.0])
    shoulder = (
        camera[:3, 3] + SHOULDER[0] * right - SHOULDER[1] * np.array([0, 0, 1.0]) + SHOULDER[2] * forward
    )
    along = unit(0.82 * unit(shoulder - wrist) - 0.18 * T_world_hand[:3, 1])
    up = unit(np.array([0.0, 0.0, 1.0]) - along[2] * along)
    return make_pose(np.stack([np.cross(along, up), along, up], axis=1), wrist)

"""The hand's path: in from beside the view, around the handle, along with the part, and out again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from recon.simulate.config import Staging
from recon.simulate.grip import Grasp
from recon.simulate.hand import WRIST
from recon.simulate.mjcf import Articulation
from recon.simulate.timeline import Timeline, minimum_jerk
from twin.geometry import Array, exp_so3, make_pose, transform, unit

CLOSURES = 7  # shapes between the open and the closed hand
OUTSIDE = np.array([0.26, 0.46, 0.26])  # where the hand waits, in the camera: below and right of the view
SHOULDER = np.array([0.24, 0.50, -0.02])  # right, down, forward of the head; low, as a raised elbow hangs
STANDOFF = 0.10  # metres before the handle at which the hand lines up
RELAXED = (-18.0, 12.0, 10.0)  # degrees about x, y, z of the grip frame while the right hand comes


@dataclass(frozen=True)
class HandMotion:
    """Per frame: T_world_hand and T_world_arm (frames, 4, 4), closure 0..1 (frames,), whether it is there."""

    T_world_hand: Array
    T_world_arm: Array
    closure: Array
    present: tuple[bool, ...]

    def during(self, first: int, last: int) -> HandMotion:
        """The frames [first, last)."""
        cut = slice(first, last)
        return HandMotion(self.T_world_hand[cut], self.T_world_arm[cut], self.closure[cut], self.present[cut])


@dataclass(frozen=True)
class Arm:
    """Which hand, whence: `sign` 1 right, -1 left; `outside` and `shoulder` (3,) as OUTSIDE, SHOULDER."""

    sign: float
    outside: Array
    shoulder: Array

    @staticmethod
    def of(config: Staging) -> Arm:
        """The arm that a configuration asks for."""
        sign = 1.0 if config.hand_side == "right" else -1.0
        if config.hand_from_deg is None:
            return Arm(sign, OUTSIDE * [sign, 1.0, 1.0], SHOULDER * [sign, 1.0, 1.0])
        angle = np.radians(config.hand_from_deg)
        across = np.array([np.cos(angle), np.sin(angle)])
        outside, shoulder = (np.hypot(v[0], v[1]) * across for v in (OUTSIDE, SHOULDER))
        return Arm(sign, np.array([*outside, OUTSIDE[2]]), np.array([*shoulder, SHOULDER[2]]))


def grip_pose(grasp: Grasp, eye: Array, sign: float = 1.0) -> Array:
    """T_world_hand (4, 4) at the closed part: z along the bar (thumb up or to the other), y into it."""
    forward = -grasp.outward
    inwards = sign * np.cross([0.0, 0.0, 1.0], unit((grasp.point - eye) * [1.0, 1.0, 0.0]))
    along = grasp.bar
    if abs(along[2]) > 0.5:
        along = along * np.sign(along[2])
    elif along @ inwards < 0.0:
        along = -along
    return make_pose(np.stack([np.cross(forward, along), forward, along], axis=1), grasp.point)


def holding(scene: Articulation, grasp: Grasp, T_start: Array, states: Array, wrist_turn: float) -> Array:
    """T_world_hand (frames, 4, 4) of a hand that holds the part, T_start where it is at state 0."""
    return np.stack([_held(scene, grasp, T_start, float(s), wrist_turn) for s in states])


def hand_motion(
    held: Array, timeline: Timeline, cameras: Array, arm: Arm, reaches: bool = True
) -> HandMotion:
    """The whole path of one interaction for `held`, T_world_hand (frames, 4, 4) of a hand that never lets go,
    and camera poses T_world_camera (frames, 4, 4). reaches: whether it is ever there.
    """
    poses = held.copy()
    closure = np.ones(timeline.frames)
    for i in range(timeline.enter, timeline.grasp):
        t = (i - timeline.enter + 0.5) / (timeline.grasp - timeline.enter)
        poses[i] = _approach(held[timeline.grasp], cameras[timeline.enter], t, arm)
        closure[i] = minimum_jerk((t - 0.62) / 0.38)
    for i in range(timeline.release + 1, timeline.gone):
        t = (i - timeline.release) / (timeline.gone - timeline.release)
        poses[i] = _approach(held[timeline.release], cameras[timeline.gone], 1.0 - t, arm)
        closure[i] = minimum_jerk((1.0 - t - 0.62) / 0.38)
    arms = np.stack([_arm(p, c, arm) for p, c in zip(poses, cameras, strict=True)])
    present = tuple(reaches and timeline.enter <= i < timeline.gone for i in range(timeline.frames))
    return HandMotion(poses, arms, np.round(closure * (CLOSURES - 1)) / (CLOSURES - 1), present)


def one_after_the_other(motions: Sequence[HandMotion]) -> HandMotion:
    """The same hand in several interactions; between two of them it is as the one before left it."""
    first, *later = motions
    hands, arms, closure = first.T_world_hand.copy(), first.T_world_arm.copy(), first.closure.copy()
    present = np.array(first.present)
    for motion in later:
        there = np.array(motion.present)
        hands[there], arms[there] = motion.T_world_hand[there], motion.T_world_arm[there]
        closure[there] = motion.closure[there]
        present |= there
    return HandMotion(hands, arms, closure, tuple(bool(p) for p in present))


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


def _approach(T_grip: Array, camera: Array, t: float, arm: Arm) -> Array:
    """Pose at share `t` of the way from outside the view (0) over the line-up point to the grip (1)."""
    outside = transform(camera, arm.outside[None])[0]
    before = T_grip[:3, 3] - STANDOFF * T_grip[:3, 1]
    far, near = minimum_jerk(t / 0.72), minimum_jerk((t - 0.45) / 0.55)
    position = outside + far * (before - outside) + near * (T_grip[:3, 3] - before)
    turn = np.array(RELAXED) * [1.0, arm.sign, arm.sign]
    relaxed = Rotation.from_matrix(T_grip[:3, :3]) * Rotation.from_euler("xyz", turn, degrees=True)
    between = Slerp([0.0, 1.0], Rotation.concatenate([relaxed, Rotation.from_matrix(T_grip[:3, :3])]))
    return make_pose(between(float(far)).as_matrix(), position)


def _arm(T_world_hand: Array, camera: Array, arm: Arm) -> Array:
    """T_world_arm: from the wrist towards the shoulder, a little bent by the hand's own direction."""
    wrist = transform(T_world_hand, (WRIST * [arm.sign, 1.0, 1.0])[None])[0]
    shoulder = shoulder_place(camera, arm)
    along = unit(0.82 * unit(shoulder - wrist) - 0.18 * T_world_hand[:3, 1])
    up = unit(np.array([0.0, 0.0, 1.0]) - along[2] * along)
    return make_pose(np.stack([np.cross(along, up), along, up], axis=1), wrist)


def shoulder_place(camera: Array, arm: Arm) -> Array:
    """The shoulder (3,) in the world, of a person whose head is the camera."""
    forward = unit(camera[:3, 2] * [1.0, 1.0, 0.0])
    right = np.cross(forward, [0.0, 0.0, 1.0])
    across, down, ahead = arm.shoulder
    return np.asarray(camera[:3, 3] + across * right - down * np.array([0, 0, 1.0]) + ahead * forward)

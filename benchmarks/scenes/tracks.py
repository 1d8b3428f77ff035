"""Closed-form scenes with exact truth: point tracks and poses of one or several moving parts.

The track recipe is public: 40 frames, 200 tracks, 5 mm isotropic noise, minimum-jerk motion over frames 6..33
with rest before and after, a door 0.55 x 0.7 m opened by 70 degrees or a drawer pulled by 0.30 m, random yaw
and offset in a 4 m room, each track seen in a random window of 45..100 % of the clip with 10 % drop-out, 20 %
outliers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Prismatic, Revolute

Outliers = Literal["none", "static", "drift", "mixed", "obs", "hand"]
PartName = Literal["door", "drawer"]


@dataclass(frozen=True, eq=False)
class TrackScene:
    """Tracks and their truth: points (T, K, 3) with NaN where not visible (T, K), the true joint, its state
    (T,), which tracks (K,) are the part's, and the part's points (K, 3) at state 0 (NaN for others)."""

    points: Array
    visible: NDArray[np.bool_]
    joint: Prismatic | Revolute
    state: Array
    member: NDArray[np.bool_]
    rest_points: Array


def minimum_jerk(frames: int, first: int = 6, last: int = 33) -> Array:
    """Share (frames,) of a motion done: 0 until `first`, 1 from `last`, 10 s^3 - 15 s^4 + 6 s^5 between."""
    s = np.clip((np.arange(frames) - first) / max(last - first, 1), 0.0, 1.0)
    return np.asarray(10 * s**3 - 15 * s**4 + 6 * s**5)


def random_room_pose(rng: np.random.Generator) -> Array:
    """T_room_part (4, 4): random yaw about the vertical, somewhere in a 4 m room."""
    yaw = rng.uniform(-np.pi, np.pi)
    return geo.make_pose(geo.exp_so3([0, 0, yaw]), [*rng.uniform(-2, 2, 2), rng.uniform(0.2, 1.2)])


def make_part(
    name: PartName, travel: float, count: int, rng: np.random.Generator
) -> tuple[Prismatic | Revolute, Array]:
    """A joint in a random place and `count` points (count, 3) of its part at state 0: a door panel with its
    hinge at one edge, or the front and the sides of a drawer."""
    place = random_room_pose(rng)
    if name == "door":
        local = np.stack(
            [rng.uniform(0, 0.55, count), rng.normal(0, 0.01, count), rng.uniform(-0.35, 0.35, count)], 1
        )
        pivot = geo.transform(place, np.zeros((1, 3)))[0]
        joint: Prismatic | Revolute = Revolute(
            axis=geo.unit(geo.rotate(place, [0, 0, 1.0])), pivot=pivot, upper=travel
        )
    else:
        depth = np.where(rng.random(count) < 0.6, 0.0, rng.uniform(0, 0.35, count))
        local = np.stack([rng.uniform(-0.25, 0.25, count), depth, rng.uniform(-0.1, 0.1, count)], 1)
        joint = Prismatic(axis=geo.unit(geo.rotate(place, [0, -1.0, 0])), upper=travel)
    return joint, geo.transform(place, local)


def moved_points(joint: Prismatic | Revolute, state: Array, rest: Array) -> Array:
    """Points (T, K, 3) of a part with rest points (K, 3) at states (T,)."""
    return np.stack([geo.transform(pose, rest) for pose in joint.poses(state)])


def visibility(frames: int, count: int, rng: np.random.Generator, dropout: float = 0.1) -> NDArray[np.bool_]:
    """(frames, count): a random window of 45..100 % of the clip for each track, less random drop-out."""
    length = np.ceil(rng.uniform(0.45, 1.0, count) * frames)
    start = rng.uniform(0, 1, count) * (frames - length)
    t = np.arange(frames)[:, None]
    return np.asarray(
        (t >= np.floor(start)) & (t < np.floor(start) + length) & (rng.random((frames, count)) >= dropout)
    )


def hand_tracks(
    joint: Prismatic | Revolute, state: Array, rest: Array, count: int, rng: np.random.Generator
) -> Array:
    """Tracks (T, count, 3) of a hand which holds the part's outermost point and turns against it by 0.55 of
    the hinge's angle (of 0.7 rad on a slide), with a wobble of 5 mm."""
    if isinstance(joint, Revolute):
        radius = np.linalg.norm(np.cross(rest - joint.pivot, joint.axis), axis=1)
        grip = rest[int(np.argmax(radius))]
        turn = -0.55 * state
        about = joint.axis
    else:
        grip = rest[0]
        turn = 0.7 * state / max(float(np.ptp(state)), 1e-9)
        about = geo.unit(np.cross(joint.axis, [0.3, 0.2, 0.9]))
    held = moved_points(joint, state, grip[None])[:, 0]
    local = rng.uniform(-0.06, 0.06, (count, 3))
    out = np.empty((len(state), count, 3))
    for t, pose in enumerate(joint.poses(state)):
        r = pose[:3, :3] @ geo.exp_so3(about * turn[t])
        out[t] = held[t] + local @ r.T
    wobble = np.cumsum(rng.normal(0, 0.0015, (len(state), 1, 3)), axis=0)
    return np.asarray(out + np.clip(wobble, -0.005, 0.005))


def track_scene(
    part: PartName,
    outliers: Outliers = "mixed",
    *,
    seed: int = 0,
    travel: float | None = None,
    frames: int = 40,
    tracks: int = 200,
    noise: float = 0.005,
    outlier_share: float = 0.2,
    background_share: float = 0.0,
) -> TrackScene:
    """The public recipe. outliers: `static` background, `drift` (20 mm/frame random walk), `mixed` half each,
    `obs` (that share of single observations gets N(0, 0.15 m)), `hand` (tracks of the hand that holds the
    part). background_share: additional share of all tracks that is static background, before outliers are
    drawn."""
    rng = np.random.default_rng(seed)
    reach = travel if travel is not None else (np.radians(70.0) if part == "door" else 0.30)
    joint, rest = make_part(part, reach, tracks, rng)
    state = reach * minimum_jerk(frames)
    points = moved_points(joint, state, rest)
    member = np.ones(tracks, dtype=bool)
    order = rng.permutation(tracks)
    still = order[: round(background_share * tracks)]
    rest_of = order[len(still) :]
    odd = rest_of[: round(outlier_share * len(rest_of))] if outliers not in ("none", "obs") else rest_of[:0]
    centre = rest.mean(axis=0)
    if outliers == "static":
        still, odd = np.concatenate([still, odd]), odd[:0]
    elif outliers == "mixed":
        still, odd = np.concatenate([still, odd[::2]]), odd[1::2]
    member[still] = member[odd] = False
    points[:, still] = centre + rng.uniform(-1.0, 1.0, (len(still), 3))
    if outliers == "hand":
        points[:, odd] = hand_tracks(joint, state, rest, len(odd), rng)
    elif len(odd):
        walk = np.cumsum(rng.normal(0, 0.02, (frames, len(odd), 3)), axis=0)
        points[:, odd] = centre + rng.uniform(-0.5, 0.5, (len(odd), 3)) + walk
    points = points + rng.normal(0, noise, points.shape)
    if outliers == "obs":
        wild = rng.random((frames, tracks)) < outlier_share
        points[wild] += rng.normal(0, 0.15, (int(wild.sum()), 3))
    visible = visibility(frames, tracks, rng)
    points[~visible] = np.nan
    rest[~member] = np.nan
    return TrackScene(points, visible, joint, state, member, rest)


def together(*scenes: TrackScene) -> tuple[Array, NDArray[np.bool_]]:
    """Points (T, K, 3) and visibility (T, K) of several scenes of equal length as one recording, in their
    order."""
    return (
        np.concatenate([s.points for s in scenes], axis=1),
        np.concatenate([s.visible for s in scenes], axis=1),
    )


def moved_scene(scene: TrackScene, T_new_old: Array) -> TrackScene:
    """The same scene in another world frame."""
    rest = np.full_like(scene.rest_points, np.nan)
    rest[scene.member] = geo.transform(T_new_old, scene.rest_points[scene.member])
    points = np.full_like(scene.points, np.nan)
    points[scene.visible] = geo.transform(T_new_old, scene.points[scene.visible])
    return TrackScene(
        points, scene.visible, scene.joint.transformed(T_new_old), scene.state, scene.member, rest
    )


def part_poses(
    joint: Prismatic | Revolute,
    state: Array,
    rng: np.random.Generator,
    noise: float = 0.0,
    noise_rad: float = 0.0,
    wild_share: float = 0.0,
) -> Array:
    """Poses T_world_part (N, 4, 4) of a body on the part about half a metre from the joint, in its own axes;
    noise at the body's origin, and a share of poses that are wild (0.15 m, 20 degrees)."""
    origin = np.zeros(3) if isinstance(joint, Prismatic) else np.array(joint.pivot)
    sideways = geo.orthogonal_basis(joint.axis)[:, 0]
    body = geo.make_pose(geo.exp_so3(rng.normal(0, 1, 3)), origin + 0.45 * sideways + 0.1 * joint.axis)
    scale = np.array([noise] * 3 + [noise_rad] * 3)
    poses = joint.poses(state) @ body @ geo.exp_se3(rng.normal(0, 1, (len(state), 6)) * scale)
    wild = rng.random(len(state)) < wild_share
    poses[wild] = poses[wild] @ geo.exp_se3(
        rng.normal(0, 1, (int(wild.sum()), 6)) * ([0.15] * 3 + [0.35] * 3)
    )
    return np.asarray(poses)

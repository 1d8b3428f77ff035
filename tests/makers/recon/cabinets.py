"""Recordings in memory of a cabinet with a door, a drawer or a sliding door that a fist opens, ray-cast in
closed form."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics, Recording
from tests.makers.recon.tiny import box, merged
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import HAND_LABEL, STATIC_LABEL, Joint, Mesh, Motion, Prismatic, Revolute, Trajectory

Kind = Literal["door", "drawer", "slide"]
Grip = Literal["bar", "knob", "edge"]

FRAMES, EVERY = 26, 2
CAMERA = Intrinsics(200, 150, 150.0, 150.0, 99.5, 74.5)
TRAVEL = {"door": 1.2, "drawer": 0.3, "slide": 0.45}
BAR = 0.014  # m, thickness
FRONT = -0.018  # y of the fronts


@dataclass(frozen=True, eq=False)
class Clip:
    """A recording with what earlier stages would know of it, and the truth. part, mesh: counted from the
    first frame.

    true_joint: from the closed end, opening positive. opening (n,): true states. grip: (3,) in the part's
    frame at the first frame, and its distance from the part's surface.
    """

    recording: Recording
    cameras: Trajectory
    labels: dict[int, NDArray[np.uint8]]
    part: MovingPart
    mesh: Mesh
    static: Mesh
    true_joint: Joint
    opening: Array
    grip: Array
    grip_depth: float


def carcass() -> list[Mesh]:
    """A hollow cabinet behind the front, and neighbours to its left and right whose fronts are level with its
    own."""
    return [
        box((-0.31, 0.2, 1.15), (0.018, 0.4, 0.72)),
        box((0.31, 0.2, 1.15), (0.018, 0.4, 0.72)),
        box((0, 0.2, 1.51), (0.62, 0.4, 0.018)),
        box((0, 0.2, 0.79), (0.62, 0.4, 0.018)),
        box((0, 0.4, 1.15), (0.62, 0.01, 0.72)),
        box((-0.625, 0.19, 1.15), (0.6, 0.41, 0.7)),
        box((0.625, 0.19, 1.15), (0.6, 0.41, 0.7)),
        box((0, 0.7, 1.2), (4.0, 0.1, 2.4)),
        box((0, -0.5, 0), (4.0, 3.0, 0.02)),
    ]


def handle(grip: Grip, at: Array, upright: bool) -> list[Mesh]:
    """A bar or a knob whose middle is at `at`, 4 cm in front of the front."""
    x, y, z = at
    if grip == "edge":
        return []
    if grip == "knob":
        return [box((x, y, z), (0.034, 0.02, 0.034)), box((x, y + 0.025, z), (0.012, 0.03, 0.012))]
    long = np.array([0, 0, 1.0]) if upright else np.array([1.0, 0, 0])
    size = np.where(long > 0, 0.2, BAR)
    posts = [box(tuple(at + s * 0.085 * long + [0, 0.02, 0]), (0.01, 0.04, 0.01)) for s in (-1, 1)]
    return [box((x, y, z), tuple(size)), *posts]


def furniture(kind: Kind, grip: Grip) -> tuple[Joint, Mesh, Mesh, Array, bool]:
    """Joint, part and static mesh at the closed state, grip centre, and whether the bar stands upright."""
    upright = kind != "drawer"
    y = FRONT - 0.04
    static = carcass()
    if kind == "door":
        at = np.array([0.25, y, 1.2])
        joint: Joint = Revolute(np.array([0, 0, -1.0]), pivot=np.array([-0.3, FRONT, 1.15]))
        panels = [box((0, FRONT / 2, 1.15), (0.596, 0.018, 0.7))]
    elif kind == "drawer":
        at = np.array([0.05, y, 1.4])
        joint = Prismatic(np.array([0, -1.0, 0]))
        panels = [
            box((0, FRONT / 2, 1.4), (0.596, 0.018, 0.2)),
            box((0, 0.18, 1.33), (0.56, 0.35, 0.012)),
            box((-0.27, 0.18, 1.38), (0.012, 0.35, 0.12)),
            box((0.27, 0.18, 1.38), (0.012, 0.35, 0.12)),
            box((0, 0.35, 1.38), (0.56, 0.012, 0.12)),
        ]
        static.append(box((0, 0.19, 1.05), (0.6, 0.41, 0.49)))
    else:
        at = np.array([-0.22, y - 0.022, 1.2])
        joint = Prismatic(np.array([1.0, 0, 0]))
        panels = [box((0, 1.5 * FRONT - 0.004, 1.15), (0.6, 0.018, 0.7))]
    if grip == "edge":
        at = np.array([0.29, FRONT / 2, 1.2])
    return joint, merged(*panels, *handle(grip, at, upright)), merged(*static), at, upright


def cast(meshes: list[tuple[int, Mesh]], T_world_cam: Array) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Depth and label image."""
    scene = o3d.t.geometry.RaycastingScene()
    for _, mesh in meshes:
        scene.add_triangles(
            o3d.core.Tensor.from_numpy(mesh.vertices.astype(np.float32)),
            o3d.core.Tensor.from_numpy(mesh.faces.astype(np.uint32)),
        )
    y, x = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = geo.rotate(T_world_cam, CAMERA.backproject(np.stack([x, y], -1).astype(float), np.ones(x.shape)))
    origin = np.broadcast_to(T_world_cam[:3, 3], rays.shape)
    hit = scene.cast_rays(o3d.core.Tensor.from_numpy(np.concatenate([origin, rays], -1).astype(np.float32)))
    depth, ids = hit["t_hit"].numpy(), hit["geometry_ids"].numpy()
    seen = np.isfinite(depth)
    table = np.array([*(k for k, _ in meshes), 0], dtype=np.uint8)
    return np.where(seen, depth, 0).astype(np.float32), table[np.where(seen, ids, len(meshes))]


# What each label looks like, RGB
PAINT = np.zeros((256, 3), np.uint8)
PAINT[[STATIC_LABEL, 2, HAND_LABEL]] = (90, 90, 90), (150, 140, 120), (220, 180, 160)


def fist(grip: Array, upright: bool) -> Mesh:
    """A fist around the grip, and a forearm that leads to the wearer."""
    long = np.array([0, 0, 1.0]) if upright else np.array([1.0, 0, 0])
    size = np.where(long > 0, 0.09, 0.065)
    arm = box(tuple(grip + [0.02, -0.22, -0.04]), (0.07, 0.36, 0.07))
    return merged(box(tuple(grip + [0, -0.012, 0]), tuple(size)), arm)


@cache
def make_clip(
    kind: Kind, grip: Grip = "bar", *, backwards: bool = False, hand: bool = True, axis_sign: int = 1
) -> Clip:
    """A clip of `FRAMES` frames, every `EVERY`-th labelled. axis_sign -1 hands out the joint with its axis
    reversed."""
    if axis_sign < 0:
        clip = make_clip(kind, grip, backwards=backwards, hand=hand)
        given, motion = clip.part.joint, clip.part.motion
        part = replace(
            clip.part, joint=replace(given, axis=-given.axis), motion=replace(motion, state=-motion.state)
        )
        return replace(clip, part=part)
    joint, mesh, static, at, upright = furniture(kind, grip)
    u = np.clip((np.arange(FRAMES) - 7) / 11.0, 0, 1)
    opening = TRAVEL[kind] * u**3 * (10 - 15 * u + 6 * u**2)
    opening = opening[::-1].copy() if backwards else opening
    rng = np.random.default_rng(3)
    depths, colors, labels, poses = [], [], {}, []
    for i in range(FRAMES):
        eye = np.array([0.35 + 0.04 * np.sin(i / 5), -1.0 + 0.02 * np.cos(i / 4), 1.75])
        z = geo.unit(np.array([0.05, 0, 1.2]) - eye)
        x = geo.unit(np.cross(z, [0, 0, 1.0]))
        T = geo.make_pose(np.stack([x, np.cross(z, x), z], axis=1), eye)
        moved = joint.pose(float(opening[i]))
        meshes = [(STATIC_LABEL, static), (2, mesh.transformed(moved))]
        if hand and 5 <= i <= 20:
            meshes.append((HAND_LABEL, fist(at, upright).transformed(moved)))
        depth, label = cast(meshes, T)
        depths.append(np.where(depth > 0, depth + rng.normal(0, 0.002, depth.shape), 0).astype(np.float32))
        colors.append(PAINT[label])
        poses.append(T)
        if i % EVERY == 0:
            labels[i] = label
    times = np.arange(FRAMES) / 15.0
    recording = Recording("cabinet", "memory", times, CAMERA, lambda i: colors[i], lambda i: depths[i], "0")
    frames = np.arange(FRAMES)
    first = joint.pose(float(opening[0]))
    part = MovingPart(2, joint, Motion(frames, times, opening - opening[0], ((8, 17),)))
    return Clip(
        recording,
        Trajectory(frames, times, np.stack(poses)),
        labels,
        part,
        mesh.transformed(first),
        static,
        replace(joint, upper=TRAVEL[kind]),
        opening,
        geo.transform(first, at[None])[0],
        {"bar": BAR / 2, "knob": 0.01, "edge": 0.009}[grip],
    )

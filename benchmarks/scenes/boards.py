"""Closed-form twins made of boards: every length, pivot, hull and mass is known exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import (
    Box,
    ContactPath,
    Inertial,
    Joint,
    Mesh,
    Motion,
    Part,
    PartPhysics,
    Prismatic,
    Quantity,
    Recorded,
    Revolute,
    StaticPart,
    Trajectory,
    Twin,
)

BOARD = 0.018
GAP = 0.003  # between a front and what surrounds it
DENSITY = 700.0
WOOD, FRONT, METAL = (176, 138, 96), (226, 224, 214), (92, 96, 102)

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
_FACES = np.concatenate([_QUADS[:, [0, 1, 2]], _QUADS[:, [0, 2, 3]]])


@dataclass(frozen=True)
class Board:
    """Axis-aligned solid box from `low` to `high` (3,) m in the cabinet's frame (x right, y into it, z
    up)."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    color: tuple[int, int, int] = WOOD

    @property
    def size(self) -> Array:
        return np.array(self.high) - np.array(self.low)

    @property
    def center(self) -> Array:
        return (np.array(self.high) + np.array(self.low)) / 2

    def box(self, T_world_cabinet: Array) -> Box:
        return Box(T_world_cabinet @ geo.make_pose(translation=self.center), self.size)


def boards_mesh(boards: list[Board], T_world_cabinet: Array | None = None, cut: int = 1) -> Mesh:
    """All board surfaces in one mesh, outward normals, coloured; `cut` halves every triangle's edges that
    often."""
    vertices = np.concatenate([b.low + _CORNERS * b.size for b in boards])
    faces = np.concatenate([_FACES + 8 * k for k in range(len(boards))])
    colors = np.repeat(np.array([b.color for b in boards], np.uint8), 8, axis=0)
    for _ in range(cut):
        vertices, faces, colors = _subdivided(vertices, faces, colors)
    mesh = Mesh(vertices, faces.astype(np.int32), colors)
    return mesh if T_world_cabinet is None else mesh.transformed(T_world_cabinet)


def _subdivided(v: Array, f: Array, c: Array) -> tuple[Array, Array, Array]:
    edges = np.sort(np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]), axis=1)
    unique, back = np.unique(edges, axis=0, return_inverse=True)
    mid = len(v) + back.reshape(3, -1).T
    a, b, d = f.T
    new = [[a, mid[:, 0], mid[:, 2]], [mid[:, 0], b, mid[:, 1]], [mid[:, 2], mid[:, 1], d], list(mid.T)]
    faces = np.concatenate([np.stack(t, axis=1) for t in new])
    return np.concatenate([v, v[unique].mean(1)]), faces, np.concatenate([c, c[unique[:, 0]]])


def boards_inertial(boards: list[Board], T_world_cabinet: Array, density: float = DENSITY) -> Inertial:
    """Exact mass, centre and tensor of solid boards."""
    masses = np.array([density * np.prod(b.size) for b in boards])
    centers = np.array([b.center for b in boards])
    com = masses @ centers / masses.sum()
    tensor = np.zeros((3, 3))
    for m, c, b in zip(masses, centers, boards, strict=True):
        d, s2 = c - com, b.size**2
        tensor += m / 12 * np.diag([s2[1] + s2[2], s2[0] + s2[2], s2[0] + s2[1]])
        tensor += m * (d @ d * np.eye(3) - np.outer(d, d))
    r = T_world_cabinet[:3, :3]
    mass = float(masses.sum())
    rotated = r @ tensor @ r.T
    return Inertial(
        Quantity(mass, "other: closed form", (0.8 * mass, 1.2 * mass)),
        geo.transform(T_world_cabinet, com[None])[0],
        (rotated + rotated.T) / 2,
    )


def bar_handle(center: tuple[float, float, float], along: int, length: float = 0.16) -> list[Board]:
    """A bar 12 mm thick, 40 mm in front of a surface at `center` (y faces the front), on two posts; axis 0 or
    2."""
    x, y, z = center
    half, thick, stand = length / 2, 0.012, 0.040
    lo, hi = np.array([x, y - stand, z]) - thick / 2, np.array([x, y - stand, z]) + thick / 2
    lo[along], hi[along] = center[along] - half, center[along] + half
    boards = [Board(tuple(lo), tuple(hi), METAL)]
    for s in (-1, 1):
        post_lo, post_hi = np.array([x, y - stand + thick / 2, z]), np.array([x, y, z])
        mid = center[along] + s * (half - thick)
        other = 2 - along
        post_lo[other], post_hi[other] = center[other] - thick / 2, center[other] + thick / 2
        post_lo[along], post_hi[along] = mid - thick / 2, mid + thick / 2
        boards.append(Board(tuple(post_lo), tuple(post_hi), METAL))
    return boards


def bar_contact(center: tuple[float, float, float], along: int, T_world_cabinet: Array) -> ContactPath:
    """The grasp of `bar_handle`: on the middle of the bar's front, fingers on both sides of the bar."""
    x, y, z = center
    columns = [[1, 0, 0], [0, 0, 1], [0, -1, 0]] if along == 2 else [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    rotation = T_world_cabinet[:3, :3] @ np.array(columns, float).T
    point = geo.transform(T_world_cabinet, np.array([[x, y - 0.046, z]]))[0]
    return ContactPath(point, rotation, 0.012, tuple(range(10, 50)), "closed form")


def opening_motion(upper: float, frames: int = 60, rate: float = 15.0) -> Motion:
    """Rest, a smooth opening from 0 to `upper`, rest."""
    s = np.clip((np.arange(frames) - 10) / (frames - 20), 0.0, 1.0)
    state = upper * s**3 * (10 - 15 * s + 6 * s**2)
    return Motion(np.arange(frames), np.arange(frames) / rate, state, ((10, frames - 10),), 0.001, 0.97)


def default_physics() -> PartPhysics:
    return PartPhysics(
        friction=Quantity(0.6, "default: chosen", (0.3, 0.9)),
        damping=Quantity(0.5, "default: chosen", (0.1, 2.0)),
        frictionloss=Quantity(0.3, "default: chosen", (0.0, 1.0)),
        density=Quantity(DENSITY, "default: chosen", (600.0, 800.0)),
    )


def make_part(
    part_id: int, name: str, boards: list[Board], joint: Joint, T: Array, contact: ContactPath | None = None,
    parent: int | None = None, cut: int = 1,
) -> Part:  # fmt: skip
    """A part of solid boards with exact boxes as collision; `joint` is given in the cabinet's frame."""
    return Part(
        id=part_id, name=name, mesh=boards_mesh(boards, T, cut), joint=joint.transformed(T),
        motion=opening_motion(joint.upper), inertial=boards_inertial(boards, T), physics=default_physics(),
        contact=contact, collision=tuple(b.box(T) for b in boards), parent=parent,
    )  # fmt: skip


WIDTH, DEPTH, HEIGHT, SPLIT = (
    0.60,
    0.45,
    0.80,
    0.58,
)  # the cabinet; SPLIT is the height between door and drawer


def carcass_boards() -> list[Board]:
    w, d, h, t = WIDTH / 2, DEPTH, HEIGHT, BOARD
    return [
        Board((-w, 0, 0), (-w + t, d, h)),
        Board((w - t, 0, 0), (w, d, h)),
        Board((-w + t, 0, 0), (w - t, d, t)),
        Board((-w + t, 0, h - t), (w - t, d, h)),
        Board((-w + t, 0, SPLIT - t / 2), (w - t, d, SPLIT + t / 2)),
        Board((-w + t, d - t, t), (w - t, d, h - t)),
    ]


DOOR_HANDLE = (WIDTH / 2 - 0.06, -GAP - BOARD, 0.34)
DRAWER_HANDLE = (0.0, -GAP - BOARD, (SPLIT + HEIGHT) / 2)


def door_boards() -> list[Board]:
    w, y = WIDTH / 2, -GAP - BOARD
    return [
        Board((-w, y, GAP), (w, -GAP, SPLIT - GAP / 2), FRONT),
        *bar_handle(DOOR_HANDLE, along=2),
    ]


def drawer_boards() -> list[Board]:
    w, y, t = WIDTH / 2, -GAP - BOARD, 0.012
    x, z0, z1, back = w - 0.035, SPLIT + 0.025, HEIGHT - 0.06, DEPTH - 0.06
    return [
        Board((-w, y, SPLIT + GAP / 2), (w, -GAP, HEIGHT), FRONT),
        Board((-x, -GAP, z0), (x, back, z0 + t)),
        Board((-x, -GAP, z0 + t), (-x + t, back, z1)),
        Board((x - t, -GAP, z0 + t), (x, back, z1)),
        Board((-x + t, back - t, z0 + t), (x - t, back, z1)),
        *bar_handle(DRAWER_HANDLE, along=0),
    ]


def world_from_cabinet(yaw: float = 0.5, position: tuple[float, float, float] = (0.9, 0.35, 0.15)) -> Array:
    return geo.make_pose(geo.exp_so3([0.0, 0.0, yaw]), position)


def cabinet_twin(
    T_world_cabinet: Array | None = None, name: str = "cabinet", nested: bool = False, lid: bool = False
) -> Twin:
    """A base cabinet: `door` (id 2, hinged left, axis -z, 1.4 rad) below, `drawer` (id 3, 0.30 m) above.

    nested: a `flap` (id 5) hinged on the door. lid: a `lid` (id 4) hinged at the back of the top. The front
    faces -y of the cabinet's frame, which is yawed and off the origin unless a pose is given.
    """
    T = world_from_cabinet() if T_world_cabinet is None else T_world_cabinet
    w, front = WIDTH / 2, -GAP - BOARD
    door = Revolute(np.array([0.0, 0.0, -1.0]), 0.0, 1.4, pivot=np.array([-w, front, 0.3]))
    drawer = Prismatic(np.array([0.0, -1.0, 0.0]), 0.0, 0.30)
    parts = [
        make_part(2, "door", door_boards(), door, T, bar_contact(DOOR_HANDLE, 2, T)),
        make_part(3, "drawer", drawer_boards(), drawer, T, bar_contact(DRAWER_HANDLE, 0, T)),
    ]
    if lid:
        boards = [Board((-w, 0, HEIGHT + GAP), (w, DEPTH, HEIGHT + GAP + BOARD), FRONT)]
        pivot = np.array([0.0, DEPTH, HEIGHT + GAP + BOARD])
        parts.append(make_part(4, "lid", boards, Revolute(np.array([-1.0, 0, 0]), 0.0, 1.2, pivot=pivot), T))
    if nested:
        boards = [Board((-0.15, front - GAP - 0.01, 0.05), (0.05, front - GAP, 0.2), METAL)]
        joint = Revolute(np.array([1.0, 0, 0]), 0.0, 1.0, pivot=np.array([0.0, front - GAP - 0.01, 0.05]))
        parts.append(make_part(5, "flap", boards, joint, T, parent=2))
    static = StaticPart(
        "carcass", boards_mesh(carcass_boards(), T, 2), tuple(b.box(T) for b in carcass_boards())
    )
    labels = {0: np.ones((6, 8), np.uint8), 30: np.full((6, 8), 2, np.uint8)}
    return Twin(
        name, static, tuple(parts), walking_camera(T), Recorded("closed_form", 60, "0" * 16),
        {"versions": {"funtwin": "test"}, "config": {"seed": 1}}, labels,
    )  # fmt: skip


def walking_camera(T_world_cabinet: Array, frames: int = 60, rate: float = 15.0) -> Trajectory:
    """A camera 1.2 m in front of the cabinet that sways; one frame (7) is lost."""
    kept = np.array([k for k in range(frames) if k != 7])
    look = np.array(
        [[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]
    )  # camera x right, y down, z towards +y of the cabinet
    poses = []
    for k in kept:
        position = [0.1 * np.sin(k / 10), -1.2, 1.2 + 0.01 * np.cos(k / 7)]
        poses.append(
            T_world_cabinet @ geo.make_pose(geo.exp_so3([0, 0, 0.02 * np.sin(k / 9)]) @ look, position)
        )
    return Trajectory(kept, kept / rate, np.stack(poses))

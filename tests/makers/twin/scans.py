"""Closed-form scans of furniture: chosen faces of boxes as open surfaces that end 5 mm before their edges, as
fused ones do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import (
    ContactPath,
    Joint,
    Mesh,
    Motion,
    Part,
    Prismatic,
    Recorded,
    Revolute,
    StaticPart,
    Trajectory,
    Twin,
)
from twin.verdict import Verdict

BENT = 0.005
STEP = 0.01
WOOD = (150, 110, 70)
Corner = tuple[float, float, float]
Piece = tuple[Corner, Corner, str]


def face(
    low: Corner, high: Corner, axis: int, sign: int, rng: np.random.Generator, noise: float = 0.0005
) -> Mesh:
    """One face of a box, triangles of a centimetre, facing outwards."""
    u, v = (k for k in range(3) if k != axis)
    step = STEP if max(high[k] - low[k] for k in (u, v)) < 1.0 else 4 * STEP  # walls need no more
    a = [np.linspace(low[k] + BENT, high[k] - BENT, max(2, round((high[k] - low[k]) / step))) for k in (u, v)]
    grid = np.stack(np.meshgrid(*a, indexing="ij"), axis=-1)
    n, m = grid.shape[:2]
    points = np.empty((n * m, 3))
    points[:, [u, v]] = grid.reshape(-1, 2)
    points[:, axis] = (high if sign > 0 else low)[axis] + rng.normal(0, noise, n * m)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij"))
    k = i * m + j
    faces = np.concatenate([np.stack([k, k + m, k + m + 1], 1), np.stack([k, k + m + 1, k + 1], 1)])
    ahead = np.cross(np.eye(3)[u], np.eye(3)[v])[axis]
    faces = faces if ahead * sign > 0 else faces[:, ::-1]
    return Mesh(points, faces.astype(np.int32), np.tile(np.array(WOOD, np.uint8), (len(points), 1)))


def surface(pieces: Sequence[Piece], seed: int = 0) -> Mesh:
    """Faces of boxes, named by "-x +z"; all six by "all"."""
    rng = np.random.default_rng(seed)
    meshes = []
    for low, high, names in pieces:
        words = ["-x", "+x", "-y", "+y", "-z", "+z"] if names == "all" else names.split()
        meshes += [face(low, high, "xyz".index(w[1]), 1 if w[0] == "+" else -1, rng) for w in words]
    return joined(meshes)


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one."""
    start = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = np.concatenate([m.faces + k for m, k in zip(meshes, start, strict=False)])
    colors = np.concatenate([np.tile(np.array(WOOD, np.uint8), (len(m.vertices), 1)) for m in meshes])
    return Mesh(np.concatenate([m.vertices for m in meshes]), faces, colors)


# A drawer of 500 x 170 mm in a cabinet, seen from the room (-y) when it was open: fronts, floor, the inner
# faces of its sides and back.
FRONT = ((-0.25, 0.0, 0.60), (0.25, 0.018, 0.77))
FLOOR = ((-0.22, 0.018, 0.62), (0.22, 0.45, 0.63))
LEFT = ((-0.22, 0.018, 0.63), (-0.208, 0.45, 0.72))
RIGHT = ((0.208, 0.018, 0.63), (0.22, 0.45, 0.72))
BACK = ((-0.22, 0.45, 0.62), (0.22, 0.462, 0.72))
BAR = ((-0.08, -0.050, 0.68), (0.08, -0.038, 0.692))
BLURRED = ((-0.085, -0.050, 0.674), (0.085, -0.030, 0.698))  # as a fused surface has it: thicker
DRAWER = (
    (*FRONT, "-y +z"),
    (*FLOOR, "+z"),
    (*LEFT, "+x +z"),
    (*RIGHT, "-x +z"),
    (*BACK, "-y"),
    (*BLURRED, "-y +z"),
)
# The cabinet's side boards from inside, a neighbour's front, floor and wall.
CABINET = (
    ((-0.268, 0.022, 0.1), (-0.25, 0.55, 0.8), "+x -y"),
    ((0.25, 0.022, 0.1), (0.268, 0.55, 0.8), "-x -y"),
    ((0.272, 0.0, 0.1), (0.70, 0.55, 0.8), "-y +z"),
    ((-0.268, 0.022, 0.782), (0.268, 0.55, 0.80), "+z"),
)
ROOM = (((-2.0, -1.5, -0.02), (2.0, 0.57, 0.0), "+z"), ((-2.0, 0.57, 0.0), (2.0, 0.6, 2.0), "-y"))


def part_of(mesh: Mesh, joint: Joint, contact: Array | None = None) -> Part:
    """A part that moved from 0 to its upper limit; contact: a point (3,) on it, held across z before a front
    that looks to -y."""
    n = 30
    state = joint.upper * np.clip((np.arange(n) - 5) / 20, 0, 1)
    held = None
    if contact is not None:
        held = ContactPath(
            contact,
            np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]).T,
            0.02,
            (10,),
            "stated: test",
        )
    return Part(
        2, "part_2", mesh, joint, Motion(np.arange(n), np.arange(n) / 15, state, ((5, 25),)), contact=held
    )


def drawer(pieces: Sequence[Piece] = DRAWER) -> Part:
    """The drawer, opened by 25 cm."""
    return part_of(surface(pieces, 1), Prismatic(np.array([0.0, -1.0, 0.0]), 0.0, 0.25))


def door() -> Part:
    """A door of the drawer's width and 400 mm high, hinged on its left; front, back and free edge seen."""
    joint = Revolute(np.array([0.0, 0.0, -1.0]), 0.0, 1.4, pivot=np.array([-0.25, 0.009, 0.4]))
    board = ((-0.25, 0.0, 0.37), (0.25, 0.018, 0.77))
    return part_of(surface([(*board, "-y +y +x")], 2), joint)


def twin_of(part: Part, static: Sequence[Piece] = (*CABINET, *ROOM)) -> Twin:
    """A twin as a reconstruction makes them, with a verdict."""
    poses = np.tile(
        geo.make_pose(np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0.0]]), [0.0, -1.2, 1.4]), (30, 1, 1)
    )
    cameras = Trajectory(np.arange(30), np.arange(30) / 15, poses)
    return Twin(
        "scan",
        StaticPart("static", surface(static, 3)),
        (part,),
        cameras,
        Recorded("scan", 30, "0"),
        verdict=Verdict(()),
    )


def moved(twin: Twin, yaw: float, shift: Sequence[float]) -> Twin:
    """The twin in another level frame."""
    from twin.placed import placed

    return placed(twin, geo.make_pose(geo.exp_so3([0.0, 0.0, yaw]), shift))

"""Random twins: 1 to 6 boards in any tree, with any axis, pivot, limits, mass, damping and name."""

from __future__ import annotations

import numpy as np

from benchmarks.scenes.boards import Board, boards_inertial, boards_mesh, opening_motion
from twin import geometry as geo
from twin.geometry import Array
from twin.names import legal_name
from twin.scene import (
    ContactPath,
    Inertial,
    Joint,
    Part,
    PartPhysics,
    Prismatic,
    Quantity,
    Revolute,
    StaticPart,
    Twin,
)

# What people call things: other scripts, accents, signs, the same twice or but for the case, and reserved
# words.
NAMES = (
    "door", "Door", "door", "Tür", "tiroir n°2", "引き出し", "дверь", "wörld", "world", "2nd shelf", "a/b:c", "", "lid-left",
    "lid left", "é" * 40, "joint", "🚪", "<door>", "base_link", "x_joint", "x",
)  # fmt: skip
SPACING = 2.5  # m between the boards, so that none ever touches another


def random_twin(seed: int, count: int | None = None) -> Twin:
    """A twin of `count` (1..6 by chance) parts; equal seeds give equal twins.

    Masses from 1 g to 2 t, joint damping between a hundredth and ten times what stops the part in a second,
    limits that may be negative, every third base yawed, axes along the world's or anywhere, parents at
    random.
    """
    rng = np.random.default_rng([seed, 20260])
    count = int(rng.integers(1, 7)) if count is None else count
    names = _names(rng, count + 1)
    base = geo.make_pose(
        geo.exp_so3([0, 0, rng.uniform(-np.pi, np.pi) * (seed % 3 == 0)]), rng.normal(size=3)
    )
    parts: list[Part] = []
    for k in range(count):
        parent = None if k == 0 or rng.random() < 0.4 else int(rng.integers(2, k + 2))
        parts.append(_part(rng, k, names[k], parent, base))
    ground = [Board((-1, -1, -9.1), (1, 1, -9))]
    static = StaticPart(names[count], boards_mesh(ground, base), tuple(b.box(base) for b in ground))
    return Twin(f"random_{seed}", static, tuple(parts))


def _names(rng: np.random.Generator, count: int) -> list[str]:
    """Names as someone would make them who has only texts."""
    taken: list[str] = []
    for _ in range(count):
        taken.append(legal_name(str(rng.choice(NAMES)), taken))
    return taken


def _part(rng: np.random.Generator, k: int, name: str, parent: int | None, base: Array) -> Part:
    place = [SPACING * (k % 3), SPACING * (k // 3), 0.0] + rng.normal(size=3) * 0.05
    T = base @ geo.make_pose(geo.exp_so3(rng.normal(size=3)), place)
    size = np.exp(rng.uniform(np.log(0.02), np.log(0.5), 3))
    board = Board((0, 0, 0), tuple(map(float, size)))
    mass = float(np.exp(rng.uniform(np.log(1e-3), np.log(2e3))))
    inertial = boards_inertial([board], T, mass / float(np.prod(size)))
    axis = np.roll([0.0, 0.0, float(rng.choice([-1, 1]))], int(rng.integers(3)))
    if rng.random() < 0.6:
        axis = geo.unit(rng.normal(size=3))
    lower, upper = -rng.uniform(0, 0.5) * int(rng.integers(2)), rng.uniform(0.05, 1.0)
    pivot = T[:3, 3] + rng.normal(size=3) * 0.2
    turning = bool(rng.random() < 0.6)
    joint: Joint = Revolute(axis, lower, upper, pivot=pivot) if turning else Prismatic(axis, lower, upper)
    return Part(
        id=k + 2, name=name, mesh=boards_mesh([board], T), joint=joint, motion=opening_motion(upper),
        inertial=inertial, physics=_physics(rng, inertial, joint), collision=(board.box(T),), parent=parent,
        contact=_contact(board, T) if rng.random() < 0.3 else None,
    )  # fmt: skip


def _physics(rng: np.random.Generator, inertial: Inertial, joint: Joint) -> PartPhysics:
    own = inertial.mass.value
    if isinstance(joint, Revolute):
        arm = np.cross(joint.axis, inertial.com - joint.pivot)
        own = float(joint.axis @ inertial.inertia @ joint.axis + own * arm @ arm)
    damping = own * float(np.exp(rng.uniform(np.log(0.01), np.log(10))))
    return PartPhysics(*(Quantity(v, "chosen", (0.0, 2 * v)) for v in (
        rng.uniform(0.1, 0.9), damping, rng.uniform(0.1, 3.0), 700.0
    )))  # fmt: skip


def _contact(board: Board, T: Array) -> ContactPath:
    point = geo.transform(T, np.array([board.center * [1, 1, 2]]))[0]
    return ContactPath(point, T[:3, :3], 0.012, (1, 2), "closed form")

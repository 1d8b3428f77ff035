"""Twins of random cabinets, exact in everything: all joints and handles that replays are measured on."""

from __future__ import annotations

import numpy as np

from benchmarks.scenes.boards import Board, boards_inertial
from benchmarks.scenes.furniture import contact_at, floor, mesh_of
from recon.simulate.random.boards import box
from recon.simulate.random.fronts import HANDLES
from recon.simulate.random.furniture import KINDS
from twin.physics import with_physics
from twin.scene import Box, Motion, Part, StaticPart, Twin

_DENSITY = 650.0  # kg/m^3, chipboard


def random_furniture(kind: str, handle: str, seed: int) -> Twin:
    """A twin named <kind>_<handle>_<seed>; sizes, heights and ranges are drawn. kind: of KINDS; handle: of
    HANDLES."""
    rng = np.random.default_rng([sorted(KINDS).index(kind), HANDLES.index(handle), seed])
    made = KINDS[kind](rng, handle)
    grip, joint, boxes = made.grip, made.joint, made.part
    contact = contact_at(grip.point, grip.along, grip.out, grip.thickness)
    motion = Motion(np.arange(5), np.arange(5) / 10.0, np.linspace(0, joint.upper, 5), ((0, 4),))
    part = Part(
        2, kind, mesh_of(boxes), joint, motion, contact=contact, collision=tuple(boxes),
        inertial=boards_inertial([_board(b) for b in boxes], np.eye(4), _DENSITY),
    )  # fmt: skip
    static = [floor(), box([0, 0.75, 1.0], [4.0, 0.05, 2.0]), *made.static]
    name = f"{kind}_{handle}_{seed}"
    return with_physics(Twin(name, StaticPart("cabinet", mesh_of(static), tuple(static)), (part,)))


def _board(b: Box) -> Board:
    middle, half = b.T_world_box[:3, 3], b.size / 2
    return Board(tuple(middle - half), tuple(middle + half))

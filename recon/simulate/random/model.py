"""Random furniture as an MJCF model: named materials, hinges and slides, what stands beside and above it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from recon.simulate.mjcf import FURNITURE
from recon.simulate.random.boards import BOARD, box
from recon.simulate.random.fronts import Front
from recon.simulate.random.furniture import Furniture
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Box, Revolute

_DENSITY = 650.0  # kg/m^3, chipboard
Rng = np.random.Generator

# How fronts and carcasses look, how often; chosen by us. `recon.simulate.textures` knows the names.
FRONTS = {"wood": 0.27, "laminate": 0.2, "plain": 0.27, "glossy": 0.14, "stripe": 0.12}
CARCASSES = {"wood": 0.35, "laminate": 0.35, "plain": 0.3}
HANDLE_LOOKS = {"metal": 0.6, "wood": 0.2, "glass_black": 0.2}


@dataclass(frozen=True)
class Placed:
    """A piece of furniture and where it stands: `shift` (3,), metres; the joint's name."""

    joint: str
    made: Furniture
    shift: Array


def furniture_model(pieces: Sequence[Placed], rng: Rng, weak_fronts: bool) -> mujoco.MjModel:
    """The pieces with joints, and around them closed neighbours with handles, a plinth, a worktop or none.

    weak_fronts: fronts on which hardly anything can be followed.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    names = {
        "front": draw_look(rng, {"plain": 0.6, "glossy": 0.25, "stripe": 0.15} if weak_fronts else FRONTS),
        "carcass": draw_look(rng, CARCASSES),
        "neighbour": draw_look(rng, FRONTS),
        "handle": draw_look(rng, HANDLE_LOOKS),
        "top": draw_look(rng, {"stone": 0.5, "wood": 0.5}),
    }
    look = {role: f"{kind}_{role}" for role, kind in names.items()}
    for name in look.values():
        spec.add_material(name=name, rgba=[0.6, 0.6, 0.6, 1.0])
    spec.add_material(name="tile_floor" if rng.random() < 0.6 else "wood_floor", rgba=[0.6, 0.6, 0.6, 1.0])
    ground = spec.materials[-1].name
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[4.0, 4.0, 0.1], material=ground)
    round_handles = bool(rng.random() < 0.6)
    carcass = spec.worldbody.add_body(name="carcass")
    for piece in pieces:
        _add_carcass(spec, carcass, piece, look["carcass"])
        add_part(spec.worldbody, piece.joint, piece.made, piece.shift, look, round_handles)
    beside = spec.worldbody.add_body(name="beside")
    for role, b in _around(pieces, rng):
        add_box(beside, b, np.zeros(3), look[role])
    return spec.compile()


def _add_carcass(spec: mujoco.MjSpec, carcass: mujoco.MjsBody, piece: Placed, look: str) -> None:
    """What stands still of a piece, the furniture itself named as what its joint belongs to."""
    for role, boxes in (("carcass", piece.made.carcass), ("around", piece.made.around)):
        body = carcass.add_body(name=f"{piece.joint}_{role}")
        for b in boxes:
            add_box(body, b, piece.shift, look)
    spec.add_tuple(
        name=f"{piece.joint}{FURNITURE}",
        objtype=[mujoco.mjtObj.mjOBJ_BODY],
        objname=[f"{piece.joint}_carcass"],
        objprm=[0.0],
    )


def add_part(
    parent: mujoco.MjsBody, name: str, front: Front, shift: Array, look: dict[str, str], round_handles: bool
) -> mujoco.MjsBody:
    """A body with the joint `name` and the boxes of a front, `shift` (3,) m from where it was made.

    look: materials of the roles front, carcass and handle.
    """
    body = parent.add_body(name=f"{name}_part")
    joint, kinds = front.joint, mujoco.mjtJoint
    turns = isinstance(joint, Revolute)
    pivot = joint.pivot + shift if isinstance(joint, Revolute) else np.zeros(3)
    body.add_joint(
        name=name,
        type=kinds.mjJNT_HINGE if turns else kinds.mjJNT_SLIDE,
        axis=joint.axis,
        pos=pivot,
        range=[joint.lower, joint.upper],
        limited=True,
    )
    for k, b in enumerate(front.panels):
        add_box(body, b, shift, look["front" if k == 0 else "carcass"])
    for b in front.grip.boxes:
        add_box(body, b, shift, look["handle"], round_handles)
    return body


def add_box(body: mujoco.MjsBody, b: Box, shift: Array, material: str, rounded: bool = False) -> None:
    """A box, or the capsule or ball as long and as thick as it."""
    centre, half = b.T_world_box[:3, 3] + shift, 0.5 * b.size
    kinds = mujoco.mjtGeom
    common = {"pos": centre, "material": material, "density": _DENSITY}
    if not rounded:
        body.add_geom(type=kinds.mjGEOM_BOX, size=half, **common)
        return
    long = int(np.argmax(half))
    radius = float(np.min(half))
    if half[long] < 1.8 * radius:
        body.add_geom(type=kinds.mjGEOM_ELLIPSOID, size=half, **common)
        return
    away = np.zeros(3)
    away[long] = half[long] - radius
    ends = np.concatenate([centre - away, centre + away])
    body.add_geom(
        type=kinds.mjGEOM_CAPSULE, size=[radius, 0, 0], fromto=ends, material=material, density=_DENSITY
    )


def _around(pieces: Sequence[Placed], rng: Rng) -> list[tuple[str, Box]]:
    """Role and box of what stands about the pieces: it keeps clear of all ways of their parts."""
    corners = np.concatenate([b.corners + p.shift for p in pieces for b in (*p.made.static, *p.made.part)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    swept = np.concatenate([_way(p) for p in pieces])
    found: list[tuple[str, Box]] = []
    for side in (-1, 1):
        edge = low[0] if side < 0 else high[0]
        for _ in range(int(rng.integers(0, 3))):
            w, tall = rng.uniform(0.25, 0.6), rng.uniform(0.5, 1.0) * high[2]
            if rng.random() < 0.6:
                tall = high[2]
            x = edge + side * (0.006 + w / 2)
            found += _column(x, w, max(tall, 0.25), float(rng.uniform(0.0, 0.03)), rng)
            edge += side * (w + 0.006)
    if low[2] > 0.12 and rng.random() < 0.7:  # what is below
        found.append(
            (
                "neighbour",
                box(
                    [(low[0] + high[0]) / 2, 0.27, low[2] / 2 - 0.004],
                    [high[0] - low[0], 0.5, low[2] - 0.008],
                ),
            )
        )
    if 0.6 < high[2] < 1.3 and rng.random() < 0.7:
        found.append(
            (
                "top",
                box([(low[0] + high[0]) / 2, 0.25, high[2] + 0.028], [high[0] - low[0] + 0.04, 0.52, 0.03]),
            )
        )
    return [(role, b) for role, b in found if not _meets(b, swept)]


def _column(x: float, width: float, tall: float, back: float, rng: Rng) -> list[tuple[str, Box]]:
    """A neighbour of closed fronts, one above the other, each with a bar."""
    out = [("carcass", box([x, 0.27 + back, tall / 2], [width, 0.48, tall]))]
    z = 0.08
    while z < tall - 0.1:
        front = min(float(rng.uniform(0.15, 0.7)), tall - z)
        middle = z + front / 2
        out.append(("neighbour", box([x, 0.02 + back, middle], [width - 0.006, BOARD, front - 0.006])))
        out.append(("handle", box([x, -0.02 + back, z + 0.8 * front], [0.4 * width, 0.012, 0.012])))
        z += front
    return out


def _way(piece: Placed) -> Array:
    """Corners (n, 8, 3) of the part's boxes on their way."""
    joint = piece.made.joint
    return np.stack(
        [
            geo.transform(joint.pose(float(s)), b.corners) + piece.shift
            for s in np.linspace(joint.lower, joint.upper, 9)
            for b in piece.made.part
        ]
    )


def _meets(b: Box, swept: Array) -> bool:
    low, high = b.corners.min(axis=0), b.corners.max(axis=0)
    inside = np.minimum(high, swept.max(axis=1)) - np.maximum(low, swept.min(axis=1))
    return bool(np.any(np.all(inside > 1e-4, axis=1)))


def draw_look(rng: Rng, shares: dict[str, float]) -> str:
    """One of the looks, drawn by their shares."""
    weights = np.array(list(shares.values()))
    return str(rng.choice(list(shares), p=weights / weights.sum()))

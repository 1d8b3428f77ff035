"""Small pieces of furniture made of boxes, with exact joints and a hand contact that can be off.
Each is made once."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import trimesh

from recon.simulate.random.boards import bar, box, shell
from twin import geometry as geo
from twin.physics import with_physics
from twin.quantities import Inertial, Quantity
from twin.scene import (
    ContactPath,
    Joint,
    Mesh,
    Motion,
    Part,
    Prismatic,
    Revolute,
    StaticPart,
    Twin,
)

_CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    dtype=np.int32,
)  # fmt: skip


def mesh_of(boxes):
    vertices = np.concatenate([geo.transform(b.T_world_box, _CUBE * b.size) for b in boxes])
    faces = np.concatenate([_FACES + 8 * k for k in range(len(boxes))])
    return Mesh(vertices, faces)


def contact_at(point, along, out, width, *, error=0.0, seed=0):
    """Hand contact with an isotropic error of length `error`."""
    n, h = geo.unit(out), geo.unit(along)
    shift = geo.unit(np.random.default_rng(seed).normal(size=3)) * error
    return ContactPath(
        np.asarray(point) + shift, np.stack([np.cross(h, n), h, n], axis=1), width, (10, 11, 12), "hand"
    )


def twin_of(boxes, joint: Joint, static, contact, name="part"):
    motion = Motion(np.arange(5), np.arange(5) / 10.0, np.linspace(0, joint.upper, 5), ((0, 4),))
    part = Part(2, name, mesh_of(boxes), joint, motion, contact=contact, collision=tuple(boxes))
    return with_physics(Twin("furniture", StaticPart("cabinet", mesh_of(static), tuple(static)), (part,)))


def floor(z=0.0):
    return box([0, -0.5, z - 0.005], [4, 4, 0.01])


@cache
def drawer(height=0.6, *, travel=0.35, error=0.0, seed=0, handle="bar"):
    """Drawer at `height` that opens towards -y."""
    static = [floor(), *shell(0.5, 0.5, 0.25, [0, 0.3, height])]
    front = [0, 0.03, height]
    boxes = [box(front, [0.48, 0.018, 0.22]), box([0, 0.25, height - 0.09], [0.44, 0.42, 0.01])]
    if handle == "bar":
        extra, grip = bar([0, 0.021, height], 0.16, vertical=False)
    else:
        extra = [
            box([0, 0.008, height], [0.012, 0.026, 0.012]),
            box([0, -0.012, height], [0.03, 0.016, 0.03]),
        ]
        grip = np.array([0, -0.012, height])
    joint = Prismatic(np.array([0, -1.0, 0]), 0.0, travel)
    contact = contact_at(grip, [1, 0, 0], [0, -1, 0], 0.02, error=error, seed=seed)
    return twin_of(boxes + extra, joint, static, contact)


@cache
def door(side="left", *, height=0.9, angle=1.257, width=0.4, error=0.0, seed=0):
    """Door hinged on its left or right (seen from the room, which is at -y), bar handle at the free edge."""
    s = -1.0 if side == "left" else 1.0
    static = [floor(), *shell(width, 0.35, 0.6, [0, 0.2, height])]
    boxes = [box([0, 0.012, height], [width - 0.005, 0.018, 0.58])]
    extra, grip = bar([-s * (width / 2 - 0.05), 0.003, height], 0.20, vertical=True)
    axis = np.array([0, 0, s])  # hinge on the left (x < 0): a turn about -z brings the right edge to -y
    joint = Revolute(axis, 0.0, angle, pivot=np.array([s * width / 2, 0.012, height]))
    contact = contact_at(grip, [0, 0, 1], [0, -1, 0], 0.02, error=error, seed=seed)
    return twin_of(boxes + extra, joint, static, contact, "door")


@cache
def lid(height=0.5, *, angle=1.134, error=0.0, seed=0):
    """Chest lid with a horizontal axis at the back; its front rim overhangs and is held by the edge."""
    static = [floor(), *[b for b in shell(0.6, 0.4, height, [0, 0.2, height / 2]) if True][:3]]
    static.append(box([0, 0.0, height / 2 - 0.02], [0.6, 0.018, height - 0.06]))
    boxes = [box([0, 0.17, height + 0.012], [0.62, 0.46, 0.018])]
    joint = Revolute(np.array([-1.0, 0, 0]), 0.0, angle, pivot=np.array([0, 0.4, height + 0.012]))
    contact = contact_at([0, -0.055, height + 0.012], [1, 0, 0], [0, -1, 0], 0.018, error=error, seed=seed)
    return twin_of(boxes, joint, static, contact, "lid")


@cache
def sliding_door(height=0.9, *, travel=0.4, error=0.0, seed=0):
    """Door that slides along +x in front of an open cabinet."""
    static = [floor(), *shell(0.9, 0.35, 0.6, [0.2, 0.2, height])]
    boxes = [box([0, 0.0, height], [0.45, 0.018, 0.58])]
    extra, grip = bar([-0.15, -0.009, height], 0.25, vertical=True, thickness=0.02, stand_off=0.04)
    contact = contact_at(grip, [0, 0, 1], [0, -1, 0], 0.02, error=error, seed=seed)
    return twin_of(boxes + extra, Prismatic(np.array([1.0, 0, 0]), 0.0, travel), static, contact, "slider")


@cache
def laden_door(mass=8.0):
    """A door (part 2) that carries a pull-out of this mass (part 3, a drawer that slides towards -y) on its
    face."""
    twin = door("left")
    extra, grip = bar([0.08, -0.109, 0.62], 0.12, vertical=False)
    boxes = [
        box([0.08, -0.10, 0.62], [0.22, 0.018, 0.16]),
        box([0.08, -0.05, 0.55], [0.22, 0.10, 0.01]),
        *extra,
    ]
    mesh, joint = mesh_of(boxes), Prismatic(np.array([0, -1.0, 0]), 0.0, 0.15)
    motion = Motion(np.arange(5), np.arange(5) / 10.0, np.linspace(0, joint.upper, 5), ((0, 4),))
    tensor = mass * np.array([[0.010, 0.001, 0], [0.001, 0.012, 0.002], [0, 0.002, 0.008]])
    weighed = Inertial(Quantity(mass, "user: test", (mass, mass)), mesh.area_centroid, tensor, "user: test")
    contact = contact_at(grip, [1, 0, 0], [0, -1, 0], 0.02)
    tray = Part(
        3,
        "pull_out",
        mesh,
        joint,
        motion,
        contact=contact,
        collision=tuple(boxes),
        parent=2,
        inertial=weighed,
    )
    return with_physics(replace(twin, parts=(*twin.parts, tray)))


def noisy(twin: Twin, sigma=0.005, seed=0):
    """The same twin with a dense part mesh bent by a random field of wavelengths 3-12 cm, as fusion leaves
    it."""
    rng = np.random.default_rng(seed)
    part = twin.parts[0]
    v, f = trimesh.remesh.subdivide_to_size(part.mesh.vertices, part.mesh.faces, 0.02)
    waves = geo.unit(rng.normal(size=(40, 3))) * (2 * np.pi / rng.uniform(0.03, 0.12, (40, 1)))
    phases = np.sin(v @ waves.T + rng.uniform(0, 2 * np.pi, 40))
    shift = phases @ rng.normal(0, 1, (40, 3)) * sigma / np.sqrt(20)
    return with_physics(replace(twin, parts=(replace(part, mesh=Mesh(v + shift, f)),)))

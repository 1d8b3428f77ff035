"""A furnished room as an MJCF model, and its surfaces: rows of fronts that look exactly alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from recon.simulate.mjcf import Articulation, articulations
from recon.simulate.random.model import CARCASSES, FRONTS, HANDLE_LOOKS, add_box, add_part, draw_look
from recon.simulate.surfaces import Surface, box
from recon.simulate.textures import make_material
from recon.simulate.walk.layout import Layout, Stand
from twin.geometry import Array, invert_pose, make_pose, transform

Rng = np.random.Generator
_TOPS = {"stone": 0.5, "wood": 0.5}
_SITTING = {"wood": 0.6, "plain": 0.4}
# Share of the rows whose fronts are alike to the last grain; in the others each has a grain of its own
_ALIKE = 0.7


def room_model(layout: Layout, rng: Rng) -> mujoco.MjModel:
    """All pieces, each a tree of bodies with a joint for each front; the chair that is moved is left out."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    for stand in layout.stands:
        look = _look(spec, stand, rng)
        round_handles = bool(rng.random() < 0.6)
        root = spec.worldbody.add_body(name=stand.name, pos=stand.pose[:3, 3])
        root.quat = _quat(stand.pose)
        for role, b in stand.piece.still:
            add_box(root, b, np.zeros(3), look[role])
        for cell in stand.piece.cells:
            frame = root.add_body(name=f"{cell.name}_place", pos=cell.shift)
            body = add_part(frame, cell.name, cell.front, np.zeros(3), look, round_handles)
            for k, geom in enumerate(body.geoms):
                geom.name = f"{cell.name}:{k}"
    return spec.compile()


def _look(spec: mujoco.MjSpec, stand: Stand, rng: Rng) -> dict[str, str]:
    """Names of the piece's materials by role."""
    sits = not stand.piece.cells
    drawn = {
        "front": draw_look(rng, FRONTS),
        "carcass": draw_look(rng, _SITTING if sits else CARCASSES),
        "handle": draw_look(rng, HANDLE_LOOKS),
        "top": draw_look(rng, _TOPS),
    }
    look = {role: f"{kind}_{role}_{stand.name}" for role, kind in drawn.items()}
    for name in look.values():
        spec.add_material(name=name, rgba=[0.6, 0.6, 0.6, 1.0])
    return look


def _quat(pose: Array) -> Array:
    """Quaternion (4,) wxyz of a turn about z."""
    angle = float(np.arctan2(pose[1, 0], pose[0, 0]))
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


def room_parts(layout: Layout, joints: Sequence[str], contrast: float, rng: Rng) -> tuple[Articulation, ...]:
    """The parts of `joints`, which share all that stands still in the room."""
    model = room_model(layout, rng)
    parts = articulations(model, "random room", joints, (), contrast, rng)
    placed = _alike(layout, rng)
    static = tuple(_dressed(s, placed) for s in parts[0].static)
    return tuple(
        replace(
            p,
            static=static,
            part=tuple(_dressed(s, placed) for s in p.part),
            furniture=tuple(_dressed(s, placed) for s in p.furniture),
        )
        for p in parts
    )


def _alike(layout: Layout, rng: Rng) -> dict[str, Array]:
    """T_texture_world (4, 4) of each box of the fronts that look alike, by its geom's name."""
    out: dict[str, Array] = {}
    rows: dict[str, int | None] = {}
    for name, (stand, cell) in layout.cells.items():
        if cell.row not in rows:
            seed = int(rng.integers(2**31))
            rows[cell.row] = seed if rng.random() < _ALIKE else None
        drawn = rows[cell.row]
        if drawn is None:
            continue
        own = np.random.default_rng(drawn)
        for k, b in enumerate(cell.front.part):
            offset = make_pose(None, own.uniform(-1.0, 1.0, 3)) @ make_pose(None, -b.T_world_box[:3, 3])
            out[f"{name}:{k}"] = offset @ invert_pose(stand.cell_pose(cell))
    return out


def _dressed(surface: Surface, placed: dict[str, Array]) -> Surface:
    texture = placed.get(surface.name)
    return surface if texture is None else replace(surface, T_texture_object=texture)


def loose_surfaces(stand: Stand, contrast: float, rng: Rng) -> tuple[Surface, ...]:
    """The surfaces of a piece without fronts, in its own frame."""
    material = make_material(draw_look(rng, _SITTING), contrast, rng)
    out = []
    for _, b in stand.piece.still:
        vertices, faces = box((float(b.size[0]), float(b.size[1]), float(b.size[2])))
        offset = make_pose(None, rng.uniform(-1.0, 1.0, 3))
        out.append(Surface("chair", transform(b.T_world_box, vertices), faces, material, offset))
    return tuple(out)

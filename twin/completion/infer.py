"""The inferred layer of a whole twin: fronts, furniture, cabinets, parts, and what stands still around."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twin.completion.eyes import part_eyes
from twin.completion.frame import viewer
from twin.completion.opening import openings
from twin.completion.part import complete_part, front_of
from twin.completion.room import split_furniture
from twin.completion.squared import Sight
from twin.completion.static import complete_static
from twin.completion.sweep import held_points, swept_points
from twin.scene import Twin


def infer(twin: Twin) -> Twin:
    """The twin with inferred layers of static scene and parts; shapes of surface in no piece are left out.

    It has at least one part.
    """
    eye = viewer(twin.cameras)
    fronts = [front_of(p, eye) for p in twin.parts]
    mesh = twin.static.mesh
    found = split_furniture(mesh, [f for f in fronts if f is not None])
    opened = openings(twin.parts, fronts, mesh, found)
    rears = {o.part.id: float(o.carcass.low[2]) for o in opened}
    layers = [
        complete_part(p, f, rears.get(p.id), part_eyes(twin, p))
        for p, f in zip(twin.parts, fronts, strict=True)
    ]
    passed = [swept_points(p, layer) for p, layer in zip(twin.parts, layers, strict=True)]
    passed += [held_points(p) for p in twin.parts]
    eyes = None if twin.cameras is None else twin.cameras.T_world_cam[:, :3, 3]
    sight = Sight(mesh, eyes) if eyes is not None and len(mesh.faces) else None
    static = complete_static(mesh, found, opened, np.concatenate(passed), sight)
    parts = tuple(
        replace(p, completion=replace(layer, limits=(p.joint.lower, p.joint.upper)))
        for p, layer in zip(twin.parts, layers, strict=True)
    )
    return replace(twin, static=replace(twin.static, completion=static), parts=parts)

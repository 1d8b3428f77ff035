"""What no camera saw of furniture, inferred from what one did: boards closed as boxes, drawers with sides and back, cabinets, handles.

The seen meshes stay as they are; what is inferred stands beside them (twin.inferred), each piece with its reason, and exports write
one layer or both. A part without a flat front is left as it was seen: nothing is inferred of what is not understood.

The seam for a learned model is `infer`: whatever gives the same layer for a twin can stand in its place.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twin.completion.asset import is_reconstructed
from twin.completion.frame import part_frame, viewer
from twin.completion.part import complete_part
from twin.completion.room import Front, apart
from twin.completion.shapes import with_shapes
from twin.completion.static import complete_static, openings
from twin.completion.sweep import swept_points
from twin.scene import Twin


def with_completion(twin: Twin) -> Twin:
    """The twin with the inferred layer of its static scene and every part, collision shapes included; itself where it has one.

    A twin that was not made from a recording was stated by somebody, whole as it is: nothing is inferred.
    """
    if not (is_reconstructed(twin) and twin.parts) or twin.static.completion is not None:
        return twin
    return with_shapes(infer(twin))


def infer(twin: Twin) -> Twin:
    """The twin with the inferred layer of its static scene and every part, without collision shapes of what lies in no piece.

    It has at least one part.
    """
    eye = viewer(twin)
    frames = [part_frame(p, eye) for p in twin.parts]
    leaves = [complete_part(p, f, None)[1] for p, f in zip(twin.parts, frames, strict=True)]
    fronts = [
        None if f is None or leaf is None else Front(f, leaf) for f, leaf in zip(frames, leaves, strict=True)
    ]
    mesh = twin.static.mesh
    found = apart(mesh, [f for f in fronts if f is not None])
    opened = openings(twin.parts, fronts, mesh, found)
    rears = {o.part.id: float(o.carcass.low[2]) for o in opened}
    layers = [complete_part(p, f, rears.get(p.id))[0] for p, f in zip(twin.parts, frames, strict=True)]
    passed = [swept_points(p, layer) for p, layer in zip(twin.parts, layers, strict=True)]
    static = complete_static(mesh, found, opened, np.concatenate(passed))
    parts = tuple(replace(p, completion=layer) for p, layer in zip(twin.parts, layers, strict=True))
    return replace(twin, static=replace(twin.static, completion=static), parts=parts)

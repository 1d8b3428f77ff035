"""Infers furniture that no camera saw: boards closed as boxes, drawers' sides and back, cabinets, handles.

The seen meshes stay as they are; what is inferred stands beside them (twin.inferred), each piece with its
reason, and exports write one layer or both. A part without a flat front is left as it was seen: nothing is
inferred of what is not understood.

`infer` (twin/completion/infer.py) is the seam for a learned model, which gives the same layer for a twin.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from twin.completion.asset import is_reconstructed
from twin.errors import InputError
from twin.inferred import VERSION
from twin.scene import Twin


def with_completion(twin: Twin, collision: Mapping[str, Any] | None = None) -> Twin:
    """The twin with the inferred layer of its static scene and every part, collision shapes included; itself
    where it has one that the program of today inferred for the joints' limits.

    A stated twin is whole: nothing is inferred. collision: settings of the shapes, by name.
    """
    if not (is_reconstructed(twin) and twin.parts) or has_completion(twin):
        return twin
    from twin.collision import collision_config
    from twin.completion.infer import infer  # SciPy and Open3D, which a wrong option needs not wait for
    from twin.completion.shapes import with_shapes
    from twin.completion.worn import worn

    return worn(with_shapes(infer(twin), collision_config(collision)))


def has_completion(twin: Twin) -> bool:
    """Whether all of a twin has a layer that the program of today inferred for its joints' limits."""
    static = twin.static.completion
    return (
        static is not None
        and static.version == VERSION
        and all(
            k is not None and (k.version, k.limits) == (VERSION, (p.joint.lower, p.joint.upper))
            for p in twin.parts
            for k in [p.completion]
        )
    )


def without_shapes(twin: Twin, inferred: bool = True) -> Twin:
    """A reconstructed twin without shapes that the program made and, if `inferred`, without inferred layer.

    Raises InputError for a stated twin that has all its shapes: nothing is left to make.
    """
    if not is_reconstructed(twin):
        if twin.static.collision and all(p.collision for p in twin.parts):
            raise InputError(
                f"{twin.name} states all its collision shapes, so their settings change nothing",
                "leave --set and --config out",
            )
        return twin
    gone: dict[str, Any] = {"collision": ()} | ({"completion": None} if inferred else {})
    parts = tuple(replace(p, **gone) for p in twin.parts)
    return replace(twin, static=replace(twin.static, **gone), parts=parts)

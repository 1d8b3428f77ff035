"""The look of a URDF link: materials, pictures on primitives, and meshes whose files say that y points up."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import InputError
from twin.geometry import Array
from twin.importers.look import U8, Tell, painted, pictured, read_picture, tell_shrunk
from twin.importers.unwrap import box_uv, capsule_uv, cylinder_uv, sphere_uv
from twin.lint.meshes import counts_y_up, locate
from twin.scene import Mesh

Placed = Callable[[Any, bool], Array]
_GLTF = (".glb", ".gltf")
# How much better the box around a link's visuals must fit that around its collision shapes, as intersection
# over union, to tell which way up they are. Chosen by us: a cabinet half as deep as high is twice as good the
# right way up.
_CLEARLY = 1.5
# Share of its longest side added to a box, to give a sheet volume. Chosen by us: a door's half.
_SHEET = 0.02


def material_of(
    path: Path, written: Any, known: Mapping[str, Any], tell: Tell
) -> tuple[Array | None, U8 | None]:
    """Colour (4,) of 0..1 and picture of a visual's material, which may name one of the robot's."""
    if written is None:
        return None, None
    named = known.get(written.name)
    color, texture = written.color, written.texture
    if color is None and texture is None and named is not None:
        color, texture = named.color, named.texture
    rgba = None if color is None else np.asarray(color.rgba, np.float64)
    if rgba is not None and len(rgba) > 3 and rgba[3] < 1:
        tell("is see-through and becomes opaque")
    if texture is None:
        return rgba, None
    found = locate(texture.filename, path.parent)
    try:
        picture, clear = read_picture(found or Path(texture.filename), "its material")
    except InputError as e:
        tell(f"{e.problem} and is not carried")
        return rgba, None
    if clear:
        tell("is see-through and becomes opaque")
    return rgba, picture


def primitive(kind: str, surface: Mesh, color: Array | None, picture: U8 | None, tell: Tell) -> Mesh:
    """The surface of a box, cylinder, capsule or sphere about the origin in its colour or picture."""
    if picture is None:
        return painted(surface, color)
    half = np.abs(surface.vertices).max(axis=0)
    corners = surface.vertices[surface.faces]
    if kind == "box":
        uv = box_uv(corners / half)
    elif kind == "sphere":
        uv = sphere_uv(corners / half)
    elif kind == "cylinder":
        uv = cylinder_uv(corners / half)
    else:
        uv = capsule_uv(corners / half[0], half[2] / half[0] - 1)
    uv[..., 1] = 1.0 - uv[..., 1]
    made, scale = pictured(surface.vertices, surface.faces, uv, picture, color)
    tell_shrunk("of its material", scale, tell)
    return made


def turned_upright(path: Path, link: Any, placed: Placed, notes: list[str]) -> frozenset[Path]:
    """Mesh files of a link that are turned from y up to z up.

    glTF's y points up, and RViz, Drake, Meshcat and Blender turn it (ros2/rviz#1482). COLLADA's `up_axis` is
    followed by Gazebo and PyBullet and ignored by RViz and MoveIt (ros-visualization/rviz#1045,
    moveit/geometric_shapes#52), since many files state it wrongly: it is ignored. Where the other way fits
    the link's collision shapes clearly better, that one is taken; where they don't tell, a note says so.
    placed: points (n, 3) m of a shape in its link's frame, its mesh turned upright or not.
    """
    shapes = [*link.visuals, *link.collisions]
    meshes = {id(s): s.geometry.mesh for s in shapes if s.geometry.mesh is not None}
    files = {k: locate(m.filename, path.parent) for k, m in meshes.items()}
    lying = {f for f in files.values() if f is not None and f.is_file() and counts_y_up(f)}
    if not lying:
        return frozenset()
    usual = frozenset(f for f in lying if f.suffix.lower() in _GLTF)
    other = frozenset(lying - usual)
    solid = [c for c in link.collisions if files.get(id(c)) not in lying]

    def fit(upright: frozenset[Path]) -> float:
        return _overlap(
            *([placed(s, files.get(id(s)) in upright) for s in of] for of in (link.visuals, solid))
        )

    fits = {way: fit(way) for way in (usual, other)}
    names = ", ".join(sorted(f.name for f in lying))
    does = {True: "is turned from y up to z up", False: "is left as its numbers are"}
    if fits[other] > _CLEARLY * fits[usual]:
        notes.append(f"link {link.name!r}: {names} {does[bool(other)]}: only so it fits the collision shapes")
        return other
    if fits[usual] <= _CLEARLY * fits[other]:
        notes.append(
            f"link {link.name!r}: {names} says that y points up and {does[bool(usual)]}: no shape confirms it"
        )
    return usual


def _overlap(visuals: Sequence[Array], solid: Sequence[Array]) -> float:
    """Intersection over union of the boxes around the points (n, 3) of both; 0 without any of one."""
    if not visuals or not solid:
        return 0.0
    (low, high), (under, over) = (_box_around(np.concatenate(points)) for points in (visuals, solid))
    common = float(np.prod(np.maximum(np.minimum(high, over) - np.maximum(low, under), 0.0)))
    return common / (float(np.prod(high - low) + np.prod(over - under)) - common)


def _box_around(points: Array) -> tuple[Array, Array]:
    """Lowest and highest corner of the box around points (n, 3), which a sheet's has a thickness for, too."""
    low, high = points.min(axis=0), points.max(axis=0)
    more = _SHEET * float((high - low).max()) + 1e-9
    return low - more, high + more

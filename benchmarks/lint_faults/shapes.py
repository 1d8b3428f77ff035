"""Shapes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.lint_faults.planting import FRONT, Mutations, attr, drop, prim

MUTATIONS = Mutations()
_add, _usd = MUTATIONS.add, MUTATIONS.usd

_add("urdf", "collider-missing", "none", drop("link[@name='door']/collision"))
_add("mjcf", "collider-missing", "none", drop(".//body[@name='door']/geom[@class='cabinet_collision']"))


@_usd("collider-missing", "none")
def _(stage: Any, _: Path) -> None:
    from pxr import UsdPhysics

    for p in list(stage.Traverse()):
        if "/door_collision_" in str(p.GetPath()):
            p.RemoveAPI(UsdPhysics.CollisionAPI)


_add("usd", "collider-approximation", "none", attr("/drawer_collision_0", "physics:approximation", "none"))
_add(
    "usd", "collider-approximation", "not written", attr("/drawer_collision_0", "physics:approximation", None)
)


def _rewrite(text: str | Callable[[str], str]) -> Callable[[Any, Path], None]:
    """Replace the drawer's first collision mesh file."""

    def change(_: Any, folder: Path) -> None:
        (path,) = folder.rglob("drawer_collision_0.obj")
        path.write_text(text if isinstance(text, str) else text(path.read_text()))

    return change


def _crossing(text: str) -> str:
    """A second, small box in the same file that pokes 5 mm out of the front."""
    vertices = [
        np.array([float(x) for x in line.split()[1:]]) for line in text.splitlines() if line.startswith("v ")
    ]
    center = np.mean(vertices, axis=0)
    more = [f"v {x} {y} {z}" for x, y, z in (center + 0.009 * FRONT + 0.6 * (v - center) for v in vertices)]
    faces = [
        [int(x) + len(vertices) for x in line.split()[1:]]
        for line in text.splitlines()
        if line.startswith("f ")
    ]
    return text + "\n".join([*more, *(f"f {a} {b} {c}" for a, b, c in faces)]) + "\n"


def _without_a_face(text: str) -> str:
    return "\n".join(text.splitlines()[:-1]) + "\n"


for _fmt in ("urdf", "mjcf"):
    _add(_fmt, "mesh-unusable", "no mesh in the file", _rewrite("not a mesh\n"))
    _add(_fmt, "mesh-unusable", "empty file", _rewrite(""))
    _add(_fmt, "mesh-open", "a face lost", _rewrite(_without_a_face))
    _add(_fmt, "mesh-self-intersecting", "two boxes cross", _rewrite(_crossing))
_add("usd", "mesh-unusable", "no points", attr("/drawer_collision_0", "points", lambda p: type(p)()))
_add(
    "usd",
    "mesh-unusable",
    "counts and indices differ",
    attr("/drawer_collision_0", "faceVertexCounts", lambda c: type(c)(list(c)[:-1])),
)


@_usd("mesh-open", "a face lost")
def _(stage: Any, _: Path) -> None:
    mesh = prim(stage, "/drawer_collision_0")
    for name, lost in (("faceVertexCounts", 1), ("faceVertexIndices", 3)):
        a = mesh.GetAttribute(name)
        a.Set(type(a.Get())(list(a.Get())[:-lost]))

"""What all layers share: units, names of prims, and values as USD holds them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, Vt

from twin import geometry as geo
from twin.exporters.tree import Tree
from twin.geometry import Array
from twin.names import unused


@contextmanager
def new_layer(path: Path, default_prim: str, doc: str) -> Iterator[Usd.Stage]:
    """A stage on the new file `path`, in metres and kilograms with z up; saved on leaving."""
    with _as_os_error(path):
        layer = Sdf.Layer.CreateNew(str(path))
    layer.documentation = doc
    layer.defaultPrim = default_prim
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    yield stage
    with _as_os_error(path):
        layer.Save()


@contextmanager
def _as_os_error(path: Path) -> Iterator[None]:
    """USD's own exception, which a full disk raises as well, as what other writers raise."""
    try:
        yield
    except Tf.ErrorException as e:
        raise OSError(f"{path}: {' '.join(str(e).split())}") from e


def link_path(tree: Tree, link: str) -> str:
    """Prim of a link."""
    return f"/{tree.name}/{link}"


def scope_path(tree: Tree, name: str) -> str:
    """Prim that holds all joints, materials or keyframes, beside the bodies; a body of that name keeps it."""
    return f"/{tree.name}/{unused(name, (k.name for k in tree.links))}"


def joint_path(tree: Tree, name: str) -> str:
    """Prim of a joint."""
    return f"{scope_path(tree, 'Joints')}/{name}"


def material_path(tree: Tree, name: str) -> str:
    """Prim of a material."""
    return f"{scope_path(tree, 'Materials')}/{name}"


def world_origins(tree: Tree) -> dict[str, Array]:
    """World position (3,) of every link's frame at state 0."""
    origins: dict[str, Array] = {}
    for link in tree.links:
        origins[link.name] = link.offset + (origins[link.parent] if link.parent is not None else 0.0)
    return origins


def quat(rotation: Array) -> Gf.Quatf:
    """A rotation matrix (3, 3) as quaternion."""
    w, x, y, z = map(float, geo.quat_wxyz_from_matrix(rotation))
    return Gf.Quatf(w, x, y, z)


def vec(values: Array) -> Gf.Vec3f:
    """A vector (3,) in single precision."""
    x, y, z = map(float, values)
    return Gf.Vec3f(x, y, z)


def points(values: Array) -> Vt.Vec3fArray:
    """Points (n, 3)."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values + 0.0, dtype=np.float32))


def ints(values: NDArray[np.integer]) -> Vt.IntArray:
    """Whole numbers (n,)."""
    return Vt.IntArray.FromNumpy(np.ascontiguousarray(values, dtype=np.int32))

"""What all layers share: units, names of prims, and values as USD holds them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, Vt

from twin import geometry as geo
from twin.exporters.tree import Tree
from twin.geometry import Array
from twin.names import unused

Group = Literal["visuals", "colliders"]
# what Isaac Sim's importer calls the two under a link; its prototypes have the names of the groups
_INSTANCES: dict[Group, str] = {"visuals": "visuals", "colliders": "collisions"}


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


def group_path(tree: Tree, link: str, group: Group) -> str:
    """Prim under which a link's shapes are written: its prototype, or the link if the asset has none.

    Without the inferred layer an asset has none, so that files of what was seen stay as they were.
    """
    return f"{_prototypes(tree, group)}/{link}" if tree.whole else link_path(tree, link)


def _prototypes(tree: Tree, group: Group) -> str:
    """Prim beside the asset's that holds a prototype per link; an asset of that name keeps it."""
    return f"/{unused(group, [tree.name])}"


def _abstract(stage: Usd.Stage, tree: Tree, group: Group) -> None:
    """A class, so that who opens the payload by itself does not see prototypes beside their instances; in
    every layer that defines what is in it, since the strongest specifier holds."""
    root = _prototypes(tree, group)
    if not stage.GetPrimAtPath(root):
        stage.CreateClassPrim(root).SetTypeName("Scope")


def shape_materials(stage: Usd.Stage, tree: Tree, link: str, group: Group) -> str:
    """Path of the prim that holds the materials of a link's shapes; a prototype's is defined.

    Inside the prototype: a relationship out of it leads from every copy of the asset into the same prim.
    """
    if not tree.whole:
        return scope_path(tree, "Materials")
    _abstract(stage, tree, group)
    return str(UsdGeom.Scope.Define(stage, f"{group_path(tree, link, group)}/Materials").GetPath())


def instance_group(stage: Usd.Stage, tree: Tree, link: str, group: Group) -> None:
    """Let a link's instance refer to what this layer stack says at its prototype, if the asset has one.

    Opinions on what is inside an instance are ignored unless they come by an arc of the instance itself
    (OpenUSD, Scenegraph Instancing), so a layer that is not of the payload's stack needs its own. The
    prototype's prim must be there.
    """
    if tree.whole:
        prim = stage.OverridePrim(f"{link_path(tree, link)}/{_INSTANCES[group]}")
        prim.GetReferences().AddInternalReference(group_path(tree, link, group))


def define_group(stage: Usd.Stage, tree: Tree, link: str, group: Group) -> None:
    """Define a link's prototype, and the instance that refers to it; nothing where the asset has none."""
    if not tree.whole:
        return
    _abstract(stage, tree, group)
    UsdGeom.Xform.Define(stage, group_path(tree, link, group))
    shown = UsdGeom.Xform.Define(stage, f"{link_path(tree, link)}/{_INSTANCES[group]}")
    instance_group(stage, tree, link, group)
    shown.GetPrim().SetInstanceable(True)


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

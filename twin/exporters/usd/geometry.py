"""Geometry: a library of meshes, and the bodies that refer to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSemantics, Vt

from twin import geometry as geo
from twin.exporters.obj import mean_color, textured_mesh
from twin.exporters.tree import Link, Tree, Visual
from twin.exporters.usd.layers import (
    define_group,
    group_path,
    ints,
    link_path,
    new_layer,
    points,
    vec,
    world_origins,
)
from twin.geometry import Array
from twin.scene import Box, Mesh

_LIBRARY = "GeometryLibrary.usdc"


def write_geometry(tree: Tree, payload: Path) -> None:
    """Write GeometryLibrary.usdc and Geometry.usda into `payload`."""
    with new_layer(
        payload / _LIBRARY, "Geometry", f"Meshes of {tree.name}, each in its body's frame"
    ) as stage:
        UsdGeom.Scope.Define(stage, "/Geometry")
        for link in tree.links:
            for shown in link.visuals:
                _visual(stage, f"/Geometry/{shown.name}", shown)
            for name, piece in link.shapes.items():
                if isinstance(piece, Mesh):
                    _hull(stage, f"/Geometry/{name}", piece)
    origins = world_origins(tree)
    with new_layer(payload / "Geometry.usda", tree.name, "Bodies, their shapes and grasp frames") as stage:
        UsdGeom.Xform.Define(stage, f"/{tree.name}")
        for link in tree.links:
            _body(stage, tree, link, origins[link.name])


def _body(stage: Usd.Stage, tree: Tree, link: Link, origin: Array) -> None:
    path = link_path(tree, link.name)
    body = UsdGeom.Xform.Define(stage, path)
    body.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, origin)))
    UsdSemantics.LabelsAPI.Apply(body.GetPrim(), "class").CreateLabelsAttr(
        [link.kind if tree.whole else link.name]
    )
    _shapes(stage, tree, link)
    if link.grasp is not None:
        _place(UsdGeom.Xform.Define(stage, f"{path}/{link.name}_grasp"), link.grasp)
    for region in link.regions:
        inside = UsdGeom.Xform.Define(stage, f"{path}/{region.name}_region")
        _place(inside, region.box.T_world_box)
        UsdSemantics.LabelsAPI.Apply(inside.GetPrim(), "class").CreateLabelsAttr(["interior"])
        inside.GetPrim().SetCustomDataByKey("size", vec(region.box.size))


def _shapes(stage: Usd.Stage, tree: Tree, link: Link) -> None:
    """What is drawn of a link and what of it collides."""
    if link.visuals:
        define_group(stage, tree, link.name, "visuals")
    for shown in link.visuals:
        path = f"{group_path(tree, link.name, 'visuals')}/{shown.name}"
        _refer(stage, path)
        if shown.basis != "seen":
            prim = stage.GetPrimAtPath(path)
            prim.SetCustomDataByKey("inferred", {"basis": shown.basis, "reason": shown.reason})
            UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr([shown.role])
    if link.shapes:
        define_group(stage, tree, link.name, "colliders")
    for name, piece in link.shapes.items():
        path = f"{group_path(tree, link.name, 'colliders')}/{name}"
        if isinstance(piece, Mesh):
            _refer(stage, path)
        else:
            _box(stage, path, piece)
        UsdGeom.Imageable(stage.GetPrimAtPath(path)).CreatePurposeAttr(UsdGeom.Tokens.guide)


def _refer(stage: Usd.Stage, path: str) -> None:
    """Define a prim that is the library's of the same name."""
    name = path.rsplit("/", 1)[1]
    stage.DefinePrim(path).GetReferences().AddReference(f"./{_LIBRARY}", f"/Geometry/{name}")


def _box(stage: Usd.Stage, path: str, box: Box) -> None:
    """A cube as large as the box's shortest side, stretched from there.

    OpenUSD takes a matrix whose determinant is below 1e-10 for singular (GfMatrix4d::Factor): a cube of 1 m
    shrunk to a handle of 0.4 mm would come to that, and MuJoCo's reader would give up.
    """
    cube, side = UsdGeom.Cube.Define(stage, path), float(min(box.size))
    cube.CreateSizeAttr(side)
    cube.CreateExtentAttr(points(np.array([[-side / 2] * 3, [side / 2] * 3])))
    _place(cube, box.T_world_box)
    cube.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*(float(s) / side for s in box.size)))


def _place(shape: UsdGeom.Xformable, pose: Array) -> None:
    shape.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, pose[:3, 3])))
    w, x, y, z = map(float, geo.quat_wxyz_from_matrix(pose[:3, :3]))
    shape.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, x, y, z))


def _visual(stage: Usd.Stage, path: str, shown: Visual) -> None:
    """A mesh with its colours twice: texture coordinates, and the display colours of its vertices."""
    mesh = shown.mesh
    dressed = textured_mesh(mesh)
    baked, normals, corners = dressed.baked, dressed.normals, dressed.corners
    shape = _mesh(stage, path, mesh.vertices, mesh.faces[baked.order])
    kind = Sdf.ValueTypeNames.Normal3fArray
    _primvar(shape, "normals", kind, points(_unit(normals)), "faceVarying", corners.ravel())
    index: NDArray[np.integer] | None
    if baked.image is not None and mesh.colors is not None:
        uv = Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(baked.uv, dtype=np.float32))
        _primvar(shape, "st", Sdf.ValueTypeNames.TexCoord2fArray, uv, "faceVarying")
        colors, which = np.unique(mesh.colors, axis=0, return_inverse=True)
        # white is first, of no vertex: MuJoCo takes a table's first colour and tints textures with it
        table = np.concatenate([np.ones((1, 3)), (colors / 255.0) ** 2.2])
        where, index = "vertex", which.ravel() + 1
    else:
        plain = mean_color(mesh) if shown.color is None else shown.color
        table, where, index = np.array([plain]) ** 2.2, "constant", None
    _primvar(shape, "displayColor", Sdf.ValueTypeNames.Color3fArray, points(np.round(table, 4)), where, index)


def _hull(stage: Usd.Stage, path: str, mesh: Mesh) -> None:
    """A convex piece with one normal per face."""
    shape = _mesh(stage, path, mesh.vertices, mesh.faces)
    directed = geo.vector_areas(mesh.vertices[mesh.faces])
    normals, index = np.unique(np.round(_unit(directed), 4), axis=0, return_inverse=True)
    _primvar(
        shape, "normals", Sdf.ValueTypeNames.Normal3fArray, points(_unit(normals)), "uniform", index.ravel()
    )


def _mesh(stage: Usd.Stage, path: str, vertices: Array, faces: NDArray[np.int32]) -> UsdGeom.Mesh:
    shape = UsdGeom.Mesh.Define(stage, path)
    shape.CreatePointsAttr(points(vertices))
    shape.CreateFaceVertexCountsAttr(ints(np.full(len(faces), 3)))
    shape.CreateFaceVertexIndicesAttr(ints(faces.ravel()))
    shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    shape.CreateExtentAttr(points(np.stack([vertices.min(axis=0), vertices.max(axis=0)])))
    return shape


def _primvar(
    shape: UsdGeom.Mesh, name: str, kind: Sdf.ValueTypeName, values: object, where: str, index: NDArray[np.integer] | None = None,
) -> None:  # fmt: skip
    primvar = UsdGeom.PrimvarsAPI(shape).CreatePrimvar(name, kind, where)
    primvar.Set(values)
    if index is not None:
        primvar.SetIndices(ints(index))


def _unit(vectors: Array) -> Array:
    """Vectors (n, 3) at length 1; up where there is none."""
    length = np.linalg.norm(vectors, axis=1)
    out = np.where(length[:, None] > 1e-12, vectors / np.maximum(length, 1e-300)[:, None], [0.0, 0.0, 1.0])
    return np.asarray(out, dtype=np.float64)

"""Shapes of complete USD assets are instances: nothing else draws or collides, they are what the other
writers' are, and copies share them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdSemantics, UsdShade

import twin as tw
from benchmarks.lint_faults.planting import as_mesh
from tests.makers.twin import scans
from twin.completion import with_completion
from twin.completion.asset import AssetView
from twin.exporters import complete
from twin.exporters.tree import Tree, build_tree
from twin.scene import Box, Mesh, Twin

WHOLE = AssetView("complete", "keep", "furniture")
GROUPS = {"visuals", "collisions"}


@pytest.fixture(scope="module")
def scanned() -> Twin:
    """A drawer whose part also collides by a hull, as what lies in no board does."""
    found = complete(with_completion(scans.twin_of(scans.drawer())))
    layer = found.parts[0].completion
    assert layer is not None
    board = next(s for p in layer.pieces for s in p.shapes if isinstance(s, Box))
    layer = replace(layer, collision=(*layer.collision, as_mesh(board)))
    return replace(found, parts=(replace(found.parts[0], completion=layer), *found.parts[1:]))


@pytest.fixture(scope="module")
def tree(scanned: Twin) -> Tree:
    return build_tree(complete(WHOLE.of(scanned), view=WHOLE))


@pytest.fixture(scope="module")
def folder(scanned: Twin, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("instances")
    tw.export(scanned, out, ["mjcf", "usd"], view=WHOLE)
    return out


def interface(folder: Path) -> Path:
    return folder / "usd" / "scan" / "simready_usd" / "scan.usda"


def everything(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    return iter(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))


def shapes(stage: Usd.Stage) -> dict[str, Usd.Prim]:
    """All meshes and boxes by name."""
    found = [p for p in everything(stage) if p.IsA(UsdGeom.Mesh) or p.IsA(UsdGeom.Cube)]
    named = {p.GetName(): p for p in found}
    assert len(named) == len(found), "each is there once"
    return named


def chosen(path: Path, runtime: str) -> Usd.Stage:
    stage = Usd.Stage.Open(Sdf.Layer.FindOrOpen(str(path)), Sdf.Layer.CreateAnonymous())
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        stage.GetDefaultPrim().GetVariantSets().GetVariantSet(runtime).SetVariantSelection("Enabled")
    return stage


def test_whatever_is_drawn_or_collides_is_in_an_instance_of_its_body(tree: Tree, folder: Path) -> None:
    files = (folder / "usd" / "scan.usda", folder / "usd" / "scan_physx.usda", interface(folder))
    for path in files:
        stage = Usd.Stage.Open(str(path))
        assert not stage.GetCompositionErrors()
        found = shapes(stage)
        for link in tree.links:
            for group, names in (
                ("visuals", [v.name for v in link.visuals]),
                ("collisions", [*link.shapes]),
            ):
                above = stage.GetPrimAtPath(f"/scan/{link.name}/{group}")
                assert above.IsInstance(), (path, link.name, group)
                assert above.IsInstanceable()
                inside = {p.GetName() for p in above.GetFilteredChildren(Usd.TraverseInstanceProxies())}
                assert inside == {*names, "Materials"}
                assert all(found.pop(n).IsInstanceProxy() for n in names)
                assert not above.HasAPI(UsdPhysics.RigidBodyAPI)  # a body moves, what is inside can't
        assert not found


def test_who_opens_the_payload_sees_no_prototype_beside_its_instance(folder: Path) -> None:
    payload = interface(folder).parent / "Payload"
    for name in ("Contents.usda", "Geometry.usda"):
        drawn = shapes(Usd.Stage.Open(str(payload / name)))
        assert drawn
        assert {str(p.GetPath()).split("/")[1] for p in drawn.values()} == {"scan"}


def test_instances_have_the_points_and_places_of_the_tree(tree: Tree, folder: Path) -> None:
    stage = Usd.Stage.Open(str(folder / "usd" / "scan.usda"))
    found, cache = shapes(stage), UsdGeom.XformCache()
    for link in tree.links:
        meshes = {v.name: v.mesh for v in link.visuals}
        meshes |= {n: s for n, s in link.shapes.items() if isinstance(s, Mesh)}
        body = cache.GetLocalToWorldTransform(stage.GetPrimAtPath(f"/scan/{link.name}"))
        for name, mesh in meshes.items():
            shape = UsdGeom.Mesh(found[name])
            assert np.array_equal(np.array(shape.GetPointsAttr().Get()), mesh.vertices.astype(np.float32)), (
                name
            )
            corners = np.array(shape.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
            assert sorted(map(tuple, corners.tolist())) == sorted(map(tuple, mesh.faces.tolist())), name
            assert cache.GetLocalToWorldTransform(found[name]) == body


def test_instances_are_where_and_as_large_as_in_the_mjcf(folder: Path) -> None:
    stage = Usd.Stage.Open(str(folder / "usd" / "scan.usda"))
    model = mujoco.MjModel.from_xml_path(str(folder / "mjcf" / "scan.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    purposes = [UsdGeom.Tokens.default_, UsdGeom.Tokens.guide]
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), purposes)
    found = shapes(stage)
    assert {model.geom(g).name for g in range(model.ngeom)} == set(found)
    for g in range(model.ngeom):
        prim, k = found[model.geom(g).name], int(model.geom_dataid[g])
        if k >= 0:
            corners = model.mesh_vert[model.mesh_vertadr[k] : model.mesh_vertadr[k] + model.mesh_vertnum[k]]
            told = len(UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get())
            assert told == model.mesh_facenum[k], prim.GetName()
        else:
            signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
            corners = signs * model.geom_size[g]
        world = corners @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g]
        if k >= 0:  # of the points: USD's own bound is of the box around them
            matrix = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim))
            points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get()) @ matrix[:3, :3] + matrix[3, :3]
            low, high = points.min(axis=0), points.max(axis=0)
        else:
            box = cache.ComputeWorldBound(prim).ComputeAlignedRange()
            low, high = np.array(box.GetMin()), np.array(box.GetMax())
        assert np.allclose([low, high], [world.min(axis=0), world.max(axis=0)], atol=2e-6), prim.GetName()


def test_physics_and_looks_are_inside_the_instances(tree: Tree, folder: Path) -> None:
    stage = Usd.Stage.Open(str(folder / "usd" / "scan.usda"))
    found = shapes(stage)
    for link in tree.links:
        for name, piece in link.shapes.items():
            prim = found[name]
            assert prim.HasAPI(UsdPhysics.CollisionAPI)
            assert UsdGeom.Imageable(prim).ComputePurpose() == UsdGeom.Tokens.guide
            if isinstance(piece, Mesh):
                assert UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get() == "convexHull"
            for purpose in ("", "physics"):
                touch, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(purpose)
                friction = UsdPhysics.MaterialAPI(touch.GetPrim()).GetDynamicFrictionAttr().Get()
                assert friction == pytest.approx(link.friction)
        for shown in link.visuals:
            prim = found[shown.name]
            assert not prim.HasAPI(UsdPhysics.CollisionAPI)
            look, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
            assert look.ComputeSurfaceSource()[0], shown.name
            if shown.basis != "seen":
                told = {"basis": shown.basis, "reason": shown.reason}
                assert dict(prim.GetCustomDataByKey("inferred")) == told
                labels = UsdSemantics.LabelsAPI(prim, "class").GetLabelsAttr().Get()
                assert list(labels) == [shown.role]


def test_runtimes_reach_into_the_instances_and_only_where_they_are_on(tree: Tree, folder: Path) -> None:
    """By arcs of their own: USD ignores what a stronger layer says of a prim inside an instance."""
    meshes = {n for k in tree.links for n, s in k.shapes.items() if isinstance(s, Mesh)}
    assert meshes

    def applied(stage: Usd.Stage, schema: str) -> set[str]:
        return {n for n, p in shapes(stage).items() if schema in p.GetPrimTypeInfo().GetAppliedAPISchemas()}

    path = interface(folder)
    assert applied(chosen(path, "Newton"), "NewtonMeshCollisionAPI") == meshes
    mine = chosen(path, "MuJoCo")
    assert applied(mine, "MjcCollisionAPI") == {n for k in tree.links for n in k.shapes}
    assert applied(mine, "MjcImageableAPI") == {v.name for k in tree.links for v in k.visuals}
    groups = {n: p.GetAttribute("mjc:group").Get() for n, p in shapes(mine).items()}
    assert groups == {n: 3 if n in applied(mine, "MjcCollisionAPI") else 2 for n in groups}
    for stage in (Usd.Stage.Open(str(path)), chosen(path, "PhysX")):
        schemas = {s for p in everything(stage) for s in p.GetPrimTypeInfo().GetAppliedAPISchemas()}
        assert not [s for s in schemas if s.startswith(("Newton", "Mjc"))]


@pytest.fixture(scope="module")
def scene(folder: Path) -> Usd.Stage:
    """Three copies of the asset, side by side."""
    stage = Usd.Stage.CreateInMemory()
    for k, name in enumerate(("a", "b", "c")):
        copy = UsdGeom.Xform.Define(stage, f"/World/{name}")
        copy.GetPrim().GetReferences().AddReference(str(interface(folder)))
        copy.AddTranslateOp().Set(Gf.Vec3d(3.0 * k, 0.0, 0.0))
    return stage


def test_copies_share_what_they_are_made_of_and_nothing_leads_from_one_into_another(
    tree: Tree, scene: Usd.Stage
) -> None:
    assert len(scene.GetPrototypes()) == 2 * len(tree.links)
    gprims = [p for p in everything(scene) if p.IsA(UsdGeom.Gprim)]
    assert len(gprims) == 3 * sum(len(k.visuals) + len(k.shapes) for k in tree.links)
    for prim in gprims:
        for purpose in ("", "physics"):
            material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(purpose)
            assert material.GetPath().GetParentPath().GetParentPath() == prim.GetPath().GetParentPath()


def test_a_copy_can_be_dressed_by_what_is_bound_to_its_instance(tree: Tree, scene: Usd.Stage) -> None:
    part = tree.moving[0]
    red = UsdShade.Material.Define(scene, "/World/red")
    above = scene.GetPrimAtPath(f"/World/b/{part.name}/visuals")
    UsdShade.MaterialBindingAPI.Apply(above).Bind(red, UsdShade.Tokens.strongerThanDescendants)
    for name, other in (("a", False), ("b", True)):
        prim = scene.GetPrimAtPath(f"/World/{name}/{part.name}/visuals/{part.visuals[0].name}")
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        assert (material.GetPath() == red.GetPath()) == other

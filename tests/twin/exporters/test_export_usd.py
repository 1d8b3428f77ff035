"""The USD asset: layers, runtimes kept apart, metadata, looks; and what public validators say of it."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from pxr import Kind, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade

from benchmarks.scenes.boards import cabinet_twin
from twin import engines
from twin import geometry as geo
from twin.exporters import Exported, export
from twin.exporters.asset import AssetInfo
from twin.exporters.tree import build_tree, front
from twin.scene import Twin
from twin.validators import check_rules, stages, validate_usd

RUNTIMES = ("PhysX", "Newton", "MuJoCo")
FOREIGN = ("newton:", "mjc:", "physx", "drive:")


@pytest.fixture(scope="module")
def twin() -> Twin:
    return cabinet_twin(nested=True, lid=True)


@pytest.fixture(scope="module")
def exported(twin: Twin, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    info = AssetInfo(author="A. Maker", license="CC0-1.0", qcode="Q36794", date="2026-01-31")
    return export(twin, tmp_path_factory.mktemp("usd"), formats=("mjcf", "usd"), asset=info)


@pytest.fixture(scope="module")
def asset(exported: Exported) -> Path:
    return exported["usd"].parent / "cabinet" / "simready_usd"


def opened(path: Path, **variants: str) -> Usd.Stage:
    """A stage with these variants chosen."""
    stage = Usd.Stage.Open(Sdf.Layer.FindOrOpen(str(path)), Sdf.Layer.CreateAnonymous())
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for name, option in variants.items():
            assert stage.GetDefaultPrim().GetVariantSets().GetVariantSet(name).SetVariantSelection(option)
    return stage


def test_the_interface_is_light_and_the_payload_holds_all(twin: Twin, asset: Path) -> None:
    light = Usd.Stage.Open(str(asset / "cabinet.usda"), Usd.Stage.LoadNone)
    root = light.GetDefaultPrim()
    assert [p.GetName() for p in light.TraverseAll()] == ["cabinet"]
    assert Usd.ModelAPI(root).GetKind() == Kind.Tokens.component
    points = np.concatenate([m.vertices for m in (twin.static.mesh, *(p.mesh for p in twin.parts))])
    hint = np.array(UsdGeom.ModelAPI(root).GetExtentsHintAttr().Get())
    assert np.allclose(hint, [points.min(0), points.max(0)], atol=1e-6)
    full = opened(asset / "cabinet.usda")
    bodies = [p.GetName() for p in full.Traverse() if p.HasAPI(UsdPhysics.RigidBodyAPI)]
    assert sorted(bodies) == sorted(["carcass", *(p.name for p in twin.parts)])
    used = {Path(x.realPath).relative_to(asset).as_posix() for x in full.GetUsedLayers() if x.realPath}
    assert used == {
        "cabinet.usda", "Payload/Contents.usda", "Payload/Physics.usda", "Payload/Materials.usda", "Payload/Geometry.usda",
        "Payload/GeometryLibrary.usdc", "Payload/MaterialsLibrary.usdc",
    }  # fmt: skip


def test_every_layer_says_its_units(exported: Exported) -> None:
    layers = [p for p in exported["usd"].parent.rglob("*.usd*") if p.suffix in (".usda", ".usdc")]
    assert len(layers) == 14
    for path in layers:
        stage = Usd.Stage.Open(str(path), Usd.Stage.LoadNone)
        assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0, path
        assert UsdPhysics.StageHasAuthoredKilogramsPerUnit(stage), path
        assert UsdPhysics.GetStageKilogramsPerUnit(stage) == 1.0, path
        assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z, path
        assert stage.GetRootLayer().HasDefaultPrim(), path


def test_no_runtime_sees_what_another_one_says(twin: Twin, asset: Path) -> None:
    """Each variant brings its own resistance in its own unit; readers would add up what several say."""
    own = {"PhysX": ("physx", "drive:"), "Newton": ("newton:",), "MuJoCo": ("mjc:",)}
    door, drawer = (twin.part(n).physics for n in ("door", "drawer"))
    degree = np.deg2rad(1.0)
    want = {
        "PhysX": (
            "drive:angular:physics:damping",
            door.damping.value * degree,
            "drive:linear:physics:damping",
        ),
        "Newton": ("newton:damping", door.damping.value * degree, "newton:damping"),
        "MuJoCo": ("mjc:damping", door.damping.value, "mjc:damping"),
    }
    for runtime in ("", *RUNTIMES):
        stage = opened(asset / "cabinet.usda", **({runtime: "Enabled"} if runtime else {}))
        seen = {n for p in stage.Traverse() for n in p.GetAuthoredPropertyNames() if n.startswith(FOREIGN)}
        allowed = own.get(runtime, ())
        assert all(n.startswith(allowed) for n in seen) if allowed else not seen, (runtime, seen)
        if runtime:
            angular, value, linear = want[runtime]
            joints = {n: stage.GetPrimAtPath(f"/cabinet/Joints/{n}_joint") for n in ("door", "drawer")}
            assert joints["door"].GetAttribute(angular).Get() == pytest.approx(value, rel=1e-6)
            assert joints["drawer"].GetAttribute(linear).Get() == pytest.approx(
                drawer.damping.value, rel=1e-6
            )
    stage = opened(asset / "cabinet.usda", PhysX="Enabled")
    drive = UsdPhysics.DriveAPI(stage.GetPrimAtPath("/cabinet/Joints/lid_joint"), "angular")
    assert drive.GetStiffnessAttr().Get() == 0.0


def test_the_ready_stages_choose_one_runtime_and_have_gravity(exported: Exported) -> None:
    for path, runtime in (
        (exported["usd"], "Newton"),
        (exported["usd"].parent / "cabinet_physx.usda", "PhysX"),
    ):
        stage = opened(path)
        sets = stage.GetDefaultPrim().GetVariantSets()
        chosen = {n for n in RUNTIMES if sets.GetVariantSelection(n) == "Enabled"}
        assert chosen == {runtime}
        scenes = [p for p in stage.Traverse() if p.IsA(UsdPhysics.Scene)]
        assert len(scenes) == 1
        assert UsdPhysics.Scene(scenes[0]).GetGravityMagnitudeAttr().Get() == pytest.approx(9.81)


def test_grasp_lines_run_through_what_is_held_and_are_off(twin: Twin, asset: Path) -> None:
    stage = opened(asset / "cabinet.usda")
    assert not [p for p in stage.Traverse() if p.IsA(UsdGeom.Curves)]
    stage = opened(asset / "cabinet.usda", Grasps="Enabled")
    for name in ("door", "drawer"):
        line = UsdGeom.BasisCurves(
            stage.GetPrimAtPath(f"/cabinet/{name}/{name}_grasp/grasp_identifier_{name}")
        )
        to_world = UsdGeom.Xformable(line).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
        ends = np.array([to_world.Transform(p) for p in line.GetPointsAttr().Get()])
        contact = twin.part(name).contact
        assert np.allclose(ends.mean(0), contact.point, atol=1e-6)
        along = geo.unit(ends[1] - ends[0])
        assert abs(along @ contact.rotation[:, 0]) == pytest.approx(1.0, abs=1e-6)
        assert np.linalg.norm(ends[1] - ends[0]) > contact.width


def test_metadata_tells_what_the_asset_is(twin: Twin, asset: Path) -> None:
    stage = opened(asset / "cabinet.usda")
    told = stage.GetRootLayer().customLayerData["SimReady_Metadata"]
    assert (told["author"], told["asset_license"], told["qcode"]) == ("A. Maker", "CC0-1.0", "Q36794")
    assert told["usd_date_generated"] == "2026-01-31"
    assert told["source_file"] == "closed_form"
    assert told["rigid_body_count"] == 5
    masses = [
        UsdPhysics.MassAPI(p).GetMassAttr().Get() for p in stage.Traverse() if p.HasAPI(UsdPhysics.MassAPI)
    ]
    assert told["mass"] == pytest.approx(sum(masses), rel=1e-6)
    assert told["mass"] > sum(p.inertial.mass.value for p in twin.parts)
    hint = np.array(UsdGeom.ModelAPI(stage.GetDefaultPrim()).GetExtentsHintAttr().Get())
    assert np.allclose(told["asset_extents"], hint[1] - hint[0], atol=1e-6)


def test_the_thumbnail_shows_the_front(twin: Twin, asset: Path) -> None:
    picture = cv2.imread(str(asset / ".thumbs" / "256x256" / "cabinet.usda.png"))[..., ::-1].astype(int)
    assert picture.shape == (256, 256, 3)
    background = np.abs(picture - picture[0, 0]).max(axis=2) < 6
    assert 0.2 < np.mean(~background) < 0.95
    pale = np.ptp(picture[~background], axis=1) < 20  # fronts are pale grey, the carcass is brown
    assert pale.mean() > 0.5
    outward = twin.part("drawer").joint.axis
    assert front(build_tree(twin)) @ outward == pytest.approx(1.0, abs=1e-6)


def test_the_static_scene_weighs_what_its_boards_would(twin: Twin) -> None:
    """As much per area as the parts, with the moments of that surface."""
    root = build_tree(twin).root
    per_area = sum(p.inertial.mass.value for p in twin.parts) / sum(p.mesh.area for p in twin.parts)
    assert root.mass == pytest.approx(per_area * twin.static.mesh.area, rel=1e-9)
    assert np.allclose(root.com, twin.static.mesh.area_centroid, atol=1e-9)
    moments = np.linalg.eigvalsh(root.inertia)
    assert moments[0] + moments[1] > moments[2] > 0
    rng = np.random.default_rng(0)
    mesh, corner = twin.static.mesh, twin.static.mesh.vertices[twin.static.mesh.faces]
    weight = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    face = rng.choice(len(mesh.faces), 200_000, p=weight / weight.sum())
    sampled = np.einsum("nk,nkd->nd", rng.dirichlet([1, 1, 1], len(face)), corner[face]) - root.com
    second = sampled.T @ sampled / len(sampled)
    assert np.allclose(
        root.mass * (np.trace(second) * np.eye(3) - second), root.inertia, rtol=0.02, atol=0.05
    )


def test_looks_are_bound_inside_the_asset_and_textures_resolve(asset: Path) -> None:
    stage = opened(asset / "cabinet.usda")
    shapes = [p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh) and p.GetName().endswith("_visual")]
    assert len(shapes) == 5
    for shape in shapes:
        material, _ = UsdShade.MaterialBindingAPI(shape).ComputeBoundMaterial()
        assert material.GetPath().HasPrefix("/cabinet/Materials")
        texture = stage.GetPrimAtPath(f"{material.GetPath()}/texture")
        file = UsdShade.Shader(texture).GetInput("file").Get()
        assert file.path.startswith("../Textures/")
        assert Path(file.resolvedPath).is_file()


MUJOCO = """
import json, sys
import mujoco._usd, mujoco
model = mujoco.MjSpec.from_file(sys.argv[1]).compile()
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, [k for k in range(model.nkey) if model.key(k).name.endswith("open")][0])
opened = {model.joint(j).name.split("/")[-1]: float(data.qpos[j]) for j in range(model.njnt)}
mujoco.mj_resetData(model, data)
mujoco.mj_forward(model, data)
shown = [g for g in range(model.ngeom) if model.geom_group[g] == 2]
print(json.dumps({
    "open": opened,
    "sites": {model.site(s).name.split("/")[-1]: data.site_xpos[s].tolist() for s in range(model.nsite)},
    "groups": sorted(set(model.geom_group.tolist())),
    "tints": [model.geom_rgba[g].tolist() for g in shown],
    "textured": [int(model.mat_texid[model.geom_matid[g]].max()) for g in shown],
    "colorspace": model.tex_colorspace.tolist(),
    "armature": sorted(set(model.dof_armature.tolist())),
    "contacts": int(data.ncon),
    "excluded": model.nexclude,
}))
"""


def test_mujoco_finds_keyframes_sites_groups_and_untinted_textures(twin: Twin, exported: Exported) -> None:
    done = subprocess.run(
        [sys.executable, "-c", MUJOCO, str(exported["usd"])], capture_output=True, text=True, check=True
    )
    told = json.loads(done.stdout)
    assert "WARNING" not in done.stderr
    assert told["open"] == {f"{p.name}_joint": pytest.approx(p.joint.upper, rel=1e-6) for p in twin.parts}
    for name in ("door", "drawer"):
        assert np.allclose(told["sites"][f"{name}_grasp_site"], twin.part(name).contact.point, atol=1e-6)
    assert told["groups"] == [2, 3]
    assert told["tints"] == [[1.0, 1.0, 1.0, 1.0]] * 5, "white, which does not tint"
    assert min(told["textured"]) >= 0
    assert set(told["colorspace"]) == {1}, "as the MJCF's textures"
    joints = [k.joint for k in build_tree(twin).moving]
    assert told["armature"] == pytest.approx(sorted(j.armature for j in joints), rel=1e-6)
    assert (told["contacts"], told["excluded"]) == (0, 4)


def test_openusd_finds_nothing_and_a_planted_fault(exported: Exported, tmp_path: Path) -> None:
    files = stages(exported["usd"])
    assert [f.name for f in files] == ["cabinet.usda", "cabinet_physx.usda", "cabinet.usda"]
    assert check_rules(files) == []
    broken = Path(shutil.copytree(exported["usd"].parent, tmp_path / "usd"))
    physics = broken / "cabinet" / "simready_usd" / "Payload" / "Physics.usda"
    text = physics.read_text()
    assert "rel physics:body1 = </cabinet/lid>" in text
    physics.write_text(
        text.replace("rel physics:body1 = </cabinet/lid>", "rel physics:body1 = </cabinet/none>")
    )
    found = check_rules(stages(broken / "cabinet.usda"))
    assert {(f.validator, f.severity) for f in found} == {("openusd", "error")}
    assert all("PhysicsJointChecker" in f.rule and "lid_joint" in f.where for f in found)


@pytest.mark.skipif(
    not engines.engine("validators").installed, reason="twin engines --install validators was not run"
)
def test_nvidias_validators_pass_the_asset_and_catch_planted_faults(
    exported: Exported, tmp_path: Path
) -> None:
    verdict = validate_usd(exported["usd"])
    assert verdict.ok, verdict.errors
    warned = {f.rule for f in verdict.findings if f.severity == "warning"}
    # The twin's own meshes are open; the white that MuJoCo's reader tints textures with belongs to no vertex.
    assert warned <= {"WeldChecker", "ManifoldChecker", "UnusedPrimvarChecker"}
    needed = {f"FET_{n}_{r.upper()}" for n in ("000", "003", "004") for r in (*RUNTIMES, "Standard")}
    assert {k for k in needed if not verdict.features[k]} == set()
    broken = Path(shutil.copytree(exported["usd"].parent, tmp_path / "usd"))
    inside = broken / "cabinet" / "simready_usd"
    shutil.rmtree(inside / ".thumbs")
    newton = inside / "runnables" / "physics" / "newton.usda"
    newton.write_text(newton.read_text().replace("newton:damping", "mjc:damping"))
    interface = inside / "cabinet.usda"
    text = interface.read_text().replace("metersPerUnit = 1", "metersPerUnit = 0.01")
    interface.write_text(text.replace('Grasps = "Disabled"', 'Grasps = "Enabled"'))
    told = validate_usd(broken / "cabinet.usda")
    assert not told.ok
    assert told.features["FET_005_STANDARD"]  # grasp lines, as the profile wants them
    text = "\n".join(f"{f.validator} {f.rule} {f.message}" for f in told.findings)
    assert "SR.002" in text  # no thumbnail
    assert "UN.007" in text  # not in metres
    assert "RV.011" in text  # another runtime's attribute under Newton

"""Exported files are complete in themselves, repeatable, and hold what the twin holds."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import cv2
import mujoco
import numpy as np
import pytest

import twin as funtwin
from benchmarks.scenes.boards import cabinet_twin
from twin import geometry as geo
from twin.errors import InputError, SceneError
from twin.exporters import Exported, export
from twin.exporters.asset import AssetInfo
from twin.exporters.obj import bake
from twin.exporters.tree import build_tree
from twin.exporters.urdf import roll_pitch_yaw
from twin.scene import Mesh


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return export(cabinet_twin(nested=True, lid=True), tmp_path_factory.mktemp("export"))


def test_export_and_check_are_functions_with_signatures(tmp_path: Path) -> None:
    """The packages that hold them have other names: importing one never hides the function."""
    fresh = (
        "import inspect, twin, twin.exporters.urdf, twin.verification.compare; "
        "print(inspect.isfunction(twin.export), inspect.isfunction(twin.check), *inspect.signature(twin.export).parameters)"
    )
    done = subprocess.run([sys.executable, "-c", fresh], capture_output=True, text=True, check=True)
    assert done.stdout.split()[:4] == ["True", "True", "twin", "folder"]
    assert dict(funtwin.export(cabinet_twin(), tmp_path, formats=("mjcf",))) == {
        "mjcf": tmp_path / "mjcf" / "cabinet.xml"
    }


def test_importing_twin_stays_light() -> None:
    code = "import sys, twin; print([m for m in ('mujoco', 'pxr', 'open3d', 'scipy', 'cv2') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_layout_and_self_contained_folders(exported: Exported, tmp_path: Path) -> None:
    assert {f: p.name for f, p in exported.items()} == {
        "urdf": "cabinet.urdf",
        "mjcf": "cabinet.xml",
        "usd": "cabinet.usda",
    }
    assert (exported["mjcf"].parent / "scene.xml").exists()
    for fmt in exported:
        for f in exported[fmt].parent.rglob("*"):
            if f.suffix in (".urdf", ".xml", ".usda", ".mtl"):
                assert str(exported[fmt].parent) not in f.read_text(), "no absolute path"
    moved = tmp_path / "elsewhere"
    exported["mjcf"].parent.rename(moved)
    try:
        assert mujoco.MjModel.from_xml_path(str(moved / "scene.xml")).njnt == 4
    finally:
        moved.rename(exported["mjcf"].parent)


def test_equal_twins_give_equal_bytes_also_in_another_process(exported: Exported, tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from benchmarks.scenes.boards import cabinet_twin; from twin.exporters import export;"
        "export(cabinet_twin(nested=True, lid=True), Path(sys.argv[1]))"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "7", "PYTHONPATH": str(Path(__file__).parents[3])}
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=True, env=environment)
    for fmt in exported:
        root, again = exported[fmt].parent, tmp_path / fmt
        names = sorted(p.relative_to(root) for p in root.rglob("*") if p.is_file())
        assert names == sorted(p.relative_to(again) for p in again.rglob("*") if p.is_file())
        for n in names:
            assert (root / n).read_bytes() == (again / n).read_bytes(), (fmt, n)


def test_whatever_a_format_can_not_carry_is_said(exported: Exported) -> None:
    said = "\n".join(exported.warnings)
    for words in (
        "urdf: contact friction",
        "urdf: pairs",
        "urdf: the keyframes",
        "usd: the keyframes",
        "usd: grasp",
    ):
        assert words in said
    assert "mjcf:" not in said


def test_mjcf_keyframes_sites_and_exclusions(exported: Exported) -> None:
    model = mujoco.MjModel.from_xml_path(str(exported["mjcf"]))
    data = mujoco.MjData(model)
    twin = cabinet_twin(nested=True, lid=True)
    mujoco.mj_resetDataKeyframe(model, data, model.key("open").id)
    mujoco.mj_forward(model, data)
    for p in twin.parts:
        assert data.joint(f"{p.name}_joint").qpos[0] == pytest.approx(p.joint.upper)
    mujoco.mj_resetDataKeyframe(model, data, model.key("closed").id)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    for name in ("door", "drawer"):
        site, contact = data.site(f"{name}_grasp"), twin.part(name).contact
        assert np.allclose(site.xpos, contact.point, atol=1e-9)
        assert np.allclose(site.xmat.reshape(3, 3), contact.rotation, atol=1e-9)
    assert model.nexclude == 4
    visual = [g for g in range(model.ngeom) if model.geom_group[g] == 2]
    assert len(visual) == 5
    assert all(model.geom_contype[g] == 0 and model.geom_matid[g] >= 0 for g in visual)


def test_gravity_does_not_move_a_closed_cabinet(exported: Exported) -> None:
    model = mujoco.MjModel.from_xml_path(str(exported["mjcf"].parent / "scene.xml"))
    data = mujoco.MjData(model)
    for _ in range(2000):
        mujoco.mj_step(model, data)
    doors = [data.joint(f"{n}_joint").qpos[0] for n in ("door", "drawer", "flap")]
    assert np.abs(doors).max() < 1e-3


def test_colours_are_seen_where_the_twin_has_them(exported: Exported) -> None:
    """Each texture coordinate of a face reads back the colour of its vertex."""
    mesh = cabinet_twin().part("drawer").mesh
    baked = bake(mesh)
    side = baked.image.shape[0]
    texel = np.floor(baked.uv * side).astype(int)
    read = baked.image[side - 1 - texel[:, 1], texel[:, 0]]
    assert np.array_equal(read, mesh.colors[mesh.faces[baked.order].ravel()])
    png = cv2.imread(str(exported["mjcf"].parent / "assets" / "drawer_visual.png"))[..., ::-1]
    assert np.array_equal(png, baked.image)


def test_a_mesh_without_colours_is_grey_and_needs_no_texture(tmp_path: Path) -> None:
    twin = cabinet_twin()
    bare = replace(twin.static, mesh=Mesh(twin.static.mesh.vertices, twin.static.mesh.faces))
    files = export(replace(twin, static=bare), tmp_path)
    model = mujoco.MjModel.from_xml_path(str(files["mjcf"]))
    assert np.allclose(model.material("carcass_material").rgba[:3], 180 / 255, atol=1e-3)
    assert not (tmp_path / "mjcf" / "assets" / "carcass_visual.png").exists()
    assert not (tmp_path / "usd" / "cabinet" / "simready_usd" / "Textures" / "carcass.png").exists()


def test_urdf_details(exported: Exported, tmp_path: Path) -> None:
    root = ET.parse(exported["urdf"]).getroot()  # noqa: S314  (a file this test wrote)
    assert root.find("link[@name='world']") is not None
    for joint in root.iter("joint"):
        if joint.get("type") != "fixed":
            assert all(float(joint.find("limit").get(k)) > 0 for k in ("upper", "effort", "velocity"))
    for mesh in root.iter("mesh"):
        assert (exported["urdf"].parent / mesh.get("filename")).exists()
    assert len(root.findall("link[@name='drawer']/collision")) == 8
    materials = [m.get("name") for m in root.iter("material")]
    assert len(materials) == len(set(materials)) == 5


def test_the_urdf_can_be_a_ros_package(tmp_path: Path) -> None:
    info = AssetInfo(author="A. Maker", license="CC0-1.0")
    main = export(cabinet_twin(), tmp_path, formats=("urdf",), package="kitchen", asset=info)["urdf"]
    root = main.parent
    manifest = ET.parse(root / "package.xml").getroot()  # noqa: S314  (a file this test wrote)
    told = [manifest.findtext(k) for k in ("name", "maintainer", "license")]
    assert told == ["kitchen", "A. Maker", "CC0-1.0"]
    text = (root / "urdf" / "cabinet.urdf").read_text()
    assert text.replace("package://kitchen/", "") == main.read_text()
    files = [m.get("filename", "") for m in ET.fromstring(text).iter("mesh")]  # noqa: S314
    assert len(files) > 2
    for file in files:
        assert (root / file.removeprefix("package://kitchen/")).is_file()
        assert file.startswith("package://kitchen/meshes/")
    installed = (root / "CMakeLists.txt").read_text()
    assert "project(kitchen)" in installed
    assert "install(DIRECTORY meshes urdf" in installed
    plain = export(cabinet_twin(), tmp_path, formats=("urdf",))["urdf"]
    assert not (plain.parent / "package.xml").exists()


def test_every_folder_says_how_to_import_it(exported: Exported) -> None:
    notes = {fmt: (path.parent / "README.md").read_text() for fmt, path in exported.items()}
    assert "position servo" in notes["urdf"]
    assert "joint drive without stiffness" in notes["usd"]
    assert "scene.xml" in notes["mjcf"]
    for text in notes.values():
        assert "| door_joint | revolute | 0 rad | 1.4 rad | 0.5 N m s/rad | 0.3 N m |" in text
        assert "| drawer_joint | prismatic | 0 m | 0.3 m | 0.5 N s/m | 0.3 N |" in text


def test_parts_may_be_called_like_what_the_writers_add(tmp_path: Path) -> None:
    twin = cabinet_twin(name="PhysicsScene", nested=True, lid=True)
    names = {"flap": "door_grasp", "drawer": "Joints", "lid": "materials"}
    parts = tuple(replace(p, name=names.get(p.name, p.name)) for p in twin.parts)
    twin = replace(twin, parts=parts, static=replace(twin.static, name="keyframes"))
    report = funtwin.check(twin, export(twin, tmp_path), ("mujoco",))
    assert report.warnings == ()
    assert report.failures == ()


def test_every_body_states_its_mass(exported: Exported) -> None:
    """Readers guess otherwise: from closed hulls, or one kilogram."""
    tree = build_tree(cabinet_twin(nested=True, lid=True))
    urdf, mjcf = (ET.parse(exported[f]).getroot() for f in ("urdf", "mjcf"))  # noqa: S314
    for link in tree.links:
        mass = urdf.find(f"link[@name='{link.name}']/inertial/mass")
        assert mass is not None
        assert float(mass.get("value", "")) == link.mass
        inertial = mjcf.find(f".//body[@name='{link.name}']/inertial")
        assert inertial is not None
        assert float(inertial.get("mass", "")) == link.mass
    assert urdf.find("link[@name='world']/inertial") is None


@pytest.mark.parametrize("seed", range(6))
def test_roll_pitch_yaw_rebuilds_the_rotation_also_in_the_singular_case(seed: int) -> None:
    rng = np.random.default_rng(seed)
    r = (
        geo.exp_so3(rng.normal(size=3))
        if seed > 1
        else geo.exp_so3([0, 0, 0.7]) @ geo.exp_so3([0, (seed - 0.5) * np.pi, 0])
    )
    x, y, z = roll_pitch_yaw(r)
    assert np.allclose(geo.exp_so3([0, 0, z]) @ geo.exp_so3([0, y, 0]) @ geo.exp_so3([x, 0, 0]), r, atol=1e-9)


def test_the_tree_puts_hinges_on_link_origins() -> None:
    twin = cabinet_twin(nested=True)
    tree = build_tree(twin)
    assert [k.name for k in tree.links] == ["carcass", "door", "flap", "drawer"]
    origin = sum((k.offset for k in tree.links if k.name in ("door", "flap")), np.zeros(3))
    flap = twin.part("flap").joint
    assert geo.point_line_distance(origin, flap.pivot, flap.axis) < 1e-12


def test_what_can_not_be_simulated_is_refused(tmp_path: Path) -> None:
    twin = cabinet_twin()
    door = twin.part("door")
    shut = replace(door, joint=replace(door.joint, upper=0.0))
    with pytest.raises(SceneError, match=r"'door' has the empty range 0.0..0.0"):
        export(replace(twin, parts=(shut,)), tmp_path)
    with pytest.raises(InputError, match="'sdf' is not known"):
        export(twin, tmp_path, formats=("sdf",))
    with pytest.raises(SceneError, match="with_physics"):
        build_tree(replace(twin, parts=(replace(door, inertial=None),)))
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="can't be written"):
        export(twin, tmp_path / "file", formats=("mjcf",))


def test_a_bare_twin_is_completed_on_the_way(tmp_path: Path) -> None:
    twin = cabinet_twin()
    bare = replace(twin, parts=tuple(replace(p, inertial=None, physics=None) for p in twin.parts))
    model = mujoco.MjModel.from_xml_path(str(export(bare, tmp_path, formats=("mjcf",))["mjcf"]))
    assert model.body("door").mass[0] == pytest.approx(twin.part("door").inertial.mass.value, rel=0.2)

"""Assets with an inferred layer: each piece is told apart in every format, engines agree on them, and a
drawer holds what falls into it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest

import twin as tw
from tests.makers.twin import scans
from twin.completion import with_completion
from twin.completion.asset import FILE, AssetView, asset_pose, view_of
from twin.errors import InputError
from twin.exporters import FORMATS, complete
from twin.scene import Twin

WHOLE = AssetView("complete", "keep", "furniture")


@pytest.fixture(scope="module")
def scanned() -> Twin:
    return complete(with_completion(scans.moved(scans.twin_of(scans.drawer()), 0.4, [0.3, 0.2, -1.1])))


@pytest.fixture(scope="module")
def whole(scanned: Twin, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    tw.export(scanned, folder, view=WHOLE)
    return folder


def pieces(twin: Twin) -> dict[str, str]:
    """Name of every piece in the files -> what it rests on."""
    found = {}
    for body in (twin.static, *twin.parts):
        assert body.completion is not None
        found |= {f"{body.name}_inferred_{p.name}": p.basis for p in body.completion.pieces}
    return found


def test_mjcf_tells_pieces_by_class_and_reason(scanned: Twin, whole: Path) -> None:
    root = ET.parse(whole / "mjcf" / "scan.xml").getroot()  # noqa: S314  (our own file)
    told = {g.get("name"): g.get("class") for g in root.iter("geom") if "_inferred_" in str(g.get("name"))}
    assert told == {name: f"scan_{basis}" for name, basis in pieces(scanned).items()}
    reasons = {t.get("name"): str(t.get("data")) for t in root.iter("text")}
    assert {n: r.split(":")[0] for n, r in reasons.items()} == pieces(scanned)
    frictions = [g for g in root.iter("geom") if g.get("class") == "scan_collision" and g.get("friction")]
    assert not frictions  # the class has it
    sensors = {s.get("name") for s in root.findall("sensor/*")}
    assert sensors == {"part_2_joint_pos", "part_2_joint_vel"}
    sites = {s.get("name") for s in root.iter("site")}
    assert {"part_2_inside_region", "part_2_inside_spawn"} <= sites


def test_urdf_tells_pieces_by_comments(scanned: Twin, whole: Path) -> None:
    text = (whole / "urdf" / "scan.urdf").read_text()
    for name, basis in pieces(scanned).items():
        assert re.search(rf"<!-- {basis}: [^>]+ -->\s*<visual name=\"{name}\">", text), name


def test_usd_tells_pieces_by_custom_data_and_labels(scanned: Twin, whole: Path) -> None:
    from pxr import Usd, UsdSemantics

    stage = Usd.Stage.Open(str(whole / "usd" / "scan.usda"))
    known = pieces(scanned)
    inside = Usd.TraverseInstanceProxies()
    found = {p.GetName(): p for p in stage.Traverse(inside) if p.GetName() in known}
    assert {n: p.GetCustomDataByKey("inferred")["basis"] for n, p in found.items()} == known
    handle = found["part_2_inferred_handle"]
    assert list(UsdSemantics.LabelsAPI(handle, "class").GetLabelsAttr().Get()) == ["handle"]
    region = next(p for p in stage.Traverse() if p.GetName() == "part_2_inside_region")
    assert list(UsdSemantics.LabelsAPI(region, "class").GetLabelsAttr().Get()) == ["interior"]


def test_beside_the_files_stands_what_they_show_and_where(scanned: Twin, whole: Path) -> None:
    for fmt in FORMATS:
        told = json.loads((whole / fmt / FILE).read_text())
        assert (told["geometry"], told["room"], told["origin"]) == ("complete", "keep", "furniture")
        assert np.allclose(told["T_asset_twin"], asset_pose(scanned))
        assert "40 pieces" not in (whole / fmt / "README.md").read_text()
        assert f"{len(pieces(scanned))} pieces" in (whole / fmt / "README.md").read_text()
    assert view_of([whole / fmt / "x" for fmt in FORMATS]) == WHOLE


def test_engines_agree_on_the_asset_as_it_was_exported(scanned: Twin, whole: Path) -> None:
    files = {
        "urdf": whole / "urdf" / "scan.urdf",
        "mjcf": whole / "mjcf" / "scan.xml",
        "usd": whole / "usd" / "scan.usda",
    }
    report = tw.check(scanned, files)
    assert report.ok, [r for r in report.rows if not r.ok]


def test_formats_that_show_different_things_are_refused(scanned: Twin, whole: Path, tmp_path: Path) -> None:
    other = tw.export(scanned, tmp_path, ["urdf"], view=AssetView("bounded", "drop", "camera"))
    assert not (tmp_path / "urdf" / "meshes" / "static_inferred_panel_1.obj").exists()
    with pytest.raises(InputError, match="different things"):
        tw.check(scanned, {"urdf": other["urdf"], "mjcf": whole / "mjcf" / "scan.xml"})


def test_the_opened_drawer_holds_what_falls_into_it(whole: Path) -> None:
    spec = mujoco.MjSpec.from_file(str(whole / "mjcf" / "scan.xml"))
    for x in (-0.12, 0.0, 0.12):
        ball = spec.worldbody.add_body(pos=[x, 0.0, 0.85])
        ball.add_freejoint()
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.02, 0, 0], mass=0.05)
    model = spec.compile()
    data = mujoco.MjData(model)
    drawer = model.joint("part_2_joint")
    for _ in range(1000):
        data.qpos[drawer.qposadr[0]], data.qvel[drawer.dofadr[0]] = 0.25, 0.0
        mujoco.mj_step(model, data)
    balls = data.xpos[-3:]
    assert np.all(np.abs(balls[:, 2] - 0.65) < 0.01)  # on its floor, which is 63 cm high


def test_the_room_is_a_body_of_its_own_or_left_out(scanned: Twin, whole: Path, tmp_path: Path) -> None:
    kept = mujoco.MjModel.from_xml_path(str(whole / "mjcf" / "scan.xml"))
    assert kept.body("room").id > 0
    files = tw.export(scanned, tmp_path, ["mjcf"])
    dropped = mujoco.MjModel.from_xml_path(str(files["mjcf"]))
    assert {dropped.body(k).name for k in range(dropped.nbody)} == {"world", "static", "part_2"}
    assert dropped.ngeom < kept.ngeom

"""Pairs that the source of a twin never lets touch don't touch in what is exported; overlaps that nobody
excludes are doubted."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from pxr import Usd, UsdPhysics

import twin as tw
from benchmarks.scenes.boards import cabinet_twin
from twin.cli.main import run
from twin.collision import with_collision
from twin.collision.meetings import meetings
from twin.errors import InputError, SceneError
from twin.level import level_evidence
from twin.lint.xml import read_xml
from twin.scene import Box, Twin

FLAGS = 'contype="1" conaffinity="0"'
EXCLUDE = '<contact><exclude body1="tub" body2="door"/><exclude body1="door" body2="rack"/></contact>'


def dishwasher(folder: Path, contact: str = "", flags: str = "", deep: float = 0.008) -> Path:
    """A tub whose front wall the closed door reaches into by `deep` m, and a rack of wire inside that reaches
    into both."""
    path = folder / "dishwasher.xml"
    path.write_text(
        f"""<mujoco model="dishwasher"><compiler angle="radian"/><default><geom {flags}/></default><worldbody>
        <body name="tub" pos="0 0 .4"><geom type="box" size=".3 .3 .02" pos="0 0 -.38"/>
          <geom type="box" size=".3 .02 .38" pos="0 .28 0"/><geom type="box" size=".02 .3 .38" pos="-.28 0 0"/>
          <geom type="box" size=".02 .3 .38" pos=".28 0 0"/></body>
        <body name="door" pos="0 -.32 .4"><joint name="hinge" type="hinge" axis="1 0 0" pos="0 0 -.38" range="0 1.5"/>
          <geom type="box" size=".3 .02 .38" pos="0 {deep} 0" density="300"/></body>
        <body name="rack" pos="0 0 .2"><joint name="slide" type="slide" axis="0 -1 0" range="0 .4"/>
          <geom type="box" size=".2 .25 .05" density="100"/></body>
        </worldbody>{contact}</mujoco>""",
        encoding="utf-8",
    )
    return path


def thrown(model: Path) -> dict[str, float]:
    """How far (m or rad) each joint gets by itself in one second from where all parts are closed."""
    m = mujoco.MjModel.from_xml_path(str(model))
    d = mujoco.MjData(m)
    most = np.zeros(m.nq)
    while d.time < 1.0:
        mujoco.mj_step(m, d)
        most = np.maximum(most, np.abs(d.qpos))
    return {m.joint(j).name: float(most[j]) for j in range(m.njnt)}


@pytest.mark.parametrize(("contact", "flags"), [(EXCLUDE, ""), ("", FLAGS)], ids=["exclude", "conaffinity"])
def test_a_door_whose_source_excludes_its_body_is_not_thrown_open(
    contact: str, flags: str, tmp_path: Path
) -> None:
    twin = tw.from_mjcf(dishwasher(tmp_path, contact, flags))
    assert ("tub", "door") in twin.filtered_pairs
    files = tw.export(twin, tmp_path / "out")
    assert files.overlaps == ()
    assert thrown(files["urdf"])["door_joint"] < 0.02
    assert thrown(files["mjcf"])["door_joint"] < 0.02


def test_a_format_that_can_filter_pairs_keeps_the_stated_shapes(tmp_path: Path) -> None:
    twin = tw.from_mjcf(dishwasher(tmp_path, EXCLUDE))
    files = tw.export(twin, tmp_path / "out")
    root = read_xml(files["mjcf"])[0]
    excludes = [(e.get("body1"), e.get("body2")) for e in root.iter("exclude")]
    assert sorted(excludes) == [("door", "rack"), ("tub", "door"), ("tub", "rack")]
    stage = Usd.Stage.Open(str(files["usd"]))
    pairs = {
        prim.GetName(): sorted(
            t.name for t in UsdPhysics.FilteredPairsAPI(prim).GetFilteredPairsRel().GetTargets()
        )
        for prim in stage.Traverse()
        if prim.HasAPI(UsdPhysics.FilteredPairsAPI)
    }
    assert pairs == {"door": ["tub"], "rack": ["door", "tub"]}
    model = mujoco.MjModel.from_xml_path(str(files["mjcf"]))
    assert [int(model.geom_type[g]) for g in range(model.ngeom) if model.geom_contype[g]] == [6] * 6, (
        "all boxes"
    )


def test_what_gives_way_in_urdf_is_told_and_keeps_clear(tmp_path: Path) -> None:
    twin = tw.from_mjcf(dishwasher(tmp_path, EXCLUDE))
    files = tw.export(twin, tmp_path / "out", ["urdf"])
    told = [w for w in files.warnings if "give way" in w]
    assert any("urdf: the collision shapes of 'tub' give way to 'door', by " in w for w in told), (
        files.warnings
    )
    assert "the collision shapes keep clear of each other" in " ".join(files.warnings)
    assert "keep clear of each other" in (files["urdf"].parent / "README.md").read_text()


def test_a_dial_that_only_touches_what_its_source_excludes_turns_in_urdf(tmp_path: Path) -> None:
    """Metaworld's dial: its cylinder stands on the table, and friction would stop it."""
    path = tmp_path / "dial.xml"
    path.write_text(
        """<mujoco><compiler angle="radian"/><default><geom contype="0" conaffinity="1"/></default><worldbody>
        <body name="table"><geom type="box" size=".3 .3 .1" pos="0 0 -.1"/></body>
        <body name="knob"><joint name="turn" axis="0 0 1" range="-3 3"/>
          <geom type="cylinder" size=".05 .018" pos="0 0 .01799"/></body></worldbody></mujoco>"""
    )
    files = tw.export(tw.from_mjcf(path), tmp_path / "out", ["urdf", "mjcf"])
    assert [w for w in files.warnings if "overlap" in w] == []
    assert any("'table' give way to 'knob'" in w for w in files.warnings if w.startswith("urdf: "))
    for name in ("urdf", "mjcf"):
        model = mujoco.MjModel.from_xml_path(str(files[name]))
        data = mujoco.MjData(model)
        data.qfrc_applied[0] = 0.1
        while data.time < 2.0:
            mujoco.mj_step(model, data)
        assert data.qpos[0] > 1.0, name


def test_a_part_on_a_part_is_not_said_to_keep_clear_of_it(tmp_path: Path) -> None:
    """Robosuite's door with a lock: its latch turns through the leaf that carries it."""
    path = tmp_path / "door.xml"
    path.write_text(
        """<mujoco><compiler angle="radian"/><worldbody><body name="frame"><geom type="box" size=".02 .02 .4" pos="-.35 0 0"/>
        <body name="leaf"><joint name="hinge" axis="0 0 1" pos="-.3 0 0" range="0 1.5"/><geom type="box" size=".3 .02 .4"/>
        <body name="latch"><joint name="turn" axis="0 1 0" range="0 1.5"/><geom type="box" size=".1 .03 .02"/></body></body>
        </body></worldbody></mujoco>"""
    )
    files = tw.export(tw.from_mjcf(path), tmp_path / "out", ["urdf"])
    assert any("of each other, but latch may overlap leaf, which carries it" in w for w in files.warnings)


def test_pairs_are_kept_with_the_twin(tmp_path: Path) -> None:
    twin = tw.from_mjcf(dishwasher(tmp_path, EXCLUDE))
    tw.save(twin, tmp_path / "twin")
    assert (
        tw.load(tmp_path / "twin").filtered_pairs
        == twin.filtered_pairs
        == (("tub", "door"), ("door", "rack"))
    )
    document = json.loads((tmp_path / "twin" / "twin.json").read_text())
    assert document["filtered_pairs"] == [["tub", "door"], ["door", "rack"]]
    document["filtered_pairs"] = [["tub", "dor"]]
    (tmp_path / "twin" / "twin.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match="filtered_pairs names 'dor'"):
        tw.load(tmp_path / "twin")


def test_a_pair_is_two_bodies_of_the_twin_once() -> None:
    twin = cabinet_twin()
    static = twin.static.name
    made = replace(twin, filtered_pairs=(("drawer", static), (static, "drawer"), ("drawer", "door")))
    assert len(made.filtered_pairs) == 2
    assert made.filtered_pairs[0] == (static, "drawer")
    with pytest.raises(SceneError, match="two different names"):
        replace(twin, filtered_pairs=(("door", "door"),))


def test_an_overlap_with_every_part_closed_that_nobody_excludes_is_doubted(tmp_path: Path, capsys) -> None:
    assert run(["import", str(dishwasher(tmp_path)), "-o", str(tmp_path / "run")]) == 0
    capsys.readouterr()
    assert run(["export", str(tmp_path / "run"), "--format", "urdf", "mjcf"]) == 2
    out, err = capsys.readouterr()
    assert "'tub' and 'door' overlap by 8.0 mm with every part closed" in err
    assert "'door' keeps clear from 0." in err
    assert "`twin import --closed` or `--limit`" in err
    assert "urdf: the collision shapes of 'tub' give way to 'door'" in out
    assert "left as stated in MJCF and USD, which exclude the contact, and are cut in URDF" in " ".join(
        out.split()
    )
    assert "keep clear of each other" not in out
    assert "these collision shapes overlap while a part opens: door and rack (by up to 2" in out, (
        "the rack can't pass it"
    )
    for name in ("urdf/dishwasher.urdf", "mjcf/dishwasher.xml"):
        assert (tmp_path / "run" / "export" / name).is_file()


@pytest.mark.parametrize(("deep", "code"), [(0.0015, 0), (0.0025, 2)])
def test_two_millimetres_are_allowed(deep: float, code: int, tmp_path: Path) -> None:
    assert run(["import", str(dishwasher(tmp_path, deep=deep)), "-o", str(tmp_path / "run")]) == 0
    assert run(["export", str(tmp_path / "run"), "--format", "mjcf"]) == code


def test_a_part_inside_a_stated_shape_keeps_shapes_that_can_be_touched() -> None:
    """A button whose file gives it no shape lies in the hull of the oven: what is made for it would be cut
    away whole."""
    twin = swallowed()
    shaped = with_collision(twin)
    assert shaped.part("drawer").collision
    assert (twin.static.name, "drawer") in [m.names for m in meetings(shaped, {"drawer"}) if m.rests]
    filtered = replace(twin, filtered_pairs=((twin.static.name, "drawer"), (twin.static.name, "door")))
    assert with_collision(filtered).part("drawer").collision
    assert all(m.filtered for m in meetings(with_collision(filtered)))


def swallowed() -> Twin:
    """The cabinet, whose drawer has no shapes and lies in a block that is stated as the cabinet's only
    shape."""
    twin = cabinet_twin()
    drawer = twin.part("drawer").mesh.vertices
    low, high = drawer.min(axis=0) - 0.5, drawer.max(axis=0) + 0.5
    pose = np.eye(4)
    pose[:3, 3] = (low + high) / 2
    parts = tuple(replace(p, collision=()) if p.name == "drawer" else p for p in twin.parts)
    return replace(twin, static=replace(twin.static, collision=(Box(pose, high - low),)), parts=parts)


def cooktop(folder: Path, post: float, count: int = 1, rise: float = 0.009) -> Path:
    """The Franka Kitchen's oven in small: burners rise through its top, which the file never lets them touch,
    and knobs turn about level lines; a post, at `post` m from the first burner, touches everything."""
    silent = 'contype="0" conaffinity="1"'
    made = "".join(
        f"""<body name="burner_{k}" pos="{0.3 * k} 0 .38"><joint name="rise_{k}" type="slide" axis="0 0 1" range="0 {rise}"/>
        <geom type="cylinder" size=".08 .01" {silent}/></body>
        <body name="knob_{k}" pos="{0.3 * k} -.33 .3"><joint name="turn_{k}" axis="0 -1 0" range="0 1.5"/>
        <geom type="cylinder" size=".02 .02" euler="1.5708 0 0" {silent}/></body>"""
        for k in range(count)
    )
    path = folder / "cooktop.xml"
    path.write_text(
        f"""<mujoco model="cooktop"><compiler angle="radian"/><worldbody>
        <geom name="post" type="box" size=".02 .02 .4" pos="{-0.1 - post} 0 .4"/>
        <body name="oven"><geom type="box" size=".5 .3 .2" pos=".15 0 .19" {silent}/></body>{made}</worldbody></mujoco>""",
        encoding="utf-8",
    )
    return path


def test_bodies_that_never_touch_are_a_pair_where_the_others_keep_clear(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What stands is one body in a twin; of it only the post may touch, and stands too far away."""
    path = cooktop(tmp_path, 0.5)
    assert ("static", "burner_0") in tw.from_mjcf(path).filtered_pairs
    assert ("static", "burner_0") not in tw.from_mjcf(cooktop(tmp_path, -0.03)).filtered_pairs
    out = str(tmp_path / "run")
    assert run(["import", str(cooktop(tmp_path, 0.5)), "-o", out]) == 0
    assert run(["export", out]) == 0
    assert run(["check", out]) == 0, "the burners go through the oven, as the file has it"
    shown = capsys.readouterr()
    assert "nothing says that they may" not in shown.out + shown.err


@pytest.mark.parametrize(("rise", "lies"), [(0.009, False), (0.05, False), (0.3, True)])
def test_burners_that_rise_contradict_no_stated_up_and_drawers_do(
    rise: float, lies: bool, tmp_path: Path
) -> None:
    """Two slides straight up and level hinges agree on an up that lies: whoever wrote the file knows where a
    burner goes, but a chest of drawers lies on its back."""
    twin = tw.from_mjcf(cooktop(tmp_path, 0.5, count=2, rise=rise))
    assert level_evidence(twin).contradicted == lies

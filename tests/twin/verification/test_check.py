"""The check passes what is true and catches every planted lie."""

from __future__ import annotations

import json
import shutil
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import twin as funtwin
from benchmarks.scenes.boards import cabinet_twin
from benchmarks.scenes.random_twins import random_twin
from twin import engines
from twin.errors import InputError, MissingDependencyError
from twin.exporters import Exported, export
from twin.geometry import Array
from twin.scene import Twin
from twin.storage import save
from twin.verification import ENGINES, OURS, _inputs, check, check_many, process
from twin.verification.exceptions import unsupported


@pytest.fixture(scope="module")
def cabinet(tmp_path_factory: pytest.TempPathFactory) -> tuple[Twin, Exported]:
    twin = cabinet_twin(nested=True, lid=True)
    return twin, export(twin, tmp_path_factory.mktemp("check"))


@pytest.mark.started
def test_the_cabinet_agrees_everywhere_without_a_warning(cabinet: tuple[Twin, Exported]) -> None:
    report = funtwin.check(*cabinet)
    assert report.warnings == ()
    assert report.failures == ()
    assert report.ok
    seen = {(r.format, r.consumer) for r in report.rows}
    assert seen == {
        ("urdf", "mujoco"), ("mjcf", "mujoco"), ("usd", "mujoco"),
        ("urdf", "pinocchio"), ("mjcf", "pinocchio"), ("urdf", "yourdfpy"),
    }  # fmt: skip
    for fields in (
        {r.field for r in report.rows if (r.format, r.consumer, r.part) == (*s, "door")} for s in seen
    ):
        assert {
            "type",
            "axis_deg",
            "pivot_m",
            "lower",
            "upper",
            "mass",
            "com_m",
            "inertia",
            "motion",
        } <= fields
    json.dumps(report.to_dict(), allow_nan=False)


def test_random_twins_agree_everywhere(tmp_path: Path) -> None:
    twins = [random_twin(seed) for seed in range(6)]
    for twin, report in zip(
        twins, check_many([(t, export(t, tmp_path / t.name)) for t in twins]), strict=True
    ):
        assert report.warnings == (), twin.name
        assert report.failures == (), twin.name
        assert report.unexpected == (), twin.name


LIES = {
    "tree": "flap", "axis_deg": "door", "pivot_m": "door", "lower": "drawer", "upper": "door", "damping": "lid",
    "frictionloss": "flap", "armature": "door", "friction": "drawer", "mass": "drawer", "com_m": "door", "inertia": "lid",
}  # fmt: skip


def numbers(text: str) -> Array:
    return np.array(text.split(), dtype=float)


def words(values: Array) -> str:
    return " ".join(repr(float(v)) for v in values)


def lie_in_urdf(path: Path, lie: str, name: str) -> None:
    """Change one number (or the parent) of a part a little."""
    tree = ET.parse(path)  # noqa: S314  (ours)
    root = tree.getroot()
    joint, link = root.find(f"joint[@name='{name}_joint']"), root.find(f"link[@name='{name}']")
    assert joint is not None
    assert link is not None
    places = {
        "tree": (joint.find("parent"), "link"), "axis_deg": (joint.find("axis"), "xyz"), "pivot_m": (joint.find("origin"), "xyz"),
        "lower": (joint.find("limit"), "lower"), "upper": (joint.find("limit"), "upper"),
        "damping": (joint.find("dynamics"), "damping"), "frictionloss": (joint.find("dynamics"), "friction"),
        "mass": (link.find("inertial/mass"), "value"), "com_m": (link.find("inertial/origin"), "xyz"),
        "inertia": (link.find("inertial/inertia"), "ixx"),
    }  # fmt: skip
    change(*places[lie], lie)
    tree.write(path)


def lie_in_mjcf(path: Path, lie: str, name: str) -> None:
    tree = ET.parse(path)  # noqa: S314  (ours)
    body = tree.getroot().find(f".//body[@name='{name}']")
    assert body is not None
    joint, inertial = body.find("joint"), body.find("inertial")
    if lie == "tree":  # hang the body on the static scene
        parent = tree.getroot().find(f".//body[@name='{name}']/..")
        static = tree.getroot().find("worldbody/body")
        assert parent is not None
        assert static is not None
        body.set("pos", words(numbers(str(body.get("pos"))) + numbers(str(parent.get("pos")))))
        parent.remove(body)
        static.append(body)
        for exclude in tree.getroot().iter("exclude"):
            exclude.attrib |= {"body1": str(static.get("name"))} if exclude.get("body2") == name else {}
        keys = tree.getroot().find("keyframe")
        assert keys is not None
        tree.getroot().remove(keys)  # they follow the order of the joints
    elif lie in ("lower", "upper"):
        assert joint is not None
        limits = numbers(str(joint.get("range"))) + [1e-3 * (lie == "lower"), 1e-3 * (lie == "upper")]
        joint.set("range", words(limits))
    elif lie == "friction":
        geom = next(g for g in body.findall("geom") if g.get("friction"))
        geom.set("friction", words(numbers(str(geom.get("friction"))) * [1.001, 1, 1]))
    else:
        places = {
            "axis_deg": (joint, "axis"), "pivot_m": (body, "pos"), "damping": (joint, "damping"), "armature": (joint, "armature"),
            "frictionloss": (joint, "frictionloss"), "mass": (inertial, "mass"), "com_m": (inertial, "pos"),
            "inertia": (inertial, "fullinertia"),
        }  # fmt: skip
        change(*places[lie], lie)
    tree.write(path)


def change(element: ET.Element | None, attribute: str, lie: str) -> None:
    assert element is not None
    value = str(element.get(attribute))
    if lie == "tree":
        element.set(attribute, "carcass")
    elif lie in ("damping", "frictionloss", "mass", "inertia", "armature"):
        element.set(attribute, words(numbers(value) * 1.001))
    else:
        moved = numbers(value)
        moved[0] += 1e-3
        element.set(attribute, words(moved))


def lie_in_usd(path: Path, lie: str, name: str) -> None:
    from pxr import Gf, Usd, UsdPhysics

    stage = Usd.Stage.Open(str(path))
    prims = {p.GetName(): p for p in stage.Traverse()}
    joint, body = prims[f"{name}_joint"], prims[name]
    attributes = {
        "lower": (joint, "physics:lowerLimit"), "upper": (joint, "physics:upperLimit"), "damping": (joint, "newton:damping"),
        "frictionloss": (joint, "newton:friction"), "armature": (joint, "newton:armature"), "mass": (body, "physics:mass"),
        "pivot_m": (joint, "physics:localPos0"), "com_m": (body, "physics:centerOfMass"),
        "inertia": (body, "physics:diagonalInertia"), "axis_deg": (joint, "physics:localRot0"),
    }  # fmt: skip
    if lie == "tree":
        UsdPhysics.Joint(joint).GetBody0Rel().SetTargets([prims["carcass"].GetPath()])
    elif lie == "friction":
        prims[f"{name}_contact"].GetAttribute("physics:dynamicFriction").Set(0.61)
    else:
        prim, attribute = attributes[lie]
        value = prim.GetAttribute(attribute).Get()
        turn = Gf.Quatf(Gf.Rotation(Gf.Vec3d(0, 1, 1), 0.06).GetQuat())
        if lie in ("axis_deg", "pivot_m"):  # in both bodies, whose frames agree when closed
            other = prim.GetAttribute(attribute[:-1] + "1")
            other.Set(other.Get() * turn if lie == "axis_deg" else other.Get() + Gf.Vec3f(1e-3, 0, 0))
        told = {
            "lower": lambda: value + 0.06, "upper": lambda: value + 0.06, "axis_deg": lambda: value * turn,
            "pivot_m": lambda: value + Gf.Vec3f(1e-3, 0, 0), "com_m": lambda: value + Gf.Vec3f(1e-3, 0, 0),
        }.get(lie, lambda: value * 1.001)()  # fmt: skip
        prim.GetAttribute(attribute).Set(told)
    stage.GetRootLayer().Save()  # an opinion of the file itself, stronger than those of any layer beneath


TELL = {"urdf": lie_in_urdf, "mjcf": lie_in_mjcf, "usd": lie_in_usd}


def asked_of(engine: str) -> Any:
    """An engine as a test's parameter; those with environments of their own are slow."""
    return engine if engine in OURS else pytest.param(engine, marks=pytest.mark.slow)


def needs(engine: str) -> None:
    if engine not in OURS and not engines.engine(engine).installed:
        pytest.skip(
            f"the environment of {engine} is not installed; `twin engines --install {engine}` makes it"
        )


@pytest.mark.parametrize("engine", [asked_of(e) for e in ENGINES])
def test_every_planted_lie_is_caught_by_every_engine(
    engine: str, cabinet: tuple[Twin, Exported], tmp_path: Path
) -> None:
    needs(engine)
    twin, files = cabinet
    told = []
    for fmt in ENGINES[engine]:
        for lie, part in LIES.items():
            if unsupported(engine, fmt, lie):
                continue
            shutil.copytree(files[fmt].parent, tmp_path / fmt / lie)
            path = tmp_path / fmt / lie / files[fmt].name
            TELL[fmt](path, lie, part)
            told.append((fmt, lie, part, path))
    reports = check_many([(twin, {fmt: path}) for fmt, _, _, path in told], [engine])
    for (fmt, lie, part, _), report in zip(told, reports, strict=True):
        failed = {(r.part, r.field) for r in report.failures}
        assert (part, lie) in failed, f"{engine} {fmt}: {lie} of {part}; {failed} {report.warnings}"
        if lie not in ("tree", "axis_deg", "pivot_m"):  # which move what hangs on the part
            assert {p for p, f in failed if f not in ("mass_diagonal", "rollout")} == {part}


@pytest.mark.slow
def test_a_joint_that_is_elsewhere_in_its_parent_is_caught_in_usd(
    cabinet: tuple[Twin, Exported], tmp_path: Path
) -> None:
    """MuJoCo looks at the frame in the child alone (it is in the table); Newton looks at both."""
    from pxr import Gf, Usd

    needs("newton")
    twin, files = cabinet
    shutil.copytree(files["usd"].parent, tmp_path / "usd")
    stage = Usd.Stage.Open(str(tmp_path / "usd" / files["usd"].name))
    place = next(p for p in stage.Traverse() if p.GetName() == "door_joint").GetAttribute("physics:localPos0")
    place.Set(place.Get() + Gf.Vec3f(1e-3, 0, 0))
    stage.GetRootLayer().Save()
    lie = {"usd": tmp_path / "usd" / files["usd"].name}
    assert ("door", "pivot_m") in {(r.part, r.field) for r in check(twin, lie, ["newton"]).failures}
    assert check(twin, lie, ["mujoco"]).ok, "MuJoCo has learnt it: the entry can leave the table"


@pytest.mark.slow
@pytest.mark.parametrize("engine", [e for e in ENGINES if e not in OURS])
def test_the_other_engines_agree_on_random_twins(engine: str, tmp_path: Path) -> None:
    needs(engine)
    twins = [random_twin(seed) for seed in range(8)]
    for twin, report in zip(
        twins, check_many([(t, export(t, tmp_path / t.name)) for t in twins], [engine]), strict=True
    ):
        assert report.warnings == (), twin.name
        assert report.failures == (), twin.name
        assert report.unexpected == (), twin.name


def test_radians_where_degrees_belong_are_caught(cabinet: tuple[Twin, Exported], tmp_path: Path) -> None:
    from pxr import Usd

    twin, files = cabinet
    shutil.copytree(files["usd"].parent, tmp_path / "usd")
    stage = Usd.Stage.Open(str(tmp_path / "usd" / files["usd"].name))
    limit = next(p for p in stage.Traverse() if p.GetName() == "door_joint").GetAttribute(
        "physics:upperLimit"
    )
    limit.Set(float(np.deg2rad(limit.Get())))
    stage.GetRootLayer().Save()
    report = check(twin, {"usd": tmp_path / "usd" / files["usd"].name})
    assert ("door", "upper") in {(r.part, r.field) for r in report.failures}


def test_warnings_damage_and_collisions_fail_the_check(
    cabinet: tuple[Twin, Exported], tmp_path: Path
) -> None:
    from pxr import Usd, UsdPhysics

    twin, files = cabinet
    lies = {}
    for fmt, file in files.items():
        shutil.copytree(file.parent, tmp_path / fmt)
        lies[fmt] = tmp_path / fmt / file.name
    stage = Usd.Stage.Open(str(lies["usd"]))
    contact = next(p for p in stage.Traverse() if p.GetName() == "door_contact")
    UsdPhysics.MaterialAPI(contact).CreateRestitutionAttr(0.5)  # MuJoCo says that it has none
    stage.GetRootLayer().Save()
    text = lies["urdf"].read_text()
    size = text.split('name="door_collision_0"')[1].split('size="')[1].split('"')[0]
    lies["urdf"].write_text(text.replace(size, " ".join(["0.6", "0.08", size.split()[2]]), 1))
    lies["mjcf"].write_text(lies["mjcf"].read_text().replace("</mujoco>", ""))
    report = check(twin, lies)
    assert not report.ok
    assert any(w.startswith("usd/mujoco") and "WARNING" in w for w in report.warnings)
    for engine in ("mujoco", "pinocchio"):
        assert any(w.startswith(f"mjcf/{engine}: can't be loaded") for w in report.warnings)
    assert any(r.field == "self_collision_m" and r.part == "door" for r in report.failures)


FAKE = """#!{python}
import json, os, signal, sys, time
from pathlib import Path
_, _, _, engine, request, answers = sys.argv
for job in json.loads(Path(request).read_text()):
    {act}
    with open(answers, "a") as out:
        line = {{"parts": {{}}, "warnings": [], "error": "read", "version": "0", "seconds": 0.0}}
        out.write(json.dumps(line) + "\\n")
"""


def fake_engine(cache: Path, monkeypatch: pytest.MonkeyPatch, act: str) -> None:
    """An environment of Drake whose Python is a script."""
    monkeypatch.setenv("FUNTWIN_ENGINES", str(cache))
    python = engines.engine("drake").folder / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(FAKE.format(python=sys.executable, act=act))
    python.chmod(0o755)
    (python.parents[1] / ".complete").touch()


def test_a_file_that_kills_an_engine_is_named_and_the_others_are_still_read(
    cabinet: tuple[Twin, Exported], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    twin, files = cabinet
    fake_engine(tmp_path, monkeypatch, "if 'urdf' in job['format']: os.kill(os.getpid(), signal.SIGSEGV)")
    report = check(twin, dict(files), ["drake"])
    assert report.warnings == (
        "urdf/drake: can't be loaded: the engine crashed (SIGSEGV)",
        "mjcf/drake: can't be loaded: read",
    )
    assert not report.ok


def test_an_engine_that_hangs_is_stopped_and_one_that_fails_to_start_says_why(
    cabinet: tuple[Twin, Exported], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    twin, files = cabinet
    fake_engine(tmp_path / "hangs", monkeypatch, "time.sleep(60)")
    started = time.monotonic()
    (answer,) = process.ask("drake", [{"format": "urdf"}], seconds=1.0)
    assert answer["error"] == "no answer within 1 s"
    assert time.monotonic() - started < 20
    fake_engine(tmp_path / "fails", monkeypatch, "raise ImportError('libGL.so.1 is missing')")
    report = check(twin, dict(files), ["drake"])
    assert report.warnings == tuple(
        f"{fmt}/drake: can't be loaded: ImportError: libGL.so.1 is missing" for fmt in ("urdf", "mjcf")
    )


def test_engines_that_are_not_there_or_not_known_are_named(
    cabinet: tuple[Twin, Exported],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    twin, files = cabinet
    monkeypatch.setenv("FUNTWIN_ENGINES", str(tmp_path / "none"))
    with pytest.raises(MissingDependencyError, match=r"'drake' is not in .*twin engines --install drake"):
        check(twin, dict(files), ["all"])
    with pytest.raises(InputError, match="did you mean 'pybullet'"):
        check(twin, dict(files), ["bullet"])
    with pytest.raises(InputError, match="yourdfpy reads no mjcf"):
        check(twin, {"mjcf": files["mjcf"]}, ["yourdfpy"])


def test_a_run_folder_is_found_and_what_is_missing_is_named(
    cabinet: tuple[Twin, Exported], tmp_path: Path
) -> None:
    twin, _ = cabinet
    save(twin, tmp_path / "run" / "twin")
    with pytest.raises(InputError, match="nothing exported"):
        check(tmp_path / "run")
    export(twin, tmp_path / "run" / "export", formats=("urdf",))
    assert _inputs(tmp_path / "run", None)[1] == _inputs(tmp_path / "run" / "twin", None)[1]
    report = check(tmp_path / "run" / "twin")
    assert report.ok
    assert {r.format for r in report.rows} == {"urdf"}
    with pytest.raises(InputError, match="does not exist"):
        check(twin, {"urdf": tmp_path / "none.urdf"})
    with pytest.raises(InputError, match="has no mass"):
        check(
            replace(twin, parts=(replace(twin.parts[0], inertial=None),)),
            {"urdf": tmp_path / "run" / "export" / "urdf" / "cabinet.urdf"},
        )

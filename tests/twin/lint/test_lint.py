"""Every planted fault is found by its own rule alone, and what is right is left alone."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.lint_faults import MUTATIONS, Mutation, lint_twin
from twin.cli.main import run
from twin.errors import InputError
from twin.exporters import Exported, export
from twin.lint import lint
from twin.lint.rules import RULES

SCENES = sorted((Path(__file__).parents[3] / "assets" / "scenes").glob("*.xml"))
SIMULATED = [name for name, rule in RULES.items() if rule.simulates]


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return export(lint_twin(), tmp_path_factory.mktemp("lint"))


def planted(clean: Exported, mutation: Mutation, folder: Path) -> Path:
    shutil.copytree(clean[mutation.format].parent, folder / "model")
    path = folder / "model" / clean[mutation.format].name
    mutation.plant(path)
    return path


@pytest.mark.started
def test_our_exports_have_no_finding(clean: Exported) -> None:
    report = lint(list(clean.values()))
    assert report.findings == ()
    assert report.notes == (), "everything was looked at, in MuJoCo too"


def test_what_a_file_says_does_not_depend_on_loaded_schemas(clean: Exported, tmp_path: Path) -> None:
    """MuJoCo's collision schema, once this process knows it, brings UsdPhysics' along where the file does not
    say so."""
    (mutation,) = (m for m in MUTATIONS if m.id == "usd-collider-missing-none")
    path = planted(clean, mutation, tmp_path)
    code = (
        "import sys, mujoco._usd; from pathlib import Path; from twin.lint import lint; "
        "print({f.rule for f in lint([Path(sys.argv[1])], ignore=sys.argv[2:]).findings})"
    )
    told = subprocess.run(
        [sys.executable, "-c", code, str(path), *SIMULATED], capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == "{'collider-missing'}"


def test_every_rule_has_a_planted_fault() -> None:
    assert {m.rule for m in MUTATIONS} == set(RULES)
    assert len({m.id for m in MUTATIONS}) == len(MUTATIONS)


@pytest.mark.parametrize("mutation", [m for m in MUTATIONS if m.rule not in SIMULATED], ids=lambda m: m.id)
def test_a_planted_fault_is_found_by_its_rule_alone(
    mutation: Mutation, clean: Exported, tmp_path: Path
) -> None:
    path = planted(clean, mutation, tmp_path)
    report = lint([path], ignore=SIMULATED)
    assert {f.rule for f in report.findings} == {mutation.rule}
    for f in report.findings:
        assert f.file == str(path)
        assert f.element
        assert f.value
        assert f.remedy


@pytest.mark.parametrize("mutation", [m for m in MUTATIONS if m.rule in SIMULATED], ids=lambda m: m.id)
def test_a_planted_fault_shows_in_motion(mutation: Mutation, clean: Exported, tmp_path: Path) -> None:
    assert {f.rule for f in lint([planted(clean, mutation, tmp_path)]).findings} == {mutation.rule}


@pytest.mark.slow
@pytest.mark.parametrize("mutation", [m for m in MUTATIONS if m.rule not in SIMULATED], ids=lambda m: m.id)
def test_a_planted_fault_gives_nothing_else_in_motion(
    mutation: Mutation, clean: Exported, tmp_path: Path
) -> None:
    assert {f.rule for f in lint([planted(clean, mutation, tmp_path)]).findings} == {mutation.rule}


def test_exit_codes_and_json(clean: Exported, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["lint", str(clean["urdf"])]) == 0
    wrong = planted(clean, next(m for m in MUTATIONS if m.id == "urdf-limits-order-swapped"), tmp_path)
    assert run(["lint", str(wrong)]) == 2
    assert "limits-order" in capsys.readouterr().out
    assert run(["lint", "--json", str(wrong)]) == 2
    report = json.loads(capsys.readouterr().out)
    assert not report["ok"]
    (finding,) = report["findings"]
    assert finding["element"].startswith("joint 'door_joint' (line ")
    assert finding["value"] == "1.4 > 0 rad"
    assert run(["lint", str(wrong), "--ignore", "limits-order", *SIMULATED]) == 0
    assert run(["lint", "--rules"]) == 0
    assert all(name in capsys.readouterr().out for name in ["pivot-off-part"])


def test_a_run_folder_is_taken_whole(clean: Exported, tmp_path: Path) -> None:
    for fmt, path in clean.items():
        shutil.copytree(path.parent, tmp_path / "run" / "export" / fmt)
    report = lint([tmp_path / "run"], ignore=SIMULATED)
    assert [Path(f).name for f in report.files] == [
        "cabinet.urdf",
        "cabinet.xml",
        "scene.xml",
        "cabinet.usda",
    ]
    with pytest.raises(InputError, match="run `twin export` first"):
        lint([tmp_path])


BAD = {
    "torn.urdf": ('<robot name="r"><link', "not well-formed"),
    "bomb.urdf": ('<!DOCTYPE r [<!ENTITY a "aa">]><robot name="r">&a;</robot>', "document type"),
    "bomb.xml": ('<!DOCTYPE r SYSTEM "http://example.org/r.dtd"><mujoco/>', "document type"),
    "other.urdf": ("<sdf/>", "no URDF"),
    "other.xml": ("<html/>", "no MJCF"),
    "torn.usda": ("#usda 1.0\ndef Xform {", "can't be opened as USD"),
    "model.xacro": ("<robot/>", "xacro"),
    "model.dae": ("<COLLADA/>", "suffix"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_can_not_be_read_is_one_line(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, said = BAD[name]
    (tmp_path / name).write_text(text)
    assert run(["lint", str(tmp_path / name)]) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_what_is_not_there_or_not_known_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        lint([tmp_path / "none.urdf"])
    with pytest.raises(InputError, match="did you mean 'limits-order'"):
        lint([], ignore=["limit-order"])


@pytest.mark.parametrize("scene", SCENES, ids=lambda p: p.stem)
def test_scenes_that_were_written_by_hand_have_no_finding(scene: Path) -> None:
    assert lint([scene]).findings == ()


ODD = {
    "no physics.usda": '#usda 1.0\ndef Xform "a"\n{\n    def Sphere "s"\n    {\n    }\n}\n',
    "empty.usda": "#usda 1.0\n",
    "odd joints.usda": """#usda 1.0
        (
            kilogramsPerUnit = 1
            metersPerUnit = 1
            upAxis = "Z"
        )
        def Xform "a" (prepend apiSchemas = ["PhysicsRigidBodyAPI"])
        {
            def Sphere "s" (prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMassAPI"])
            {
                float physics:density = 500
            }
        }
        def PhysicsSphericalJoint "ball"
        {
            rel physics:body1 = </a>
        }
        def PhysicsJoint "six"
        {
            rel physics:body1 = </a>
        }
        def PhysicsRevoluteJoint "off"
        {
            rel physics:body1 = </nowhere>
            bool physics:jointEnabled = 0
        }
        def PhysicsDistanceJoint "rope"
        {
            rel physics:body0 = </a>
        }
        """,
    "odd joints.urdf": """<robot name="r"><link name="base"/><link name="a"/><link name="b"/><link name="c"/>
        <joint name="f" type="floating"><parent link="base"/><child link="a"/></joint>
        <joint name="p" type="planar"><parent link="base"/><child link="b"/></joint>
        <joint name="n" type="no_such_type"><parent link="base"/><child link="c"/></joint></robot>""",
    "empty.urdf": '<robot name="r"/>',
    "empty elements.urdf": """<robot><link/><link name="a"><visual/><collision><geometry/></collision><inertial/></link>
        <joint/><joint name="j" type="revolute"><axis/><limit/></joint></robot>""",
    "odd joints.xml": """<mujoco><worldbody><body mocap="true"><geom size=".1" contype="0" conaffinity="0"/></body>
        <body pos="0 0 1"><freejoint/><geom size=".1" density="500"/><body><joint type="ball"/><geom size=".1" density="500"/></body></body>
        <body pos="0 1 0"><joint axis="0 0 1"/><joint type="slide" axis="1 0 0"/><geom type="capsule" fromto="0 0 0 1 0 0" size=".02"
          mass="1"/></body></worldbody></mujoco>""",
    "empty.xml": "<mujoco/>",
}


@pytest.mark.parametrize("name", ODD)
def test_what_is_odd_is_looked_at_all_the_same(name: str, tmp_path: Path) -> None:
    """Joints of other kinds, bodies without a joint, files without a model: findings perhaps, a crash
    never."""
    path = tmp_path / name
    path.write_text(ODD[name], encoding="utf-8")
    report = lint([path])
    assert report.files == (str(path),)
    if "elements" not in name and not name.endswith(".urdf"):
        assert {f.rule for f in report.findings} <= {"refused"}


def limits(fmt: str, lower: float, upper: float) -> str:
    """A file with one hinge of these limits."""
    if fmt == "urdf":
        return f"""<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0"
            ixz="0" iyz="0"/></inertial></link><joint name="j" type="revolute"><parent link="base"/><child link="arm"/>
            <axis xyz="0 0 1"/><limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/></joint></robot>"""
    if fmt == "mjcf":
        return f"""<mujoco><worldbody><body name="arm"><joint name="j" range="{lower} {upper}"/><geom size=".1" mass="1"/></body>
            </worldbody></mujoco>"""
    return f"""#usda 1.0
        (
            kilogramsPerUnit = 1
            metersPerUnit = 1
            upAxis = "Z"
        )
        def Xform "arm" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])
        {{
            float physics:mass = 1
            float3 physics:diagonalInertia = (1, 1, 1)
        }}
        def PhysicsRevoluteJoint "j"
        {{
            rel physics:body1 = </arm>
            float physics:lowerLimit = {lower}
            float physics:upperLimit = {upper}
        }}"""


@pytest.mark.parametrize(
    ("fmt", "lower", "upper", "rule"),
    [
        ("urdf", -6.2832, 6.2832, None),  # a wrist that turns once to each side
        ("urdf", 0, 90, "limits-unit"),
        ("urdf", -1.5708, 1.5708, None),
        ("mjcf", 0, 90, None),  # MJCF counts in degrees unless it says otherwise
        ("mjcf", 0, 1.5708, "limits-unit"),
        ("usd", 0, 90, None),
        ("usd", -10, 10, None),
        ("usd", -1.5708, 1.5708, "limits-unit"),
        ("usd", -3, 0, "limits-unit"),
        ("usd", 178, 182, None),  # a range of a few degrees far from zero is none in radians
    ],
)
def test_units_of_limits(fmt: str, lower: float, upper: float, rule: str | None, tmp_path: Path) -> None:
    path = tmp_path / {"urdf": "a.urdf", "mjcf": "a.xml", "usd": "a.usda"}[fmt]
    path.write_text(limits(fmt, lower, upper))
    assert {f.rule for f in lint([path], ignore=SIMULATED).findings} == ({rule} if rule else set())


@pytest.mark.parametrize(
    ("off", "found"), [(0.0, False), (0.02, False), (0.045, False), (0.055, True), (-0.2, False)]
)
def test_how_far_a_hinge_may_be_beside_its_part(off: float, found: bool, tmp_path: Path) -> None:
    """A board of 0.6 x 0.02 x 0.5 m whose edge is `off` from the hinge; -0.2 m is a hinge inside of it."""
    text = f"""<mujoco><worldbody><body name="door"><joint axis="0 0 1" range="0 90"/>
        <geom type="box" size=".3 .01 .25" pos="{0.3 + off} 0 0" mass="3"/></body></worldbody></mujoco>"""
    (tmp_path / "a.xml").write_text(text)
    findings = lint([tmp_path / "a.xml"], ignore=SIMULATED).findings
    assert ["pivot-off-part"] * found == [f.rule for f in findings]
    if found:
        assert float(findings[0].value.split()[0]) == pytest.approx(55, rel=0.01)


def test_meshes_in_a_ros_package_are_found(tmp_path: Path) -> None:
    path = export(lint_twin(), tmp_path, formats=("urdf",), package="kitchen")["urdf"]
    package = path.parent / "urdf" / path.name
    assert "package://kitchen/" in package.read_text()
    assert lint([package], ignore=SIMULATED).findings == ()
    alone = tmp_path / "elsewhere" / package.name
    alone.parent.mkdir()
    shutil.copy(package, alone)
    assert {f.rule for f in lint([alone], ignore=SIMULATED).findings} == {"path-outside"}


@pytest.mark.parametrize("absolute", [False, True])
def test_a_mesh_beside_an_included_file_is_named_by_no_absolute_path(absolute: bool, tmp_path: Path) -> None:
    """MuJoCo takes such a path from the included file on, and tells it from the root of the disk on."""
    (tmp_path / "assets").mkdir()
    (tmp_path / "meshes").mkdir()
    mesh = tmp_path / "meshes/wedge.obj"
    mesh.write_text("v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    named = mesh if absolute else "../meshes/wedge.obj"
    (tmp_path / "assets/meshes.xml").write_text(
        f'<mujocoinclude><asset><mesh name="wedge" file="{named}"/></asset></mujocoinclude>'
    )
    path = tmp_path / "model.xml"
    path.write_text(
        '<mujoco><include file="assets/meshes.xml"/><worldbody><geom type="mesh" mesh="wedge"/></worldbody></mujoco>'
    )
    assert [f.rule for f in lint(path).findings] == (["path-absolute"] if absolute else [])

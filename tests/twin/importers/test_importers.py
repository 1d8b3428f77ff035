"""Articulated scenes from elsewhere become twins: what the file says is what the twin does, and nothing is
lost unsaid."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest

import twin
from benchmarks.scenes.boards import cabinet_twin
from benchmarks.scenes.random_twins import random_twin
from tests.makers.twin.scene_texts import LADEN, urdf
from twin import geometry as geo
from twin.cli import main as cli
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Box, Mesh, Part, Revolute, Twin

ROOT = Path(__file__).resolve().parents[3]
SCENES = sorted((ROOT / "assets" / "scenes").glob("*.xml"))
READ: dict[str, Callable[..., Twin]] = {"urdf": twin.from_urdf, "mjcf": twin.from_mjcf}
STILL = np.eye(4)


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        yield


def as_it_was(made: Twin) -> dict[str, Any]:
    """Joints of an export closed where the twin was, with all of its range: ours may open to both sides."""
    joints = {f"{p.name}_joint": p.joint for p in made.parts}
    return {
        "closed": dict.fromkeys(joints, 0.0),
        "limits": {n: (j.lower, j.upper) for n, j in joints.items()},
    }


def surface_distance(points: Array, mesh: Mesh) -> float:
    """The farthest that any of the points (n, 3) lies from a mesh."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    center = mesh.vertices.mean(axis=0)  # single precision: near the origin
    scene.add_triangles((mesh.vertices - center).astype(np.float32), mesh.faces.astype(np.uint32))
    return float(scene.compute_distance((points - center).astype(np.float32)).numpy().max())


def require_same_part(got: Part, want: Part, T: Array, mesh_tolerance: float = 1e-6) -> None:
    joint, expected = got.joint, want.joint.transformed(T)
    assert (got.name, joint.kind) == (want.name, expected.kind)
    assert np.allclose(joint.axis, expected.axis, atol=1e-9)
    assert np.allclose((joint.lower, joint.upper), (expected.lower, expected.upper), atol=1e-9)
    if isinstance(expected, Revolute):
        assert isinstance(joint, Revolute)
        assert geo.point_line_distance(joint.pivot, expected.pivot, expected.axis) < 1e-9
    assert got.inertial is not None
    assert want.inertial is not None
    mass = want.inertial.mass.value
    assert got.inertial.mass.value == pytest.approx(mass, rel=1e-9)
    assert np.allclose(got.inertial.com, geo.transform(T, want.inertial.com[None])[0], atol=1e-9)
    turned = T[:3, :3] @ want.inertial.inertia @ T[:3, :3].T
    assert np.allclose(got.inertial.inertia, turned, rtol=1e-9, atol=1e-9 * float(np.trace(turned)))
    surface = want.mesh.transformed(T)
    assert got.mesh.area == pytest.approx(surface.area, rel=1e-5)
    assert surface_distance(got.mesh.vertices, surface) < mesh_tolerance
    assert surface_distance(surface.vertices, got.mesh) < mesh_tolerance


def require_same(got: Twin, want: Twin, T: Array = STILL) -> None:
    assert [p.name for p in got.parts] != []
    ids = {p.id: p.name for p in got.parts}
    for part in want.parts:
        mine = got.part(part.name)
        require_same_part(mine, part, T)
        parent = None if mine.parent is None else ids[mine.parent]
        assert parent == (None if part.parent is None else want.part(part.parent).name)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("fmt", READ)
def test_an_exported_twin_comes_back(fmt: str, seed: int, tmp_path: Path) -> None:
    made = random_twin(seed)
    files = twin.export(made, tmp_path, [fmt])
    back = READ[fmt](files[fmt], **as_it_was(made))
    require_same(back, made)
    for part in made.parts:
        mine, said = back.part(part.name), part.physics
        assert mine.physics is not None
        assert said is not None
        assert mine.physics.damping.value == pytest.approx(said.damping.value, rel=1e-9)
        assert mine.physics.frictionloss.value == pytest.approx(said.frictionloss.value, rel=1e-9)
        assert mine.physics.damping.origin == "user"
        assert files[fmt].name in mine.physics.damping.source
        if fmt == "mjcf":
            assert mine.physics.friction.value == pytest.approx(said.friction.value, rel=1e-9)
        (box,), (was,) = mine.collision, part.collision
        assert isinstance(box, Box)
        assert isinstance(was, Box)
        assert np.allclose(box.T_world_box, was.T_world_box, atol=1e-9)
        assert np.allclose(box.size, was.size, atol=1e-9)


def test_a_twin_that_comes_back_has_its_colours_and_its_nested_tree(tmp_path: Path) -> None:
    made = cabinet_twin(nested=True, lid=True)
    for fmt, read in READ.items():
        back = read(twin.export(made, tmp_path, [fmt])[fmt])
        require_same(back, made)
        assert back.static.name == made.static.name
        for part in back.parts:
            assert part.mesh.colors is not None
            was = made.part(part.name).mesh
            assert was.colors is not None
            nearest = np.linalg.norm(part.mesh.vertices[:, None] - was.vertices[None], axis=2)
            # of the corners at one place, which boards of different colour share, one has the colour
            same = [
                min(np.abs(was.colors[near < 1e-5].astype(int) - c.astype(int)).max(axis=1), default=0)
                for near, c in zip(nearest, part.mesh.colors, strict=True)
            ]
            assert np.median(same) <= 2


@pytest.mark.parametrize("fmt", READ)
def test_a_scene_that_is_moved_gives_a_twin_that_is_moved(fmt: str, tmp_path: Path) -> None:
    """Turned about any axis and shifted: every joint, mass and surface with it."""
    made = random_twin(3)
    path = twin.export(made, tmp_path, [fmt])[fmt]
    tree = ET.parse(path)  # noqa: S314  (our own)
    T = geo.make_pose(geo.exp_so3([0.3, -0.2, 1.1]), [1.0, -2.0, 0.5])
    if fmt == "mjcf":
        body = tree.getroot().find("worldbody/body")
        assert body is not None
        body.set("pos", " ".join(map(repr, T[:3, 3].tolist())))
        body.set("quat", " ".join(map(repr, geo.quat_wxyz_from_matrix(T[:3, :3]).tolist())))
    else:
        from twin.exporters.urdf import roll_pitch_yaw

        origin = tree.getroot().find(f"joint[@name='{made.static.name}_to_world']/origin")
        assert origin is not None
        origin.set("xyz", " ".join(map(repr, T[:3, 3].tolist())))
        origin.set("rpy", " ".join(map(repr, roll_pitch_yaw(T[:3, :3]).tolist())))
    moved = path.with_name(f"moved{path.suffix}")
    tree.write(moved)
    require_same(READ[fmt](moved, **as_it_was(made)), made, T)


@pytest.mark.parametrize(
    ("closed", "door", "drawer"),
    [
        ({}, (0.1, 1.0), (0.0, -1.0)),  # the door at qpos0, which is near neither end
        ({"door_hinge": "upper", "slide": "lower"}, (1.0, -1.0), (-0.3, 1.0)),
        ({"door_hinge": 0.3}, (0.3, -1.0), (0.0, -1.0)),  # it opens the longer way
    ],
)
def test_parts_move_as_the_file_moves_them_wherever_closed_is(
    closed: dict[str, float | str], door: tuple[float, float], drawer: tuple[float, float], tmp_path: Path
) -> None:
    """Every geom's pose in MuJoCo at random positions of all joints, against the twin's surface at the same
    states.

    door, drawer: where each is closed in the file, and the sign in which it opens.
    """
    path = tmp_path / "laden.xml"
    path.write_text(LADEN)
    made = twin.from_mjcf(path, closed=closed)
    assert [p.name for p in made.parts] == ["door", "flap", "drawer"]
    assert [p.parent for p in made.parts] == [None, 2, None]
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    starts = {"door": door, "flap": (0.0, -1.0), "drawer": drawer}
    joints = {"door": "door_hinge", "flap": "flap_hinge", "drawer": "slide"}
    rng = np.random.default_rng(5)
    for _ in range(5):
        states = {p.id: float(rng.uniform(p.joint.lower, p.joint.upper)) for p in made.parts}
        for part in made.parts:
            low, high = model.joint(joints[part.name]).range
            start, sign = starts[part.name]
            position = start + sign * states[part.id]
            assert low - 1e-9 <= position <= high + 1e-9
            data.joint(joints[part.name]).qpos[0] = position
        mujoco.mj_kinematics(model, data)
        for part in made.parts:
            pose = made.part_pose(part.id, states)
            body = model.body(part.name).id
            geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body]
            shown = part.mesh.transformed(pose)
            for g in geoms:
                assert surface_distance(data.geom_xpos[g][None], Mesh(shown.vertices, shown.faces)) < 0.06
            (want,) = (data.xipos[body],) if part.name != "door" else (None,)
            assert part.inertial is not None
            got = geo.transform(pose, part.inertial.com[None])[0]
            if want is not None and part.inertial.mass.origin == "user":
                assert np.allclose(got, want, atol=1e-9)
            centers = np.array([data.geom_xpos[g] for g in geoms])
            pieces = [c.T_world_box[:3, 3] if isinstance(c, Box) else c.area_centroid for c in part.collision]
            moved = geo.transform(pose, np.array(pieces))
            for center in centers:
                assert np.linalg.norm(moved - center, axis=1).min() < 1e-5


@pytest.mark.parametrize(
    ("low", "high", "lower", "upper", "opens", "source"),
    [
        (0.0, 1.5, 0.0, 1.5, 1.0, "the rest pose"),
        (-1.5, 0.0, 0.0, 1.5, -1.0, "the rest pose"),
        (-0.5, 1.0, -0.5, 1.0, 1.0, "the rest pose"),
        (0.2, 1.0, 0.0, 0.8, 1.0, "next to its rest pose"),
    ],
)
def test_closed_is_the_end_next_to_the_rest_pose_and_else_the_rest_pose(
    low: float, high: float, lower: float, upper: float, opens: float, source: str, tmp_path: Path
) -> None:
    path = tmp_path / "door.urdf"
    path.write_text(urdf(f'<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
                         f'<limit lower="{low}" upper="{high}" effort="1" velocity="1"/></joint>'))  # fmt: skip
    (part,) = twin.from_urdf(path).parts
    assert (part.joint.lower, part.joint.upper) == (pytest.approx(lower), pytest.approx(upper))
    assert np.allclose(part.joint.axis, [0, 0, opens])
    assert source in part.closed_source
    assert "door.urdf" in part.closed_source
    (part,) = twin.from_urdf(path, closed={"j": "upper"}).parts
    assert np.allclose(part.joint.axis, [0, 0, -1])
    assert part.closed_source == "given by the user"
    (part,) = twin.from_urdf(path, limits={"j": (0.1, 0.4)}, closed={"j": 0.1}).parts
    assert part.joint.upper == pytest.approx(0.3)
    assert part.limits_source == "given by the user"


def test_bodies_are_left_out_by_name_with_what_hangs_on_them(tmp_path: Path) -> None:
    path = tmp_path / "laden.xml"
    path.write_text(LADEN)
    assert [p.name for p in twin.from_mjcf(path, exclude=["door"]).parts] == ["drawer"]
    assert [p.name for p in twin.from_mjcf(path, exclude=["fl*", "drawer"]).parts] == ["door"]
    for asked, word in (
        ({"exclude": ["dor"]}, "door"),
        ({"closed": {"door_hinges": 0.0}}, "door_hinge"),
        ({"limits": {"x": (0.0, 1.0)}}, "slide"),
        ({"closed": {"slide": 0.5}}, "-0.3 to 0"),
        ({"closed": {"slide": "open"}}, "lower, upper"),
    ):
        with pytest.raises(InputError, match=word):
            twin.from_mjcf(path, **asked)  # type: ignore[arg-type]


def test_meshes_are_found_in_packages_and_scaled(tmp_path: Path) -> None:
    import trimesh

    package = tmp_path / "things"
    (package / "urdf").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>things</name></package>")
    trimesh.creation.box(extents=(1000, 20, 600)).export(package / "board.stl")
    mesh = '<mesh filename="package://things/board.stl" scale="0.001 0.001 0.001"/>'
    path = package / "urdf" / "board.urdf"
    path.write_text(f'<robot name="r"><link name="a"><visual><geometry>{mesh}</geometry>'
                    '<material name="m"><color rgba="1 0.5 0 1"/></material></visual></link></robot>')  # fmt: skip
    made = twin.from_urdf(path)
    assert np.allclose(np.ptp(made.static.mesh.vertices, axis=0), [1.0, 0.02, 0.6])
    assert made.static.mesh.colors is not None
    assert np.all(made.static.mesh.colors == [255, 128, 0])


@pytest.mark.parametrize("scene", SCENES, ids=lambda p: p.stem)
def test_a_foreign_scene_has_the_joints_that_mujoco_sees(scene: Path) -> None:
    made = twin.from_mjcf(scene)
    model = mujoco.MjModel.from_xml_path(str(scene))
    assert len(made.parts) == model.njnt
    for part in made.parts:
        body = model.body(part.name)
        (joint,) = (j for j in range(model.njnt) if model.jnt_bodyid[j] == body.id)
        assert part.joint.upper == pytest.approx(np.ptp(model.jnt_range[joint]))
        assert part.inertial is not None
        assert part.inertial.mass.value == pytest.approx(float(model.body_subtreemass[body.id]))


@pytest.mark.slow
@pytest.mark.skipif(find_spec("gymnasium_robotics") is None, reason="needs funtwin[simulate]")
def test_franka_kitchen_without_its_robot_is_a_twin(tmp_path: Path) -> None:
    from recon.simulate import kitchen_scene

    made = twin.from_mjcf(kitchen_scene(), exclude=["panda0_link0"])
    names = {p.name for p in made.parts}
    assert {"microdoorroot", "slidelink", "hingeleftdoor", "hingerightdoor", "knob_1"} <= names
    assert "kettle" not in names
    twin.save(made, tmp_path / "twin")
    assert len(twin.load(tmp_path).parts) == len(made.parts) == 14


def test_a_twin_that_nobody_moved_is_exported_checked_and_shown(tmp_path: Path) -> None:
    run = tmp_path / "run"
    twin.save(twin.from_mjcf(ROOT / "assets" / "scenes" / "chest.xml"), run / "twin")
    assert len(twin.load(run).parts[0].motion.frames) == 0
    assert cli.run(["export", str(run), "--format", "mjcf"]) == 0
    assert cli.run(["check", str(run), "--format", "mjcf", "--engines", "mujoco"]) == 0
    assert cli.run(["physics", "show", str(run), "--json"]) == 0
    assert cli.run(["lint", str(run)]) == 0
    assert (run / "report.html").is_file()


def test_the_command_line_imports_a_scene_and_never_over_a_twin(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, run = tmp_path / "laden.xml", tmp_path / "run"
    path.write_text(LADEN)
    options = ["--closed", "door_hinge=upper", "--limit", "slide=-0.2,0", "--exclude", "flap", "--json"]
    assert cli.run(["import", str(path), "-o", str(run), *options]) == 0
    assert json.loads(capsys.readouterr().out)["parts"] == ["door", "drawer"]
    made = twin.load(run)
    assert made.part("drawer").joint.upper == pytest.approx(0.2)
    assert made.part("door").closed_source == "given by the user"
    before = (run / "twin" / "twin.json").read_bytes()
    assert cli.run(["import", str(path), "-o", str(run)]) == 1
    assert "holds a twin already" in capsys.readouterr().err
    assert (run / "twin" / "twin.json").read_bytes() == before
    for wrong, words in (
        ("--closed door", "names no joint and value"),
        ("--limit slide=1", "slide"),
        ("--limit slide=a,b", "slide"),
        ("--limit =0,1", "names no joint and value"),
        ("--closed x=upper", "x"),
    ):
        assert cli.run(["import", str(path), "-o", str(tmp_path / "other"), *wrong.split()]) == 1
        err = capsys.readouterr().err
        assert err.count("\n") == 1
        assert words in err


@pytest.mark.slow
def test_a_robot_opens_a_cabinet_from_elsewhere(tmp_path: Path) -> None:
    made = twin.from_mjcf(ROOT / "assets" / "scenes" / "base_cabinet.xml")
    import robots

    trajectory = robots.plan(made, "drawer_top")
    report = robots.replay(made, trajectory, tmp_path, video=False)
    assert report.ok, report.reason
    assert (tmp_path / "report.json").is_file()

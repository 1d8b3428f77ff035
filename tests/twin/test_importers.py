"""Articulated scenes from elsewhere become twins: what the file says is what the twin does, and nothing is lost unsaid."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest

import twin
from benchmarks.scenes.boards import cabinet_twin
from benchmarks.scenes.random_twins import random_twin
from twin import geometry as geo
from twin.cli import main as cli
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Box, Mesh, Part, Revolute, Twin

ROOT = Path(__file__).resolve().parents[2]
SCENES = sorted((ROOT / "assets" / "scenes").glob("*.xml"))
READ: dict[str, Callable[..., Twin]] = {"urdf": twin.from_urdf, "mjcf": twin.from_mjcf}
STILL = np.eye(4)


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        yield


def as_it_was(made: Twin) -> dict[str, float]:
    """Joints of an export closed where the twin was, whatever its limits: ours may open to both sides."""
    return {f"{p.name}_joint": 0.0 for p in made.parts}


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
    back = READ[fmt](files[fmt], closed=as_it_was(made))
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
    require_same(READ[fmt](moved, closed=as_it_was(made)), made, T)


# A box body with a door that the file has half open, a flap on it, and a drawer that opens against its axis; `ref` shifts what
# MuJoCo counts from.
LADEN = """<mujoco model="laden"><compiler angle="radian"/><worldbody>
 <body name="body" pos="0.4 0.1 0.2" euler="0 0 0.4"><geom type="box" size="0.3 0.25 0.4"/>
  <body name="door" pos="-0.3 -0.27 0" euler="0 0 -0.5">
   <joint name="door_hinge" type="hinge" axis="0 0 -1" range="-0.5 1.0" pos="0.01 0 0" ref="0.1"/>
   <geom type="box" size="0.28 0.01 0.39" pos="0.28 0 0"/>
   <body name="knob" pos="0.5 -0.03 0"><geom type="sphere" size="0.02"/></body>
   <body name="flap" pos="0.3 -0.02 0.1" euler="0.2 0 0">
    <joint name="flap_hinge" type="hinge" axis="1 0 0" range="-1.2 0"/>
    <geom type="box" size="0.1 0.005 0.05" pos="0 0 0.05"/><geom type="cylinder" size="0.01 0.05" pos="0 -0.02 0.05"/>
   </body></body>
  <body name="drawer" pos="0 -0.27 0.45"><joint name="slide" type="slide" axis="0 1 0" range="-0.3 0"/>
   <geom type="capsule" size="0.03 0.1"/><geom type="ellipsoid" size="0.1 0.05 0.03" pos="0 0.1 0"/></body>
 </body></worldbody></mujoco>"""


@pytest.mark.parametrize("closed", [{}, {"door_hinge": "upper", "slide": "lower"}, {"door_hinge": 0.3}])
def test_parts_move_as_the_file_moves_them_wherever_closed_is(
    closed: dict[str, float | str], tmp_path: Path
) -> None:
    """Every geom's pose in MuJoCo at random positions of all joints, against the twin's surface at the same states."""
    path = tmp_path / "laden.xml"
    path.write_text(LADEN)
    made = twin.from_mjcf(path, closed=closed)
    assert [p.name for p in made.parts] == ["door", "flap", "drawer"]
    assert [p.parent for p in made.parts] == [None, 2, None]
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    starts = {"door": -0.5, "flap": 0.0, "drawer": 0.0}
    if closed:
        starts |= {"door": 1.0, "drawer": -0.3} if "slide" in closed else {"door": 0.3}
    joints = {"door": "door_hinge", "flap": "flap_hinge", "drawer": "slide"}
    rng = np.random.default_rng(5)
    for _ in range(5):
        states = {p.id: float(rng.uniform(p.joint.lower, p.joint.upper)) for p in made.parts}
        for part in made.parts:
            low, high = model.joint(joints[part.name]).range
            sign = -1.0 if starts[part.name] == high else 1.0
            position = starts[part.name] + sign * states[part.id]
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
    ("low", "high", "upper", "opens", "source"),
    [
        (0.0, 1.5, 1.5, 1.0, "rest pose"),
        (-1.5, 0.0, 1.5, -1.0, "rest pose"),
        (-0.5, 1.0, 1.5, 1.0, "lower end"),
        (0.2, 1.0, 0.8, 1.0, "lower end"),
    ],
)
def test_closed_is_the_rest_pose_where_that_is_an_end_and_else_the_lower_end(
    low: float, high: float, upper: float, opens: float, source: str, tmp_path: Path
) -> None:
    path = tmp_path / "door.urdf"
    path.write_text(urdf(f'<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
                         f'<limit lower="{low}" upper="{high}" effort="1" velocity="1"/></joint>'))  # fmt: skip
    (part,) = twin.from_urdf(path).parts
    assert (part.joint.lower, part.joint.upper) == (0.0, pytest.approx(upper))
    assert np.allclose(part.joint.axis, [0, 0, opens])
    assert source in part.closed_source
    assert "door.urdf" in part.closed_source
    (part,) = twin.from_urdf(path, closed={"j": "upper"}).parts
    assert np.allclose(part.joint.axis, [0, 0, -1])
    assert part.closed_source == "given by the user"
    (part,) = twin.from_urdf(path, limits={"j": (0.1, 0.4)}, closed={"j": 0.1}).parts
    assert part.joint.upper == pytest.approx(0.3)
    assert part.limits_source == "given by the user"


def urdf(joints: str, links: str = "") -> str:
    shape = '<visual><geometry><box size="0.4 0.02 0.6"/></geometry></visual>'
    body = "".join(f'<link name="{n}">{shape}</link>' for n in "ab")
    return f'<robot name="scene">{body}{links}{joints}</robot>'


HINGE = '<joint name="j" type="{}"><parent link="a"/><child link="b"/>{}</joint>'
LIMIT = '<limit lower="0" upper="1" effort="1" velocity="1"/>'


def mjcf(body: str, after: str = "") -> str:
    return f'<mujoco><worldbody><body name="a"><geom size=".1"/>{body}</body></worldbody>{after}</mujoco>'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (urdf(HINGE.format("continuous", "")), ["joint 'j'", "no limits", "limits={'j': (0.0, 1.5)}"]),
        (urdf(HINGE.format("revolute", '<limit effort="1" velocity="1"/>')), ["joint 'j'", "no limits"]),
        (urdf(HINGE.format("revolute", LIMIT.replace('"1"', '"0"', 1))), ["joint 'j'", "0 to 0"]),
        (urdf(HINGE.format("planar", LIMIT)), ["body 'b'", "'planar'", "exclude"]),
        (urdf(HINGE.format("revolute", f'<axis xyz="0 0 0"/>{LIMIT}')), ["joint 'j'", "axis"]),
        (urdf(HINGE.format("revolute", LIMIT) + HINGE.format("fixed", "").replace('"j"', '"k"')), ["'b'", "two joints"]),
        (urdf(HINGE.format("revolute", LIMIT).replace('"a"', '"z"')), ["joint 'j'", "'z'"]),
        (urdf(HINGE.format("revolute", LIMIT).replace('"b"', '"c"'), '<link name="c"/>'), ["body 'c'", "joint 'j'", "no shape"]),
        (urdf("", '<link name="c"><visual><geometry><mesh filename="no.obj"/></geometry></visual></link>'), ["visual 0", "'c'", "no.obj"]),
        (urdf("", '<link name="c"><visual><geometry><mesh filename="package://p/no.obj"/></geometry></visual></link>'), ["'c'", "no.obj"]),
        (urdf("", '<link name="c"><visual><geometry/></visual></link>'), ["can't be read as URDF"]),
        (urdf(HINGE.format("revolute", LIMIT)).replace("0.02", "-0.02"), ["link 'a'", "must be positive"]),
        (urdf(HINGE.format("revolute", f'{LIMIT}<dynamics damping="abc"/>')), ["link 'b'", "'abc'"]),
        (urdf(HINGE.format("revolute", f'{LIMIT}<dynamics damping="-1"/>')), ["body 'b'", "damping must be zero or more"]),
        (urdf("", '<link name="c"><inertial><mass value="-1"/></inertial></link>'), ["link 'c'", "mass must be positive"]),
        (urdf("", '<link name="b"/>'), ["two links 'b'"]),
        ('<robot name="r"><xacro:macro name="m"/></robot>', ["xacro"]),
        ('<!DOCTYPE r [<!ENTITY e SYSTEM "file:///etc/hostname">]><robot name="&e;"/>', ["document type"]),
        ("<html/>", ["<html>"]),
        (mjcf('<body name="b"><joint type="ball"/><geom size=".1"/></body>'), ["body 'b'", "ball"]),
        (mjcf('<body name="b"><joint name="x" type="slide" range="0 1"/><joint name="y" type="slide" range="0 1"/><geom size=".1"/></body>'), ["'b'", "'x', 'y'"]),
        (mjcf('<body name="b"><joint name="k"/><geom size=".1"/></body>'), ["joint 'k'", "no limits"]),
        (mjcf('<body name="b"><joint nme="k"/></body>'), ["MuJoCo can't load", "nme"]),
        (mjcf("", '<option gravity="0 -9.81 0"/>'), ["gravity"]),
    ],
)  # fmt: skip
def test_what_no_twin_can_carry_is_refused_by_name(text: str, words: list[str], tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        (twin.from_mjcf if "<mujoco" in text else twin.from_urdf)(path)
    told = str(caught.value)
    assert "\n" not in told
    for word in words:
        assert word in told


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (mjcf("").replace("</worldbody>", '<body name="b"><freejoint/><geom size=".1"/></body></worldbody>'), ["'b'", "stands loose"]),
        (urdf(HINGE.format("floating", "")), ["'b'", "stands loose"]),
        (urdf(HINGE.format("revolute", f'{LIMIT}<mimic joint="j"/>')), ["joint 'j' follows 'j' (mimic)"]),
        (mjcf('<geom type="plane" size="0 0 1" name="floor"/>'), ["'floor'", "infinite plane"]),
        (mjcf('<body name="b"><joint name="k" range="0 1" stiffness="3" armature="1" limited="true"/><geom size=".1"/></body>',
              '<equality><joint joint1="k"/></equality><actuator><motor joint="k"/></actuator>'),
         ["spring of joint 'k'", "armature", "'joint' of joints 'k'", "1 actuators"]),
    ],
)  # fmt: skip
def test_what_is_left_out_is_told(text: str, words: list[str], tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    path.write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        made = (twin.from_mjcf if "<mujoco" in text else twin.from_urdf)(path)
    told = " | ".join(str(w.message) for w in caught if w.category is UserWarning)
    for word in words:
        assert word in told
    assert "scene.xml" in told
    assert [p.name for p in made.parts if p.name == "b"] == (["b"] if "'j'" in told or "'k'" in told else [])


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


def test_a_tensor_that_no_body_can_have_is_told_and_the_mass_kept(tmp_path: Path) -> None:
    path = tmp_path / "point.urdf"
    inertia = (
        '<inertial><mass value="3.5"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    )
    text = urdf(HINGE.format("revolute", LIMIT)).replace('<link name="b">', f'<link name="b">{inertia}')
    path.write_text(text)
    with pytest.warns(UserWarning, match="'b': inertia must be positive definite.*spread over the surface"):
        (part,) = twin.from_urdf(path).parts
    assert part.inertial is not None
    assert part.inertial.mass.value == 3.5
    assert part.inertial.mass.origin == "user"


def test_what_a_file_does_not_state_comes_from_the_table_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "bare.urdf"
    path.write_text(urdf(HINGE.format("revolute", LIMIT)))
    (part,) = twin.from_urdf(path).parts
    assert part.inertial is not None
    assert part.physics is not None
    quantities = [part.inertial.mass, *vars(part.physics).values()]
    assert all("bare.urdf" not in q.source for q in quantities)
    assert len(part.motion.frames) == 0


def test_a_concave_collision_mesh_is_not_filled_up(tmp_path: Path) -> None:
    """A hull over a carcass would close it: shapes are made from the surface instead, and that is told."""
    import trimesh

    carcass = trimesh.util.concatenate(
        [trimesh.creation.box(extents=e).apply_translation(t) for e, t in
         (((0.02, 0.4, 0.6), (-0.3, 0, 0)), ((0.02, 0.4, 0.6), (0.3, 0, 0)), ((0.6, 0.02, 0.6), (0, 0.2, 0)))]
    )  # fmt: skip
    carcass.export(tmp_path / "carcass.stl")
    shape = '<geometry><mesh filename="carcass.stl" scale="1 1 1"/></geometry>'
    path = tmp_path / "open.urdf"
    path.write_text(urdf("", f'<link name="c"><visual>{shape}</visual><collision>{shape}</collision></link>'))
    with pytest.warns(UserWarning, match="collision 0 of link 'c' is not convex"):
        made = twin.from_urdf(path)
    assert made.static.collision == ()


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
    for wrong in (
        "--closed door",
        "--limit slide=1",
        "--limit slide=a,b",
        "--limit =0,1",
        "--closed x=upper",
    ):
        assert cli.run(["import", str(path), "-o", str(tmp_path / "other"), *wrong.split()]) == 1
        assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.slow
def test_a_robot_opens_a_cabinet_from_elsewhere(tmp_path: Path) -> None:
    made = twin.from_mjcf(ROOT / "assets" / "scenes" / "base_cabinet.xml")
    import robots

    trajectory = robots.plan(made, "drawer_top")
    report = robots.replay(made, trajectory, tmp_path, video=False)
    assert report.ok, report.reason
    assert (tmp_path / "report.json").is_file()

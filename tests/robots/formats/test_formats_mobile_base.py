"""A mobile base that moves while its arm does: its files together put the tool where the plan has it.

The judge is Pinocchio with the published table of Spot's arm; the arm's joints and the body's way come from
the files.
"""

from __future__ import annotations

import csv
import json

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robots.formats import FORMATS, export_trajectory
from robots.formats.spot import WRIST_T_TOOL
from robots.model.catalog import resolve
from robots.model.mjcf import compiled
from tests.makers.robots import planned_motions
from tests.makers.robots.planned_motions import stacked
from tests.makers.robots.spot_table import ARM, HAND, TOOL_AXES
from twin import geometry as geo

pin = pytest.importorskip("pinocchio")


@pytest.fixture(scope="module", params=["mobile base opens", "mobile base closes"])
def source(request):
    return planned_motions.SOURCES[request.param]()


@pytest.fixture(scope="module")
def folder(source, tmp_path_factory):
    out = tmp_path_factory.mktemp("handed")
    export_trajectory(source, ["csv", "ros2", "moveit", "spot"], out)
    return out


def arm_of(q):
    """Poses (n, 4, 4) of the tool in Spot's body at arm joints (n, 6), from the published table alone."""
    model, parent = pin.Model(), 0
    for name, kind, origin, *_ in ARM:
        joint = getattr(pin, f"JointModel{kind}")()
        parent = model.addJoint(parent, joint, pin.SE3(np.eye(3), np.array(origin)), name)
    data, hand = model.createData(), pin.SE3(np.eye(3), np.array(HAND))
    poses = []
    for row in q:
        pin.forwardKinematics(model, data, row)
        poses.append((data.oMi[parent] * hand).homogeneous @ TOOL_AXES)
    return np.stack(poses)


def poses_of(places, turns):
    q = np.array([[t[a] for a in "xyzw"] for t in turns])
    return stacked(Rotation.from_quat(q).as_matrix(), np.array([[p[a] for a in "xyz"] for p in places]))


def clock(points):
    return [(p["time_from_start"]["sec"], p["time_from_start"]["nanosec"]) for p in points]


def test_columns_and_features_carry_the_unit_of_their_joint(source, folder):
    with (folder / "trajectory.csv").open(newline="", encoding="utf-8") as f:
        rows = list(csv.DictReader(f))
    t = source.trajectory
    for k, (joint, unit) in enumerate(zip(t.joint_names, ("m", "m", *["rad"] * 7), strict=True)):
        assert np.array_equal([float(r[f"{joint}_{unit}"]) for r in rows], t.q[:, k])
        assert np.array_equal([float(r[f"{joint}_{unit}_per_s"]) for r in rows], t.qd[:, k])
    assert "base_x_rad" not in rows[0]
    pytest.importorskip("pyarrow")
    info = json.loads(FORMATS["lerobot"].render(source)["lerobot/meta/info.json"])
    for key in ("observation.state", "action"):
        names = info["features"][key]["names"]
        assert names[:4] == ["base_x_m", "base_y_m", "base_yaw_rad", "arm_sh0_rad"]
        assert len(names) == 10


def test_the_arms_file_holds_the_arm_alone(source, folder):
    message = planned_motions.read_yaml(folder / "joint_trajectory.yaml")
    assert message["joint_names"] == [row[0] for row in ARM]
    assert message["header"]["frame_id"] == "body"
    q = np.array([p["positions"] for p in message["points"]])
    assert np.abs(q - source.trajectory.q[:, 3:]).max() <= 1e-9
    assert np.all((q >= [row[3] for row in ARM]) & (q <= [row[4] for row in ARM]))


def test_arm_and_base_together_put_the_tool_where_the_cartesian_file_has_it(source, folder):
    arm, base, tool = (
        planned_motions.read_yaml(folder / f"{n}_trajectory.yaml") for n in ("joint", "base", "cartesian")
    )
    assert clock(arm["points"]) == clock(base["points"]) == clock(tool["points"])
    assert base["joint_names"] == [arm["header"]["frame_id"]]
    assert base["header"]["frame_id"] == tool["header"]["frame_id"] == source.robot.base_body
    (transforms,) = zip(*(p["transforms"] for p in base["points"]), strict=True)
    body = poses_of([t["translation"] for t in transforms], [t["rotation"] for t in transforms])
    poses = [p["point"]["pose"] for p in tool["points"]]
    wanted = poses_of([p["position"] for p in poses], [p["orientation"] for p in poses])
    found = body @ arm_of(np.array([p["positions"] for p in arm["points"]]))
    assert np.abs(found - wanted).max() < 1e-7
    assert np.ptp(body[:, :2, 3], axis=0).min() > 0.2, "a body that stands would not tell"
    world = source.trajectory.T_world_base @ wanted
    assert np.abs(world - source.trajectory.T_world_tool).max() < 1e-7


def test_the_bodys_velocities_are_the_rates_of_its_poses(source, folder):
    base = planned_motions.read_yaml(folder / "base_trajectory.yaml")["points"]
    times = source.trajectory.times
    place = np.array([[p["transforms"][0]["translation"][a] for a in "xyz"] for p in base])
    turn = np.unwrap([2 * np.arctan2(*(p["transforms"][0]["rotation"][a] for a in "zw")) for p in base])
    linear = np.array([[p["velocities"][0]["linear"][a] for a in "xyz"] for p in base])
    angular = np.array([[p["velocities"][0]["angular"][a] for a in "xyz"] for p in base])
    inside = slice(2, -2)
    assert np.abs(np.gradient(place, times, axis=0) - linear)[inside].max() < 5e-3
    assert np.abs(np.gradient(turn, times) - angular[:, 2])[inside].max() < 5e-3
    assert np.abs(linear).max() > 0.1
    assert np.abs(angular[:, 2]).max() > 0.3
    assert not np.any(angular[:, :2])


def test_the_claw_is_told_angles_inside_its_limits(source, folder):
    message = planned_motions.read_yaml(folder / "gripper_trajectory.yaml")
    assert message["joint_names"] == ["arm_f1x"]
    angle = np.array([p["positions"] for p in message["points"]])[:, 0]
    low, high = compiled(source.robot).joint("arm_f1x").range
    assert np.all((angle >= low) & (angle <= high))
    held = source.trajectory.gripper == 0.0
    assert np.all(angle[held] == source.robot.jaw_closed)
    assert np.all(angle[~held] == source.robot.jaw_open)


def test_the_wrists_tool_is_that_of_our_model():
    spec = resolve("spot")
    model = compiled(spec)
    site = model.site(spec.tool)
    # of the body that the last joint of the arm turns, which is the manufacturer's link_wr1
    assert model.jnt_bodyid[model.joint("arm_wr1").id] == model.site_bodyid[site.id]
    own = geo.make_pose(geo.matrix_from_quat_wxyz(site.quat), site.pos)
    assert np.abs(own - WRIST_T_TOOL).max() < 1e-12
    data = mujoco.MjData(model)
    data.qpos[9] = spec.jaw_open
    mujoco.mj_kinematics(model, data)
    tip = data.geom("upper_jaw_blade").xpos - data.geom("lower_jaw_blade").xpos
    assert data.site(spec.tool).xmat.reshape(3, 3)[:, 1] @ tip > 0.02, "the claw opens along the tool's y"


def spot_leg(folder, leg):
    read = {
        kind: json.loads(next((folder / "spot").glob(f"{kind}_?_{leg}.json")).read_text(encoding="utf-8"))
        for kind in ("arm_impedance", "body")
    }
    return read["arm_impedance"], read["body"]


@pytest.mark.parametrize("leg", ["approach", "close", "move", "open", "retreat"])
def test_spots_body_and_arm_together_put_the_tool_where_the_command_has_it(source, folder, leg):
    arm, body = spot_leg(folder, leg)
    assert arm["rootFrameName"] == body["se2FrameName"] == "odom"
    points, steps = arm["taskTformDesiredTool"]["points"], body["trajectory"]["points"]
    assert [p["timeSinceReference"] for p in points] == [p["timeSinceReference"] for p in steps]
    root = arm["rootTformTask"]
    poses = [p["pose"] for p in points]
    task = poses_of([root["position"]], [root["rotation"]])[0]
    wanted = task @ poses_of([p["position"] for p in poses], [p["rotation"] for p in poses])
    t = source.trajectory
    begin = max(t.phases.index(leg) - 1, 0)
    times = t.times[begin] + np.array([float(p["timeSinceReference"][:-1]) for p in points])
    at = np.abs(t.times[:, None] - times).argmin(axis=0)
    turns = geo.exp_so3([[0.0, 0.0, s["pose"]["angle"]] for s in steps])
    places = [[s["pose"]["position"]["x"], s["pose"]["position"]["y"], 0.0] for s in steps]
    found = stacked(turns, np.array(places)) @ arm_of(t.q[at, 3:])
    assert np.abs(found - wanted).max() < 1e-7
    if leg == "approach":
        assert steps[0]["pose"] == {"position": {"x": 0.0, "y": 0.0}, "angle": 0.0}
    if leg == "move":
        assert np.abs(np.diff([s["pose"]["angle"] for s in steps])).max() < 0.5
        assert np.ptp([s["pose"]["angle"] for s in steps]) > 1.0


def test_an_arm_that_stands_leaves_no_files_of_a_base(tmp_path):
    mobile, arm = planned_motions.mobile_base(), planned_motions.door()
    export_trajectory(mobile, ["ros2", "spot"], tmp_path)
    assert (tmp_path / "base_trajectory.yaml").is_file()
    export_trajectory(arm, ["ros2", "spot"], tmp_path)
    names = {p.name for p in tmp_path.rglob("*") if p.is_file()} - {"files.json"}
    assert not [n for n in names if n.startswith(("base", "body"))]
    assert len(names) == 5, "a gripper of two fingers closes where it is"
    assert json.loads((tmp_path / "spot/arm_impedance_3_move.json").read_text())["rootFrameName"] == "body"


def test_what_closes_is_said_to_close(source, folder):
    verb = "close" if source.trajectory.goal < source.trajectory.start else "open"
    for name in ("joint", "gripper", "base", "cartesian"):
        first = (folder / f"{name}_trajectory.yaml").read_text(encoding="utf-8").splitlines()[0]
        assert first.endswith(f": spot {verb}s door of furniture")
    pa = pytest.importorskip("pyarrow.parquet")
    import io

    tasks = pa.read_table(io.BytesIO(FORMATS["lerobot"].render(source)["lerobot/meta/tasks.parquet"]))
    assert tasks.to_pydict()["task"] == [f"{verb} door"]

"""Every format is read back by a parser that is not ours, and holds what the trajectory holds."""

from __future__ import annotations

import csv
import errno
import hashlib
import json
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.scenes import furniture
from robots.formats import FORMATS, PlannedMotion, export_trajectory, native
from robots.formats.moveit import velocities
from robots.formats.trajectory_export import smooth_quaternions_wxyz, yaml_bytes
from tests.makers.robots import planned_motions
from tests.makers.robots.messages import ROS, faults
from tests.makers.robots.planned_motions import contents, stacked
from twin import geometry as geo
from twin.cli import main as cli
from twin.errors import InputError
from twin.storage import save

LIGHT = [f for f in FORMATS if f != "lerobot"]


@pytest.fixture(scope="module")
def source():
    return planned_motions.door()


@pytest.fixture(scope="module")
def folder(source, tmp_path_factory):
    out = tmp_path_factory.mktemp("handed")
    export_trajectory(source, LIGHT, out)
    return out


def seconds(points):
    return np.array([p["time_from_start"]["sec"] + p["time_from_start"]["nanosec"] * 1e-9 for p in points])


def test_the_tables_of_messages_can_tell_a_wrong_one():
    good = {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "base"},
        "joint_names": ["a"],
        "points": [
            {"positions": [1.0], "velocities": [], "accelerations": [], "effort": [], "time_from_start": {"sec": 0, "nanosec": 1}}
        ],
    }  # fmt: skip
    assert faults(good, "JointTrajectory", ROS) == []
    wrong = []
    for change in (
        lambda m: m.pop("joint_names"),
        lambda m: m["points"][0].pop("effort"),
        lambda m: m["points"][0].update(positions=[1]),
        lambda m: m["points"][0].update(positions=["1e-05"]),
        lambda m: m["points"][0]["time_from_start"].update(nanosec=-1),
        lambda m: m["header"].update(seq=0),
    ):
        message = deepcopy(good)
        change(message)
        wrong.append(faults(message, "JointTrajectory", ROS))
    assert all(len(found) == 1 for found in wrong)


def test_numbers_stay_numbers_in_yaml_1_1(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_bytes(yaml_bytes({"small": [1e-5, -1e-12, 0.1], "text": "no", "points": [{"a": 1.0}]}, ["x"]))
    assert planned_motions.read_yaml(path) == {
        "small": [1e-5, 0.0, 0.1],
        "text": "no",
        "points": [{"a": 1.0}],
    }


def test_quaternions_of_a_whole_turn_do_not_jump():
    turns = np.linspace(0, 2 * np.pi, 100)
    rotations = geo.exp_so3(turns[:, None] * np.array([0, 0.6, 0.8]))
    q = smooth_quaternions_wxyz(rotations)
    assert np.abs(np.diff(q, axis=0)).max() < 0.04
    assert np.allclose(q[:, 0], np.cos(turns / 2))
    assert np.abs(Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix() - rotations).max() < 1e-12


def test_csv_reads_back_the_same_numbers(source, folder):
    t = source.trajectory
    with (folder / "trajectory.csv").open(newline="", encoding="utf-8") as f:
        rows = list(csv.DictReader(f))
    assert len(rows) == len(t.times)
    assert tuple(r["phase"] for r in rows) == t.phases
    read = {key: np.array([float(r[key]) for r in rows]) for key in rows[0] if key != "phase"}
    assert np.array_equal(read["time_s"], t.times)
    for k, joint in enumerate(t.joint_names):
        assert np.array_equal(read[f"{joint}_rad"], t.q[:, k])
        assert np.array_equal(read[f"{joint}_rad_per_s"], t.qd[:, k])
    assert np.array_equal(read["gripper_m"], t.gripper)
    assert np.array_equal(read["part_state_rad"], t.part_state)
    place = np.column_stack([read[f"world_tool_{a}_m"] for a in "xyz"])
    turn = Rotation.from_quat(np.column_stack([read[f"world_tool_q{a}"] for a in "xyzw"])).as_matrix()
    assert np.array_equal(place, t.T_world_tool[:, :3, 3])
    assert np.abs(turn - t.T_world_tool[:, :3, :3]).max() < 1e-12


def test_the_unit_of_a_drawer_is_the_metre(source):
    drawer = replace(furniture.drawer().part(2), name=source.part.name)
    header = (
        FORMATS["csv"]
        .render(PlannedMotion(source.trajectory, drawer, source.robot))["trajectory.csv"]
        .split(b"\r")[0]
    )
    assert b"part_state_m," in header
    assert b"part_state_rad" not in header


def test_ros2_files_are_the_messages_field_by_field(source, folder):
    t = source.trajectory
    for name in ("joint_trajectory.yaml", "gripper_trajectory.yaml"):
        message = planned_motions.read_yaml(folder / name)
        assert faults(message, "JointTrajectory", ROS) == []
        times = seconds(message["points"])
        assert np.all(np.diff(times) > 0)
        assert np.abs(times - t.times).max() <= 0.5e-9 + 1e-12
        assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": source.robot.base_body}
        assert {len(p["positions"]) for p in message["points"]} == {len(message["joint_names"])}
    assert message["joint_names"] == list(source.robot.gripper_joints)
    assert np.abs(np.sum([p["positions"] for p in message["points"]], axis=1) - t.gripper).max() < 2e-9


def test_a_joint_controller_would_take_the_arm(source, folder):
    """What ros2_controllers' joint_trajectory_controller refuses: uneven lengths, times that don't grow, an
    end in motion."""
    t, message = source.trajectory, planned_motions.read_yaml(folder / "joint_trajectory.yaml")
    q = np.array([p["positions"] for p in message["points"]])
    qd = np.array([p["velocities"] for p in message["points"]])
    assert tuple(message["joint_names"]) == t.joint_names
    assert np.abs(q - t.q).max() <= 1e-9
    assert np.abs(qd - t.qd).max() <= 1e-9
    assert np.all((q >= t.limits[0]) & (q <= t.limits[1]))
    assert np.all(np.abs(qd) <= t.velocity_limits)
    assert np.all(qd[-1] == 0)
    assert seconds(message["points"])[0] == 0


def test_moveit_poses_lead_back_to_the_world(source, folder):
    t, message = source.trajectory, planned_motions.read_yaml(folder / "cartesian_trajectory.yaml")
    assert faults(message, "CartesianTrajectory", ROS) == []
    assert message["tracked_frame"] == source.robot.tool
    assert message["header"]["frame_id"] == source.robot.base_body
    points = message["points"]
    assert np.all(np.diff(seconds(points)) > 0)
    poses = [p["point"]["pose"] for p in points]
    q = np.array([[p["orientation"][a] for a in "xyzw"] for p in poses])
    place = np.array([[p["position"][a] for a in "xyz"] for p in poses])
    world = t.T_world_base @ stacked(Rotation.from_quat(q).as_matrix(), place)
    assert np.abs(world - t.T_world_tool).max() < 1e-8
    assert np.sum(q[1:] * q[:-1], axis=1).min() > 0.99  # no jump of sign


def test_moveit_velocities_are_those_of_a_door(source, folder):
    t, joint = source.trajectory, source.part.joint
    points = [p["point"] for p in planned_motions.read_yaml(folder / "cartesian_trajectory.yaml")["points"]]
    move = np.flatnonzero(np.array(t.phases) == "move")[2:-2]
    rate = np.gradient(t.part_state, t.times)[move]
    turn = np.array([[points[k]["velocity"]["angular"][a] for a in "xyz"] for k in move])
    speed = np.array([[points[k]["velocity"]["linear"][a] for a in "xyz"] for k in move])
    to_base = t.T_world_base[:3, :3].T
    assert np.abs(turn - (rate[:, None] * joint.axis) @ to_base.T).max() < 1e-3
    radius = t.T_world_tool[move, :3, 3] - joint.pivot
    assert np.abs(speed - np.cross(rate[:, None] * joint.axis, radius) @ to_base.T).max() < 1e-3
    assert np.abs(turn).max() > 0.5
    last = points[-1]["velocity"]
    assert set(last["linear"].values()) | set(last["angular"].values()) == {0.0}


def test_velocities_are_exact_up_to_even_acceleration_on_uneven_steps():
    t = np.cumsum([0, 0.02, 0.013, 0.02, 0.005, 0.04])
    axis, line = np.array([0.6, 0, 0.8]), np.array([0.1, -0.2, 0.3])
    for way, rate, inside in ((t, np.ones(6), slice(None)), (t**2, 2 * t, slice(1, -1))):
        poses = stacked(geo.exp_so3(0.7 * way[:, None] * axis), way[:, None] * line)
        linear, angular = velocities(t, poses)
        assert np.abs(linear - rate[:, None] * line)[inside].max() < 1e-12
        assert np.abs(angular - 0.7 * rate[:, None] * axis)[inside].max() < 1e-12


def test_native_files_come_back(source, folder):
    again = native.load(folder / "trajectory.json")
    assert np.abs(again.q - source.trajectory.q).max() <= 1e-9
    with np.load(folder / "trajectory.npz", allow_pickle=False) as arrays:
        assert np.array_equal(arrays["T_world_tool"], source.trajectory.T_world_tool)


def test_equal_input_gives_equal_bytes_and_no_leftovers(source, folder, tmp_path):
    export_trajectory(source, LIGHT, tmp_path)
    export_trajectory(source, LIGHT, tmp_path)
    assert contents(tmp_path) == contents(folder)
    absent = "base_trajectory.yaml", "_2_close.json", "_4_open.json"  # of a claw, and of a mobile base
    expected = {f for name in LIGHT for f in FORMATS[name].files if not f.endswith(absent)}
    expected = {f for f in expected if not f.startswith("spot/body_")}
    assert set(contents(tmp_path)) == expected | {"files.json"}


def test_bad_output_is_told_and_changes_nothing(source, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="can't be written"):
        export_trajectory(source, ["csv"], tmp_path / "file" / "out")
    with pytest.raises(InputError, match="did you mean 'moveit'"):
        export_trajectory(source, ["csv", "movit"], tmp_path / "out")
    assert not (tmp_path / "out").exists()
    (tmp_path / "out/spot").mkdir(parents=True)
    (tmp_path / "out/spot/notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"notes\.txt is not of a spot"):
        export_trajectory(source, ["csv", "spot"], tmp_path / "out")
    (tmp_path / "blocked/trajectory.csv").mkdir(parents=True)
    with pytest.raises(InputError, match="is a folder"):
        export_trajectory(source, ["json", "csv"], tmp_path / "blocked")
    assert contents(tmp_path) == {"file": b"", "out/spot/notes.txt": b"mine"}


def test_a_full_disk_leaves_the_earlier_files(source, tmp_path, monkeypatch):
    export_trajectory(source, ["csv", "ros2"], tmp_path)
    before, write = contents(tmp_path), Path.write_bytes

    def full(path, data):
        if path.name == "joint_trajectory.yaml":
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    short = replace(source.trajectory, part_state=source.trajectory.part_state * 0.5)
    with pytest.raises(InputError, match="No space left"):
        export_trajectory(PlannedMotion(short, source.part, source.robot), ["csv", "ros2"], tmp_path)
    assert contents(tmp_path) == before


def test_what_does_not_belong_together_is_refused(source):
    with pytest.raises(InputError, match="not 'part'"):
        PlannedMotion(source.trajectory, furniture.drawer().part(2), source.robot)
    with pytest.raises(InputError, match="has"):
        PlannedMotion(replace(source.trajectory, joint_names=tuple("abcdefg")), source.part, source.robot)


def test_the_command_hands_over_what_the_replay_left(source, tmp_path, capsys):
    run, out = tmp_path / "run", tmp_path / "out"
    save(furniture.door("left"), run / "twin")
    order = ["trajectory", str(run), "--format", "csv", "ros2", "-o", str(out)]
    assert cli.run(order) == 1
    assert "no trajectory of franka for door yet; run `twin replay" in capsys.readouterr().err
    native.save(source.trajectory, run / "replay/franka/door")
    for wrong, hint in (
        (["--robot", "frnka"], "did you mean 'franka'"),
        (["--part", "dor"], "door"),
        (["--format", "ross2"], "did you mean 'ros2'"),
    ):
        assert cli.run([*order, *wrong]) == 1
        told = capsys.readouterr().err
        assert hint in told
        assert told.count("\n") == 1
    assert not out.exists()
    assert cli.run([*order, "--part", "door"]) == 0
    assert sorted(contents(out)) == [
        "files.json",
        "gripper_trajectory.yaml",
        "joint_trajectory.yaml",
        "trajectory.csv",
    ]
    assert cli.run(order) == 0
    assert (out / "door/trajectory.csv").read_bytes() == (out / "trajectory.csv").read_bytes()
    capsys.readouterr()
    assert cli.run([*order, "--goal", "close"]) == 1
    assert "twin replay" in (told := capsys.readouterr().err)
    assert told.endswith("--part door --goal close`\n")
    native.save(planned_motions.closing(source).trajectory, run / "replay/franka/door_close")
    assert cli.run([*order, "--part", "door", "--goal", "close"]) == 0
    assert b"franka closes door" in (out / "joint_trajectory.yaml").read_bytes()


def test_a_file_that_no_call_wrote_is_not_replaced_by_a_trajectory(source, tmp_path):
    (tmp_path / "trajectory.csv").write_text("mine")
    with pytest.raises(InputError, match=r"trajectory\.csv is not a file that was exported"):
        export_trajectory(source, ["json", "csv"], tmp_path)
    assert contents(tmp_path) == {"trajectory.csv": b"mine"}
    export_trajectory(source, ["ros2"], tmp_path)  # another format is not in the way
    export_trajectory(source, ["json"], tmp_path)
    assert contents(tmp_path)["trajectory.csv"] == b"mine"
    export_trajectory(source, ["json", "csv"], tmp_path, overwrite=True)
    assert contents(tmp_path)["trajectory.csv"] != b"mine"
    (tmp_path / "joint_trajectory.yaml").write_text("edited")
    export_trajectory(source, ["json", "csv"], tmp_path)
    with pytest.raises(InputError, match=r"joint_trajectory\.yaml was changed since"):
        export_trajectory(source, ["ros2"], tmp_path)
    assert contents(tmp_path)["joint_trajectory.yaml"] == b"edited"


def test_what_a_trajectory_does_not_need_any_more_goes(source, tmp_path):
    export_trajectory(source, ["ros2", "csv"], tmp_path)
    listed = json.loads((tmp_path / "files.json").read_text())
    stale = b"base: gone"
    (tmp_path / "base_trajectory.yaml").write_bytes(stale)
    listed["files"]["base_trajectory.yaml"] = hashlib.sha256(stale).hexdigest()
    (tmp_path / "files.json").write_text(json.dumps(listed))
    export_trajectory(source, ["ros2"], tmp_path)
    assert set(contents(tmp_path)) == {
        "trajectory.csv", "joint_trajectory.yaml", "gripper_trajectory.yaml", "files.json"
    }  # fmt: skip

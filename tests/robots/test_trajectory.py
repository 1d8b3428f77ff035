"""Laws of a trajectory, of its timing and of its file."""

from __future__ import annotations

import errno
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robots.config import PlanConfig
from robots.formats import native
from robots.model.catalog import resolve
from robots.planning.timing import ACCELERATION_SHARE, VELOCITY_SHARE, Leg, quintic, timed
from robots.trajectory import RejectedBase, RobotTrajectory
from tests.makers.robots.planned_motions import contents
from twin import geometry as geo
from twin.errors import ConfigError, InputError, PlanningError


def leg(start, end, n=9, length=0.3):
    q = np.linspace(start, end, n)
    tool = np.tile(np.eye(4), (n, 1, 1))
    tool[:, 0, 3] = np.linspace(0, length, n)
    return Leg(q, np.linspace(0, 1, n), np.zeros(n), tool)


@pytest.fixture(scope="module")
def franka():
    return resolve("franka")


@pytest.fixture(scope="module")
def trajectory(franka):
    home = franka.home
    moved = home + np.array([0.6, 0.3, -0.2, 0.4, 0.1, 0.2, -0.5])
    s = timed(leg(home - 0.1, home), leg(home, moved), leg(moved, moved - 0.1), franka, PlanConfig())
    return RobotTrajectory(
        "franka", "twin", 2, "door", franka.arm_joints, s.times, s.q, s.qd, s.gripper, s.phases, s.part_state,
        s.T_world_tool, s.position_error, geo.make_pose(translation=[1, 2, 0.5]), 0.5,
        np.stack([franka.home - 2, franka.home + 2]), franka.velocity, 1.0, "bar", 1.5, 0.02,
        (RejectedBase((0.0, 1.0, 2.0), 0.3, 0.4, -1.0, "out of reach at state 0.50: 31 mm short, 2 deg off"),),
    )  # fmt: skip


def test_quintic_rests_at_both_ends_and_goes_from_0_to_1():
    t, s, rate = quintic(2.0, 0.001)
    assert s[0] == 0
    assert s[-1] == pytest.approx(1)
    assert rate[0] == 0
    assert abs(rate[-1]) < 1e-9
    assert rate.max() == pytest.approx(1.875 / 2.0, rel=1e-5)
    assert np.abs(np.gradient(s, t)[1:-1] - rate[1:-1]).max() < 1e-4
    assert np.abs(np.gradient(rate, t)).max() == pytest.approx(5.774 / 4.0, rel=1e-2)


def test_timing_keeps_speed_velocity_and_acceleration(franka, trajectory):
    config = PlanConfig()
    assert np.all(np.abs(trajectory.qd) <= VELOCITY_SHARE * franka.velocity + 1e-9)
    acceleration = np.gradient(trajectory.qd, trajectory.times, axis=0)
    assert np.all(np.abs(acceleration) <= ACCELERATION_SHARE * franka.acceleration * 1.02)
    step = np.linalg.norm(np.diff(trajectory.T_world_tool[:, :3, 3], axis=0), axis=1)
    same = np.array(trajectory.phases[1:]) == np.array(trajectory.phases[:-1])
    speed = step[same] / np.diff(trajectory.times)[same]
    assert speed.max() <= config.tool_speed * 1.01


def test_velocities_are_the_derivative_of_positions(trajectory):
    t = np.linspace(0, trajectory.duration, 4000)
    q, qd, _ = trajectory.at(t)
    assert np.abs(np.gradient(q, t, axis=0)[2:-2] - qd[2:-2]).max() < 0.01
    on, qd_on, _ = trajectory.at(trajectory.times)
    assert np.abs(on - trajectory.q).max() < 1e-9
    assert np.abs(qd_on - trajectory.qd).max() < 1e-9


def test_the_ends_are_held(trajectory):
    q, qd, gripper = trajectory.at(np.array([-1.0, trajectory.duration + 5]))
    assert np.allclose(q, trajectory.q[[0, -1]])
    assert np.all(qd == 0)
    assert gripper[0] == pytest.approx(0.08)


def test_phases_come_in_order_and_the_hand_is_closed_while_it_moves_the_part(trajectory):
    order = list(dict.fromkeys(trajectory.phases))
    assert order == ["approach", "close", "move", "hold", "open", "retreat"]
    moving = np.array([p in ("move", "hold") for p in trajectory.phases])
    assert np.all(trajectory.gripper[moving] == 0)


def test_without_release_the_hand_keeps_holding(franka):
    home = franka.home
    piece = leg(home, home + 0.2)
    s = timed(piece.reversed(), piece, None, franka, PlanConfig())
    assert s.phases[-1] == "hold"
    assert s.gripper[-1] == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q": lambda t: t.q + 9}, "leaves its limits"),
        ({"qd": lambda t: t.qd * 9}, "velocity limit"),
        ({"times": lambda t: t.times[::-1]}, "strictly increase"),
        ({"gripper": lambda t: t.gripper[:-1]}, "shape"),
        ({"phases": lambda t: ("dance",) * len(t.times)}, "dance"),
        ({"part_state": lambda t: t.part_state * np.nan}, "finite"),
    ],
)
def test_a_trajectory_checks_itself(trajectory, change, message):
    ((key, wrong),) = change.items()
    with pytest.raises(PlanningError, match=message):
        replace(trajectory, **{key: wrong(trajectory)})


def test_files_give_the_trajectory_back(trajectory, tmp_path: Path):
    json_path, npz_path = native.save(trajectory, tmp_path / "replay")
    again = native.load(json_path)
    for key in ("times", "q", "qd", "gripper", "part_state", "T_world_tool", "T_world_base", "limits"):
        assert np.allclose(getattr(again, key), getattr(trajectory, key), atol=1e-8)
    for key in ("robot", "part", "part_id", "phases", "joint_names", "grasp", "rejected", "goal", "pedestal"):
        assert getattr(again, key) == getattr(trajectory, key)
    with np.load(npz_path, allow_pickle=False) as arrays:
        assert np.array_equal(arrays["q"], trajectory.q)
        assert tuple(arrays["phases"]) == trajectory.phases


def test_bad_files_say_what_is_wrong(trajectory, tmp_path: Path):
    with pytest.raises(InputError, match="can't be read"):
        native.load(tmp_path / "missing.json")
    path, _ = native.save(trajectory, tmp_path)
    document = json.loads(path.read_text())
    for change, message in (
        ({"format": "other/1"}, "not of format"),
        ({"q": None}, "lacks q"),
        ({"phases": document["phases"][:-1]}, "valid trajectory"),
    ):
        path.write_text(json.dumps({**document, **change}))
        with pytest.raises(InputError, match=message):
            native.load(path)
    path.write_text("{")
    with pytest.raises(InputError, match="not JSON"):
        native.load(path)


def test_an_unwritable_folder_is_named(trajectory, tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="can't be written"):
        native.save(trajectory, tmp_path / "file" / "replay")


def test_a_full_disk_leaves_the_earlier_files(trajectory, tmp_path: Path, monkeypatch):
    native.save(trajectory, tmp_path)
    before, write = contents(tmp_path), Path.write_bytes

    def full(path, data):
        if "npz" in path.name:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match="No space left"):
        native.save(replace(trajectory, grasp="another"), tmp_path)
    assert contents(tmp_path) == before


def test_settings_are_checked():
    with pytest.raises(ConfigError, match="pedestal"):
        PlanConfig(pedestal=(2.0, 1.0))
    with pytest.raises(ConfigError, match="torque_share"):
        PlanConfig(torque_share=1.5)

"""Where the film is seen from: everything that matters is in the picture, and the axis is drawn where the
joint has it."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig
from robots.film.video import _draw_axis, axis_arrow, draw
from robots.film.viewpoint import View, choose_view, fit
from robots.scene.world import PEDESTAL, ROBOT, World, build_world
from robots.simulation.replay import simulate
from tests.robots.planning.test_replay import can_draw
from twin.geometry import Array

FAST = PlanConfig(candidates=150, finalists=2)


def plane(view: View, points: Array) -> tuple[Array, Array]:
    """Tangents (n, 2) to the right and downwards, and depths (n,), worked out from the angles' definition."""
    a, e = view.azimuth, view.elevation
    forward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    offsets = points - view.eye
    depth = offsets @ forward
    return np.stack([offsets @ right, offsets @ down], axis=1) / depth[:, None], depth


@pytest.mark.parametrize("seed", range(6))
def test_the_nearest_eye_that_sees_all_points_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(40, 3)) * rng.uniform(0.2, 2, 3)
    wide, high = rng.uniform(0.3, 0.8, 2)
    view = fit(points, rng.uniform(-3, 3), rng.uniform(-1.2, 0.2), wide, high)
    share, depth = plane(view, points)
    share = np.abs(share / [wide, high]).max(axis=0)
    assert depth.min() > 0
    assert share.max() == pytest.approx(0.94, abs=1e-9), "one axis is used in full"
    assert share.min() <= 0.94 + 1e-9
    for aside in np.linspace(-0.5, 0.5, 11):  # nearer, none sees all
        nearer = View(
            view.eye
            + 0.02 * view.forward
            + aside * np.array([np.sin(view.azimuth), -np.cos(view.azimuth), 0]),
            view.azimuth,
            view.elevation,
            view.distance,
        )
        assert np.abs(plane(nearer, points)[0] / [wide, high]).max() > 0.94


@pytest.fixture(scope="module", params=["drawer", "door"])
def played(request: pytest.FixtureRequest):
    twin = getattr(furniture, request.param)()
    trajectory = robots.plan(twin, 2, config=FAST)
    world = build_world(
        twin, robots.resolve("franka"), trajectory.T_world_base, trajectory.pedestal, visual=True
    )
    _, frames = simulate(world, trajectory, robots.ReplayConfig(video_frames=8))
    return twin.parts[0], trajectory, world, frames


def middles(world: World, part: int, frames: Array) -> Array:
    """Middles (n, 3) of all shapes of robot and part at all moments, the column under the robot left out."""
    model, data = world.model, mujoco.MjData(world.model)
    shown = [
        g
        for g in range(model.ngeom)
        if (world.owner[g] == ROBOT or world.geom_part[g] == part) and model.geom(g).name != PEDESTAL
    ]
    points = []
    for qpos in frames:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        points.append(data.geom_xpos[shown])
    return np.concatenate(points)


@pytest.mark.parametrize("size", [(640, 480), (201, 401)])
def test_robot_part_and_axis_are_in_the_picture(played, size: tuple[int, int]) -> None:
    part, trajectory, world, frames = played
    arrow = np.array(axis_arrow(part))
    view = choose_view(world, trajectory, frames, size, arrow)
    points = np.vstack([arrow, middles(world, part.id, frames), trajectory.T_world_tool[:, :3, 3]])
    share, depth = plane(view, points)
    slope = np.tan(np.deg2rad(world.model.vis.global_.fovy) / 2)
    assert depth.min() > 0
    assert np.abs(share[:, 0]).max() <= slope * size[0] / size[1]
    assert np.abs(share[:, 1]).max() <= slope
    assert np.abs(share / [slope * size[0] / size[1], slope]).max() > 0.5, "and not far off"


def test_the_front_is_seen_and_a_motion_does_not_come_straight_at_the_eye(played) -> None:
    part, trajectory, world, frames = played
    view = choose_view(world, trajectory, frames, (640, 480), np.array(axis_arrow(part)))
    front = -trajectory.T_world_tool[0, :3, 2]
    assert -view.forward @ front > np.cos(np.deg2rad(67)), "not edge-on"
    if part.joint.kind == "prismatic":
        assert abs(view.forward @ part.joint.axis) < np.cos(np.deg2rad(45))


@pytest.mark.skipif(not can_draw(), reason="no OpenGL without a screen on this machine")
def test_the_axis_is_drawn_from_end_to_end_whatever_hides_it(played) -> None:
    part, trajectory, world, frames = played
    size = (400, 300)
    image = draw(world, trajectory, part, frames[:1], size)[0].astype(int)
    arrow = np.array(axis_arrow(part))
    view = choose_view(world, trajectory, frames[:1], size, arrow)
    share, _ = plane(view, arrow)
    ends = share * (size[1] / 2) / np.tan(np.deg2rad(world.model.vis.global_.fovy) / 2) + np.array(size) / 2
    red = np.argwhere((image[..., 0] > 130) & (image[..., 0] > image[..., 1:].max(axis=2) + 70))[:, ::-1]
    assert len(red) > 20
    way = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    along, aside = (red - ends[0]) @ way, (red - ends[0]) @ [-way[1], way[0]]
    length = np.linalg.norm(ends[1] - ends[0])
    assert along.min() == pytest.approx(0, abs=4)
    assert along.max() == pytest.approx(length, abs=4)
    assert np.abs(aside).max() < 7
    assert np.diff(np.sort(along)).max() < 0.12 * length, "dashes leave no wide gap"


@pytest.mark.skipif(not can_draw(), reason="no OpenGL without a screen on this machine")
def test_the_arrow_is_as_long_as_the_axis() -> None:
    renderer = mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 240, 640)
    view = View(np.array([0.5, -1.5, 0]), np.pi / 2, 0.0, 1.5)
    renderer.update_scene(mujoco.MjData(renderer.model), view.camera())
    _draw_axis(renderer.scene, (np.zeros(3), np.array([1.0, 0, 0])), 0.06)
    across = np.flatnonzero((renderer.render()[..., 0] > 100).any(axis=0))
    renderer.close()
    at = (across[[0, -1]] - 320) * 1.5 * np.tan(np.deg2rad(22.5)) / 120 + 0.5
    assert at == pytest.approx([0.0, 1.0], abs=0.03)

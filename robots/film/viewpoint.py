"""Where the film is seen from: robot and part whole in the picture, the hand least hidden."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.scene.world import PEDESTAL, ROBOT, STATIC, World
from robots.trajectory import RobotTrajectory
from twin.geometry import Array

# points on the fingers and on the handle to both sides of them, in tool axes (m)
_GRIP = np.array(
    [[0, 0.03, 0], [0, -0.03, 0], [0.05, 0, 0], [-0.05, 0, 0], [0, 0.02, -0.03], [0, -0.02, -0.03]]
)
_TURNS = tuple(range(-150, 151, 15))  # degrees off the robot's back
_LIFTS = (5, 15, 25, 35, 50, 65)  # degrees above the horizon
_POSES = 7  # moments of the replay that are looked at, first and last among them
_RIM = 0.94  # share of the picture that is used
_SOLID = np.array([0, 0, 0, 1, 0, 1], dtype=np.uint8)  # what hides: the robot and collision shapes
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class View:
    """A camera: `eye` (3,) m in the world, azimuth and elevation (rad) of its direction in MuJoCo's terms."""

    eye: Array
    azimuth: float
    elevation: float
    distance: float

    @property
    def forward(self) -> Array:
        """Unit direction (3,) in which it looks."""
        return direction(self.azimuth, self.elevation)

    def camera(self) -> mujoco.MjvCamera:
        """As MuJoCo takes it."""
        camera = mujoco.MjvCamera()
        camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        camera.lookat[:] = self.eye + self.distance * self.forward
        camera.distance = self.distance
        camera.azimuth, camera.elevation = np.rad2deg([self.azimuth, self.elevation])
        return camera


def direction(azimuth: float, elevation: float) -> Array:
    """Unit vector (3,)."""
    return np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )


def choose_view(
    world: World, trajectory: RobotTrajectory, frames: Array, size: tuple[int, int], also: Array
) -> View:
    """The view for joint positions `frames` (f, nq) in a picture of this size.

    Each candidate direction gets the nearest eye from which robot, part and the points `also` (n, 3) are in
    the picture. Of these the one from which the fingers and what they hold are least hidden wins; a view at
    the part's front, across the part's way, from near and from a little above is preferred.
    """
    picked = np.unique(np.linspace(0, len(frames) - 1, _POSES).astype(int))
    moments = [_look(world, trajectory.part_id, q) for q in frames[picked]]
    seen = np.vstack([also, *(m.outline for m in moments)])
    hand = np.mean([m.hand for m in moments], axis=0)
    body = np.mean([m.body for m in moments], axis=0)
    facing = float(np.arctan2(*(hand - body)[1::-1]))
    outward = -trajectory.T_world_tool[0, :3, 2]  # the part's front is worth seeing
    moving = np.array([p == "move" for p in trajectory.phases])
    way = np.diff(trajectory.T_world_tool[moving, :3, 3][[0, -1]], axis=0)[0]
    way = way / max(float(np.linalg.norm(way)), 1e-9)
    reach = float(np.linalg.norm(np.ptp(seen, axis=0)))
    slope = np.tan(np.deg2rad(world.model.vis.global_.fovy) / 2)
    best, best_score = None, -np.inf
    for turn in np.deg2rad(_TURNS):
        for lift in np.deg2rad(_LIFTS):
            view = fit(seen, facing + turn, -lift, slope * size[0] / size[1], slope)
            forward = view.forward
            score = _visible(world, moments, view.eye)
            facing_front = float(-forward @ outward)
            score += 1.3 * min(facing_front, 0.7)
            score -= 4.0 * max(0.4 - facing_front, 0.0)  # edge-on, neither front nor inside are seen
            # a motion towards the eye is hard to see
            score -= 3.0 * max(abs(float(forward @ way)) - 0.5, 0.0)
            score -= 0.15 * abs(abs(turn) - 0.9) + 2.0 * abs(lift - 0.35)
            score -= 0.3 * view.distance / reach
            if score > best_score + 1e-9:
                best, best_score = view, score
    assert best is not None
    return best


def fit(points: Array, azimuth: float, elevation: float, wide: float, high: float) -> View:
    """The nearest eye that looks in this direction and has all points (n, 3) in the picture.

    wide, high: tangents of half the angles of view. `distance` of the result is that to the points' middle.
    """
    forward = direction(azimuth, elevation)
    right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
    up = np.cross(right, forward)
    depth = points @ forward
    aside, back = zip(
        *(_edge(points @ a, depth, s * _RIM) for a, s in ((right, wide), (up, high))), strict=True
    )
    nearest = min(*back, float(depth.min()) - 0.1)
    eye = aside[0] * right + aside[1] * up + nearest * forward
    return View(eye, azimuth, elevation, float(depth.mean()) - nearest)


def _edge(across: Array, depth: Array, slope: float) -> tuple[float, float]:
    """Where across and how far along the eye is, on one axis, for |across - x| <= slope (depth - z)."""
    one, other = float((across - slope * depth).max()), float((-across - slope * depth).max())
    return (one - other) / 2, -(one + other) / (2 * slope)


@dataclass(frozen=True, eq=False)
class _Moment:
    """One moment: hand, robot's middle (3,), points of the grip (g, 3), corners of robot and part (n, 3)."""

    data: mujoco.MjData
    hand: Array
    body: Array
    grip: Array
    outline: Array


def _look(world: World, part: int, qpos: Array) -> _Moment:
    model, data = world.model, mujoco.MjData(world.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    pedestal = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, PEDESTAL)
    robot = (world.owner == ROBOT) & (np.arange(model.ngeom) != pedestal)
    shown = np.flatnonzero(robot | (world.geom_part == part))
    axes = data.geom_xmat[shown].reshape(-1, 3, 3)
    boxes = model.geom_aabb[shown, None, :3] + _CORNERS * model.geom_aabb[shown, None, 3:]
    corners = data.geom_xpos[shown, None] + np.einsum("nij,nkj->nki", axes, boxes)
    tool = data.site_xpos[world.tool].copy()
    grip = tool + _GRIP @ data.site_xmat[world.tool].reshape(3, 3).T
    middle = corners[robot[shown]].mean(axis=(0, 1))
    return _Moment(data, tool, middle, grip, corners.reshape(-1, 3))


def _visible(world: World, moments: list[_Moment], eye: Array) -> float:
    """How much of the grip is seen from the eye, 0..3, and whether walls hide the robot, 0..0.5.

    By the root of the share that is seen: a hand hides half of what it holds from wherever the motion is seen
    well. The worst moment weighs half as much as all.
    """
    hit: NDArray[np.int32] = np.array([-1], dtype=np.int32)

    def gap(data: mujoco.MjData, target: Array) -> float:
        """Distance in metres between the target and the first thing that the ray to it meets."""
        ray = target - eye
        share = mujoco.mj_ray(world.model, data, eye, ray, _SOLID, 1, -1, hit)
        return 0.0 if share < 0 or share > 1 else float((1 - share) * np.linalg.norm(ray))

    seen, free = [], []
    for m in moments:
        seen.append(float(np.sqrt(np.mean([gap(m.data, g) < 0.035 for g in m.grip]))))
        hidden = gap(m.data, m.body) > 0.1 and hit[0] >= 0 and world.owner[hit[0]] == STATIC
        free.append(0.0 if hidden else 0.5)
    return 2.0 * float(np.mean(seen)) + 1.0 * min(seen) + float(np.mean(free))

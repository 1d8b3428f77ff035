"""Draws a replay with MuJoCo's renderer, without a screen, and writes it as H.264."""

from __future__ import annotations

import logging
import os
import platform
from fractions import Fraction
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.config import ReplayConfig
from robots.demonstration import Demonstration
from robots.film import side_by_side
from robots.trajectory import RobotTrajectory
from robots.world import STATIC, World
from twin.errors import InputError, MissingDependencyError
from twin.geometry import Array
from twin.scene import Part, Revolute

_LOG = logging.getLogger(__name__)
_AXIS_COLOUR = np.array([0.95, 0.25, 0.1, 1.0], dtype=np.float32)
# points on the fingers and on the handle to both sides of them, in tool axes (m)
_GRIP = np.array(
    [[0, 0.03, 0], [0, -0.03, 0], [0.05, 0, 0], [-0.05, 0, 0], [0, 0.02, -0.03], [0, -0.02, -0.03]]
)
_GROUPS = (1, 0, 1, 1, 0, 0)  # 2 visual meshes, 3 the robot; collision shapes of the twin (5) stay hidden


def write_video(
    path: Path,
    world: World,
    trajectory: RobotTrajectory,
    part: Part,
    frames: Array,
    config: ReplayConfig,
    demonstration: Demonstration | None = None,
) -> bool:
    """Draw joint positions `frames` (f, nq), beside what the person did if that is given, and write them to `path`.

    Returns False, after one warning, when no OpenGL is found: the replay itself doesn't need it. A demonstration that
    doesn't fit costs one warning and its half of the film.
    Raises InputError when the file can't be written.
    """
    try:
        images = draw(world, trajectory, part, frames, config.video_size)
    except MissingDependencyError as e:
        _LOG.warning("no video: %s", e)
        return False
    if demonstration is not None:
        try:
            images = side_by_side(
                images, frames[:, world.part_qpos[part.id]], trajectory, part, demonstration
            )
        except (InputError, OSError) as e:
            _LOG.warning("the film of %s shows the robot alone: %s", part.name, e)
    encode(path, images, config.video_rate)
    return True


def draw(
    world: World, trajectory: RobotTrajectory, part: Part, frames: Array, size: tuple[int, int]
) -> list[NDArray[np.uint8]]:
    """Images (height, width, 3) uint8 of the scene with the joint axis drawn in. Raises MissingDependencyError."""
    model = world.model
    _finish_looks(model, size)
    renderer = _renderer(model, size)
    data = mujoco.MjData(model)
    camera = _camera(world, data, trajectory, frames)
    option = mujoco.MjvOption()
    option.geomgroup[:] = _GROUPS
    images = []
    try:
        for qpos in frames:
            data.qpos[:] = qpos
            mujoco.mj_kinematics(model, data)
            mujoco.mj_camlight(model, data)
            renderer.update_scene(data, camera, option)
            _draw_axis(renderer.scene, part)
            images.append(renderer.render().copy())
    finally:
        renderer.close()
    return images


def _finish_looks(model: mujoco.MjModel, size: tuple[int, int]) -> None:
    model.vis.global_.offwidth, model.vis.global_.offheight = size
    model.vis.map.znear, model.vis.map.zfar = 0.005, 50.0
    model.vis.quality.shadowsize = 0


def _renderer(model: mujoco.MjModel, size: tuple[int, int]) -> mujoco.Renderer:
    try:
        _prefer_egl()
        renderer = mujoco.Renderer(model, height=size[1], width=size[0])
    except (
        Exception
    ) as e:  # the drivers raise ImportError, RuntimeError, AttributeError and GL errors of their own
        raise MissingDependencyError(
            f"OpenGL can't be used without a screen ({type(e).__name__}: {e})",
            "install libegl1 and libgl1-mesa-dri, or set MUJOCO_GL; `twin doctor` tells more",
        ) from e
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
    return renderer


def _prefer_egl() -> None:
    """Without a screen, and where nothing else was asked for, draw through EGL.

    MuJoCo reads MUJOCO_GL once, when it is first imported; whoever sets it later, our command line included, is not heard.
    """
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if platform.system() == "Linux" and (asked == "egl" or not (asked or os.environ.get("DISPLAY"))):
        from mujoco.egl import GLContext
        from mujoco.rendering.classic import gl_context

        gl_context.GLContext = GLContext


def _camera(
    world: World, data: mujoco.MjData, trajectory: RobotTrajectory, frames: Array
) -> mujoco.MjvCamera:
    """A view from the side of the base in which hand, handle and shoulder are least hidden."""
    hand = trajectory.T_world_tool[:: max(len(trajectory.times) // 6, 1), :3, 3]
    shoulder = trajectory.T_world_base[:3, 3] + [0, 0, 0.35]
    look = 0.65 * hand.mean(axis=0) + 0.35 * shoulder
    seen = np.vstack([hand, shoulder[None]])
    distance = max(1.1, 3.0 * float(np.linalg.norm(seen - look, axis=1).max()))
    facing = np.arctan2(*(hand.mean(axis=0) - shoulder)[1::-1])
    outward = -trajectory.T_world_tool[0, :3, 2]  # the part's front is worth seeing
    moving = np.array([p == "move" for p in trajectory.phases])
    way = np.diff(trajectory.T_world_tool[moving, :3, 3][[0, -1]], axis=0)[0]
    way = way / max(float(np.linalg.norm(way)), 1e-9)
    model = world.model
    poses = frames[:: max(len(frames) // 5, 1)]
    best, best_score = (0.0, 0.0), -np.inf
    for turn in np.deg2rad([-50, 50, -35, 35, -70, 70, -90, 90, -20, 20, -115, 115, 140, -140]):
        for lift in np.deg2rad([20, 5, 35, 50, 65]):
            azimuth = facing + turn
            forward = np.array(
                [np.cos(lift) * np.cos(azimuth), np.cos(lift) * np.sin(azimuth), -np.sin(lift)]
            )
            eye = look - distance * forward
            score = _visible(model, data, world, poses, eye, shoulder)
            score += 1.3 * min(float(-forward @ outward), 0.5)
            score -= 2.0 * max(
                abs(float(forward @ way)) - 0.6, 0.0
            )  # a motion towards the eye is hard to see
            score -= 0.15 * abs(abs(turn) - 0.9) + 0.5 * abs(lift - 0.35)
            if score > best_score + 1e-9:
                best, best_score = (azimuth, lift), score
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat[:] = look
    camera.distance = distance
    camera.azimuth, camera.elevation = np.rad2deg(best[0]), -np.rad2deg(best[1])
    return camera


def _visible(
    model: mujoco.MjModel, data: mujoco.MjData, world: World, poses: Array, eye: Array, shoulder: Array
) -> float:
    """How much of the grip is seen from the eye, 0..2, and whether a wall hides the shoulder, 0..0.5."""
    groups = np.array([0, 0, 0, 1, 0, 1], dtype=np.uint8)
    hit = np.array([-1], dtype=np.int32)

    def gap(target: Array) -> float:
        """Distance in metres between the target and the first thing that the ray to it meets."""
        ray = target - eye
        share = mujoco.mj_ray(model, data, eye, ray, groups, 1, -1, hit)
        return 0.0 if share < 0 or share > 1 else float((1 - share) * np.linalg.norm(ray))

    seen = 0.0
    for qpos in poses:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        tool, axes = data.site_xpos[world.tool], data.site_xmat[world.tool].reshape(3, 3)
        grip = [tool + axes @ offset for offset in _GRIP]
        seen += 2.0 * float(np.mean([gap(g) < 0.035 for g in grip]))
        hidden = gap(shoulder) > 0.1 and hit[0] >= 0 and world.owner[hit[0]] == STATIC
        seen += 0.0 if hidden else 0.5
    return seen / len(poses)


def _draw_axis(scene: mujoco.MjvScene, part: Part) -> None:
    """The joint axis as an arrow: through the pivot of a hinge, above a slider at state 0."""
    joint = part.joint
    middle = part.mesh.area_centroid
    if isinstance(joint, Revolute):
        along = (part.mesh.vertices - joint.pivot) @ joint.axis
        start = joint.pivot + joint.axis * (along.min() - 0.08)
        end = joint.pivot + joint.axis * (along.max() + 0.08)
    else:
        front = part.contact.point if part.contact else middle
        start = np.array([front[0], front[1], part.mesh.vertices[:, 2].max() + 0.04])
        end = start + joint.axis * max(joint.upper, 0.1)
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(
        geom, mujoco.mjtGeom.mjGEOM_ARROW, np.zeros(3), np.zeros(3), np.eye(3).ravel(), _AXIS_COLOUR
    )
    mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_ARROW, 0.008, start, end)
    scene.ngeom += 1


def encode(path: Path, images: list[NDArray[np.uint8]], rate: int) -> None:
    """Write images as H.264, yuv420p. Raises InputError when the file can't be written."""
    import av

    height, width = images[0].shape[:2]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with av.open(str(path), "w") as container:
            stream = container.add_stream(
                "libx264", rate=Fraction(rate), options={"crf": "23", "preset": "fast"}
            )
            stream.width, stream.height, stream.pix_fmt = width - width % 2, height - height % 2, "yuv420p"
            for image in images:
                frame = av.VideoFrame.from_ndarray(image[: stream.height, : stream.width], format="rgb24")
                for packet in stream.encode(frame):
                    container.mux(packet)
            for packet in stream.encode():
                container.mux(packet)
    except (OSError, av.FFmpegError) as e:
        raise InputError(f"{path} can't be written: {e}", "choose another output folder") from e

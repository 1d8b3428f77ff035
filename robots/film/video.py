"""Draws a replay with MuJoCo's renderer, without a screen, and writes it as H.264."""

from __future__ import annotations

import logging
import os
import platform
from fractions import Fraction
from pathlib import Path

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.config import SETTLE, ReplayConfig
from robots.demonstration import Demonstration, Image
from robots.film.closeup import inset_size, near, with_insets
from robots.film.side_by_side import alone, pace_text, side_by_side
from robots.film.viewpoint import choose_view
from robots.scene.world import World
from robots.trajectory import RobotTrajectory
from twin.errors import InputError, MissingDependencyError
from twin.geometry import Array
from twin.scene import Part, Revolute

_LOG = logging.getLogger(__name__)
_AXIS_COLOUR = np.array([0.95, 0.25, 0.1, 1.0], dtype=np.float32)
_AXIS_WIDTH = 0.004  # of the distance from which it is seen
_DASHES = 9
# Frames in a second of the film; chosen by us
RATE = 25
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
    """Draw joint positions `frames` (f, nq), beside the person's film if given, and write them to `path`.

    The pace, simulated time over the film's, stands in the picture and in the file's comment.

    Returns False, after one warning, when no OpenGL is found: the replay itself doesn't need it. An unfit
    demonstration costs a warning and its half of the film. Raises OSError when the file can't be written.
    """
    try:
        images = draw(world, trajectory, part, frames, config.video_size)
    except MissingDependencyError as e:
        _LOG.warning("no video: %s", e)
        return False
    states = frames[:, world.part_qpos[part.id]]
    pace = pace_text(trajectory.duration + SETTLE, len(frames), RATE)
    film = None
    if demonstration is not None:
        try:
            film = side_by_side(images, states, trajectory, part, demonstration, pace)
        except (InputError, OSError) as e:
            _LOG.warning("the film of %s shows the robot alone: %s", part.name, e)
    encode(path, film or alone(images, states, trajectory, part, pace), RATE, pace)
    return True


def draw(
    world: World, trajectory: RobotTrajectory, part: Part, frames: Array, size: tuple[int, int]
) -> list[NDArray[np.uint8]]:
    """Images (height, width, 3) uint8 of the scene with the joint axis, and the hand seen close in a corner.

    Raises MissingDependencyError.
    """
    model = world.model
    _finish_looks(model, size)
    renderer, small = _renderer(model, size), _renderer(model, inset_size(size))
    data = mujoco.MjData(model)
    arrow = axis_arrow(part)
    view = choose_view(world, trajectory, frames, size, np.array(arrow))
    camera, width = view.camera(), _AXIS_WIDTH * view.distance
    option = mujoco.MjvOption()
    option.geomgroup[:] = _GROUPS
    images, insets = [], []
    try:
        for qpos in frames:
            data.qpos[:] = qpos
            mujoco.mj_kinematics(model, data)
            mujoco.mj_camlight(model, data)
            renderer.update_scene(data, camera, option)
            _draw_axis(renderer.scene, arrow, width)
            images.append(_with_hidden_axis(renderer.render().copy(), renderer.scene, arrow))
            small.update_scene(data, near(view, data.site_xpos[world.tool]), option)
            insets.append(small.render().copy())
    finally:
        renderer.close()
        small.close()
    return with_insets(images, insets)


def _finish_looks(model: mujoco.MjModel, size: tuple[int, int]) -> None:
    model.vis.global_.offwidth, model.vis.global_.offheight = size
    model.vis.map.znear, model.vis.map.zfar = 0.005, 50.0
    model.vis.quality.shadowsize = 0
    # MuJoCo's default, four samples a pixel, takes 3.6 times as long without a graphics card.
    model.vis.quality.offsamples = 0


def _renderer(model: mujoco.MjModel, size: tuple[int, int]) -> mujoco.Renderer:
    try:
        _prefer_egl()
        renderer = mujoco.Renderer(model, height=size[1], width=size[0])
    except (
        Exception
    ) as e:  # the drivers raise ImportError, RuntimeError, AttributeError and GL errors of their own
        raise MissingDependencyError(
            f"OpenGL can't be used without a screen ({type(e).__name__}: {e})",
            "install Mesa's EGL (on Debian libegl1 and libgl1-mesa-dri), or set MUJOCO_GL; `twin doctor` tells more",
        ) from e
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
    return renderer


def _prefer_egl() -> None:
    """Without a screen, and where nothing else was asked for, draw through EGL.

    MuJoCo reads MUJOCO_GL when it is first imported; a later setting, also our command line's, has no effect.
    """
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if platform.system() == "Linux" and (asked == "egl" or not (asked or os.environ.get("DISPLAY"))):
        from mujoco.egl import GLContext
        from mujoco.rendering.classic import gl_context

        gl_context.GLContext = GLContext


def axis_arrow(part: Part) -> tuple[Array, Array]:
    """Start and end (3,) of the axis as an arrow: through a hinge's pivot, above a slider at state 0."""
    joint = part.joint
    if isinstance(joint, Revolute):
        along = (part.mesh.vertices - joint.pivot) @ joint.axis
        ends = np.array([along.min() - 0.08, along.max() + 0.08])
        start, end = joint.pivot + ends[:, None] * joint.axis
        return start, end
    front = part.contact.point if part.contact else part.mesh.area_centroid
    start = np.array([front[0], front[1], part.mesh.vertices[:, 2].max() + 0.04])
    return start, start + joint.axis * max(joint.upper, 0.1)


def _draw_axis(scene: mujoco.MjvScene, arrow: tuple[Array, Array], width: float) -> None:
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(
        geom, mujoco.mjtGeom.mjGEOM_ARROW, np.zeros(3), np.zeros(3), np.eye(3).ravel(), _AXIS_COLOUR
    )
    mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_ARROW, width, *arrow)
    geom.size[2] *= 2  # MuJoCo 4 draws arrows half as long as it is told
    scene.ngeom += 1


def _with_hidden_axis(image: Image, scene: mujoco.MjvScene, arrow: tuple[Array, Array]) -> Image:
    """Dashes along the axis, also where something hides the arrow: hinges mostly lie inside of boards."""
    height, width = image.shape[:2]
    camera = mujoco.mjv_averageCamera(scene.camera[0], scene.camera[1])
    forward, up = np.array(camera.forward), np.array(camera.up)
    focal = height / 2 * camera.frustum_near / camera.frustum_top
    offsets = np.linspace(*arrow, 2 * _DASHES) - np.array(camera.pos)
    depth = offsets @ forward
    if depth.min() < camera.frustum_near:
        return image
    across = offsets @ np.cross(forward, up) / depth * focal + width / 2
    down = -offsets @ up / depth * focal + height / 2
    ends = np.round(16 * np.stack([across, down], axis=1)).astype(int)
    colour = tuple(int(255 * c) for c in _AXIS_COLOUR[:3])
    for a, b in zip(ends[:-1:2].tolist(), ends[1::2].tolist(), strict=True):
        cv2.line(image, a, b, colour, max(height // 300, 1), cv2.LINE_AA, 4)
    return image


def encode(path: Path, images: list[NDArray[np.uint8]], rate: int, comment: str = "") -> None:
    """Write images as H.264, yuv420p, with a comment. Raises OSError when the file can't be written."""
    import av

    height, width = images[0].shape[:2]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with av.open(str(path), "w") as container:
            container.metadata["comment"] = comment
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
    except av.FFmpegError as e:
        raise OSError(e.errno, e.strerror, str(path)) from e

"""Cameras of ROS bags: lenses, where two cameras stand to each other, RealSense's recorder, and known
poses."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks.layouts import ros as layouts
from benchmarks.layouts.ros import Style
from benchmarks.layouts.ros_realsense import write_realsense
from recon.readers.ros import RosReader
from recon.readers.streams import recording_of
from recon.recording import Intrinsics, Recording
from recon.recording.rig import Rig
from tests.makers.recon import bags
from twin.errors import InputError
from twin.geometry import Array, exp_so3, make_pose

FRAMES = 10
CAMERA = Intrinsics(64, 48, 60.0, 61.0, 31.2, 24.1)
T_COLOR_DEPTH = make_pose(exp_so3([0.02, -0.05, 0.03]), [0.05, 0.004, -0.01])
NORMAL, DISTANCE = np.array([0.3, -0.2, 0.933]) / np.linalg.norm([0.3, -0.2, 0.933]), 1.2


def plane_depth(camera: Intrinsics, T_color_cam: Array) -> Array:
    """Depth (H, W) m of the plane NORMAL . X = DISTANCE (colour camera's axes) as a camera at `T_color_cam`
    sees it."""
    y, x = np.mgrid[0 : camera.height, 0 : camera.width].astype(np.float64)
    rays = camera.backproject(np.stack([x, y], axis=-1), np.ones(x.shape))
    normal = T_color_cam[:3, :3].T @ NORMAL
    return np.asarray((DISTANCE - NORMAL @ T_color_cam[:3, 3]) / (rays @ normal))


def seen(T_color_depth: Array) -> Recording:
    """Colour, and depth of the plane from the depth camera's place."""
    depth = np.repeat(plane_depth(CAMERA, T_color_depth)[None].astype(np.float32), FRAMES, axis=0)
    return Recording.from_arrays(np.full((FRAMES, 48, 64, 3), 77, np.uint8), depth, CAMERA, fps=10)


def streams_rig(path: Path) -> Rig:
    return RosReader().streams(path).rig


def plane_error(path: Path) -> tuple[float, float]:
    """Greatest distance (m) of the registered depth from the plane in the colour picture, and the part of it
    that is known."""
    depth = recording_of(RosReader().streams(path)).depth(3)
    known = depth > 0
    return float(np.abs(depth - plane_depth(CAMERA, np.eye(4)))[known].max()), float(known.mean())


Write = Callable[[Recording, Path], Path]
SEPARATE: dict[str, Write] = {
    "realsense.bag": lambda r, p: write_realsense(r, p, T_COLOR_DEPTH, unit=0.0001),
    "realsense_option.bag": lambda r, p: write_realsense(r, p, T_COLOR_DEPTH, unit=0.0001, in_images=False),
    "realsense.db3": lambda r, p: write_realsense(r, p, T_COLOR_DEPTH, 0.0001, "db3"),
    "tf_static.bag": lambda r, p: layouts.write_ros1(r, p, Style(depth="32FC1", T_color_depth=T_COLOR_DEPTH)),
    "tf.bag": lambda r, p: layouts.write_ros1(
        r, p, Style(depth="32FC1", T_color_depth=T_COLOR_DEPTH, transforms="/tf")
    ),
    "tf_static": lambda r, p: layouts.write_ros2(r, p, Style(depth="32FC1", T_color_depth=T_COLOR_DEPTH)),
}


@pytest.mark.parametrize("name", SEPARATE)
def test_depth_of_a_camera_beside_is_registered_to_the_plane(tmp_path: Path, name: str) -> None:
    path = SEPARATE[name](seen(T_COLOR_DEPTH), tmp_path / name)
    error, known = plane_error(path)
    assert error < 0.001
    assert known > 0.8
    np.testing.assert_allclose(streams_rig(path).T_color_depth, T_COLOR_DEPTH, atol=2e-6)


def test_missing_transform_is_told_and_passes_with_a_calibration(tmp_path: Path) -> None:
    style = Style(T_color_depth=T_COLOR_DEPTH, transforms="")
    path = layouts.write_ros1(seen(T_COLOR_DEPTH), tmp_path / "a.bag", style)
    with pytest.raises(InputError, match="between camera_color_optical_frame and camera_depth_optical_frame"):
        RosReader().streams(path)
    for told in (frozenset(), frozenset(("color", "depth"))):
        with pytest.raises(InputError, match="no transform"):
            RosReader(calibrated=told).streams(path)
    rig = RosReader(calibrated=bags.CALIBRATED).streams(path).rig
    assert np.isnan(rig.T_color_depth).all()  # of no meaning until the calibration replaces it


def test_missing_camera_info_is_told_and_passes_with_a_calibration(tmp_path: Path) -> None:
    path = layouts.write_ros1(seen(np.eye(4)), tmp_path / "a.bag", Style(camera_info=False))
    with pytest.raises(
        InputError, match="no CameraInfo of /camera/color/image_raw; record /camera/color/camera_info"
    ):
        RosReader().streams(path)
    with pytest.raises(InputError, match="no CameraInfo"):
        RosReader(calibrated=frozenset(("pose",))).streams(path)
    assert RosReader(calibrated=bags.CALIBRATED).streams(path).rig.color.camera.width == CAMERA.width


def test_aligned_depth_needs_no_registration(tmp_path: Path) -> None:
    assert streams_rig(layouts.write_ros1(seen(np.eye(4)), tmp_path / "a.bag")).is_registered


def test_topic_that_is_named_aligned_lies_on_color_whatever_its_frame(tmp_path: Path) -> None:
    recording = seen(np.eye(4))
    with layouts.ros1_bag(tmp_path / "a.bag") as bag:
        layouts.write_into(bag, recording, Style(T_color_depth=T_COLOR_DEPTH, transforms=""))
        for k, t in enumerate(recording.times):
            stamp = round(t * 1e9)
            depth, frame = recording.depth(k), "camera_aligned_depth_to_color_frame"
            layouts.put_depth(bag, layouts.ALIGNED, depth, stamp, stamp, frame, Style())
            info = bag.info(stamp, frame, CAMERA, "plumb_bob", (0.0,) * 5)
            topic = f"{layouts.place_of(layouts.ALIGNED)}/camera_info"
            bag.put(topic, "sensor_msgs/msg/CameraInfo", info, stamp)
    streams = RosReader().streams(tmp_path / "a.bag")
    assert streams.metadata["depth_topic"] == layouts.ALIGNED
    assert streams.rig.is_registered


def test_aligned_depth_of_another_size_has_its_own_camera(tmp_path: Path) -> None:
    half = Intrinsics(32, 24, 30.0, 30.5, 15.35, 11.8)
    style = Style(depth="32FC1", depth_camera=half)
    depth = plane_depth(half, np.eye(4)).astype(np.float32)
    recording = seen(np.eye(4))
    small = Recording(**{**vars(recording), "read_depth": lambda _: depth})
    path = layouts.write_ros2(small, tmp_path / "a", style)
    rig = streams_rig(path)
    assert rig.depth.camera == half
    error, known = plane_error(path)
    assert error < 0.001
    assert known > 0.9


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [
        ("plumb_bob", (0.1, -0.05, 0.001, 0.002, 0.01)),
        ("rational_polynomial", (0.1, -0.05, 0.001, 0.002, 0.01, 0.2, 0.1, 0.03)),
        ("Inverse Brown Conrady", (-0.05, 0.06, 0.0002, -0.0001, -0.02)),
        ("Brown Conrady", (0.1, 0.0, 0.0, 0.0, 0.0)),
    ],
)
def test_distortion_goes_into_the_lens(tmp_path: Path, model: str, coefficients: tuple[float, ...]) -> None:
    style = Style(model=model, distortion=coefficients)
    for path in (
        layouts.write_ros1(seen(np.eye(4)), tmp_path / "a.bag", style),
        layouts.write_ros2(seen(np.eye(4)), tmp_path / "b", style, storage="mcap"),
    ):
        rig = streams_rig(path)
        assert rig.color.distortion == coefficients
        assert rig.depth.distortion == coefficients
        assert not rig.is_registered


def test_distortion_that_is_zero_is_none_whatever_its_model(tmp_path: Path) -> None:
    path = layouts.write_ros1(
        seen(np.eye(4)), tmp_path / "a.bag", Style(model="equidistant", distortion=(0.0,) * 4)
    )
    assert streams_rig(path).is_registered


@pytest.mark.parametrize("model", ["equidistant", "Kannala Brandt4", "F-Theta", ""])
def test_fisheye_lenses_are_refused(tmp_path: Path, model: str) -> None:
    style = Style(model=model, distortion=(0.1, 0.02, 0.0, 0.0))
    path = layouts.write_ros1(seen(np.eye(4)), tmp_path / "a.bag", style)
    with pytest.raises(InputError, match=r"distortion model .*undistort the images first"):
        RosReader().streams(path)


def test_rectified_pictures_have_the_projection_s_camera(tmp_path: Path) -> None:
    style = Style(color_topic="/camera/color/image_rect_color", distortion=(0.1, 0.0, 0.0, 0.0, 0.0))
    rig = streams_rig(layouts.write_ros1(seen(np.eye(4)), tmp_path / "a.bag", style))
    assert rig.color.is_pinhole


def test_camera_info_of_another_size_is_refused(tmp_path: Path) -> None:
    recording = seen(np.eye(4))
    other = Recording(**{**vars(recording), "intrinsics": CAMERA.scaled(128, 96)})
    path = layouts.write_ros1(other, tmp_path / "a.bag")
    with pytest.raises(InputError, match="is 64x48, /camera/color/camera_info is of 128x96"):
        RosReader().streams(path)


def test_realsense_units_that_no_camera_has_are_refused(tmp_path: Path) -> None:
    path = write_realsense(seen(np.eye(4)), tmp_path / "a.bag", np.eye(4), 25.0)
    with pytest.raises(InputError, match="depth unit of 25 m"):
        RosReader().streams(path)


def test_realsense_clock_of_its_images(tmp_path: Path) -> None:
    recording = seen(np.eye(4))
    streams = RosReader().streams(write_realsense(recording, tmp_path / "a.bag", np.eye(4)))
    np.testing.assert_allclose(streams.color_times, recording.times, atol=1e-6)
    np.testing.assert_allclose(streams.depth_times, recording.times, atol=1e-6)


def moving() -> Recording:
    """A camera that goes and turns."""
    poses = np.stack(
        [make_pose(exp_so3([0.01 * k, 0.02 * k, -0.01 * k]), [0.1 * k, 0.02 * k, 1.0]) for k in range(FRAMES)]
    )
    still = seen(np.eye(4))
    color, depth = np.stack([f.color for f in still]), np.stack([f.depth for f in still])
    return Recording.from_arrays(color, depth, CAMERA, times=3.0 + np.arange(FRAMES) / 10, poses=poses)


@pytest.mark.parametrize("transforms", ["odometry", "tf"])
def test_poses_of_the_color_camera(tmp_path: Path, transforms: str) -> None:
    original = moving()
    assert original.poses is not None
    path = tmp_path / "a.bag"
    with layouts.ros1_bag(path) as bag:
        layouts.write_into(bag, original, Style(odometry=transforms == "odometry"))
        if transforms == "tf":
            for k, t in enumerate(original.times):
                stamp = round(t * 1e9)
                T = original.poses.T_world_cam[k] @ np.linalg.inv(layouts.T_BASE_CAMERA)
                edges = (
                    ("odom", "base_link", T),
                    ("/base_link", "/" + layouts.COLOR_FRAME, layouts.T_BASE_CAMERA),
                )
                bag.put("/tf", "tf2_msgs/msg/TFMessage", bag.tf(stamp, *edges), stamp)
    recording = recording_of(RosReader().streams(path))
    assert recording.poses is not None
    assert len(recording.poses.frames) == FRAMES
    np.testing.assert_allclose(recording.poses.T_world_cam, original.poses.T_world_cam, atol=1e-9)


def test_odometry_of_a_body_that_is_not_the_camera_s_is_left_out(tmp_path: Path) -> None:
    with layouts.ros1_bag(tmp_path / "a.bag") as bag:
        layouts.write_into(bag, moving(), Style())
        bag.put("/odom", "nav_msgs/msg/Odometry", bag.odometry(1, "odom", "base_link", np.eye(4)), 1)
    streams = RosReader().streams(tmp_path / "a.bag")
    assert streams.poses is None
    assert "base_link, whose transform to camera_color_optical_frame is not known" in streams.warnings[0]


def test_colour_and_depth_of_different_clocks_take_the_log_s(tmp_path: Path) -> None:
    recording = seen(np.eye(4))
    with layouts.ros1_bag(tmp_path / "a.bag") as bag:
        for k in range(FRAMES):
            log = 10**10 + k * 10**8
            frame, style = recording.frame(k), Style()
            layouts.put_color(bag, layouts.COLOR, frame.color, log, log, style)
            layouts.put_depth(bag, layouts.ALIGNED, frame.depth, 17 + k, log, layouts.COLOR_FRAME, style)
            info = bag.info(log, layouts.COLOR_FRAME, CAMERA, "", ())
            bag.put("/camera/color/camera_info", "sensor_msgs/msg/CameraInfo", info, log)
    streams = RosReader().streams(tmp_path / "a.bag")
    np.testing.assert_allclose(streams.depth_times, 10 + np.arange(FRAMES) / 10, atol=1e-6)
    assert "different clocks" in streams.warnings[0]


def test_lens_of_the_log(tmp_path: Path) -> None:
    rig = streams_rig(write_realsense(seen(np.eye(4)), tmp_path / "a.db3", np.eye(4), 0.001, "db3"))
    assert rig.color.camera == CAMERA
    assert rig.color.is_pinhole

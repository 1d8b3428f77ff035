"""Both cameras of an Azure Kinect: in closed form, and on a real file against the SDK and OpenCV."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest

from recon.dense.registration import DepthGrid, rays
from recon.readers.kinect.calibration import DEPTH_MODES, rig_of
from recon.readers.streams import Streams
from recon.recording.rig import Rig
from tests.makers.recon.azure_recording import (
    COLOR,
    DEPTH,
    READER,
    calibration,
    check_against_ffmpeg,
)
from twin.errors import InputError
from twin.geometry import exp_so3, invert_pose, make_pose, transform


def rig(camera: bytes, color: tuple[int, int] = COLOR, depth: tuple[int, int] = DEPTH) -> Rig:
    return rig_of(camera, "clip.mkv", color, depth)


def test_16_9_colour_is_cut_from_the_middle_of_4_3() -> None:
    for width, height in ((1280, 720), (1920, 1080), (2560, 1440), (3840, 2160)):
        cut, whole = (rig(calibration(), (width, h)).color.camera for h in (height, width * 3 // 4))
        np.testing.assert_allclose(
            cut.vector, whole.vector - [0, 0, 0, (width * 3 // 4 - height) / 2], atol=1e-9
        )
    small, large = (rig(calibration(), s).color.camera for s in ((640, 480), (4096, 3072)))
    np.testing.assert_allclose(large.scaled(640, 480).vector, small.vector, atol=1e-9)


def test_depth_modes_are_cuts_of_one_sensor() -> None:
    def aim(d0: dict[str, Any], _: dict[str, Any]) -> None:
        d0["Intrinsics"]["ModelParameters"][:4] = [0.51, 0.52, 0.49, 0.495]

    of = {size: rig(calibration(aim), depth=size).depth.camera for size in DEPTH_MODES}
    whole = of[(1024, 1024)]
    np.testing.assert_allclose(whole.vector, [501.76, 506.88, 521.74, 531.98], atol=1e-9)
    np.testing.assert_allclose(of[(640, 576)].vector, whole.vector - [0, 0, 192, 180], atol=1e-9)
    np.testing.assert_allclose(of[(512, 512)].vector, whole.binned(2).vector, atol=1e-9)
    np.testing.assert_allclose(of[(320, 288)].vector, of[(640, 576)].binned(2).vector, atol=1e-9)


def test_a_calibration_on_the_16_9_picture_is_the_same_camera() -> None:
    def early(_: dict[str, Any], pv0: dict[str, Any]) -> None:
        cx, cy, fx, fy = pv0["Intrinsics"]["ModelParameters"][:4]
        pixels = cy * 3072 - 384  # on the 4096x2304 in the middle
        pv0["Intrinsics"]["ModelParameters"][:4] = [cx, pixels / 2304, fx, fy * 3072 / 2304]
        pv0["SensorHeight"] = 2304

    for size in ((1280, 720), (2048, 1536)):
        now, then = rig(calibration(), size), rig(calibration(early), size)
        np.testing.assert_allclose(then.color.camera.vector, now.color.camera.vector, atol=1e-9)


def test_points_go_from_depth_to_colour_through_the_device() -> None:
    poses = {
        "D0": make_pose(exp_so3(np.array([0.1, 0, 0.02])), [0.01, 0.02, 0.03]),
        "PV0": make_pose(exp_so3(np.array([0, 0.3, 0])), [-0.03, 0, 0.004]),
    }

    def place(*cameras: dict[str, Any]) -> None:
        for c, T in zip(cameras, poses.values(), strict=True):
            c["Rt"] = {"Rotation": T[:3, :3].ravel().tolist(), "Translation": T[:3, 3].tolist()}

    device = np.array([[0.2, -0.1, 1.5]])
    T = rig(calibration(place)).T_color_depth
    np.testing.assert_allclose(
        transform(T, transform(poses["D0"], device)), transform(poses["PV0"], device), atol=1e-12
    )
    assert not np.allclose(T, invert_pose(T))


def test_coefficients_come_in_opencv_s_order() -> None:
    def bend(d0: dict[str, Any], _: dict[str, Any]) -> None:
        d0["Intrinsics"]["ModelParameters"][4:] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0, 0, 0.002, 0.001]

    assert rig(calibration(bend)).depth.distortion == (0.1, 0.2, 0.001, 0.002, 0.3, 0.4, 0.5, 0.6)


def test_the_older_lens_model_is_read_where_it_is_opencv_s_within_half_a_pixel() -> None:
    def model(p1: float) -> Callable[[dict[str, Any], dict[str, Any]], None]:
        def change(d0: dict[str, Any], _: dict[str, Any]) -> None:
            d0["Intrinsics"]["ModelType"] = "CALIBRATION_LensDistortionModelRational6KT"
            d0["Intrinsics"]["ModelParameters"][13] = p1

        return change

    assert rig(calibration(model(1e-4))).depth.distortion[2] == 1e-4
    with pytest.raises(InputError, match="Rational6KT"):
        rig(calibration(model(0.01)))


@pytest.fixture(scope="module")
def real(funtwin_data: Path) -> Path:
    return funtwin_data / "samples" / "azure_kinect"


@pytest.fixture(scope="module")
def capture(real: Path) -> Streams:
    return READER.streams(real / "recording.mkv")


def test_real_cameras_are_those_of_the_sdk(capture: Streams) -> None:
    seen = capture.rig
    np.testing.assert_allclose(seen.depth.camera.vector, [504.6076, 504.7325, 332.7811, 348.8297], atol=1e-3)
    np.testing.assert_allclose(seen.color.camera.vector, [611.7953, 611.9270, 639.3043, 365.8529], atol=1e-3)
    expected = {
        "depth": [0.547940, -0.020971, 2.0558e-5, -7.2104e-5, -0.002652, 0.889679, 0.086130, -0.013910],
        "color": [0.330121, -2.489397, -1.6178e-4, -1.2945e-4, 1.453671, 0.208912, -2.302915, 1.375128],
    }
    np.testing.assert_allclose(seen.depth.distortion, expected["depth"], atol=1e-6)
    np.testing.assert_allclose(seen.color.distortion, expected["color"], atol=1e-6)
    np.testing.assert_allclose(seen.T_color_depth[:3, 3], [-0.0320834, -0.0022054, 0.0038837], atol=1e-7)
    assert capture.color_times.tolist() == capture.depth_times.tolist() == [0.463945]


def test_real_pictures_are_those_of_another_decoder(real: Path, capture: Streams) -> None:
    color, depth = capture.read_color(0), capture.read_depth(0)
    millimetres = cv2.imread(str(real / "depth0.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(np.rint(1000 * depth), millimetres)
    with av.open(str(real / "recording.mkv")) as video:
        other = next(video.decode(video=0)).to_ndarray(format="rgb24")
    assert np.abs(color.astype(int) - other).mean() < 1.5  # chroma is brought up in two ways
    stored = cv2.imread(str(real / "color0.jpg"))[..., ::-1]
    assert np.abs(color.astype(int) - stored).mean() < 1.5  # compressed once more


def test_real_depth_lies_where_opencv_s_own_projection_puts_it(real: Path, capture: Streams) -> None:
    lens = capture.rig.color
    ours = DepthGrid(capture.rig, lens.camera)(capture.read_depth(0))
    splatted = cv2.imread(str(real / "depth_in_color0.png"), cv2.IMREAD_UNCHANGED) / 1000.0
    ray = rays(lens)  # of the distorted picture's pixels, into the undistorted one
    x, y = (
        ray[..., c] * f + m
        for c, f, m in ((0, lens.camera.fx, lens.camera.cx), (1, lens.camera.fy, lens.camera.cy))
    )
    j, i = np.floor(x), np.floor(y)
    h, w = ours.shape
    inside = (splatted > 0) & (j >= 0) & (i >= 0) & (j < w - 1) & (i < h - 1)
    j, i, u, v = j[inside].astype(int), i[inside].astype(int), (x - j)[inside], (y - i)[inside]
    corners = np.stack([ours[i, j], ours[i, j + 1], ours[i + 1, j], ours[i + 1, j + 1]])
    between = (corners * [(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v]).sum(axis=0)
    known = (corners > 0).all(axis=0)
    assert known.mean() > 0.9
    assert np.mean(np.abs(between - splatted[inside])[known] < 0.003) > 0.95


def test_real_frames_lie_where_ffmpeg_finds_them(real: Path) -> None:
    check_against_ffmpeg(real / "recording.mkv", 1000)

"""ROS's images: every encoding and compression that is read, and those that are refused."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from backports import zstd

from benchmarks.layouts import ros as layouts
from benchmarks.layouts.ros import Style
from recon.recording import Recording
from tests.makers.recon import bags
from tests.makers.recon.bags import CAMERA, FRAMES, check_same, opened, problem


@pytest.fixture(scope="module")
def original() -> Recording:
    return bags.frames()


COLORS = {
    "bgr8": 0, "rgba8": 0, "bgra8": 0, "rgb16": 0, "bgr16": 0, "8UC3": 0, "png": 0, "jpeg": 9,
    "yuv422": 12, "uyvy": 12, "yuv422_yuy2": 12, "yuyv": 12,
}  # fmt: skip


@pytest.mark.parametrize(("encoding", "levels"), COLORS.items())
def test_color_encodings(tmp_path: Path, original: Recording, encoding: str, levels: int) -> None:
    # JPEG's loss, and chroma that two pixels share: the pictures have 5 and 4 levels a column
    style = Style(color=encoding, padding=0 if encoding in ("png", "jpeg") else 6)
    check_same(opened(layouts.write_ros1(original, tmp_path / "a.bag", style)), original, color=levels)


def test_big_endian_16_bit_color_and_padded_rows(tmp_path: Path, original: Recording) -> None:
    style = Style(color="bgr16", big_endian=True, padding=5)
    check_same(opened(layouts.write_ros1(original, tmp_path / "a.bag", style)), original)


@pytest.mark.parametrize("tile", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer_tiles(tmp_path: Path, tile: str) -> None:
    color = np.full((FRAMES, 24, 32, 3), [200, 120, 30], np.uint8)
    plain = Recording.from_arrays(color, np.ones((FRAMES, 24, 32), np.float32), CAMERA, fps=15)
    check_same(opened(layouts.write_ros1(plain, tmp_path / "a.bag", Style(color=f"bayer_{tile}8"))), plain)


def test_grey_pictures_serve_where_there_is_no_color(tmp_path: Path, original: Recording) -> None:
    image = opened(layouts.write_ros1(original, tmp_path / "a.bag", Style(color="mono8"))).color(3)
    np.testing.assert_array_equal(image, np.repeat(original.color(3)[..., :1], 3, axis=-1))


DEPTHS = {
    "16UC1": 0.0, "mono16": 0.0, "32FC1": 0.0, "compressedDepth 16UC1": 0.0,
    "compressedDepth 32FC1": 1.4**2 / 10100 * 0.5 + 1e-5,  # half a count of 10100 / z
}  # fmt: skip


@pytest.mark.parametrize(("encoding", "metres"), DEPTHS.items())
def test_depth_encodings(tmp_path: Path, original: Recording, encoding: str, metres: float) -> None:
    style = Style(depth=encoding, padding=0 if " " in encoding else 3, big_endian=" " not in encoding)
    check_same(opened(layouts.write_ros2(original, tmp_path / "a", style)), original, depth=metres)


def write_compressed(
    original: Recording,
    path: Path,
    color: Callable[[int], tuple[str, bytes]],
    depth: Callable[[int], tuple[str, bytes]],
) -> Path:
    """A bag of compressed images alone: frame -> format and data."""
    with layouts.ros2_bag(path) as bag:
        for k, t in enumerate(original.times):
            stamp = round(t * 1e9)
            for topic, made in ((layouts.COLOR, color), (layouts.ALIGNED, depth)):
                message = bag.compressed(stamp, layouts.COLOR_FRAME, *made(k))
                bag.put(f"{topic}/compressed", "sensor_msgs/msg/CompressedImage", message, stamp)
            info = bag.info(stamp, layouts.COLOR_FRAME, CAMERA, "", ())
            bag.put("/camera/color/camera_info", "sensor_msgs/msg/CameraInfo", info, stamp)
    return path


def png_of(original: Recording) -> Callable[[int], bytes]:
    return lambda k: cv2.imencode(".png", np.rint(original.depth(k) * 1000).astype(np.uint16))[1].tobytes()


def test_packed_pixels_of_realsense_and_plain_png_depth(tmp_path: Path, original: Recording) -> None:
    png = png_of(original)

    def packed(k: int) -> tuple[str, bytes]:
        return "YUYV; zstd; 32x24 step=64", zstd.compress(
            layouts.encoded(original.color(k), "yuyv").tobytes()
        )

    for n, form in enumerate(("16UC1; png compressed mono16", "png")):
        path = write_compressed(original, tmp_path / str(n), packed, lambda k, f=form: (f, png(k)))  # type: ignore[misc]
        check_same(opened(path, calibrated=bags.CALIBRATED), original, color=COLORS["yuyv"])


def test_depth_in_a_compression_that_is_not_read_is_told(tmp_path: Path, original: Recording) -> None:
    jpeg = cv2.imencode(".jpg", original.color(0))[1].tobytes()
    rvl = ("16UC1; compressedDepth rvl", struct.pack("<iff", 1, 0, 0) + bytes(200))
    path = write_compressed(original, tmp_path / "a", lambda _: ("jpeg", jpeg), lambda _: rvl)
    assert "not rvl" in problem(path, calibrated=bags.CALIBRATED)


def test_compressed_image_that_claims_gigapixels_is_not_decoded(tmp_path: Path, original: Recording) -> None:
    png = png_of(original)(0)
    huge = png[:16] + struct.pack(">II", 60000, 60000) + png[24:]
    jpeg = cv2.imencode(".jpg", original.color(0))[1].tobytes()
    path = write_compressed(original, tmp_path / "a", lambda _: ("jpeg", jpeg), lambda _: ("png", huge))
    assert "60000x60000" in problem(path, calibrated=bags.CALIBRATED)


def test_float_depth_that_is_no_depth_is_unknown(tmp_path: Path, original: Recording) -> None:
    wrong = original.depth(0).copy()
    wrong[0, :4] = np.nan, np.inf, -np.inf, -1.0
    strange = replace(original, read_depth=lambda _: wrong)
    depth = opened(layouts.write_ros1(strange, tmp_path / "a.bag", Style(depth="32FC1"))).depth(0)
    np.testing.assert_array_equal(depth[0, :4], 0.0)
    np.testing.assert_array_equal(depth[1:], original.depth(0)[1:])

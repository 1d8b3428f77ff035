"""Calibration files: numbers come back, other programs' files are read, and a recording gets the cameras at
its size."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from recon.readers.calibration.file import Calibration, calibrated, read_calibration
from recon.readers.streams import Streams, recording_of
from recon.recording import Intrinsics
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array, exp_so3, make_pose

COLOR = Lens(Intrinsics(640, 480, 610.1, 609.2, 321.3, 239.4), (0.1, -0.2, 0.001, -0.002, 0.05))
DEPTH = Lens(Intrinsics(320, 288, 251.5, 251.7, 160.2, 143.9), (-0.1, 0.03, 0.0, 0.0, 0.0, 0.2, 0.1, 0.0))
T = make_pose(exp_so3([0.05, 0.01, -0.02]), [-0.032, -0.002, 0.004])


def full() -> dict[str, Any]:
    """A file with everything."""
    return dict(json.loads(Calibration(COLOR, DEPTH, T, 1.012).text))


def written(tmp_path: Path, data: Any) -> Path:
    path = tmp_path / "calibration.json"
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    return path


def streams(color: Lens = COLOR, depth: Lens | None = None, T_color_depth: Array | None = None) -> Streams:
    """Ten frames; without a depth camera, depth lies on colour."""
    lens = depth or color
    h, w = lens.camera.height, lens.camera.width
    pose = np.eye(4) if T_color_depth is None else T_color_depth
    return Streams(
        name="r", source="r", color_times=np.arange(10) / 10.0, depth_times=np.arange(10) / 10.0,
        read_color=lambda k: np.full((color.camera.height, color.camera.width, 3), k, np.uint8),
        read_depth=lambda k: np.full((h, w), 1.0 + k, np.float32),
        rig=Rig(color, lens, pose), fingerprint="f",
    )  # fmt: skip


def test_numbers_come_back(tmp_path: Path) -> None:
    path = written(tmp_path, Calibration(COLOR, DEPTH, T, 1.012).text)
    for name in (path, path.parent):
        found = read_calibration(name)
        assert (found.color, found.depth, found.depth_scale) == (COLOR, DEPTH, 1.012)
        assert found.T_color_depth is not None
        assert np.array_equal(found.T_color_depth, T)
    scale = read_calibration(written(tmp_path, {"format": "funtwin-calibration/1", "depth_scale": 0.99}))
    assert (scale.color, scale.depth, scale.T_color_depth, scale.depth_scale) == (None, None, None, 0.99)
    assert scale.digest != found.digest
    assert found.contents == {"color", "depth", "pose"}
    assert scale.contents == frozenset()


def test_open3d(tmp_path: Path) -> None:
    import open3d as o3d

    k = COLOR.camera
    camera = o3d.camera.PinholeCameraIntrinsic(k.width, k.height, k.matrix)
    path = tmp_path / "intrinsic.json"
    o3d.io.write_pinhole_camera_intrinsic(path, camera)
    found = read_calibration(path)
    assert found.color is not None
    assert found.color.is_pinhole
    assert np.allclose(found.color.camera.vector, k.vector, atol=1e-9)


@pytest.mark.parametrize("suffix", [".yml", ".xml"])
@pytest.mark.parametrize(
    "names",
    [
        ("camera_matrix", "distortion_coefficients", "image_width image_height"),
        ("Camera_Matrix", "Distortion_Coefficients", "image_Width image_Height"),
        ("K", "dist", "img_size"),
    ],
)
def test_opencv(tmp_path: Path, suffix: str, names: tuple[str, str, str]) -> None:
    path = tmp_path / f"calib{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Tue 25 Nov 2025")
    k, sizes = COLOR.camera, names[2].split()
    if len(sizes) == 2:
        storage.write(sizes[0], k.width)
        storage.write(sizes[1], k.height)
    storage.write("board_width", 9)
    storage.write(names[0], k.matrix)
    storage.write(names[1], np.array(COLOR.distortion).reshape(-1, 1))
    if len(sizes) == 1:
        storage.write(sizes[0], np.array([[k.width], [k.height]], np.int32))
    storage.release()
    found = read_calibration(path)
    assert found.color == COLOR


def test_ros_camera_info(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(
        "image_width: 640\nimage_height: 480\ncamera_name: head\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
        "  data: [610.1, 0.0, 321.3, 0.0, 609.2, 239.4, 0.0, 0.0, 1.0]\ndistortion_model: plumb_bob\n"
        "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.1, -0.2, 0.001, -0.002, 0.05]\n"
    )
    assert read_calibration(path).color == COLOR


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"format": "other/1"}, "format is 'other/1'"),
        ({"colour": {}}, "unknown key 'colour'; did you mean 'color'"),
        ({"color": 5}, "color is '5', not an object"),
        ({"color": {"width": 640, "height": 480}}, "color lacks intrinsic_matrix"),
        ({"color": {**full()["color"], "fx": 1}}, "color has the unknown key 'fx'"),
        ({"color": {**full()["color"], "width": 640.5}}, "width is '640.5'"),
        ({"color": {**full()["color"], "width": True}}, "width is 'True'"),
        ({"color": {**full()["color"], "height": 10**9}}, "height is '1000000000'"),
        ({"color": {**full()["color"], "distortion": [0.1]}}, "distortion has 1 numbers"),
        ({"color": {**full()["color"], "distortion": [0.1, "a", 0, 0]}}, "distortion is"),
        ({"color": {**full()["color"], "intrinsic_matrix": [610, 0, 320, 0, 610, 240, 0, 0, 1]}}, "column by column"),
        ({"color": {**full()["color"], "intrinsic_matrix": [-1, 0, 0, 0, 610, 0, 320, 240, 1]}}, "positive"),
        ({"T_color_depth": [1, 2, 3]}, "T_color_depth is"),
        ({"T_color_depth": (2 * np.eye(4)).tolist()}, "no rigid pose"),
        ({"T_color_depth": np.diag([1.0, 1, -1, 1]).tolist()}, "no rigid pose"),
        ({"T_color_depth": make_pose(translation=[32.0, 0, 0]).tolist()}, "write metres"),
        ({"T_color_depth": [[float("nan")] * 4] * 4}, "finite numbers"),
        ({"depth_scale": 0}, "depth_scale is '0'"),
        ({"depth_scale": 1000}, "depth_scale is '1000'"),
        ({"depth_scale": "1"}, "depth_scale is '1'"),
    ],
)  # fmt: skip
def test_mistakes_are_named(tmp_path: Path, change: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError) as error:
        read_calibration(written(tmp_path, {**full(), **change}))
    message = str(error.value)
    assert told in message
    assert "calibration.json" in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "is empty"), ("{", "is not JSON"), ("hello", "neither JSON nor"), ("[" * 9000, "neither JSON nor"),
        ('{"a":' * 5000, "is not JSON"), ('{"format": "funtwin-calibration/1"}', "tells nothing of a camera"),
        ("%YAML:1.0\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   data: [1, 2, x]\n", "neither JSON nor"),
        ("camera_matrix:\n  data: [600, 0, 320, 0, 600, 240, 0, 0, 1]\n", "does not tell the size"),
        ("image_width: 640\nimage_height: 480\nK:\n data: [600, 1, 320, 0, 600, 240, 0, 0, 1]\n", "without skew"),
        ("image_width: 640\nimage_height: 480\nK:\n data: [1e999, 0, 320, 0, 600, 240, 0, 0, 1]\n", "finite"),
    ],
)  # fmt: skip
def test_other_files_are_told(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(InputError, match=told):
        read_calibration(written(tmp_path, text))


def test_places_that_hold_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"folder without calibration\.json"):
        read_calibration(tmp_path)
    with pytest.raises(InputError, match="can't be read"):
        read_calibration(tmp_path / "missing.json")
    (tmp_path / "large.json").write_bytes(b" " * (2**20 + 1))
    with pytest.raises(InputError, match="fewer than"):
        read_calibration(tmp_path / "large.json")


def test_flipped_bytes(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    yaml = tmp_path / "calib.yml"
    storage = cv2.FileStorage(str(yaml), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", COLOR.camera.matrix)
    storage.release()
    for whole in (Calibration(COLOR, DEPTH, T, 1.0).text.encode(), yaml.read_bytes()):
        for _ in range(200):
            data = bytearray(whole)
            data[rng.integers(len(data))] = rng.integers(256)
            path = tmp_path / "flipped"
            path.write_bytes(bytes(data))
            told = ""
            try:
                read_calibration(path)
            except InputError as error:
                told = str(error)
            assert "\n" not in told


def test_cameras_at_the_size_of_the_pictures() -> None:
    small = COLOR.scaled(320, 240)
    raw = streams(Lens(small.camera, ()), DEPTH, np.eye(4))
    known = Calibration(COLOR, DEPTH, T, None, "d")
    found = calibrated(raw, known)
    assert found.rig.color == small
    assert found.rig.depth == DEPTH
    assert np.array_equal(found.rig.T_color_depth, T)
    assert found.fingerprint not in ("f", raw.fingerprint)
    assert found.fingerprint != calibrated(raw, replace(known, digest="e")).fingerprint
    alone = calibrated(raw, Calibration(COLOR, None, None, None))
    assert alone.rig.color == small
    assert alone.rig.depth == raw.rig.depth
    assert np.array_equal(alone.rig.T_color_depth, np.eye(4))


def test_another_shape_is_refused() -> None:
    wide = streams(Lens(Intrinsics(640, 360, 500.0, 500.0, 319.5, 179.5)))
    with pytest.raises(InputError, match="640x360, the calibration is of 640x480"):
        calibrated(wide, Calibration(COLOR, None, None, None))


def test_registered_depth_follows_colour() -> None:
    plain = streams(Lens(COLOR.camera, ()))
    assert plain.rig.is_registered
    found = calibrated(plain, Calibration(COLOR, None, None, None))
    assert found.rig.color == found.rig.depth == COLOR
    both = calibrated(plain, Calibration(COLOR, DEPTH, T, None))
    assert both.rig.color == both.rig.depth == COLOR
    assert np.array_equal(both.rig.T_color_depth, np.eye(4))
    assert "are not used" in both.warnings[-1]
    with pytest.raises(InputError, match="tells the depth camera alone"):
        calibrated(plain, Calibration(None, DEPTH, None, None))


def test_depth_is_scaled() -> None:
    found = calibrated(streams(), Calibration(None, None, None, 1.25))
    assert np.array_equal(found.read_depth(3), np.full((480, 640), 5.0, np.float32))
    assert found.read_depth(0).dtype == np.float32
    assert found.rig.color == COLOR


def test_straight_lines_become_straight() -> None:
    """A recording with a calibration is undistorted: what the lens bends comes to the pinhole camera's
    place."""
    plain = streams(Lens(COLOR.camera, ()))
    image = np.zeros((480, 640, 3), np.uint8)
    at = cv2.projectPoints(
        np.array([[0.4, 0.3, 1.0]]), np.zeros(3), np.zeros(3), COLOR.camera.matrix, np.array(COLOR.distortion)
    )[0]
    x, y = np.rint(at.ravel()).astype(int)
    image[y - 1 : y + 2, x - 1 : x + 2] = 255
    recording = recording_of(
        calibrated(replace(plain, read_color=lambda _: image), Calibration(COLOR, None, None, None))
    )
    rows, columns = np.nonzero(recording.color(0)[..., 0] > 100)
    straight = COLOR.camera.project(np.array([0.4, 0.3, 1.0]))
    assert np.abs([columns.mean(), rows.mean()] - straight).max() < 1.0
    assert np.abs(at.ravel() - straight).max() > 2.0

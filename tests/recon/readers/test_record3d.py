"""Record3D archives: axes, grids, clocks, compression, and what is refused."""

from __future__ import annotations

import json
import sys
import types
import zipfile
from pathlib import Path
from typing import Any

import cv2
import lzfse
import numpy as np
import pytest

from recon.readers import open_recording
from twin.errors import InputError, MissingDependencyError


def write_r3d(path: Path, quaternions: Any = None, count: int = 12, **changes: Any) -> Path:
    """A .r3d of a slanted plane: colour 192x256 (portrait), raw depth 48x64, confidence low in the first
    row."""
    q = np.tile([0.0, 0, 0, 1], (count, 1)) if quaternions is None else np.asarray(quaternions)
    positions = np.column_stack([np.arange(count) * 0.1, np.full(count, 1.5), np.zeros(count)])
    meta: dict[str, Any] = {
        "w": 192, "h": 256, "dw": 48, "dh": 64, "fps": 60,
        "K": [200.0, 0, 0, 0, 210.0, 0, 95.5, 127.5, 1], "poses": np.hstack([q, positions]).tolist(),
    }  # fmt: skip
    meta.update(changes)
    y, x = np.mgrid[0:64, 0:48]
    depth = (1.0 + 0.002 * x + 0.001 * y).astype("<f4")
    depth[20, 30] = np.nan
    confidence = np.full((64, 48), 2, np.uint8)
    confidence[0] = 0
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("metadata", json.dumps({k: v for k, v in meta.items() if v is not None}))
        for k in range(count):
            image = np.full((256, 192, 3), 20 * k, np.uint8)
            archive.writestr(f"rgbd/{k}.jpg", cv2.imencode(".jpg", image)[1].tobytes())
            archive.writestr(f"rgbd/{k}.depth", depth.tobytes())
            archive.writestr(f"rgbd/{k}.conf", confidence.tobytes())
    return path


def test_record3d_level_camera_looks_along_the_world_with_gravity_down(tmp_path: Path) -> None:
    half = np.sqrt(0.5)
    q = np.tile([0.0, 0, 0, 1], (12, 1))
    q[1] = [0, half, 0, half]  # a quarter turn to the left about ARKit's y
    q[2] = [-half, 0, 0, half]  # pitched down to the floor
    recording = open_recording(write_r3d(tmp_path / "clip.r3d", q))
    assert recording.gravity_camera0 is not None
    np.testing.assert_allclose(recording.gravity_camera0, [0, 1, 0], atol=1e-12)
    assert recording.poses is not None
    T = recording.poses.T_world_cam
    np.testing.assert_allclose(T[0, :3, 2], [0, 1, 0], atol=1e-12)  # forward: ARKit's -z is our y
    np.testing.assert_allclose(T[0, :3, 1], [0, 0, -1], atol=1e-12)  # image down is world down
    np.testing.assert_allclose(T[1, :3, 2], [-1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(T[2, :3, 2], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(T[3, :3, 3], [0.3, 0, 1.5], atol=1e-12)  # 1.5 m above the origin


def test_record3d_grid_times_and_numeric_order(tmp_path: Path) -> None:
    recording = open_recording(write_r3d(tmp_path / "clip.r3d"))
    assert len(recording) == 12
    np.testing.assert_allclose(recording.times, np.arange(12) / 60)
    frame = recording.frame(11)  # as text, 11 comes before 2
    assert abs(int(frame.color[0, 0, 0]) - 220) < 5
    assert frame.color.shape == (256, 192, 3)
    assert frame.depth.shape == (256, 192)
    assert np.all(frame.depth[:4] == 0)  # low confidence
    assert frame.depth[82, 122] == 0  # not a number
    y, x = np.mgrid[0:256, 0:192]
    plane = 1.0 + 0.002 * ((x + 0.5) / 4 - 0.5) + 0.001 * ((y + 0.5) / 4 - 0.5)
    inner = np.s_[20:60, 8:-8]
    np.testing.assert_allclose(frame.depth[inner], plane[inner], atol=1e-4)


def test_record3d_large_colour_is_scaled_with_its_intrinsics(tmp_path: Path) -> None:
    path = write_r3d(tmp_path / "clip.r3d", w=96, h=128, K=[100.0, 0, 0, 0, 105.0, 0, 47.5, 63.5, 1])
    k = open_recording(path).intrinsics  # the JPEGs are twice as large as the metadata says
    assert (k.width, k.height, k.fx, k.fy) == (192, 256, 200.0, 210.0)
    coeffs = [[202.0, 212.0, 95.5, 127.5]] * 12
    k = open_recording(write_r3d(tmp_path / "own.r3d", perFrameIntrinsicCoeffs=coeffs)).intrinsics
    assert (k.fx, k.fy) == (202.0, 212.0)
    coeffs[5] = [220.0, 212.0, 95.5, 127.5]
    assert (
        "focal length"
        in open_recording(write_r3d(tmp_path / "zoom.r3d", perFrameIntrinsicCoeffs=coeffs)).warnings[0]
    )


def test_record3d_stamps_and_missing_poses(tmp_path: Path) -> None:
    stamps = (7.0 + np.arange(12) / 30).tolist()
    recording = open_recording(write_r3d(tmp_path / "clip.r3d", frameTimestamps=stamps, poses=None))
    np.testing.assert_allclose(recording.times, stamps)
    assert recording.poses is None
    assert recording.gravity_camera0 is None
    with pytest.raises(InputError, match="5 time stamps for 12 frames"):
        open_recording(write_r3d(tmp_path / "bad.r3d", frameTimestamps=stamps[:5]))


def test_record3d_refuses_bad_archives(tmp_path: Path) -> None:
    path = write_r3d(tmp_path / "clip.r3d")
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("../outside.txt", "x")
    with pytest.raises(InputError, match=r"outside\.txt"):
        open_recording(path)
    (tmp_path / "no.r3d").write_bytes(b"PK but no zip")
    with pytest.raises(InputError, match=r"no\.r3d is no readable zip"):
        open_recording(tmp_path / "no.r3d")
    with (
        zipfile.ZipFile(tmp_path / "hole.r3d", "w") as target,
        zipfile.ZipFile(write_r3d(tmp_path / "a.r3d")) as whole,
    ):
        for name in whole.namelist():
            if name != "rgbd/7.depth":
                target.writestr(name, whole.read(name))
    with pytest.raises(InputError, match=r"rgbd/7\.depth is missing"):
        open_recording(tmp_path / "hole.r3d")
    nan = np.tile([0.0, 0, 0, 1], (12, 1))
    nan[4, 0] = np.nan
    with pytest.raises(InputError, match="pose 4 is not finite"):
        open_recording(write_r3d(tmp_path / "nan.r3d", nan))


def compressed_r3d(path: Path, compress: Any) -> Path:
    with zipfile.ZipFile(write_r3d(path.with_suffix(".raw"))) as raw, zipfile.ZipFile(path, "w") as archive:
        for name in raw.namelist():
            data = raw.read(name)
            archive.writestr(name, compress(data) if name.endswith((".depth", ".conf")) else data)
    return path


def test_record3d_compressed_depth_needs_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = compressed_r3d(tmp_path / "clip.r3d", lambda data: b"bvx2" + data)
    monkeypatch.setitem(sys.modules, "lzfse", None)
    with pytest.raises(MissingDependencyError, match=r"install the package lzfse.*extra `record3d`"):
        open_recording(path)
    decoder = types.SimpleNamespace(decompress=lambda data: data[4:], error=OSError)
    monkeypatch.setitem(sys.modules, "lzfse", decoder)
    raw = open_recording(write_r3d(tmp_path / "raw.r3d")).frame(2)
    np.testing.assert_array_equal(open_recording(path).frame(2).depth, raw.depth)


def test_record3d_real_compression(tmp_path: Path) -> None:
    path = compressed_r3d(tmp_path / "clip.r3d", lzfse.compress)
    raw = open_recording(write_r3d(tmp_path / "raw.r3d")).frame(2)
    np.testing.assert_array_equal(open_recording(path).frame(2).depth, raw.depth)
    broken = compressed_r3d(tmp_path / "broken.r3d", lambda data: lzfse.compress(data)[: len(data) // 50])
    with pytest.raises(InputError, match=r"rgbd/0\.(depth|conf)"):
        open_recording(broken)

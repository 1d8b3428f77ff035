"""ScanNet's .sens: what is written is read again, in its units, axes and clocks; what is wrong is told in one
line."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import recon
from benchmarks.layouts import datasets as write
from recon.readers.scannet import ScanNetReader
from recon.readers.streams import recording_of
from tests.makers.recon.clips import assert_poses, assert_same, read, refused
from twin import geometry as geo


@pytest.mark.parametrize(("color", "depth"), [("jpeg", "zlib"), ("png", "raw"), ("raw", "zlib")])
def test_scannet_round_trip(
    recording: recon.Recording, T: Any, tmp_path: Path, color: str, depth: str
) -> None:
    found = read(
        ScanNetReader(), write.write_scannet(recording, tmp_path / "a.sens", T, color=color, depth=depth)
    )
    assert_same(found, recording, color=1.5 if color == "jpeg" else 0.0)
    assert_poses(found, T)
    np.testing.assert_allclose(found.times, recording.times, atol=1e-6)
    assert found.warnings == ()
    assert found.metadata == {"sensor": "StructureSensor"}
    assert found.gravity_camera0 is None  # the file does not say that its world is z-up


def test_scannet_pose_is_the_depth_cameras_and_extrinsics_take_depth_to_colour(
    recording: recon.Recording, T: Any, tmp_path: Path
) -> None:
    E = geo.make_pose(geo.exp_so3([0.01, -0.02, 0.005]), [0.03, 0.002, -0.004])
    streams = ScanNetReader().streams(
        write.write_scannet(recording, tmp_path / "a.sens", T, depth_to_color=E)
    )
    np.testing.assert_allclose(streams.rig.T_color_depth, E, atol=1e-6)
    assert streams.poses is not None
    np.testing.assert_allclose(streams.poses[1], T, atol=1e-5)  # colour's, whatever stands between the two


def test_scannet_lost_poses_and_missing_clock(recording: recon.Recording, T: Any, tmp_path: Path) -> None:
    path = write.write_scannet(recording, tmp_path / "a.sens", T, lost=(0, 4), times=False)
    found = read(ScanNetReader(), path)
    assert_poses(found, T, [1, 2, 3, 5, 6, 7, 8, 9, 10, 11])
    np.testing.assert_allclose(np.diff(found.times), 1 / 30)
    assert found.warnings == ("a.sens has no time stamps; taken to be recorded at 30 frames a second",)
    assert (
        read(ScanNetReader(), write.write_scannet(recording, tmp_path / "b.sens")).poses is None
    )  # all the same


def test_scannet_coarser_depth_of_another_unit(recording: recon.Recording, tmp_path: Path) -> None:
    path = write.write_scannet(recording, tmp_path / "a.sens", depth_step=2, per_metre=5000.0)
    streams = ScanNetReader().streams(path)
    assert (streams.rig.depth.camera.width, streams.rig.color.camera.width) == (48, 96)
    np.testing.assert_allclose(streams.read_depth(3), recording.depth(3)[::2, ::2], atol=1e-4)
    brought = recording_of(streams).depth(3)
    known = (brought > 0) & (recording.depth(3) > 0)
    assert known.mean() > 0.9
    assert np.median(np.abs(brought - recording.depth(3))[known]) < 0.002


def test_scannet_refusals(recording: recon.Recording, T: Any, tmp_path: Path) -> None:
    reader = ScanNetReader()
    data = write.write_scannet(recording, tmp_path / "a.sens", T).read_bytes()
    at = 12 + len("StructureSensor")  # where the matrices begin
    changed = {
        "cut.sens": (data[: len(data) // 2], "truncated: it ends inside frame"),
        "tail.sens": (data[:-5], "truncated: it ends inside frame 11 of 12"),
        "head.sens": (data[:200], "truncated: it ends inside its header"),
        "occi.sens": (data[: at + 260] + struct.pack("<i", 2) + data[at + 264 :], "occi"),
        "kind.sens": (data[: at + 256] + struct.pack("<i", 9) + data[at + 260 :], "compression of colour is 9"),
        "size.sens": (data[: at + 264] + struct.pack("<I", 2**31) + data[at + 268 :], "colour is 2147483648x72"),
        "shift.sens": (data[: at + 280] + struct.pack("<f", 0.0) + data[at + 284 :], "a metre of depth is 0"),
        "count.sens": (data[: at + 284] + struct.pack("<Q", 2**60) + data[at + 292 :], "frames by its header"),
        "K.sens": (data[:at] + struct.pack("<f", np.nan) + data[at + 4 :], "colour: intrinsics must be finite"),
        "E.sens": (data[: at + 64] + struct.pack("<f", 3.0) + data[at + 68 :], "no rigid motion"),
        "pose.sens": (data[: at + 292] + struct.pack("<f", 3.0) + data[at + 296 :], "pose 0 is no rigid motion"),
        "payload.sens": (data[: at + 292 + 80] + struct.pack("<Q", 2**40) + data[at + 292 + 88 :], "frame 0 has"),
        "version.sens": (struct.pack("<I", 5) + data[4:], "of version 5"),
        "name.sens": (data[:4] + struct.pack("<Q", 2**40) + data[12:], "sensor's name of"),
    }  # fmt: skip
    for name, (content, match) in changed.items():
        (tmp_path / name).write_bytes(content)
        refused(reader, tmp_path / name, match)
    assert not reader.recognises(tmp_path / "version.sens")


def test_scannet_zip_bomb_stays_small(recording: recon.Recording, tmp_path: Path) -> None:
    import zlib

    bomb = zlib.compress(bytes(2**26))
    data = write.write_scannet(recording, tmp_path / "a.sens").read_bytes()
    at = 12 + len("StructureSensor") + 292
    color = struct.unpack("<Q", data[at + 80 : at + 88])[0]
    depth = struct.unpack("<Q", data[at + 88 : at + 96])[0]
    head = data[: at + 88] + struct.pack("<Q", len(bomb)) + data[at + 96 : at + 96 + color] + bomb
    (tmp_path / "bomb.sens").write_bytes(head + data[at + 96 + color + depth :])
    refused(ScanNetReader(), tmp_path / "bomb.sens", "depth 0 has 13825 bytes, not those of 96x72")

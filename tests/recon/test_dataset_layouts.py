"""Data sets' layouts: what is written is read again, in its units, axes and clocks; what is wrong with a copy is told in one line."""

from __future__ import annotations

import json
import shutil
import struct
import sys
import types
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import recon
from benchmarks.layouts import datasets as write
from recon.readers.arti4d import Arti4dReader
from recon.readers.bundlesdf import BundleSdfReader
from recon.readers.hoi4d import Hoi4dReader
from recon.readers.itaco import ItacoReader
from recon.readers.numpy_files import read_npy, read_npz
from recon.readers.scannet import ScanNetReader
from recon.readers.streams import recording_of
from tests.recon.tiny import cameras, write_recording
from twin import geometry as geo
from twin.errors import FuntwinError, InputError, MissingDependencyError

FRAMES = 12
READERS: list[Any] = [ScanNetReader(), Hoi4dReader(), Arti4dReader(), ItacoReader(), BundleSdfReader()]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> recon.Recording:
    return recon.open_recording(write_recording(tmp_path_factory.mktemp("tiny") / "door", frames=FRAMES))


@pytest.fixture(scope="module")
def T() -> Any:
    return cameras(FRAMES)


def read(reader: Any, path: Path) -> recon.Recording:
    """The recording at a path, which this reader alone knows."""
    assert [r for r in READERS if r.recognises(path)] == [reader]
    return recording_of(reader.streams(path))


def assert_same(
    found: recon.Recording, true: recon.Recording, depth: float = 5e-4, color: float = 1.5
) -> None:
    """Equal frames: depth within `depth` m, colour within `color` of 255 in the mean, as JPEG leaves it; relative times within 1 us."""
    assert len(found) == len(true)
    k = true.intrinsics
    np.testing.assert_allclose(found.intrinsics.vector, k.vector, rtol=1e-6)
    assert (found.intrinsics.width, found.intrinsics.height) == (k.width, k.height)
    for i in range(0, len(true), 5):
        np.testing.assert_allclose(found.depth(i), true.depth(i), atol=depth)
        off = np.abs(found.color(i).astype(float) - true.color(i).astype(float))
        assert off.mean() <= color, i


def assert_poses(found: recon.Recording, T: Any, frames: Any = None, atol: float = 1e-6) -> None:
    assert found.poses is not None
    frames = np.arange(FRAMES) if frames is None else frames
    assert found.poses.frames.tolist() == list(frames)
    np.testing.assert_allclose(found.poses.T_world_cam, T[frames], atol=atol)


def read_whole(reader: Any, path: Path) -> None:
    opened = recording_of(reader.streams(path))
    for i in range(len(opened)):
        opened.frame(i)


def refused(reader: Any, path: Path, match: str) -> str:
    """One line that says what is wrong, when opened or when the first frame that is touched is read."""
    with pytest.raises(InputError, match=match) as caught:
        read_whole(reader, path)
    said = str(caught.value)
    assert "\n" not in said
    assert caught.value.remedy
    return said


# ScanNet


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


# HOI4D


@pytest.mark.parametrize("nested", [False, True])
def test_hoi4d_round_trip(recording: recon.Recording, T: Any, tmp_path: Path, nested: bool) -> None:
    clip = write.write_hoi4d(recording, tmp_path, nested=nested)
    write.write_hoi4d_annotations(tmp_path / "HOI4D_annotations" / write.CLIP, T, [])
    found = read(Hoi4dReader(), clip)
    assert_same(found, recording)
    assert_poses(found, T)
    np.testing.assert_allclose(found.times, np.arange(FRAMES) / 15)
    assert found.name == "ZY20210800001_H1_C4_N11_S1_s1_T1"
    assert found.warnings == ()


def test_hoi4d_log_is_camera_to_world_where_open3d_hands_back_the_inverse(T: Any, tmp_path: Path) -> None:
    import open3d as o3d

    from recon.readers.hoi4d import read_redwood_log

    folder = write.write_hoi4d_annotations(tmp_path, T, [])
    log = folder / "3Dseg" / "output.log"
    np.testing.assert_allclose(read_redwood_log(log), T, atol=1e-10)
    by_open3d = o3d.io.read_pinhole_camera_trajectory(str(log)).parameters
    np.testing.assert_allclose(np.linalg.inv(by_open3d[3].extrinsic), T[3], atol=1e-6)


def test_hoi4d_numbers_are_frames_also_where_some_are_missing(
    recording: recon.Recording, tmp_path: Path
) -> None:
    clip = write.write_hoi4d(recording, tmp_path)
    for name in ("align_rgb/00003.jpg", "align_depth/00005.png"):
        (clip / name).unlink()
    found = read(Hoi4dReader(), clip)
    np.testing.assert_allclose(found.times * 15, [0, 1, 2, 4, 6, 7, 8, 9, 10, 11])
    np.testing.assert_allclose(found.depth(4), recording.depth(6), atol=5e-4)
    assert found.warnings[0].endswith("1 of 11 colour images have no depth image in time")


def test_hoi4d_colour_from_the_video(
    recording: recon.Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Video:
        """The interface that the reader needs."""

        width, height = recording.intrinsics.width, recording.intrinsics.height
        times = 0.2 + np.arange(FRAMES) / 15

        def __init__(self, path: Path) -> None:
            assert path.name == "image.mp4"

        def read(self, index: int) -> Any:
            return recording.color(index)

    module = types.ModuleType("recon.readers.video")
    module.Video = Video  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "recon.readers.video", module)
    clip = write.write_hoi4d(recording, tmp_path)
    shutil.rmtree(clip / "align_rgb")
    (clip / "align_rgb").mkdir()
    (clip / "align_rgb" / "image.mp4").write_bytes(b"video")
    assert_same(read(Hoi4dReader(), clip), recording, color=0.0)


def test_hoi4d_refusals(recording: recon.Recording, T: Any, tmp_path: Path) -> None:
    def clip(name: str) -> Path:
        return write.write_hoi4d(recording, tmp_path / name)

    packed = clip("packed")
    shutil.rmtree(packed / "align_depth")
    (packed / "align_depth").mkdir()
    (packed / "align_depth" / "depth_video.avi").write_bytes(b"RIFF")
    assert "utils/decode.py" in refused(Hoi4dReader(), packed, "depth packed as video")
    alone = clip("alone")
    shutil.rmtree(tmp_path / "alone" / "camera_params")
    refused(Hoi4dReader(), alone, "no camera_params/ZY20210800001/intrin.npy")
    K = tmp_path / "other" / "camera_params" / "ZY20210800001" / "intrin.npy"
    other = clip("other")
    np.save(K, np.array([[1060.0, 0, 971.0], [0, 1061.0, 523.0], [0, 0, 1]]))
    refused(Hoi4dReader(), other, "principal point .* outside the 96x72 image")
    np.save(K, np.array([{}], dtype=object), allow_pickle=True)
    refused(Hoi4dReader(), other, "pickled objects")
    np.save(K, np.eye(4))
    refused(Hoi4dReader(), other, r"shape \(4, 4\), not \(3, 3\)")
    turned = clip("turned")
    (turned / "align_depth" / "00000.png").write_bytes(write.png(np.full((50, 96), 900, np.uint16)))
    refused(Hoi4dReader(), turned, "is 96x50, colour 96x72")
    log = write.write_hoi4d_annotations(clip("log"), T, []) / "3Dseg" / "output.log"
    text = log.read_text()
    log.write_text(text[: len(text) // 2])
    refused(Hoi4dReader(), log.parents[1], "begins no pose")


# Arti4D


@pytest.mark.parametrize("slam", [False, True])
def test_arti4d_round_trip(recording: recon.Recording, T: Any, tmp_path: Path, slam: bool) -> None:
    found = read(Arti4dReader(), write.write_arti4d(recording, tmp_path, T, slam=slam))
    assert_same(found, recording)
    assert_poses(found, T)
    np.testing.assert_allclose(found.times - found.times[0], recording.times - recording.times[0], atol=1e-6)
    assert abs(found.times[0] - write.FIRST_NS * 1e-9) < 1e-6
    assert found.warnings == ()


def test_arti4d_tracker_without_calibration_gives_no_poses(
    recording: recon.Recording, T: Any, tmp_path: Path
) -> None:
    scene = write.write_arti4d(recording, tmp_path, T, D=[0.4, -2.6, 0, 0, 1.5, 0.3, -2.4, 1.4])
    shutil.rmtree(tmp_path / "meta")
    found = read(Arti4dReader(), scene)
    assert found.poses is None
    assert "there is no azure_tf.json" in " ".join(found.warnings)
    assert sum("distortion in" in w for w in found.warnings) == 2


def test_arti4d_poses_are_the_nearest_in_time_in_seconds_or_nanoseconds(
    recording: recon.Recording, T: Any, tmp_path: Path
) -> None:
    scene = write.write_arti4d(recording, tmp_path, T)
    file = scene / "odom" / f"{write.SCENE}.csv"
    head, *rows = file.read_text().splitlines()
    inside = [r.replace(",", ",", 1) for r in rows]
    nanoseconds = [f"{round(float(r.split(',')[0]) * 1e9)},{r.split(',', 1)[1]}" for r in inside]
    file.write_text("\n".join([head, *nanoseconds[::-1]]))  # in any order
    assert_poses(read(Arti4dReader(), scene), T)
    file.write_text("\n".join([head, *rows[:3], *rows[6:]]))
    assert_poses(read(Arti4dReader(), scene), T, [0, 1, 2, 6, 7, 8, 9, 10, 11])


def test_what_lies_above_the_folder_counts_in_the_fingerprint(
    recording: recon.Recording, T: Any, tmp_path: Path
) -> None:
    scene = write.write_arti4d(recording, tmp_path / "a", T)
    clip = write.write_hoi4d(recording, tmp_path / "h")
    for reader, path, file in (
        (Arti4dReader(), scene, tmp_path / "a" / "meta" / "calibration" / "azure_tf.json"),
        (Hoi4dReader(), clip, tmp_path / "h" / "camera_params" / "ZY20210800001" / "intrin.npy"),
    ):
        first = reader.streams(path).fingerprint
        file.write_bytes(file.read_bytes().replace(b"0.0018", b"0.0019").replace(bytes(np.float64(80.0)), bytes(np.float64(81.0))))  # fmt: skip
        assert reader.streams(path).fingerprint != first


def test_arti4d_refusals(recording: recon.Recording, T: Any, tmp_path: Path) -> None:
    def scene(name: str) -> Path:
        return write.write_arti4d(recording, tmp_path / name, T)

    counts = scene("counts")
    next((counts / "depth").glob("*.png")).unlink()
    refused(Arti4dReader(), counts, "12 colour and 11 depth images")
    other = scene("other")
    info = other / "rgb" / "camera_info.txt"
    info.write_text(info.read_text().replace("width: 96", "width: 1280"))
    refused(Arti4dReader(), other, "is of 1280x72 images")
    info.write_text("K: (1, 2, three)")
    refused(Arti4dReader(), other, "has no line K")
    named = scene("named")
    first = next((named / "rgb").glob("*.jpg"))
    first.rename(first.with_name("rgb_image_first.jpg"))
    refused(Arti4dReader(), named, "has no time in its name")
    columns = scene("columns")
    odom = columns / "odom" / f"{write.SCENE}.csv"
    text = odom.read_text()
    odom.write_text(text.replace("qw", "w"))
    refused(Arti4dReader(), columns, "lacks qw")
    odom.write_text(text.replace(text.splitlines()[2], "1,2,3"))
    refused(Arti4dReader(), columns, "row 3 is")
    (tmp_path / "columns" / "meta" / "calibration" / "azure_tf.json").write_text(
        '{"base_T_depth": {"rotation": [1]}}'
    )
    odom.write_text(text)
    refused(Arti4dReader(), columns, "holds no rotation x y z w")


# iTACO


@pytest.mark.parametrize("kind", ["rendered", "real"])
def test_itaco_round_trip(recording: recon.Recording, T: Any, tmp_path: Path, kind: str) -> None:
    written = write.write_itaco_rendered if kind == "rendered" else write.write_itaco_real
    found = read(ItacoReader(), written(recording, tmp_path, T))
    assert_same(found, recording, depth=1e-6)
    assert_poses(found, T)
    assert found.gravity_camera0 is not None
    np.testing.assert_allclose(found.gravity_camera0, -T[0, 2, :3], atol=1e-6)
    np.testing.assert_allclose(np.diff(found.times), 1 / (30 if kind == "rendered" else 15))
    assert len(found.warnings) == (1 if kind == "rendered" else 0)


def test_itaco_depth_in_opengls_direction_and_unknown_values(
    recording: recon.Recording, tmp_path: Path
) -> None:
    view = write.write_itaco_rendered(recording, tmp_path)
    depth = recording.depth(0).copy()
    depth[0, :3] = [np.nan, np.inf, -1.0]
    np.savez(view / "depth" / "000000.npz", a=depth)
    assert read(ItacoReader(), view).depth(0)[0, :3].tolist() == [0.0, 0.0, 0.0]
    np.savez(view / "depth" / "000003.npz", a=-depth)
    np.savez(view / "depth" / "000004.npz", a=-np.abs(recording.depth(0)))
    refused(ItacoReader(), view, "no positive depth")


def test_itaco_refusals(recording: recon.Recording, tmp_path: Path) -> None:
    view = write.write_itaco_rendered(recording, tmp_path / "sim")
    np.savez(view / "depth" / "000000.npz", b=recording.depth(0))
    refused(ItacoReader(), view, "has no array 'a'")
    np.savez(view / "depth" / "000000.npz", a=np.array([{}], dtype=object))
    refused(ItacoReader(), view, "pickled objects")
    np.savez(view / "depth" / "000000.npz", a=recording.depth(0))
    (view / "intrinsics.npy").unlink()
    np.save(view / "camera_pose.npy", np.zeros((12, 7)))
    refused(ItacoReader(), view, r"no intrinsics\.npy")
    clip = write.write_itaco_real(recording, tmp_path / "real")
    meta = json.loads((clip / "metadata.json").read_text())
    for change, match in (
        ({"K": [1, 2]}, "K is no table"),
        ({"w": 720, "h": 960}, "says 720x960, 0.jpg is 96x72"),
        ({"w": "wide"}, "says widex72"),
        ({"K": None}, "has no K"),
    ):
        (clip / "metadata.json").write_text(json.dumps(meta | change))
        refused(ItacoReader(), clip, match)


def test_arrays_are_bounded_before_they_are_read(tmp_path: Path) -> None:
    header = b"\x93NUMPY\x01\x00" + struct.pack("<H", 118)
    text = "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 1000000000000), }"
    huge = header + text.ljust(117).encode() + b"\n" + bytes(64)
    (tmp_path / "a.npy").write_bytes(huge)
    with pytest.raises(InputError, match="at most 268435456 bytes"):
        read_npy(tmp_path / "a.npy")
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", huge)
    with pytest.raises(InputError, match="at most 268435456 bytes"):
        read_npz(tmp_path / "a.npz", "a")
    np.save(tmp_path / "b.npy", np.arange(6.0).reshape(2, 3))
    assert read_npy(tmp_path / "b.npy").tolist() == [[0, 1, 2], [3, 4, 5]]
    np.save(tmp_path / "c.npy", np.asfortranarray(np.arange(6.0).reshape(2, 3)))
    assert read_npy(tmp_path / "c.npy").tolist() == [[0, 1, 2], [3, 4, 5]]
    data = (tmp_path / "b.npy").read_bytes()
    (tmp_path / "b.npy").write_bytes(data[:-8])
    with pytest.raises(InputError, match="truncated: 40 of 48 bytes"):
        read_npy(tmp_path / "b.npy")


# BundleSDF


def test_bundlesdf_round_trip(recording: recon.Recording, tmp_path: Path) -> None:
    found = read(BundleSdfReader(), write.write_bundlesdf(recording, tmp_path / "milk"))
    assert_same(found, recording, color=0.0)
    assert found.warnings == ("milk tells no times; taken to be recorded at 30 frames a second",)
    np.testing.assert_allclose(np.diff(found.times), 1 / 30)
    assert found.poses is None


def test_bundlesdf_recurring_troubles(recording: recon.Recording, tmp_path: Path) -> None:
    reader = BundleSdfReader()

    def folder(name: str) -> Path:
        return write.write_bundlesdf(recording, tmp_path / name)

    eight = folder("eight")
    first = sorted((eight / "depth").iterdir())[0].name
    (eight / "depth" / first).write_bytes(write.png(np.full((72, 96), 200, np.uint8)))
    refused(reader, eight, "8-bit")
    colourful = folder("colourful")
    (colourful / "masks" / first).write_bytes(write.png(np.zeros((72, 96, 3), np.uint8)))
    assert f"masks/{first} has 3 channels" in read(reader, colourful).warnings[1]
    fewer = folder("fewer")
    (fewer / "masks" / first).unlink()
    assert "masks/ holds 11 masks for 12 images" in read(reader, fewer).warnings[1]
    lost = folder("lost")
    (lost / "cam_K.txt").unlink()
    assert "fx 0 cx" in refused(reader, lost, r"no cam_K\.txt")
    (lost / "cam_K.txt").write_text("320 0 320\n0 320 240\n0 0 1\n")
    refused(reader, lost, "principal point .* outside the 96x72")
    (lost / "cam_K.txt").write_text("40 0 20\n0 40 15\n0 0 1\n")
    assert "of another resolution?" in read(reader, lost).warnings[1]
    (lost / "cam_K.txt").write_text("80 0 0\n0 80 0\n47.5 35.5 1\n")
    refused(reader, lost, "K transposed")
    (lost / "cam_K.txt").write_text("80 0 47.5\n0 80\n")
    refused(reader, lost, "has 2 numbers, not 3")
    unequal = folder("unequal")
    (unequal / "depth" / first).unlink()
    refused(reader, unequal, "12 images in rgb/ and 11 in depth/; rgb/1000000 has none in depth/")


# All


WRITERS: dict[str, tuple[Any, Callable[[recon.Recording, Path, Any], Path]]] = {
    "scannet": (ScanNetReader(), lambda r, out, T: write.write_scannet(r, out / "a.sens", T)),
    "hoi4d": (Hoi4dReader(), lambda r, out, T: write.write_hoi4d_annotations(write.write_hoi4d(r, out), T, [])),
    "arti4d": (Arti4dReader(), write.write_arti4d),
    "itaco": (ItacoReader(), write.write_itaco_rendered),
    "itaco real": (ItacoReader(), write.write_itaco_real),
    "bundlesdf": (BundleSdfReader(), lambda r, out, _: write.write_bundlesdf(r, out / "milk")),
}  # fmt: skip


@pytest.mark.parametrize("name", WRITERS)
def test_flipped_bytes_give_one_line_or_a_recording(
    recording: recon.Recording, T: Any, tmp_path: Path, name: str
) -> None:
    reader, writer = WRITERS[name]
    path = writer(recording, tmp_path, T)
    every = sorted(p for p in tmp_path.rglob("*") if p.is_file())
    small = [
        p
        for p in every
        if not any(c.isdigit() for c in p.stem) or p.suffix in (".csv", ".sens", ".npy", ".log")
    ]
    rng = np.random.default_rng(0)
    for k in range(200):
        file = (
            (small or every)[int(rng.integers(len(small or every)))]
            if k % 4
            else every[int(rng.integers(len(every)))]
        )
        data = file.read_bytes()
        broken = bytearray(data)
        end = min(len(data), 2000) if k % 2 else len(data)
        for at in rng.integers(0, end, int(rng.integers(1, 4))):
            broken[at] = int(rng.integers(256))
        file.write_bytes(bytes(broken) if k % 10 else bytes(broken[: len(broken) // 2]))
        said = ""
        try:
            assert isinstance(reader.recognises(path), bool)
            opened = recording_of(reader.streams(path))
            for i in (0, len(opened) - 1):
                opened.frame(i)
        except (InputError, MissingDependencyError) as error:
            said = str(error)
        finally:
            file.write_bytes(data)
        assert "\n" not in said


@pytest.mark.parametrize("name", WRITERS)
def test_nothing_is_written_and_the_fingerprint_follows_the_bytes(
    recording: recon.Recording, T: Any, tmp_path: Path, name: str
) -> None:
    reader, writer = WRITERS[name]
    path = writer(recording, tmp_path, T)
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    first = reader.streams(path)
    recording_of(first).frame(0)
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before
    again = path.parent / "again" if path.is_dir() else path.with_name("again.sens")
    path.rename(again)
    if name != "hoi4d" and name != "arti4d":  # whose names tell them
        assert reader.streams(again).fingerprint == first.fingerprint
    again.rename(path)
    picture = path if path.is_file() else next(p for p in sorted(path.rglob("*")) if "depth" in p.parent.name)
    data = bytearray(picture.read_bytes())
    data[-20] ^= 1
    picture.write_bytes(bytes(data))
    try:
        changed = reader.streams(path).fingerprint
    except FuntwinError:
        return
    assert changed != first.fingerprint


def test_a_picture_that_is_no_picture(recording: recon.Recording, tmp_path: Path) -> None:
    clip = write.write_bundlesdf(recording, tmp_path / "milk")
    first = sorted((clip / "depth").iterdir())[0]
    for data, match in ((b"", "0 bytes|is empty"), (b"text", "no PNG")):
        first.write_bytes(data)
        refused(BundleSdfReader(), clip, match)
    cv2.imwrite(str(first), np.full((72, 90), 900, np.uint16))
    refused(BundleSdfReader(), clip, "depth 0 is 90x72")

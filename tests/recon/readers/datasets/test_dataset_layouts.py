"""Arti4D's, iTACO's and BundleSDF's layouts, and laws of all: what is written is read again; what is wrong is
told in one line."""

from __future__ import annotations

import json
import shutil
import struct
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
from tests.makers.recon.clips import assert_poses, assert_same, read, refused
from twin.errors import FuntwinError, InputError, MissingDependencyError

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

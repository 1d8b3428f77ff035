"""Record3D's EXR export, Polycam, 3D Scanner App and ARKitScenes: what each writes comes back, and what is
refused."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import recon
from benchmarks.layouts.phones import (
    write_arkit_scenes,
    write_record3d_exr,
    write_scanner_app,
)
from recon.readers.arkit import KEY_FRAMES_ONLY
from recon.readers.polycam import PolycamReader
from recon.readers.record3d_exr import Record3DExrReader
from recon.readers.streams import recording_of
from recon.recording import Intrinsics, Recording
from tests.makers.recon.phone_recording import (
    HOLE,
    LAYOUTS,
    SIZE,
    opened,
    phone_recording,
    same_pictures,
    written_layouts,
)
from tests.makers.recon.tiny import FRAMES
from twin.errors import InputError, MissingDependencyError
from twin.scene import Trajectory

WITH_CONFIDENCE = ("polycam", "scanner_app", "arkit_scenes")


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> recon.Recording:
    return phone_recording(tmp_path_factory.mktemp("phones") / "tiny")


@pytest.fixture(scope="module")
def written(original: recon.Recording, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return written_layouts(original, tmp_path_factory.mktemp("written"))


@pytest.fixture
def copied(written: dict[str, Path], tmp_path: Path) -> Callable[[str], Path]:
    return lambda layout: Path(shutil.copytree(written[layout], tmp_path / layout))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_it_comes_back(original: recon.Recording, written: dict[str, Path], layout: str) -> None:
    found = opened(layout, written[layout])
    assert len(found) == FRAMES
    assert found.name == layout
    np.testing.assert_allclose(found.times, original.times, atol=6e-4)  # ARKitScenes names files by ms
    k, of = found.intrinsics, original.intrinsics
    assert (k.width, k.height) == (of.width, of.height)
    np.testing.assert_allclose(k.vector, of.vector, atol=1e-9)
    same_pictures(found, original, {k: k for k in (0, 1, 14, 29)})
    for frame in (0, 14):
        bound = 1e-3 if layout == "record3d_exr" else 6e-4  # m; a half float between 1 and 2 is within 0.5 mm
        np.testing.assert_allclose(found.depth(frame), original.depth(frame), atol=bound)
        assert not found.depth(frame)[HOLE].any()
        assert found.depth(frame)[-1].all()  # medium confidence is kept


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_world_is_z_up_and_poses_have_the_cameras_axes(
    original: recon.Recording, written: dict[str, Path], layout: str
) -> None:
    found = opened(layout, written[layout])
    assert found.poses is not None
    assert original.poses is not None
    np.testing.assert_allclose(found.poses.T_world_cam, original.poses.T_world_cam, atol=1e-7)
    down = original.poses.T_world_cam[0, :3, :3].T @ [0, 0, -1]
    assert found.gravity_camera0 is not None
    np.testing.assert_allclose(found.gravity_camera0, down, atol=1e-7)


@pytest.mark.parametrize("layout", ["record3d_exr", "polycam", "scanner_app", "r3d"])
def test_depth_of_its_own_size_is_of_the_same_lens(
    original: recon.Recording, tmp_path: Path, layout: str
) -> None:
    reader, write = LAYOUTS[layout]
    folder = write(original, tmp_path / "small.r3d", (48, 36))
    rig = reader.streams(folder).rig
    k = rig.depth.camera
    assert (k.width, k.height, k.fx, k.fy, k.cx, k.cy) == (48, 36, 40.0, 40.0, 23.5, 17.5)
    assert rig.color.camera == original.intrinsics
    np.testing.assert_array_equal(rig.T_color_depth, np.eye(4))
    depth, expected = recording_of(reader.streams(folder)).depth(3), original.depth(3)
    both = (depth > 0) & (expected > 0)
    assert both.mean() > 0.9
    assert np.median(np.abs(depth - expected)[both]) < 0.004  # m, half a depth pixel of slanted surfaces


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_picture_held_upright_comes_back(original: recon.Recording, tmp_path: Path, layout: str) -> None:
    reader, write = LAYOUTS[layout]
    upright = turned(original)
    found = recording_of(reader.streams(write(upright, tmp_path / "upright.r3d", (72, 96))))
    assert (found.intrinsics.width, found.intrinsics.height) == (72, 96)
    np.testing.assert_allclose(found.intrinsics.vector, upright.intrinsics.vector)
    np.testing.assert_allclose(found.depth(9), upright.depth(9), atol=1e-3)
    assert found.poses is not None
    assert upright.poses is not None
    np.testing.assert_allclose(found.poses.T_world_cam, upright.poses.T_world_cam, atol=1e-7)
    assert found.gravity_camera0 is not None
    # the same way in the world, though the picture is turned
    np.testing.assert_allclose(
        found.poses.T_world_cam[0, :3, :3] @ found.gravity_camera0, [0, 0, -1], atol=1e-7
    )


def turned(recording: recon.Recording) -> Recording:
    """A recording with the camera turned by a quarter about its view: its x is the old -y, its y the old
    x."""
    k = recording.intrinsics
    assert recording.poses is not None
    T_old_new = np.array([[0.0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    poses = recording.poses
    return replace(
        recording,
        intrinsics=Intrinsics(k.height, k.width, k.fy, k.fx, k.height - 1 - k.cy, k.cx),
        read_color=lambda i: np.ascontiguousarray(np.rot90(recording.color(i), -1)),
        read_depth=lambda i: np.ascontiguousarray(np.rot90(recording.depth(i), -1)),
        poses=Trajectory(poses.frames, poses.times, poses.T_world_cam @ T_old_new),
    )


def test_record3d_pictures_are_found_by_their_number(original: recon.Recording, tmp_path: Path) -> None:
    folder = write_record3d_exr(original, tmp_path / "gaps", SIZE, missing=(0, 4, 5), suffix=".png")
    found = opened("record3d_exr", folder)
    kept = [k for k in range(FRAMES) if k not in (0, 4, 5)]
    np.testing.assert_allclose(found.times, original.times[kept])
    assert found.poses is not None
    assert original.poses is not None
    np.testing.assert_allclose(found.poses.T_world_cam, original.poses.T_world_cam[kept], atol=1e-9)
    np.testing.assert_array_equal(found.color(3), original.color(6))  # 11 comes after 2, and 6 after 3
    np.testing.assert_array_equal(found.color(10), original.color(13))
    (folder / "EXR_RGBD" / "depth" / "8.exr").unlink()
    found = opened("record3d_exr", folder)
    assert len(found) == FRAMES - 4
    np.testing.assert_array_equal(found.color(4), original.color(7))
    np.testing.assert_array_equal(found.color(5), original.color(9))
    np.testing.assert_allclose(found.depth(5), original.depth(9), atol=1e-3)


def test_record3d_without_stamps_counts_by_number(original: recon.Recording, tmp_path: Path) -> None:
    folder = write_record3d_exr(original, tmp_path / "rate", SIZE, missing=(2,), stamps=False)
    numbers = np.array([k for k in range(FRAMES) if k != 2])
    np.testing.assert_allclose(opened("record3d_exr", folder).times, numbers / 60)
    inside = recording_of(Record3DExrReader().streams(folder / "EXR_RGBD"))
    assert inside.name == "rate"
    assert inside.fingerprint == opened("record3d_exr", folder).fingerprint


def test_record3d_depth_that_is_not_finite_is_unknown(copied: Callable[[str], Path]) -> None:
    import OpenEXR

    folder = copied("record3d_exr")
    metres = np.full((72, 96), 1.5, np.float16)
    metres[0, :4] = [np.nan, np.inf, -np.inf, -1.0]
    file = str(folder / "EXR_RGBD" / "depth" / "0.exr")
    OpenEXR.File({}, {"R": metres}).write(file)
    depth = opened("record3d_exr", folder).depth(0)
    assert depth[0, :5].tolist() == [0, 0, 0, 0, 1.5]
    OpenEXR.File({}, {"R": metres, "G": metres}).write(file)
    with pytest.raises(InputError, match="has the channels G, R, depth has one"):
        opened("record3d_exr", folder).depth(0)
    OpenEXR.File({}, {"R": metres[:60]}).write(str(folder / "EXR_RGBD" / "depth" / "3.exr"))
    with pytest.raises(InputError, match=r"3\.exr is 96x60, the first one 96x72"):
        opened("record3d_exr", folder).depth(3)


def test_record3d_tells_what_to_install(
    copied: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = copied("record3d_exr")
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    assert Record3DExrReader().recognises(folder)
    with pytest.raises(
        MissingDependencyError,
        match="EXR image and the decoder is not installed; install the package OpenEXR",
    ):
        Record3DExrReader().streams(folder)


def test_polycam_takes_the_corrected_set_or_the_other_one(
    original: recon.Recording, copied: Callable[[str], Path]
) -> None:
    folder = copied("polycam") / "keyframes"
    assert original.poses is not None

    def beside() -> float:
        poses = opened("polycam", folder.parent).poses
        assert poses is not None
        return float((poses.T_world_cam - original.poses.T_world_cam)[:, 0, 3].mean())  # type: ignore[union-attr]

    assert beside() == pytest.approx(0, abs=1e-9)
    name = sorted(p.stem for p in (folder / "images").iterdir())[5]
    (folder / "corrected_cameras" / f"{name}.json").unlink()
    found = opened("polycam", folder.parent)
    assert len(found) == FRAMES - 1
    assert any(
        "1 key frames are not in both corrected_images and corrected_cameras" in w for w in found.warnings
    )
    shutil.rmtree(folder / "corrected_cameras")
    assert beside() == pytest.approx(0.05, abs=1e-9)  # never one set's images with the other's cameras
    assert not opened("polycam", folder.parent).color(0).any()
    assert len(recording_of(PolycamReader().streams(folder))) == FRAMES


@pytest.mark.parametrize("layout", ["polycam", "scanner_app"])
def test_key_frames_are_told(written: dict[str, Path], layout: str) -> None:
    assert opened(layout, written[layout]).warnings == (f"{layout}: {KEY_FRAMES_ONLY}",)


def test_scanner_app_frames_without_a_picture_are_left_out(original: recon.Recording, tmp_path: Path) -> None:
    folder = write_scanner_app(original, tmp_path / "scan", SIZE, every=2)
    found = opened("scanner_app", folder)
    np.testing.assert_allclose(found.times, original.times[::2])
    same_pictures(found, original, {0: 0, 6: 12, 14: 28})
    np.testing.assert_allclose(found.depth(6), original.depth(12), atol=6e-4)
    (folder / "depth_00012.png").unlink()
    found = opened("scanner_app", folder)
    assert len(found) == 14  # not paired with its neighbours' depth
    np.testing.assert_allclose(found.depth(6), original.depth(14), atol=6e-4)


def test_arkit_scenes_is_found_in_its_frames_folder(original: recon.Recording, tmp_path: Path) -> None:
    found = opened("arkit_scenes", write_arkit_scenes(original, tmp_path / "47333462", SIZE, nested=True))
    np.testing.assert_allclose(found.depth(3), original.depth(3), atol=6e-4)
    assert found.warnings == ()


def test_arkit_scenes_without_poses(copied: Callable[[str], Path]) -> None:
    folder = copied("arkit_scenes")
    expected = opened("arkit_scenes", folder)
    (folder / "lowres_wide.traj").unlink()
    found = opened("arkit_scenes", folder)
    assert found.poses is None
    assert found.gravity_camera0 is None
    assert found.fingerprint != expected.fingerprint


@pytest.mark.parametrize("layout", ["polycam", "scanner_app", "arkit_scenes"])
def test_a_lens_that_moves_is_told(copied: Callable[[str], Path], layout: str) -> None:
    folder = copied(layout)
    for change, warned in ((0.3, False), (3.2, True)):
        for file in sorted(CAMERAS[layout](folder))[:4]:
            text = file.read_text()
            if layout == "polycam":
                text = json.dumps({**json.loads(text), "fx": 80 + change})
            elif layout == "scanner_app":
                data = json.loads(text)
                data["intrinsics"][0] = 80 + change
                text = json.dumps(data)
            else:
                text = f"96 72 {80 + change} 80 47.5 35.5"
            file.write_text(text)
        found = opened(layout, folder)
        assert found.intrinsics.fx == 80.0
        assert any("change by 4.0% of the focal length" in w for w in found.warnings) == warned


CAMERAS: dict[str, Callable[[Path], Any]] = {
    "polycam": lambda f: (f / "keyframes" / "corrected_cameras").iterdir(),
    "scanner_app": lambda f: f.glob("frame_*.json"),
    "arkit_scenes": lambda f: (f / "lowres_wide_intrinsics").iterdir(),
}


@pytest.mark.parametrize("layout", WITH_CONFIDENCE)
def test_without_confidence_all_depth_is_kept(copied: Callable[[str], Path], layout: str) -> None:
    folder = copied(layout)
    for file in [*folder.rglob("confidence/*.png"), *folder.glob("conf_*.png")]:
        file.unlink()
    assert np.all(opened(layout, folder).depth(2)[HOLE] == 3.0)


def test_folders_of_other_layouts_are_not_taken(written: dict[str, Path], tmp_path: Path) -> None:
    for layout, (reader, _) in LAYOUTS.items():
        assert [k for k, path in written.items() if reader.recognises(path)] == [layout]
        assert not reader.recognises(tmp_path)
        assert not reader.recognises(Path(__file__))

"""Reading recordings: units, axes, clocks and grids are right at the door, whatever the layout."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recon.readers import READERS, open_recording
from recon.readers.streams import associate
from recon.readers.tum import PUBLISHED_INTRINSICS
from recon.recording import Intrinsics
from tests.makers.recon.tiny import (
    FRAMES,
    HEIGHT,
    WIDTH,
    cameras,
    read_image,
    write_intrinsics,
    write_poses,
    write_recording,
)
from twin.errors import InputError


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("readers") / "tiny")


@pytest.fixture
def native(original: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(original, tmp_path / "tiny"))


def test_native_reads_colour_as_rgb_and_depth_in_metres(native: Path) -> None:
    red = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    red[..., 2] = 255  # OpenCV writes BGR
    cv2.imwrite(str(native / "color" / "000003.jpg"), red)
    recording = open_recording(native)
    frame = recording.frame(3)
    assert frame.color.shape == (HEIGHT, WIDTH, 3)
    assert frame.color.dtype == np.uint8
    assert frame.color[..., 0].min() > 250
    assert frame.color[..., 1:].max() < 5
    stored = read_image(native / "depth" / "000003.png")
    assert frame.depth.dtype == np.float32
    np.testing.assert_allclose(frame.depth, stored / 1000.0, rtol=1e-6)
    assert len(recording) == FRAMES
    assert recording.times[1] - recording.times[0] == pytest.approx(1 / 15, abs=1e-6)
    assert recording.warnings == ()
    assert recording.poses is None
    assert recording.gravity_camera0 is None


@pytest.mark.parametrize("name", ["rgb", "image"])
def test_native_knows_open3d_names_and_sorts_numbers(native: Path, name: str) -> None:
    (native / "color").rename(native / name)
    for folder in (native / name, native / "depth"):
        for file in folder.iterdir():
            file.rename(folder / f"frame-{int(file.stem)}{file.suffix}")
    first = read_image(native / "depth" / "frame-2.png")
    np.testing.assert_allclose(open_recording(native).frame(2).depth, first / 1000.0, rtol=1e-6)


def test_frames_are_read_when_asked_for(native: Path) -> None:
    recording = open_recording(native)
    shutil.rmtree(native / "color")
    with pytest.raises(InputError, match=r"000005\.jpg can't be read"):
        recording.frame(5)
    with pytest.raises(InputError, match=r"frames 0\.\.29, not 30"):
        recording.frame(30)


@pytest.mark.parametrize("lost", ["color", "depth"])
def test_colour_and_depth_are_decoded_apart(native: Path, lost: str) -> None:
    recording = open_recording(native)
    expected = recording.frame(5)
    shutil.rmtree(native / lost)
    kept = "depth" if lost == "color" else "color"
    np.testing.assert_array_equal(getattr(recording, kept)(5), getattr(expected, kept))
    with pytest.raises(InputError, match=r"000005\.\w+ can't be read"):
        getattr(recording, lost)(5)


def test_native_without_time_stamps_warns_and_assumes_15_per_second(native: Path) -> None:
    (native / "timestamps.txt").unlink()
    recording = open_recording(native)
    np.testing.assert_allclose(recording.times, np.arange(FRAMES) / 15.0)
    assert "15 frames per second" in recording.warnings[0]


def test_native_poses_are_matched_by_time(native: Path) -> None:
    T = cameras(FRAMES)
    keep = np.array([k for k in range(FRAMES) if k not in (4, 5, 20)])
    times = 5.0 + keep / 15.0
    write_poses(native / "trajectory.txt", times + 0.004, T[keep])
    poses = open_recording(native).poses
    assert poses is not None
    assert poses.frames.tolist() == keep.tolist()
    np.testing.assert_allclose(poses.T_world_cam, T[keep], atol=1e-9)
    np.testing.assert_allclose(poses.times, times, atol=1e-5)


def test_native_metadata_gives_gravity_and_description(native: Path) -> None:
    (native / "metadata.json").write_text(
        json.dumps({"gravity_camera0": [0, 0.8, 0.6], "description": "open it"})
    )
    recording = open_recording(native)
    assert recording.gravity_camera0 is not None
    np.testing.assert_allclose(recording.gravity_camera0, [0, 0.8, 0.6])
    assert recording.metadata["description"] == "open it"


def test_smaller_depth_is_brought_to_the_colour_grid(native: Path) -> None:
    small = Intrinsics(40, 30, 36.0, 36.0, 19.0, 15.0)
    write_intrinsics(native / "depth_intrinsic.json", 40, 30, 36.0)
    data = json.loads((native / "depth_intrinsic.json").read_text())
    data["intrinsic_matrix"][6:8] = [19.0, 15.0]
    (native / "depth_intrinsic.json").write_text(json.dumps(data))
    y, x = np.mgrid[0:30, 0:40]
    rays = np.stack([(x - small.cx) / small.fx, (y - small.cy) / small.fy, np.ones(x.shape)], -1)
    plane = 1.5 / (rays @ np.array([0.2, -0.1, 1.0]))  # depth of the plane 0.2 x - 0.1 y + z = 1.5
    for file in (native / "depth").iterdir():
        cv2.imwrite(str(file), np.rint(plane * 1000).astype(np.uint16))
    recording = open_recording(native)
    depth = recording.frame(0).depth.astype(np.float64)
    assert depth.shape == (HEIGHT, WIDTH)
    v, u = np.nonzero(depth)
    points = recording.intrinsics.backproject(np.stack([u, v], -1).astype(float), depth[v, u])
    off = points @ np.array([0.2, -0.1, 1.0]) - 1.5
    assert len(points) > 0.8 * depth.size
    assert np.abs(off).max() < 1e-3  # between the depth pixels of a plane lies the plane
    assert abs(off.mean()) < 1e-4


def test_fingerprint_is_of_the_content_alone(native: Path, tmp_path: Path) -> None:
    one = open_recording(native).fingerprint
    copy = Path(shutil.copytree(native, tmp_path / "elsewhere", copy_function=shutil.copyfile))
    shutil.rmtree(copy / "truth")
    assert open_recording(copy).fingerprint == one
    with (copy / "timestamps.txt").open("a") as file:
        file.write("\n")
    assert open_recording(copy).fingerprint != one


def tum_folder(folder: Path, native: Path, delay: float = 0.007) -> Path:
    """The recording as TUM RGB-D, its depth images `delay` later, and a mocap at 100 Hz for the first
    second."""
    (folder / "rgb").mkdir(parents=True)
    (folder / "depth").mkdir()
    lists: dict[str, list[str]] = {"rgb": ["# colour"], "depth": ["# depth"]}
    for k in range(FRAMES):
        t = 100 + k / 30
        image = read_image(native / "color" / f"{k:06d}.jpg")
        cv2.imwrite(str(folder / "rgb" / f"{t:.6f}.png"), image)
        lists["rgb"].append(f"{t:.6f} rgb/{t:.6f}.png")
        if k != 12:
            depth = read_image(native / "depth" / f"{k:06d}.png")
            cv2.imwrite(str(folder / "depth" / f"{t + delay:.6f}.png"), depth * 5)
            lists["depth"].append(f"{t + delay:.6f} depth/{t + delay:.6f}.png")
    for name, lines in lists.items():
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")
    write_poses(folder / "groundtruth.txt", 99.99 + np.arange(60) / 100, cameras(60))
    return folder


def test_tum_pairs_by_time_and_divides_by_5000(native: Path, tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "mine", native)
    write_intrinsics(folder / "intrinsic.json", WIDTH, HEIGHT, 80.0)
    recording = open_recording(folder)
    assert len(recording) == FRAMES - 1
    assert "1 of 30" in recording.warnings[0]
    stored = read_image(native / "depth" / "000013.png")
    np.testing.assert_allclose(recording.frame(12).depth, stored / 1000.0, rtol=1e-6)
    assert recording.times[12] == pytest.approx(100 + 13 / 30, abs=1e-6)
    assert recording.poses is not None
    k = recording.poses.frames.tolist().index(12)
    nearest = round((recording.times[12] - 99.99) * 100)
    np.testing.assert_allclose(recording.poses.T_world_cam[k], cameras(60)[nearest], atol=1e-9)
    assert recording.poses.times[-1] < 100.61  # no pose is made up after the mocap's end


def test_tum_uses_published_intrinsics_by_name_or_asks_for_them(native: Path, tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "rgbd_dataset_freiburg3_cabinet", native)
    with pytest.raises(InputError, match="96x72, the intrinsics are of 640x480"):
        open_recording(folder)
    for file in [*(folder / "rgb").iterdir(), *(folder / "depth").iterdir()]:
        image = read_image(file)
        cv2.imwrite(str(file), cv2.resize(image, (640, 480), interpolation=cv2.INTER_NEAREST))
    assert open_recording(folder).intrinsics == PUBLISHED_INTRINSICS["freiburg3"]
    folder = folder.rename(tmp_path / "cabinet")
    with pytest.raises(InputError, match=r"no intrinsic\.json"):
        open_recording(folder)


def test_tum_names_the_line_of_a_missing_image(native: Path, tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "mine", native)
    (folder / "rgb" / "100.100000.png").unlink()
    with pytest.raises(InputError, match=r"100\.100000\.png, line 5 of rgb\.txt, is missing"):
        open_recording(folder)
    with (folder / "depth.txt").open("a") as file:
        file.write("101.0 ../../secret.png\n")
    (folder / "rgb.txt").write_text("100.0 rgb/100.000000.png\n")
    with pytest.raises(InputError, match=r"inside the folder"):
        open_recording(folder)


@given(
    st.lists(st.floats(0, 2), min_size=1, max_size=25, unique=True),
    st.lists(st.floats(0, 2), min_size=1, max_size=25, unique=True),
)
def test_association_uses_each_time_once_within_the_tolerance(a: list[float], b: list[float]) -> None:
    first, second = np.sort(a), np.sort(b)
    pairs = associate(first, second, 0.02)
    assert len(set(pairs[:, 0])) == len(set(pairs[:, 1])) == len(pairs)
    assert np.all(np.abs(first[pairs[:, 0]] - second[pairs[:, 1]]) <= 0.02 + 1e-12)
    assert np.all(np.diff(pairs[:, 0]) > 0)
    left = np.setdiff1d(np.arange(len(first)), pairs[:, 0])
    right = np.setdiff1d(np.arange(len(second)), pairs[:, 1])
    assert not np.any(np.abs(first[left, None] - second[right]) < 0.02 - 1e-12)


def test_layout_is_recognised_or_named(native: Path, tmp_path: Path) -> None:
    assert open_recording(native, "native").fingerprint == open_recording(native).fingerprint
    with pytest.raises(InputError, match="did you mean 'native'"):
        open_recording(native, "nativ")
    with pytest.raises(InputError, match="does not exist"):
        open_recording(tmp_path / "nowhere")
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "readme.md").write_text("hello")
    with pytest.raises(InputError, match=r"readme\.md"):
        open_recording(tmp_path / "notes")
    assert list(READERS)[-1] == "native"  # the most general one


def test_shared_recordings_open(funtwin_data: Path) -> None:
    for folder in sorted((funtwin_data / "recordings").glob("kitchen_*")):
        recording = open_recording(folder)
        assert recording.warnings == ()
        k = recording.intrinsics
        assert (k.width, k.height) == (640, 480)
        frame = recording.frame(len(recording) - 1)
        assert frame.color.shape == (480, 640, 3)
        assert 0.3 < np.median(frame.depth[frame.depth > 0]) < 3.0

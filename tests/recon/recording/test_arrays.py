"""A recording made from arrays: what they hold is read, and what is no recording is named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recon import Recording, open_recording
from tests.makers.recon.in_memory import K, T, arrays, made
from tests.makers.recon.tiny import HEIGHT, WIDTH, cameras, write_recording
from twin.errors import InputError
from twin.scene import Trajectory


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("python") / "clip")


def test_a_recording_from_arrays_gives_the_arrays_frames() -> None:
    given = arrays()
    recording = Recording.from_arrays(**given)
    assert len(recording) == T
    assert recording.intrinsics == K
    assert recording.path is None
    np.testing.assert_allclose(recording.times, np.arange(T) / 15)
    for k in (0, 7, T - 1):
        np.testing.assert_array_equal(recording.frame(k).color, given["color"][k])
        np.testing.assert_array_equal(recording.frame(k).depth, given["depth"][k])
    assert recording.frame(0).depth.dtype == np.float32


def test_arrays_are_read_when_asked_for_and_never_changed() -> None:
    class Counting:
        """Frames that are made when asked for, as of a file on disk."""

        asked = 0

        def __init__(self, frames: Any) -> None:
            self.frames = frames

        def __len__(self) -> int:
            return len(self.frames)

        def __getitem__(self, k: int) -> Any:
            self.asked += 1
            return self.frames[k]

    color, depth = Counting(arrays()["color"]), Counting(list(arrays()["depth"]))
    recording = made(color=color, depth=depth)
    asked = color.asked
    recording.frame(3)
    assert color.asked == asked + 1
    frame = recording.frame(3)
    frame.color[:] = 0
    frame.depth[:] = 0
    assert color[3].any()
    assert depth[3].all()


def test_whole_numbers_of_depth_need_their_unit() -> None:
    metres = arrays()["depth"]
    counts = np.rint(metres * 1000).astype(np.uint16)
    found = made(depth=counts, depth_scale=1000)
    np.testing.assert_allclose(found.frame(2).depth, counts[2] / 1000, rtol=1e-6)
    same = made(depth=(counts / 1000).astype(np.float64))
    np.testing.assert_allclose(found.frame(2).depth, same.frame(2).depth, rtol=1e-6)
    with pytest.raises(InputError, match="depth is uint16 and its unit is not said; give depth_scale=1000"):
        made(depth=counts)
    with pytest.raises(InputError, match=r"depth_scale is 0\.001, metres a value; .* depth_scale=1000"):
        made(depth=counts, depth_scale=0.001)


def test_unknown_depth_may_be_zero_nan_or_infinite() -> None:
    depth = arrays()["depth"]
    depth[:, 0, :3] = [0, np.nan, np.inf]
    np.testing.assert_array_equal(made(depth=depth).frame(4).depth[0, :3], [0, 0, 0])


def test_the_fingerprint_is_of_the_content() -> None:
    one = made().fingerprint
    assert one == made().fingerprint
    assert one == made(name="other", intrinsics=K, fps=None, times=np.arange(T) / 15).fingerprint
    color = arrays()["color"]
    color[5, 3, 3, 0] ^= 1
    depth = arrays()["depth"]
    depth[5, 3, 3] += 0.01
    for change in (
        {"color": color},
        {"depth": depth},
        {"fps": 30},
        {"intrinsics": replace(K, fx=81.0)},
        {"gravity_camera0": [0, 1, 0]},
        {"poses": cameras(T)},
    ):
        assert made(**change).fingerprint != one


def test_arrays_hold_what_the_folder_holds(folder: Path) -> None:
    disk = open_recording(folder)
    memory = Recording.from_arrays(
        [f.color for f in disk], [f.depth for f in disk], disk.intrinsics, times=disk.times, name=disk.name
    )
    for a, b in zip(disk, memory, strict=True):
        np.testing.assert_array_equal(a.color, b.color)
        np.testing.assert_array_equal(a.depth, b.depth)
    assert np.array_equal(disk.times, memory.times)


def turned(values: Any) -> Any:
    return np.swapaxes(values, 1, 2)


A = arrays()
WRONG: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "color 0 to 1": ({"color": A["color"] / 255.0}, ("colour of frame 0 is float64 from 0 to 1", "multiply by 255")),
    "color is int32": ({"color": A["color"].astype(np.int32)}, ("is int32 from 0 to 255", "as uint8")),
    "color has alpha": ({"color": np.concatenate([A["color"], A["color"][..., :1]], -1)}, ("color[..., :3]",)),
    "color has channels first": ({"color": np.moveaxis(A["color"], -1, 1)}, ("np.moveaxis(color, 1, -1)",)),
    "color is grey": ({"color": A["color"][..., 0]}, ("np.repeat(color[..., None], 3, axis=-1)",)),
    "color is one image": ({"color": A["color"][0]}, ("put frames first",)),
    "color is nothing": ({"color": np.zeros((0, HEIGHT, WIDTH, 3), np.uint8)}, ("without frames",)),
    "color is a number": ({"color": 3}, ("color is int without frames",)),
    "color is an array of no axes": ({"color": np.array(3)}, ("color is ndarray without frames",)),
    "depth is 8-bit": ({"depth": A["depth"].astype(np.uint8), "depth_scale": 100}, ("depth is uint8", "uint16 with depth_scale")),
    "depth is text": ({"depth": A["depth"].astype(str)}, ("can't hold distances",)),
    "depth looks like millimetres": ({"depth": A["depth"] * 1000}, ("as if in millimetres", "depth_scale, the depth values in a metre: 1000")),
    "depth was divided twice": ({"depth": A["depth"] / 1000}, ("depth has a median of 0.00", "1 for metres")),
    "depth has width first": ({"depth": turned(A["depth"])}, ("np.swapaxes(depth, 1, 2)",)),
    "depth has a channel": ({"depth": A["depth"][..., None]}, ("depth[..., 0]",)),
    "depth is smaller": ({"depth": A["depth"][:, ::2, ::2]}, ("register depth to the colour image",)),
    "depth is negative": ({"depth": -A["depth"]}, ("depth of frame 0 is negative", "OpenGL")),
    "depth is unknown": ({"depth": 0 * A["depth"]}, ("depth is unknown in all 12 frames",)),
    "depth lacks a frame": ({"depth": A["depth"][1:]}, ("12 colour and 11 depth images",)),
    "depth scale is text": ({"depth_scale": "mm"}, ("depth_scale is 'mm'",)),
    "both are turned": ({"color": turned(A["color"]), "depth": turned(A["depth"])}, ("the images are 72x96, but K has its centre at (47.5, 35.5)", "swap fx with fy")),
    "intrinsics of another size": ({"intrinsics": K.scaled(640, 480)}, ("intrinsics are of 640x480, the images are 96x72", "scaled(width, height)")),
    "K of another size": ({"intrinsics": K.scaled(640, 480).matrix}, ("outside the 96x72 image",)),
    "K is transposed": ({"intrinsics": K.matrix.T}, ("K is column by column", "K.T")),
    "K has skew": ({"intrinsics": K.matrix + [[0, 3, 0], [0, 0, 0], [0, 0, 0]]}, ("no pinhole camera without skew",)),
    "K is four numbers": ({"intrinsics": [80, 80, 47.5, 35.5]}, ("intrinsics have shape (4,)", "K (3, 3)")),
    "no clock": ({"fps": None}, ("give either times or fps", "times=(T,)")),
    "two clocks": ({"times": np.arange(T)}, ("not both",)),
    "times is fps": ({"fps": None, "times": 30}, ("times have shape ()", "say fps=30")),
    "too few times": ({"fps": None, "times": np.arange(3)}, ("times have shape (3,) for 12 frames",)),
    "times go back": ({"fps": None, "times": np.arange(T)[::-1]}, ("strictly increase",)),
    "fps is zero": ({"fps": 0}, ("fps is 0", "such as 30")),
    "gravity is a number": ({"gravity_camera0": 9.81}, ("gravity_camera0 is", "point down")),
    "poses of other frames": ({"poses": cameras(5)}, ("poses have shape (5, 4, 4) for 12 frames",)),
    "poses are not rigid": ({"poses": 2 * cameras(T)}, ("poses: camera poses must be rigid", "camera to world")),
    "few frames": ({"color": A["color"][:3], "depth": A["depth"][:3]}, ("at least 10 frames, got 3",)),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_arrays_that_are_not_a_recording_say_what_to_do(case: str) -> None:
    change, told = WRONG[case]
    with pytest.raises(InputError) as caught:
        made(**change)
    message = str(caught.value)
    assert "\n" not in message
    assert caught.value.remedy
    for words in told:
        assert words in message


def test_a_frame_of_another_size_is_named() -> None:
    color = list(arrays()["color"])
    color[6] = color[6][::2]
    with pytest.raises(InputError, match=r"frame 6 has colour \(36, 96, 3\)"):
        made(color=color)


def test_one_image_of_a_frame_is_read_without_the_other() -> None:
    read: list[str] = []

    class Noted:
        def __init__(self, what: str) -> None:
            self.what, self.images = what, arrays()[what]

        def __len__(self) -> int:
            return len(self.images)

        def __getitem__(self, k: int) -> Any:
            read.append(self.what)
            return self.images[k]

    recording = made(color=Noted("color"), depth=Noted("depth"))
    part = recording[2:]
    read.clear()
    color, depth = part.color(1), part.depth(1)
    assert read == ["color", "depth"]
    both = recording.frame(3)
    assert read == ["color", "depth"] * 2
    np.testing.assert_array_equal(both.color, color)
    np.testing.assert_array_equal(both.depth, depth)
    for one in (recording.color, recording.depth):
        with pytest.raises(InputError, match=f"not {T}"):
            one(T)


def test_poses_and_gravity_from_arrays() -> None:
    T_world_cam = cameras(T)
    T_world_cam[4] = np.nan
    recording = made(poses=T_world_cam, gravity_camera0=[0, 9.81, 0])
    assert recording.poses is not None
    assert recording.poses.frames.tolist() == [k for k in range(T) if k != 4]
    np.testing.assert_array_equal(recording.gravity_camera0, [0, 1, 0])
    known = Trajectory(np.arange(3), np.arange(3.0), cameras(3))
    assert made(poses=known).poses is known
    with pytest.raises(InputError, match="poses are of frames 0 to 12, there are 12"):
        made(poses=Trajectory(np.arange(13), np.arange(13.0), cameras(13)))

"""A recording as Python sees it: made from arrays, indexed, sliced, looped over, shown."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import recon
import recon.simulate
from recon import Frame, Intrinsics, Recording, open_recording, pipeline
from recon.models.joint_hint import PrecomputedJointHint
from recon.recording.decoded import SCRATCH, decoded_beside, decoded_once
from recon.verdict.assemble import say_where
from tests.makers.recon.in_memory import T, made
from tests.makers.recon.tiny import FRAMES, cameras, write_poses, write_recording
from twin import geometry as geo
from twin.errors import InputError
from twin.files.text import read_json
from twin.runs.manifest import MANIFEST, update_manifest


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("python") / "clip")


def test_recon_shows_its_names() -> None:
    names = dir(recon)
    for name in recon.__all__:
        assert name in names
        assert getattr(recon, name) is not None
    assert {"Recording", "fit_motion", "fit_motion_poses", "open_recording", "reconstruct"} <= set(names)
    with pytest.raises(AttributeError, match="no attribute 'Recordings'"):
        _ = recon.Recordings


def public_functions() -> list[tuple[str, Any]]:
    """What recon exports, what makes a simulated recording, and the ways to truth and hints."""
    found = [(f"recon.{n}", getattr(recon, n)) for n in recon.__all__]
    found += [(f"recon.simulate.{n}", getattr(recon.simulate, n)) for n in recon.simulate.__all__]
    modules = (
        "recon.evaluation.evaluate",
        "recon.evaluation.truth",
        "recon.readers",
        "recon.simulate.mjcf",
        "recon.models.joint_hint",
    )
    for name in modules:
        own = vars(import_module(name)).items()
        found += [
            (f"{name}.{k}", v)
            for k, v in own
            if inspect.isfunction(v) and v.__module__ == name and k[0] != "_"
        ]
    return found + [("PrecomputedJointHint", PrecomputedJointHint)]


@pytest.mark.parametrize(("name", "function"), public_functions())
def test_every_path_argument_takes_text(name: str, function: Any) -> None:
    for argument in inspect.signature(function).parameters.values():
        if "Path" in str(argument.annotation):
            assert "str" in str(argument.annotation), f"{name}({argument})"


def test_indexing_and_loops(folder: Path) -> None:
    recording = open_recording(folder)
    assert isinstance(recording[3], Frame)
    np.testing.assert_array_equal(recording[-1].depth, recording.frame(FRAMES - 1).depth)
    np.testing.assert_array_equal(recording[np.int64(2)].color, recording.frame(2).color)
    assert isinstance(iter(recording), Iterator)
    assert sum(1 for _ in recording) == len(recording) == FRAMES
    for wrong in (FRAMES, -FRAMES - 1):
        with pytest.raises(InputError, match=rf"frames 0\.\.29, not {wrong}"):
            recording[wrong]
    with pytest.raises(TypeError):
        recording["first"]  # type: ignore[call-overload]


def test_a_slice_is_a_recording_of_its_frames(folder: Path) -> None:
    recording = open_recording(folder)
    part = recording[5:-1:2]
    assert len(part) == 12
    np.testing.assert_array_equal(part.times, recording.times[5:-1:2])
    np.testing.assert_array_equal(part[0].color, recording[5].color)
    np.testing.assert_array_equal(part[-1].depth, recording[27].depth)
    assert part.fingerprint != recording.fingerprint
    assert part.fingerprint == recording[5:29:2].fingerprint
    assert part.source == f"{recording.source}[5:-1:2]"
    assert part.path is None
    with pytest.raises(InputError, match="turns time around"):
        recording[::-1]
    with pytest.raises(InputError, match="at least 10 frames, got 4"):
        recording[:4]


def test_poses_and_gravity_of_a_slice_are_those_of_its_frames(tmp_path: Path) -> None:
    clip = write_recording(tmp_path / "clip")
    T_world_cam = cameras(FRAMES)
    keep = np.array([k for k in range(FRAMES) if k != 8])
    write_poses(clip / "trajectory.txt", 5.0 + keep / 15.0, T_world_cam[keep])
    down = T_world_cam[0, :3, :3].T @ [0, 0, -1]
    recording = replace(open_recording(clip), gravity_camera0=down)
    part = recording[6:20]
    assert part.poses is not None
    assert part.poses.frames.tolist() == [k - 6 for k in range(6, 20) if k != 8]
    np.testing.assert_allclose(part.poses.pose(4), T_world_cam[10], atol=1e-9)
    np.testing.assert_allclose(part.gravity_camera0, T_world_cam[6, :3, :3].T @ [0, 0, -1], atol=1e-9)
    assert recording[:15].gravity_camera0 is down
    blind = recording[8:22]  # frame 8 has no pose, so that the direction down is not known in it
    assert blind.gravity_camera0 is None
    assert "gravity was known in frame 0 only" in blind.warnings[-1]
    assert replace(recording, poses=None)[1:].gravity_camera0 is None
    assert replace(recording, gravity_camera0=None)[1:].warnings == recording.warnings
    assert geo.angle_between(part.gravity_camera0, [0, 1, 0]) < 0.5


def test_a_recording_shows_itself_in_a_line(folder: Path) -> None:
    recording = open_recording(folder)
    assert repr(recording) == (
        "<Recording 'clip': 30 frames of 96x72, 1.9 s, no known poses, gravity to be estimated>"
    )
    assert "known poses of 12 frames, gravity known" in repr(
        made(poses=cameras(T), gravity_camera0=[0, 1, 0])
    )


def test_a_recording_shows_itself_in_a_notebook() -> None:
    page = made(name="<b>clip</b>")._repr_html_()
    assert "&lt;b&gt;clip&lt;/b&gt;" in page
    assert "<b>clip" not in page
    assert re.findall(r'title="(frame \d+)" src="data:image/jpeg;base64,/9j/', page) == [
        "frame 0",
        "frame 6",
        "frame 11",
    ]
    assert len(page) < 100_000


class Stop(Exception): ...


def test_reconstruct_takes_a_folder_as_text_or_path(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []

    def stop(run: Any, recording: Recording, *_more: Any) -> None:
        seen.append((run.folder, recording.fingerprint, len(recording)))
        raise Stop

    monkeypatch.setattr(pipeline, "_run", stop)
    for given, out in (
        (str(folder), str(tmp_path / "a")),
        (folder, tmp_path / "b"),
        (open_recording(folder), None),
    ):
        with pytest.raises(Stop):
            recon.reconstruct(given, out=out)
    assert seen[0][0] == tmp_path / "a"
    assert [s[1:] for s in seen] == [(open_recording(folder).fingerprint, FRAMES)] * 3
    with pytest.raises(InputError, match="does not exist"):
        recon.reconstruct(str(folder / "nowhere"))


def test_a_joint_hint_takes_text_and_path(folder: Path, tmp_path: Path) -> None:
    file = tmp_path / "hint.json"
    file.write_text(
        '{"parts": [{"object_name": "door", "joint_type": "revolute", "first_frame": 5, "last_frame": 20}]}'
    )
    recording = open_recording(folder)
    assert PrecomputedJointHint(str(file))(recording, None) == PrecomputedJointHint(file)(recording, None)
    with pytest.raises(InputError, match=r"nowhere\.json can't be read"):
        PrecomputedJointHint("nowhere.json")(recording, None)


def test_a_recording_in_memory_is_not_taken_for_a_file_of_its_name(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arrays").mkdir()  # what the recording in memory is called
    update_manifest(tmp_path, note="a run")
    say_where(made(), tmp_path)
    assert "recording" not in read_json(tmp_path / MANIFEST)
    say_where(open_recording(folder), tmp_path)
    assert (tmp_path / read_json(tmp_path / MANIFEST)["recording"]).resolve() == folder.resolve()


@pytest.mark.slow
def test_arrays_make_the_twin_that_their_folder_makes(tmp_path: Path) -> None:
    source = Path(__file__).parents[3] / "assets" / "recordings" / "cabinet_drawer"
    disk = open_recording(source)
    counts = [np.rint(f.depth * 1000).astype(np.uint16) for f in disk]
    memory = Recording.from_arrays(
        np.stack([f.color for f in disk]), np.stack(counts), disk.intrinsics, times=disk.times,
        depth_scale=1000, gravity_camera0=disk.gravity_camera0, name=disk.name,
    )  # fmt: skip
    one, other = recon.reconstruct(memory, out=tmp_path / "run"), recon.reconstruct(disk)
    for a, b in zip(one.parts, other.parts, strict=True):
        np.testing.assert_array_equal(a.joint.axis, b.joint.axis)
        np.testing.assert_array_equal(a.motion.state, b.motion.state)
        np.testing.assert_array_equal(a.mesh.vertices, b.mesh.vertices)
    assert one.recorded is not None
    assert one.recorded.source == disk.name
    assert (tmp_path / "run" / "twin" / "twin.json").is_file()
    assert list((tmp_path / "run" / "report").iterdir())  # key frames


class Counted:
    """A recording of ten frames of 4x5 pixels that counts what is decoded."""

    def __init__(self, depth: NDArray[np.float32]) -> None:
        self.reads: list[str] = []
        camera = Intrinsics(5, 4, 5.0, 5.0, 2.0, 2.0)

        def read_color(k: int) -> NDArray[np.uint8]:
            self.reads.append(f"colour {k}")
            return np.full((4, 5, 3), k, np.uint8)

        def read_depth(k: int) -> NDArray[np.float32]:
            self.reads.append(f"depth {k}")
            return depth[k].copy()

        self.recording = Recording("r", "r", np.arange(10.0), camera, read_color, read_depth, "f")


_MILLIMETRES = np.random.default_rng(0).integers(0, 2**16, (10, 4, 5)).astype(np.float32) / np.float32(1000)
_THIRDS = np.full((10, 4, 5), 1 / 3, np.float32)


@pytest.mark.parametrize("depth", [_MILLIMETRES, _THIRDS], ids=["millimetres", "thirds"])
def test_images_are_decoded_once_and_nothing_is_lost(tmp_path: Path, depth: NDArray[np.float32]) -> None:
    counted = Counted(depth)
    with decoded_once(counted.recording, tmp_path) as recording:
        for _ in range(2):
            for k, frame in enumerate(recording):
                assert (frame.color == k).all()
                assert np.array_equal(frame.depth, depth[k])
                frame.depth[:], frame.color[:] = 99.0, 99  # the next reader doesn't see it
    assert sorted(counted.reads) == sorted(f"{what} {k}" for k in range(10) for what in ("colour", "depth"))
    assert not list(tmp_path.iterdir())


def test_only_as_many_decoded_images_are_kept_as_fit() -> None:
    counted = Counted(_THIRDS)
    header, slot = 2 * 10 + 8, 4 * 5 * (3 + 4)
    with decoded_once(counted.recording, None, header + 3 * slot) as recording:
        for _ in range(2):
            for k in range(10):
                assert np.array_equal(recording.depth(k), _THIRDS[k])
    assert [counted.reads.count(f"depth {k}") for k in range(10)] == [1, 1, 1] + [2] * 7


def test_another_process_reads_and_adds_to_what_a_run_has_decoded(tmp_path: Path) -> None:
    first, second = Counted(_MILLIMETRES), Counted(_MILLIMETRES)
    with decoded_once(first.recording, tmp_path) as recording:
        recording.frame(0)
        with decoded_beside(second.recording, tmp_path) as beside:
            assert np.array_equal(beside.depth(0), _MILLIMETRES[0])
            assert (beside.color(0) == 0).all()
            beside.frame(1)
        assert np.array_equal(recording.depth(1), _MILLIMETRES[1])
    assert first.reads == ["colour 0", "depth 0"]
    assert second.reads == ["colour 1", "depth 1"]
    with decoded_beside(second.recording, tmp_path) as beside:  # the run has ended
        assert np.array_equal(beside.depth(2), _MILLIMETRES[2])


def test_what_a_killed_run_still_writes_reaches_no_later_one(tmp_path: Path) -> None:
    """Its processes may live on for a while: a slot cleared between its image and its mark would be black."""
    killed, later = Counted(_MILLIMETRES), Counted(_MILLIMETRES)
    with (
        decoded_once(killed.recording, tmp_path) as _,
        decoded_beside(killed.recording, tmp_path) as orphan,
        decoded_once(later.recording, tmp_path) as recording,
    ):
        orphan.frame(3)
        assert np.array_equal(recording.depth(3), _MILLIMETRES[3])
        assert later.reads == ["depth 3"]


def test_a_folder_that_cannot_be_written_costs_time_alone(tmp_path: Path) -> None:
    counted = Counted(_MILLIMETRES)
    (tmp_path / SCRATCH).mkdir()
    with decoded_once(counted.recording, tmp_path) as recording:
        assert [np.array_equal(recording.depth(3), _MILLIMETRES[3]) for _ in range(2)] == [True, True]
    assert counted.reads == ["depth 3"] * 2

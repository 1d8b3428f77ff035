"""Inspection names faults that are planted into the shipped recording, and nothing in it as it is."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

import recon
from recon.inspection import frame_checks, motion_checks
from recon.inspection.finding import Inspection, Unknown
from recon.inspection.glance import Stretch, chosen_frames, glance
from recon.inspection.pictures import facts_of
from recon.readers import open_recording
from recon.recording import Recording
from recon.tracking.tracks import Tracks
from tests.makers.recon.tiny import read_image, write_recording
from twin.cause import Cause
from twin.cli import main as cli
from twin.files.assets import asset
from twin.scene import Trajectory

SHIPPED = asset("recordings/cabinet_drawer")
HAND = 255  # label of the truth

ColorChange = Callable[[NDArray[np.uint8]], NDArray[np.uint8]]


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Every second frame of the shipped recording."""
    return open_recording(SHIPPED)[::2]


@pytest.fixture(scope="module")
def stretch(recording: Recording) -> Stretch:
    (only,) = glance(recording)
    assert only.cameras is not None
    return only


def changed(
    stretch: Stretch, frames: NDArray[np.int64] | None = None, focal: float = 1.0, depth: Any = None
) -> Stretch:
    """A stretch of some frames, with another focal length or other depth; tracks and cameras are those of the
    whole one."""
    kept = np.arange(len(stretch.small)) if frames is None else frames
    k = stretch.small.intrinsics
    read = depth or stretch.small.depth
    small = replace(
        stretch.small,
        times=stretch.small.times[: len(kept)],
        intrinsics=replace(k, fx=k.fx * focal, fy=k.fy * focal),
        read_color=lambda i: stretch.small.color(int(kept[i])),
        read_depth=lambda i: read(int(kept[i])),
    )
    out = Stretch(kept, small, tuple(stretch.facts[i] for i in kept))
    assert stretch.cameras is not None
    of = stretch.tracks
    seen = (of.points_cam[kept], of.pixels[kept], of.visible[kept])
    out.__dict__["tracks"] = Tracks(*seen)
    out.__dict__["cameras"] = Trajectory(np.arange(len(kept)), small.times, stretch.cameras.T_world_cam[kept])
    return out


def with_colors(recording: Recording, change: ColorChange) -> Stretch:
    """A stretch of ten frames whose colours are changed."""
    kept = np.linspace(0, len(recording) - 1, 10).astype(int)
    facts = tuple(facts_of(change(recording.color(int(i))), recording.depth(int(i))) for i in kept)
    return Stretch(kept, recording, facts)


def kinds(found: list[Cause | Unknown]) -> list[str]:
    return [x.type for x in found if isinstance(x, Cause)]


def shifted(x: int, y: int) -> Callable[[NDArray[Any]], NDArray[Any]]:
    def shift(image: NDArray[Any]) -> NDArray[Any]:
        return cv2.warpAffine(
            image, np.array([[1.0, 0, x], [0, 1.0, y]]), image.shape[1::-1], flags=cv2.INTER_NEAREST
        )

    return shift


def test_nothing_is_named_in_the_shipped_recording(recording: Recording, stretch: Stretch) -> None:
    found = [
        *frame_checks.clock(open_recording(SHIPPED).times),
        *frame_checks.size(recording),
        *(
            x
            for check in (frame_checks.copies, frame_checks.blur, frame_checks.exposure)
            for x in check([stretch])
        ),
        *frame_checks.depth([stretch]),
        *motion_checks.registration([stretch], recording),
        *motion_checks.focal([stretch], recording),
        *motion_checks.rest_and_hand([stretch]),
    ]
    assert kinds(found) == []
    assert len(found) <= 1  # up and down depth has too few edges here


@pytest.mark.parametrize(("missing", "named"), [(0.4, []), (1, ["ClockGap"]), (5, ["ClockGap"])])
def test_a_gap_of_the_clock(missing: float, named: list[str]) -> None:
    times = open_recording(SHIPPED).times.copy()
    step = float(np.median(np.diff(times)))
    times[20:] += missing * step
    found = frame_checks.clock(times)
    assert kinds(found) == named
    for gap in found:
        assert gap.type == "ClockGap"
        assert (gap.numbers["frame"], gap.numbers["count"]) == (19, 1)
        assert gap.numbers["step"] == pytest.approx((1 + missing) * step, rel=1e-3)


def test_a_clock_that_jitters_has_no_gaps_and_one_that_repeats_itself_is_named() -> None:
    rng = np.random.default_rng(1)
    assert frame_checks.clock(np.arange(300) / 30 + rng.uniform(0, 0.02, 300)) == []
    doubled = np.arange(60) / 15
    doubled[30] = doubled[29] + 0.001
    assert "ClockDoubled" in kinds(frame_checks.clock(doubled))
    assert kinds(frame_checks.clock(np.arange(60) / 7.5)) == ["TooSlow"]


@pytest.mark.parametrize(("x", "y"), [(-4, 3)])
def test_depth_beside_colour(recording: Recording, stretch: Stretch, x: int, y: int) -> None:
    moved = shifted(x, y)
    (found,) = motion_checks.registration(
        [changed(stretch, np.arange(0, 44, 3), depth=lambda i: moved(stretch.small.depth(i)))], recording
    )[:1]
    assert found.type == "Misregistered"
    assert found.numbers["x"] == pytest.approx(x, abs=0.7)
    assert found.numbers["y"] in (None, pytest.approx(y, abs=0.7))  # few edges run across here


def test_depth_far_from_colour(recording: Recording, stretch: Stretch) -> None:
    mirrored = changed(
        stretch, np.arange(0, 44, 3), depth=lambda i: np.ascontiguousarray(stretch.small.depth(i)[:, ::-1])
    )
    assert kinds(motion_checks.registration([mirrored], recording)) == ["NoCommonEdges"]


@pytest.mark.parametrize(("error", "named"), [(0.95, True), (1.01, False)])
def test_a_wrong_focal_length(recording: Recording, stretch: Stretch, error: float, named: bool) -> None:
    k = recording.intrinsics
    stated = replace(recording, intrinsics=replace(k, fx=error * k.fx, fy=error * k.fy))
    found = motion_checks.focal([changed(stretch, focal=error)], stated)
    assert kinds(found) == ["WrongFocal"] * named
    for wrong in found:
        assert wrong.type == "WrongFocal"
        assert wrong.numbers["fitted"] == pytest.approx(k.fx, rel=0.01)


def test_a_camera_that_does_not_turn_tells_no_focal_length(recording: Recording, stretch: Stretch) -> None:
    tracks = stretch.tracks
    rng = np.random.default_rng(2)
    at = np.argmax(tracks.visible.sum(axis=1))
    still = changed(stretch)
    points, pixels = (
        np.repeat(x[at][None], len(tracks.visible), axis=0) for x in (tracks.points_cam, tracks.pixels)
    )
    seen = np.repeat(tracks.visible[at][None], len(tracks.visible), axis=0)
    pixels = pixels + rng.normal(0, 0.3, pixels.shape)
    points[..., 2] += rng.normal(0, 0.003, points.shape[:2])
    still.__dict__["tracks"] = replace(tracks, points_cam=points, pixels=pixels, visible=seen)
    (found,) = motion_checks.focal([still], recording)
    assert isinstance(found, Unknown)


def motion_blur(length: int, axis: int) -> ColorChange:
    kernel = np.zeros((length, length), np.float32)
    kernel[length // 2] = 1 / length
    return lambda c: np.asarray(cv2.filter2D(c, -1, kernel if axis == 0 else kernel.T), dtype=np.uint8)


@pytest.mark.parametrize(("axis", "direction"), [(0, "horizontal"), (1, "vertical")])
def test_blur_by_motion_and_its_direction(recording: Recording, axis: int, direction: str) -> None:
    (found,) = frame_checks.blur([with_colors(recording, motion_blur(7, axis))])
    assert found.type == "Blurred"
    assert found.numbers["share"] == 1.0
    assert found.numbers["direction"] == direction
    assert kinds(frame_checks.blur([with_colors(recording, motion_blur(1, axis))])) == []


def test_a_lens_out_of_focus_and_a_picture_without_edges(recording: Recording) -> None:
    soft = with_colors(recording, lambda c: np.asarray(cv2.GaussianBlur(c, (0, 0), 2.0), dtype=np.uint8))
    (found,) = frame_checks.blur([soft])
    assert found.type == "Blurred"
    assert found.numbers["direction"] == ""
    assert isinstance(frame_checks.blur([with_colors(recording, lambda c: c * 0 + 90)])[0], Unknown)


@pytest.mark.parametrize(("gain", "named"), [(1.0, []), (4.0, ["OverExposed"]), (0.002, ["UnderExposed"])])
def test_exposure(recording: Recording, gain: float, named: list[str]) -> None:
    def expose(color: NDArray[np.uint8]) -> NDArray[np.uint8]:
        return np.clip(255 * ((color / 255) ** 2.2 * gain) ** (1 / 2.2), 0, 255).astype(np.uint8)

    assert kinds(frame_checks.exposure([with_colors(recording, expose)])) == named


@pytest.mark.parametrize(("share", "named"), [(0.2, []), (0.5, ["MissingDepth"])])
def test_missing_depth(recording: Recording, share: float, named: list[str]) -> None:
    def holes(i: int) -> NDArray[np.float32]:
        depth = recording.depth(i).copy()
        depth[:, : round(share * depth.shape[1])] = 0
        return depth

    holed = replace(recording, read_depth=holes)
    facts = tuple(facts_of(holed.color(i), holed.depth(i)) for i in (0, 20, 40))
    found = frame_checks.depth([Stretch(np.array([0, 20, 40]), holed, facts)])
    assert kinds(found) == named
    for missing in found:
        assert missing.type == "MissingDepth"
        assert missing.numbers["whole"] == pytest.approx(share, abs=0.05)


@pytest.mark.parametrize(("scale", "named"), [(5.0, "OutOfReach"), (0.1, "TooNear")])
def test_depth_in_a_wrong_unit(recording: Recording, scale: float, named: str) -> None:
    facts = (facts_of(recording.color(0), recording.depth(0) * np.float32(scale)),) * 2
    assert named in kinds(frame_checks.depth([Stretch(np.arange(2), recording, facts)]))


def hands(stretch: Stretch) -> NDArray[np.int64]:
    """Frames in which the hand is in view, by the truth."""
    count = len(stretch.frames)
    return np.flatnonzero(
        [(read_image(SHIPPED / f"truth/labels/{2 * i:06d}.png") == HAND).any() for i in range(count)]
    )


def test_no_rest_before_or_after(stretch: Stretch) -> None:
    """Cut while the drawer moves, which it does from frame 15 to 31."""
    for kept, before, after in (
        (np.arange(21, len(stretch.frames)), True, False),
        (np.arange(26), False, True),
    ):
        found = motion_checks.rest_and_hand([changed(stretch, kept)])
        (rest,) = (x for x in found if x.type == "NoRest")
        assert (rest.numbers["before"], rest.numbers["after"]) == (before, after)
        (hand,) = (x for x in found if x.type == "HandAlwaysThere")
        assert (hand.numbers["before"], hand.numbers["after"]) == (before, after)
    still = changed(stretch, np.arange(10))
    assert kinds(motion_checks.rest_and_hand([still])) == ["NothingMoves"]


def test_a_hand_in_every_frame(stretch: Stretch) -> None:
    """It rests in view before and after, where the truth has none."""
    seen = hands(stretch)
    held = int(seen[len(seen) // 3])
    mask = read_image(SHIPPED / f"truth/labels/{2 * held:06d}.png") == HAND
    there = stretch.small.depth(held)

    def depth(i: int) -> NDArray[np.float32]:
        return stretch.small.depth(i) if i in seen else np.where(mask, there, stretch.small.depth(i))

    found = motion_checks.rest_and_hand([changed(stretch, depth=depth)])[-1]
    assert found.type == "HandAlwaysThere"
    assert found.numbers["before"]
    assert found.numbers["after"]
    assert found.kind == "hand in every frame"


def test_a_long_recording_is_looked_at_in_three_stretches() -> None:
    assert [len(k) for k in chosen_frames(np.arange(120) / 15)] == [120]
    assert [len(k) for k in chosen_frames(np.arange(240) / 30)] == [120]
    first, middle, last = chosen_frames(np.arange(1800) / 30)
    assert (first[0], last[-1]) == (0, 1798)
    assert len(first) == len(middle) == len(last) == 60


def test_the_verb_tells_findings_and_never_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_recording(tmp_path / "tiny")
    times = 5.0 + np.arange(30) / 15
    times[12:] += 0.5
    (folder / "timestamps.txt").write_text("".join(f"{t:.6f}\n" for t in times))
    found = recon.inspect(str(folder))
    assert isinstance(found, Inspection)
    assert [(r[0], r[2]) for r in found.table().rows] == [(x.kind, x.help) for x in found.findings]
    assert cli.run(["inspect", str(folder), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["findings"] == found.as_dict()["findings"]
    by_name = {x["finding"]: x for x in told["findings"]}
    assert by_name["ClockGap"]["values"]["frame"] == 11
    assert all(x["text"] and x["help"] for x in told["findings"])
    (folder / "timestamps.txt").write_text("".join(f"{t:.6f}\n" for t in times[::-1]))
    assert cli.run(["inspect", str(folder)]) == 1
    assert "must strictly increase" in capsys.readouterr().err


@pytest.mark.slow
def test_the_kitchen_recordings_and_the_shipped_one_have_no_faults(funtwin_data: Path) -> None:
    folders = [
        SHIPPED,
        *(funtwin_data / "recordings" / n for n in ("kitchen_hinge", "kitchen_slide", "kitchen_microwave")),
    ]
    assert [recon.inspect(p).findings for p in folders] == [()] * 4

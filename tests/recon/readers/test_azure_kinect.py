"""Azure Kinect recordings: read as they were written, in their formats and clocks, known by content, and cut
off."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.layouts.azure_kinect import (
    cluster,
    ebml_header,
    element,
    head,
    number,
    pack_color,
    tag,
    track,
    write_azure_kinect,
)
from recon.readers import open_recording
from recon.readers.streams import recording_of
from recon.recording import Intrinsics, Recording
from tests.makers.recon.azure_recording import (
    COLOR,
    DEPTH,
    READER,
    calibration,
    depth_bytes,
    opened,
    picture,
    tracks,
    write,
)
from tests.makers.recon.tiny import write_recording
from twin.errors import InputError


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return open_recording(write_recording(tmp_path_factory.mktemp("native") / "tiny"))


# The whole way


@pytest.mark.parametrize(("color", "live"), [("MPNG", False), ("BGRA", True)])
def test_a_written_recording_is_read_as_it_was(
    original: Recording, tmp_path: Path, color: str, live: bool
) -> None:
    again = opened(write_azure_kinect(original, tmp_path / "out.mkv", color, live=live))
    assert again.warnings == ()
    assert len(again) == len(original)
    assert again.intrinsics.vector == pytest.approx(original.intrinsics.vector, abs=1e-9)
    np.testing.assert_allclose(again.times, original.times - original.times[0], atol=5e-7)  # us in the file
    for k in (0, 13, 29):
        np.testing.assert_array_equal(again.color(k), original.color(k))
        np.testing.assert_array_equal(again.depth(k) == 0, original.depth(k) == 0)
        np.testing.assert_allclose(again.depth(k), original.depth(k), atol=1e-6)


def test_a_vga_recording_fills_the_width_of_depth(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    color = rng.integers(0, 255, (10, 480, 640, 3), dtype=np.uint8)
    mm = np.round(1500 + 300 * np.sin(np.arange(640) / 60) + np.arange(480)[:, None]).astype(np.uint16)
    mm[100:150, 200:260] = 0
    k = Intrinsics(640, 480, 570.0, 571.0, 318.25, 242.5)
    source = Recording.from_arrays(color, np.stack([mm] * 10), k, fps=30, depth_scale=1000)
    again = opened(write_azure_kinect(source, tmp_path / "vga.mkv", "BGRA"))
    np.testing.assert_array_equal(again.color(9), color[9])
    np.testing.assert_array_equal(np.rint(1000 * again.depth(9)), mm)
    assert again.intrinsics.vector == pytest.approx(k.vector, abs=1e-9)


def test_the_writer_refuses_what_does_not_fit(original: Recording, tmp_path: Path) -> None:
    for k, what in (
        (Intrinsics(800, 600, 700, 700, 400, 300), "fit"),
        (Intrinsics(60, 72, 60, 60, 30, 36), "4:3"),
    ):
        big = Recording.from_arrays(
            np.zeros((10, k.height, k.width, 3), np.uint8),
            np.ones((10, k.height, k.width), np.float32),
            k,
            fps=30,
        )
        with pytest.raises(InputError, match=what):
            write_azure_kinect(big, tmp_path / "big.mkv")


# Formats and clocks


@pytest.mark.parametrize(
    ("color", "bound"), [("MPNG", 0), ("BGRA", 0), ("MJPG", 6), ("NV12", 5), ("YUY2", 4)]
)
def test_colour_formats(tmp_path: Path, color: str, bound: int) -> None:
    pictures = lambda k: [(1, 0, pack_color(picture(k), color)), (2, 0, depth_bytes(k))]  # noqa: E731
    streams = READER.streams(write(tmp_path / "a.mkv", tracks(color), pictures))
    for k in (0, 11):
        assert np.abs(streams.read_color(k).astype(int) - picture(k)).max() <= bound


def test_jpeg_under_the_name_that_copying_tools_give_it(tmp_path: Path) -> None:
    pictures = lambda k: [(1, 0, pack_color(picture(k), "MJPG")), (2, 0, depth_bytes(k))]  # noqa: E731
    streams = READER.streams(write(tmp_path / "a.mkv", tracks("\0\0\0\0", codec="V_MJPEG"), pictures))
    assert np.abs(streams.read_color(3).astype(int) - picture(3)).max() <= 6


def test_depth_is_big_endian_millimetres(tmp_path: Path) -> None:
    both = lambda k: [(1, 0, pack_color(picture(k), "MPNG")), (2, 0, b"\x01\x02" * 320 * 288)]  # noqa: E731
    depth = READER.streams(write(tmp_path / "a.mkv", pictures=both)).read_depth(0)
    assert depth.shape == (288, 320)
    assert depth.dtype == np.float32
    assert np.all(depth == np.float32(0.258))
    early = READER.streams(write(tmp_path / "b.mkv", tracks(depth="YUY2"), both))
    assert np.all(early.read_depth(0) == np.float32(0.513))


def test_bytes_cut_off_the_front_of_each_frame_are_put_back(tmp_path: Path) -> None:
    cut = element(0x5034, number(0x4254, 3) + element(0x4255, b"\x89PNG"))
    more = element(0x6D80, element(0x6240, cut))
    both = lambda k: [(1, 0, pack_color(picture(k), "MPNG")[4:]), (2, 0, depth_bytes(k))]  # noqa: E731
    streams = READER.streams(write(tmp_path / "a.mkv", tracks(more=more), both))
    np.testing.assert_array_equal(streams.read_color(5), picture(5))


@pytest.mark.parametrize("delay", [0.05, -0.05])
def test_a_depth_delay_of_more_than_half_a_frame_keeps_captures_together(
    original: Recording, tmp_path: Path, delay: float
) -> None:
    path = write_azure_kinect(original, tmp_path / "a.mkv", delay=delay)
    again = opened(path)
    assert len(again) == 30
    for k in (0, 12, 29):
        np.testing.assert_allclose(again.depth(k), original.depth(k), atol=1e-6)
    assert f"{1000 * delay:.1f} ms after colour" in again.warnings[0]


def test_times_are_of_the_clusters_and_the_file_s_ticks(tmp_path: Path) -> None:
    both = lambda k: [(1, -7, pack_color(picture(k), "MPNG")), (2, 25, depth_bytes(k))]  # noqa: E731
    for scale in (1000, 100_000):
        streams = READER.streams(write(tmp_path / "a.mkv", pictures=both, scale=scale))
        np.testing.assert_allclose(
            streams.color_times, (33333 * np.arange(12) - 7) * scale * 1e-9, atol=1e-12
        )
        np.testing.assert_allclose(
            streams.depth_times, (33333 * np.arange(12) + 25) * scale * 1e-9, atol=1e-12
        )
        assert streams.warnings == ()


def test_a_file_that_was_not_closed_counts_in_microseconds(tmp_path: Path) -> None:
    streams = READER.streams(write(tmp_path / "a.mkv", scale=0))
    np.testing.assert_allclose(streams.color_times, 0.033333 * np.arange(12), atol=1e-12)
    assert "did not close it" in streams.warnings[0]


def test_lost_pictures_leave_out_their_captures_alone(tmp_path: Path) -> None:
    def both(k: int) -> list[tuple[int, int, bytes]]:
        pair = [(1, 0, pack_color(picture(k), "MPNG")), (2, 0, depth_bytes(k))]
        return {4: pair[:1], 7: pair[1:]}.get(k, pair)

    recording = opened(write(tmp_path / "a.mkv", pictures=both, frames=20))
    kept = [k for k in range(20) if k not in (4, 7)]
    np.testing.assert_allclose(recording.times, 0.033333 * np.array(kept), atol=1e-9)
    for k in (3, 4, 6, 17):
        np.testing.assert_array_equal(recording.color(k), picture(kept[k]))
        assert 1000 * recording.depth(k).max() == pytest.approx(1000 + kept[k], abs=1e-2)


def test_tracks_are_found_by_the_tags_that_name_them(tmp_path: Path) -> None:
    entries = [
        track(1, 7, "COLOR", "MJPG", 32, 24),
        track(3, 101, "A", "MPNG", *COLOR),
        track(4, 102, "B", "b16g", *DEPTH),
    ]
    tags = [tag("K4A_COLOR_TRACK", "101", 101), tag("K4A_DEPTH_TRACK", "102", 102)]
    both = lambda k: [(3, 0, pack_color(picture(k), "MPNG")), (4, 0, depth_bytes(k))]  # noqa: E731
    recording = opened(write(tmp_path / "a.mkv", entries, both, tags))
    np.testing.assert_array_equal(recording.color(2), picture(2))


def test_recordings_are_known_by_content(tmp_path: Path, original: Recording) -> None:
    assert READER.recognises(write_azure_kinect(original, tmp_path / "renamed.bin"))
    late = [
        head(tracks(), calibration(), []),
        head(tracks(), None, []),
        head([track(1, 1, "IR", "b16g", *DEPTH)], calibration(), []),
    ]
    for k, data in enumerate(late):  # tools that copy may write tags behind the frames
        (tmp_path / f"{k}.mkv").write_bytes(data + cluster(0, []))
        assert READER.recognises(tmp_path / f"{k}.mkv")
    other = {
        "a.mkv": b"",
        "b.mkv": b"\x1aE",
        "c.mkv": ebml_header(),
        "d.mkv": b"PK\3\4" + bytes(99),
        "e.mkv": bytes(999),
    }
    other["f.mkv"] = head([track(1, 1, "COLOR", "MJPG", 64, 48)], None, [])
    for name, data in other.items():
        (tmp_path / name).write_bytes(data)
        assert not READER.recognises(tmp_path / name)
        with pytest.raises(InputError, match=name):
            READER.streams(tmp_path / name)
    assert not READER.recognises(tmp_path)


@pytest.mark.parametrize("missing", [1, 100, 184_320, 200_000, 184_320 * 5])
def test_a_file_that_is_cut_off_keeps_its_whole_frames(tmp_path: Path, missing: int) -> None:
    whole = write(tmp_path / "a.mkv", frames=20).read_bytes()
    (tmp_path / "a.mkv").write_bytes(whole[:-missing])
    streams = READER.streams(tmp_path / "a.mkv")
    assert (
        f"cut off or damaged at byte {whole[:-missing].rfind(bytes([0xA3, 1, 0, 0]))}" in streams.warnings[0]
    )
    n = len(streams.depth_times)
    assert n == 20 - 1 - (missing - 1) // (184_320 + 450)
    assert len(recording_of(streams)) == n
    np.testing.assert_allclose(streams.read_depth(n - 1), (1000 + n - 1) / 1000, atol=1e-6)


def test_a_file_that_is_cut_after_opening_is_named_at_the_frame(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mkv")
    recording = opened(path)
    path.write_bytes(path.read_bytes()[:1_000_000])
    recording.frame(2)
    with pytest.raises(InputError, match=r"a\.mkv: picture 9 of track 'DEPTH' has 0 of 184320 bytes"):
        recording.depth(9)
    path.unlink()
    with pytest.raises(InputError, match=r"a\.mkv: picture 9 of track 'COLOR' can't be read"):
        recording.color(9)

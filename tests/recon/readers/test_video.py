"""Videos frame by frame: the same pictures in any order, each decoded once on the way, and damage told."""

from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

import recon
from benchmarks.layouts.videos import FrameClock, write_video
from recon.readers.video import Video
from tests.makers.recon.phone_recording import altered_bytes, phone_recording
from tests.makers.recon.tiny import FRAMES
from twin.errors import InputError

EVEN = FrameClock(Fraction(1, 60))
EARLY = FrameClock(Fraction(1, 60), start=-1)  # the first frame lies before the file's edit list
VIDEOS: dict[str, tuple[str, dict[str, Any]]] = {
    "h264, B-frames": ("a.mp4", {"b_frames": 3}),
    "h264, none": ("a.mp4", {"b_frames": 0}),
    "h264, in fragments": ("a.mp4", {"movflags": "frag_keyframe+empty_moov"}),
    "h264, edited": ("a.mp4", {"clock": EARLY}),
    "h264, mkv": ("a.mkv", {}),
    "mpeg4, B-frames": ("a.mov", {"codec": "mpeg4", "clock": EVEN}),
    "mpeg4, avi": ("a.avi", {"codec": "mpeg4", "clock": EVEN}),
    "hevc": ("a.mp4", {"codec": "libx265", "b_frames": 3}),
    "h264, open groups": (
        "a.mp4",
        {"b_frames": 3, "encoder": {"x264-params": "open-gop=1:b-adapt=0:bframes=3:keyint=12:scenecut=0"}},
    ),
    "key frames alone": ("a.mkv", {"codec": "ffv1", "pixels": "bgr0", "between_keys": 1}),
    "key frames in order": ("a.mp4", {"between_keys": 1, "b_frames": 0}),
}
needs_h264 = pytest.mark.skipif("libx264" not in av.codecs_available, reason="no encoder")


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> recon.Recording:
    return phone_recording(tmp_path_factory.mktemp("videos") / "tiny")


@pytest.fixture(scope="module")
def videos(original: recon.Recording, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    found = {}
    for case, (name, options) in VIDEOS.items():
        if options.get("codec", "libx264") in av.codecs_available:
            found[case] = write_video(original, tmp_path_factory.mktemp("video") / name, **options)
    return found


def in_order(path: Path, **options: str) -> list[np.ndarray]:
    with av.open(str(path), options=options) as file:
        return [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]


@pytest.mark.parametrize("case", VIDEOS)
def test_frames_are_the_same_in_any_order(videos: dict[str, Path], case: str) -> None:
    if case not in videos:
        pytest.skip("no encoder")
    expected = in_order(videos[case])
    video = Video(videos[case])
    assert len(video) == len(expected) == FRAMES - (case == "h264, edited")
    assert (video.width, video.height) == (96, 72)
    rng = np.random.default_rng(1)
    for k in [len(video) - 1, 0, *rng.integers(len(video), size=40).tolist()]:
        np.testing.assert_array_equal(video.read(k), expected[k])
    for k in range(len(video) - 1, -1, -3):
        np.testing.assert_array_equal(video.read(k), expected[k])


@pytest.mark.parametrize("case", VIDEOS)
def test_each_frame_is_decoded_once_on_the_way(videos: dict[str, Path], case: str) -> None:
    if case not in videos:
        pytest.skip("no encoder")
    video = Video(videos[case])
    assert video.decoded == 0  # opening decodes nothing
    for k in range(len(video)):
        video.read(k)
        video.read(max(k - 2, 0))  # kept
    assert video.decoded == len(video)
    steps = Video(videos[case])
    for k in range(0, len(steps), 5):
        steps.read(k)
    assert steps.decoded <= len(steps)


@pytest.mark.parametrize("case", VIDEOS)
def test_times_are_those_of_display(original: recon.Recording, videos: dict[str, Path], case: str) -> None:
    if case not in videos:
        pytest.skip("no encoder")
    times = Video(videos[case]).times
    assert np.all(np.diff(times) > 0)
    if VIDEOS[case][1].get("clock") is None:
        bound = 6e-4 if VIDEOS[case][0].endswith("mkv") else 2e-6  # s; MKV counts milliseconds
        np.testing.assert_allclose(times - times[0], original.times - original.times[0], atol=bound)
    else:
        np.testing.assert_allclose(np.diff(times), 1 / 60, atol=1e-9)


@pytest.mark.parametrize("case", ["h264, B-frames", "mpeg4, avi"])
def test_threads_may_share_a_video(videos: dict[str, Path], case: str) -> None:
    if case not in videos:
        pytest.skip("no encoder")
    expected = in_order(videos[case])
    video = Video(videos[case])
    order = np.random.default_rng(2).integers(len(video), size=60).tolist()
    with ThreadPoolExecutor(4) as pool:
        for k, found in zip(order, pool.map(video.read, order), strict=True):
            np.testing.assert_array_equal(found, expected[k])


@needs_h264
def test_frames_that_are_cut_off_count_when_asked(original: recon.Recording, tmp_path: Path) -> None:
    for b_frames in (0, 2):
        path = write_video(original, tmp_path / f"{b_frames}.mp4", EARLY, b_frames=b_frames)
        shown, stored = Video(path), Video(path, every_stored=True)
        assert (len(shown), len(stored)) == (FRAMES - 1, FRAMES)
        for k in (7, 0, 28):
            np.testing.assert_array_equal(shown.read(k), stored.read(k + 1))


@needs_h264
def test_opening_reads_the_index_alone(videos: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    read = []
    whole = Video._packets

    def counted(self: Video) -> Any:
        for packet in whole(self):
            read.append(packet)
            yield packet

    monkeypatch.setattr(Video, "_packets", counted)
    Video(videos["h264, none"])
    assert len(read) == 1
    Video(videos["h264, B-frames"])  # its index tells when frames are decoded, not when they are shown
    assert len(read) == 1 + FRAMES


@needs_h264
def test_a_cut_video_is_told(videos: dict[str, Path], tmp_path: Path) -> None:
    data = videos["h264, none"].read_bytes()
    at = data.find(b"moov") - 4
    early = tmp_path / "early.mp4"  # its index comes last
    early.write_bytes(data[: at - 2000])
    with pytest.raises(InputError, match=r"early\.mp4 can't be opened as a video of \d+ bytes"):
        Video(early)
    data = videos["h264, in fragments"].read_bytes()
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(data[: len(data) // 3])
    with pytest.raises(InputError, match=r"cut\.mp4 is truncated: frame \d+ of 12 lies beyond its \d+ bytes"):
        Video(cut)


@needs_h264
def test_a_damaged_frame_is_named(videos: dict[str, Path], tmp_path: Path) -> None:
    data = bytearray(videos["h264, none"].read_bytes())
    with av.open(str(videos["h264, none"])) as file:
        entry = file.streams.video[0].index_entries[15]
        start, end = entry.pos + 8, entry.pos + entry.size
    data[start:end] = bytes(end - start)
    path = tmp_path / "damaged.mp4"
    path.write_bytes(data)
    video, expected = Video(path), in_order(videos["h264, none"])
    np.testing.assert_array_equal(video.read(14), expected[14])
    with pytest.raises(InputError, match=r"damaged\.mp4 frame 15 can't be decoded"):
        video.read(15)
    np.testing.assert_array_equal(video.read(26), expected[26])  # from the key frame after it
    np.testing.assert_array_equal(video.read(3), expected[3])
    with pytest.raises(InputError, match=r"has frames 0\.\.29, not 30"):
        video.read(30)


@needs_h264
def test_a_frame_that_the_decoder_patched_up_is_told(videos: dict[str, Path], tmp_path: Path) -> None:
    path = Path(shutil.copy(videos["h264, none"], tmp_path / "patched.mp4"))
    with av.open(str(path)) as file:
        entry = file.streams.video[0].index_entries[15]
        start, end = entry.pos + 8, entry.pos + entry.size
    whole, said = path.read_bytes(), set()
    for k in range(30):
        data = bytearray(whole)
        data[start + k * (end - start) // 30] ^= 16
        path.write_bytes(data)
        video = Video(path)
        for frame in (17, 15):  # the earlier one is decoded on the way to the later one
            try:
                video.read(frame)
            except InputError as error:
                said.add((frame, error.problem.split(": ")[-1]))
    assert (15, "parts of it are lost") in said


@pytest.mark.parametrize("case", ["h264, B-frames", "h264, mkv", "mpeg4, avi", "hevc"])
def test_altered_videos_are_read_or_refused(videos: dict[str, Path], tmp_path: Path, case: str) -> None:
    if case not in videos:
        pytest.skip("no encoder")
    av.logging.set_level(av.logging.PANIC)
    path = Path(shutil.copy(videos[case], tmp_path))
    refused = 0
    for _ in altered_bytes(path, 40):
        try:
            video = Video(path)
            for k in (0, len(video) // 2, len(video) - 1):
                video.read(k)
        except InputError:
            refused += 1
    assert refused


def test_a_list_of_files_is_no_video(tmp_path: Path) -> None:
    """FFmpeg would open what such a file names, elsewhere or over the network."""
    path = tmp_path / "clip.mp4"
    for text in (
        "#EXTM3U\n#EXT-X-TARGETDURATION:1\nhttp://localhost:9/a.ts\n",
        "ffconcat version 1.0\nfile /etc/hosts\n",
    ):
        path.write_text(text)
        with pytest.raises(InputError, match="is no MP4, MOV, MKV or AVI video"):
            Video(path)

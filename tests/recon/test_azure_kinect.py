"""Azure Kinect recordings: the container, both cameras, formats and clocks, a real file, and what is refused."""

from __future__ import annotations

import io
import json
import random
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.layouts.azure_kinect import (
    UNKNOWN,
    calibration_of,
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
from recon.dense.registration import DepthGrid, rays
from recon.readers import open_recording
from recon.readers.kinect import AzureKinectReader, ebml
from recon.readers.kinect.calibration import DEPTH_MODES, rig_of
from recon.readers.kinect.matroska import Contents, read_contents, walk
from recon.readers.streams import Streams, recording_of
from recon.recording import Intrinsics, Recording
from recon.recording.rig import Rig
from tests.recon.tiny import write_recording
from twin.errors import InputError
from twin.geometry import exp_so3, invert_pose, make_pose, transform

COLOR = (96, 72)
DEPTH = (320, 288)  # the smallest mode
PINHOLE = Intrinsics(*COLOR, 80.0, 81.0, 47.0, 35.0)
READER = AzureKinectReader()


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return open_recording(write_recording(tmp_path_factory.mktemp("native") / "tiny"))


def picture(k: int) -> NDArray[np.uint8]:
    """Smooth colours that differ from frame to frame."""
    y, x = np.mgrid[0 : COLOR[1], 0 : COLOR[0]]
    return np.stack([40 + 2 * x, 200 - 2 * y, np.full_like(x, 20 * k)], axis=-1).astype(np.uint8)


def depth_bytes(k: int, kind: str = ">u2") -> bytes:
    """1 m and `k` mm."""
    return np.full(DEPTH[::-1], 1000 + k, kind).tobytes()


def tracks(
    color: str = "MPNG", depth: str = "b16g", size: tuple[int, int] = DEPTH, **more: Any
) -> list[bytes]:
    return [track(1, 101, "COLOR", color, *COLOR, **more), track(2, 102, "DEPTH", depth, *size)]


def calibration(change: Callable[[dict[str, Any], dict[str, Any]], None] | None = None) -> bytes:
    """The device's JSON, its cameras D0 and PV0 changed."""
    data = calibration_of(PINHOLE)
    if change is not None:
        change(*data["CalibrationInformation"]["Cameras"])
    return json.dumps(data).encode()


def write(
    path: Path,
    entries: Sequence[bytes] | None = None,
    pictures: Callable[[int], Sequence[tuple[int, int, bytes]]] | None = None,
    tags: Sequence[bytes] = (),
    camera: bytes | None = None,
    frames: int = 12,
    scale: int = 1000,
    flags: int = 0x80,
) -> Path:
    """A file of captures at 30 Hz."""
    whole = head(tracks() if entries is None else entries, camera or calibration(), tags, scale)
    for k in range(frames):
        both = pictures(k) if pictures else [(1, 0, pack_color(picture(k), "MPNG")), (2, 0, depth_bytes(k))]
        whole += cluster(33333 * k, both, flags=flags)
    path.write_bytes(whole)
    return path


def opened(path: Path) -> Recording:
    assert READER.recognises(path)
    return recording_of(READER.streams(path))


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


# Cameras


def rig(camera: bytes, color: tuple[int, int] = COLOR, depth: tuple[int, int] = DEPTH) -> Rig:
    return rig_of(camera, "clip.mkv", color, depth)


def test_16_9_colour_is_cut_from_the_middle_of_4_3() -> None:
    for width, height in ((1280, 720), (1920, 1080), (2560, 1440), (3840, 2160)):
        cut, whole = (rig(calibration(), (width, h)).color.camera for h in (height, width * 3 // 4))
        np.testing.assert_allclose(
            cut.vector, whole.vector - [0, 0, 0, (width * 3 // 4 - height) / 2], atol=1e-9
        )
    small, large = (rig(calibration(), s).color.camera for s in ((640, 480), (4096, 3072)))
    np.testing.assert_allclose(large.scaled(640, 480).vector, small.vector, atol=1e-9)


def test_depth_modes_are_cuts_of_one_sensor() -> None:
    def aim(d0: dict[str, Any], _: dict[str, Any]) -> None:
        d0["Intrinsics"]["ModelParameters"][:4] = [0.51, 0.52, 0.49, 0.495]

    of = {size: rig(calibration(aim), depth=size).depth.camera for size in DEPTH_MODES}
    whole = of[(1024, 1024)]
    np.testing.assert_allclose(whole.vector, [501.76, 506.88, 521.74, 531.98], atol=1e-9)
    np.testing.assert_allclose(of[(640, 576)].vector, whole.vector - [0, 0, 192, 180], atol=1e-9)
    np.testing.assert_allclose(of[(512, 512)].vector, whole.binned(2).vector, atol=1e-9)
    np.testing.assert_allclose(of[(320, 288)].vector, of[(640, 576)].binned(2).vector, atol=1e-9)


def test_a_calibration_on_the_16_9_picture_is_the_same_camera() -> None:
    def early(_: dict[str, Any], pv0: dict[str, Any]) -> None:
        cx, cy, fx, fy = pv0["Intrinsics"]["ModelParameters"][:4]
        pixels = cy * 3072 - 384  # on the 4096x2304 in the middle
        pv0["Intrinsics"]["ModelParameters"][:4] = [cx, pixels / 2304, fx, fy * 3072 / 2304]
        pv0["SensorHeight"] = 2304

    for size in ((1280, 720), (2048, 1536)):
        now, then = rig(calibration(), size), rig(calibration(early), size)
        np.testing.assert_allclose(then.color.camera.vector, now.color.camera.vector, atol=1e-9)


def test_points_go_from_depth_to_colour_through_the_device() -> None:
    poses = {
        "D0": make_pose(exp_so3(np.array([0.1, 0, 0.02])), [0.01, 0.02, 0.03]),
        "PV0": make_pose(exp_so3(np.array([0, 0.3, 0])), [-0.03, 0, 0.004]),
    }

    def place(*cameras: dict[str, Any]) -> None:
        for c, T in zip(cameras, poses.values(), strict=True):
            c["Rt"] = {"Rotation": T[:3, :3].ravel().tolist(), "Translation": T[:3, 3].tolist()}

    device = np.array([[0.2, -0.1, 1.5]])
    T = rig(calibration(place)).T_color_depth
    np.testing.assert_allclose(
        transform(T, transform(poses["D0"], device)), transform(poses["PV0"], device), atol=1e-12
    )
    assert not np.allclose(T, invert_pose(T))


def test_coefficients_come_in_opencv_s_order() -> None:
    def bend(d0: dict[str, Any], _: dict[str, Any]) -> None:
        d0["Intrinsics"]["ModelParameters"][4:] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0, 0, 0.002, 0.001]

    assert rig(calibration(bend)).depth.distortion == (0.1, 0.2, 0.001, 0.002, 0.3, 0.4, 0.5, 0.6)


def test_the_older_lens_model_is_read_where_it_is_opencv_s_within_half_a_pixel() -> None:
    def model(p1: float) -> Callable[[dict[str, Any], dict[str, Any]], None]:
        def change(d0: dict[str, Any], _: dict[str, Any]) -> None:
            d0["Intrinsics"]["ModelType"] = "CALIBRATION_LensDistortionModelRational6KT"
            d0["Intrinsics"]["ModelParameters"][13] = p1

        return change

    assert rig(calibration(model(1e-4))).depth.distortion[2] == 1e-4
    with pytest.raises(InputError, match="Rational6KT"):
        rig(calibration(model(0.01)))


# A real recording


@pytest.fixture(scope="module")
def real(funtwin_data: Path) -> Path:
    return funtwin_data / "samples" / "azure_kinect"


@pytest.fixture(scope="module")
def capture(real: Path) -> Streams:
    return READER.streams(real / "recording.mkv")


def test_real_cameras_are_those_of_the_sdk(capture: Streams) -> None:
    seen = capture.rig
    np.testing.assert_allclose(seen.depth.camera.vector, [504.6076, 504.7325, 332.7811, 348.8297], atol=1e-3)
    np.testing.assert_allclose(seen.color.camera.vector, [611.7953, 611.9270, 639.3043, 365.8529], atol=1e-3)
    expected = {
        "depth": [0.547940, -0.020971, 2.0558e-5, -7.2104e-5, -0.002652, 0.889679, 0.086130, -0.013910],
        "color": [0.330121, -2.489397, -1.6178e-4, -1.2945e-4, 1.453671, 0.208912, -2.302915, 1.375128],
    }
    np.testing.assert_allclose(seen.depth.distortion, expected["depth"], atol=1e-6)
    np.testing.assert_allclose(seen.color.distortion, expected["color"], atol=1e-6)
    np.testing.assert_allclose(seen.T_color_depth[:3, 3], [-0.0320834, -0.0022054, 0.0038837], atol=1e-7)
    assert capture.color_times.tolist() == capture.depth_times.tolist() == [0.463945]


def test_real_pictures_are_those_of_another_decoder(real: Path, capture: Streams) -> None:
    color, depth = capture.read_color(0), capture.read_depth(0)
    millimetres = cv2.imread(str(real / "depth0.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(np.rint(1000 * depth), millimetres)
    with av.open(str(real / "recording.mkv")) as video:
        other = next(video.decode(video=0)).to_ndarray(format="rgb24")
    assert np.abs(color.astype(int) - other).mean() < 1.5  # chroma is brought up in two ways
    stored = cv2.imread(str(real / "color0.jpg"))[..., ::-1]
    assert np.abs(color.astype(int) - stored).mean() < 1.5  # compressed once more


def test_real_depth_lies_where_opencv_s_own_projection_puts_it(real: Path, capture: Streams) -> None:
    lens = capture.rig.color
    ours = DepthGrid(capture.rig, lens.camera)(capture.read_depth(0))
    splatted = cv2.imread(str(real / "depth_in_color0.png"), cv2.IMREAD_UNCHANGED) / 1000.0
    ray = rays(lens)  # of the distorted picture's pixels, into the undistorted one
    x, y = (
        ray[..., c] * f + m
        for c, f, m in ((0, lens.camera.fx, lens.camera.cx), (1, lens.camera.fy, lens.camera.cy))
    )
    j, i = np.floor(x), np.floor(y)
    h, w = ours.shape
    inside = (splatted > 0) & (j >= 0) & (i >= 0) & (j < w - 1) & (i < h - 1)
    j, i, u, v = j[inside].astype(int), i[inside].astype(int), (x - j)[inside], (y - i)[inside]
    corners = np.stack([ours[i, j], ours[i, j + 1], ours[i + 1, j], ours[i + 1, j + 1]])
    between = (corners * [(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v]).sum(axis=0)
    known = (corners > 0).all(axis=0)
    assert known.mean() > 0.9
    assert np.mean(np.abs(between - splatted[inside])[known] < 0.003) > 0.95


def test_real_frames_lie_where_ffmpeg_finds_them(real: Path) -> None:
    check_against_ffmpeg(real / "recording.mkv", 1000)


def check_against_ffmpeg(path: Path, scale: int) -> Contents:
    """Times and bytes of all frames of all tracks."""
    found, data = read_contents(path), path.read_bytes()
    assert found.whole_until == found.size == len(data)
    assert found.scale == scale
    with av.open(str(path)) as video:
        packets = [(p.stream.index, float(p.pts * p.time_base), bytes(p)) for p in video.demux() if p.size]
    for index, number_ in enumerate(t.number for t in found.tracks):
        own = [p for p in packets if p[0] == index]
        frames = found.frames[number_]
        assert len(own) == len(frames.ticks) > 0
        np.testing.assert_allclose(frames.ticks * scale / 1e9, [p[1] for p in own], atol=1e-9)
        places = zip(frames.starts, frames.sizes, strict=True)
        assert [data[start : start + size] for start, size in places] == [p[2] for p in own]
    return found


# The container


@pytest.mark.parametrize("live", ["0", "1"])
def test_a_file_of_ffmpeg_is_walked_as_ffmpeg_reads_it(tmp_path: Path, live: str) -> None:
    path = tmp_path / "video.mkv"
    with av.open(str(path), "w", options={"live": live, "cluster_time_limit": "200"}) as out:
        stream = out.add_stream("mjpeg", rate=20)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuvj420p"
        stream.metadata["title"] = "COLOR"
        out.add_attachment("calibration.json", "application/json", b'{"a": 1}')
        for k in range(40):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 5 * k, np.uint8), format="rgb24")
            out.mux(stream.encode(frame))
        out.mux(stream.encode())
    found = check_against_ffmpeg(path, 1_000_000)
    assert [(t.name, t.codec, t.width, t.height) for t in found.tracks] == [("COLOR", "V_MJPEG", 64, 48)]
    kept = found.attachments[0]
    assert kept.name == "calibration.json"
    assert path.read_bytes()[kept.start : kept.start + kept.size] == b'{"a": 1}'
    assert READER.recognises(path)  # colour alone, with a calibration: refused by name
    with pytest.raises(InputError, match="no track DEPTH: depth was off"):
        READER.streams(path)


class Counting(io.BytesIO):
    """A file that counts what is read of it."""

    taken = 0

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        self.taken += len(data)
        return data


def test_opening_reads_headers_alone(tmp_path: Path) -> None:
    data = write(tmp_path / "a.mkv", frames=30).read_bytes()
    stream = Counting(data)
    assert len(walk(stream, len(data), "a.mkv").frames[2].ticks) == 30
    assert stream.taken < 100 * 64 + 8192 < len(data) / 100
    stream.taken = 0
    assert len(walk(stream, len(data), "a.mkv", head_only=True).frames[2].ticks) == 0
    assert stream.taken < 4096


def test_three_gigabytes_open_at_once(tmp_path: Path) -> None:
    path, size = tmp_path / "large.mkv", 1280 * 288
    with path.open("wb") as file:
        file.write(
            head(
                [*tracks(), track(3, 9, "IR", "b16g", *DEPTH)], calibration(), [tag("K4A_IR_MODE", "ACTIVE")]
            )
        )
        for k in range(2700):
            file.write(element(0x1F43B675, number(0xE7, 33333 * k), UNKNOWN))
            for index in (1, 2, 3):
                block = bytes([0x80 | index, 0, 0, 0x80])
                file.write(b"\xa3\x01" + (size + 4).to_bytes(7) + block)
                file.seek(size, 1)
        file.truncate()
    assert path.stat().st_size > 2.9e9
    started = time.perf_counter()
    assert READER.recognises(path)
    streams = READER.streams(path)
    assert time.perf_counter() - started < 2
    assert len(streams.color_times) == len(streams.depth_times) == 2700


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


def nested(depth: int) -> bytes:
    return b"[" * depth + b"]" * depth


def changed(key: str, value: Any, where: str = "Intrinsics", who: int = 0) -> bytes:
    def change(*cameras: dict[str, Any]) -> None:
        target = cameras[who][where] if where else cameras[who]
        target[key] = value

    return calibration(change)


def parameters(**values: float) -> bytes:
    """The depth camera's with some of them replaced, by place."""
    own = calibration_of(PINHOLE)["CalibrationInformation"]["Cameras"][0]["Intrinsics"]["ModelParameters"]
    for place, value in values.items():
        own[int(place[1:])] = value
    return changed("ModelParameters", own)


REFUSED_TRACKS: list[tuple[list[bytes], Sequence[bytes], str]] = [
    (tracks()[:1], (), "no track DEPTH: depth was off"),
    (tracks()[:1], [tag("K4A_DEPTH_MODE", "PASSIVE_IR")], "PASSIVE_IR records infrared without depth"),
    (tracks()[1:], (), "no track COLOR: colour was off"),
    ([], [tag("K4A_IMU_MODE", "ON")], "no pictures"),
    (tracks("H264"), (), "track COLOR is stored as 'H264'"),
    (tracks(depth="FFV1"), (), "track DEPTH is stored as 'FFV1'"),
    (tracks("b16g", "MPNG"), (), "track COLOR is stored as 'b16g'"),
    (tracks(codec="V_MPEG4/ISO/AVC"), (), "'V_MPEG4/ISO/AVC'"),
    (tracks(size=(640, 480)), (), "depth is 640x480"),
    (tracks(size=(20_000, 20_000)), (), "20000x20000"),
    ([track(1, 1, "COLOR", "MPNG", 90, 72), tracks()[1]], (), "90x72, neither 4:3 nor 16:9"),
    (tracks(more=element(0x6D80, element(0x6240, element(0x5034)))), (), "stored with compression 0"),
    (tracks(more=element(0x6D80, element(0x6240, element(0x5035)))), (), "stored with encryption"),
    (tracks(), [tag("K4A_DEPTH_DELAY_NS", "soon\n")], r"K4A_DEPTH_DELAY_NS is 'soon\\n'"),
    (tracks(), [tag("K4A_DEPTH_DELAY_NS", "9" * 5000)], "K4A_DEPTH_DELAY_NS is '999"),
]  # fmt: skip
REFUSED_CALIBRATIONS: list[tuple[bytes, str]] = [
    (b"\0", "lists no cameras"),
    (b"\xff\xfe", "lists no cameras"),
    (b"{}", "lists no cameras"),
    (nested(100_000), "lists no cameras"),
    (b'{"CalibrationInformation": {"Cameras": 3}}', "camera D0 is missing"),
    (b'{"CalibrationInformation": {"Cameras": [null]}}', "camera D0 is incomplete"),
    (changed("Location", "CALIBRATION_CameraLocationD1", ""), "camera D0 is missing"),
    (changed("Location", 3, "", 1), "camera PV0 is missing"),
    (changed("ModelParameters", [0.5] * 13), "values, not 14"),
    (changed("ModelParameters", [[0.5], 1]), "camera D0 is incomplete"),
    (changed("ModelParameters", "0.5"), "values, not 14"),
    (changed("ModelParameters", [10**400] * 14), "camera D0 is incomplete"),
    (parameters(p0=float("nan")), "values, not 14"),
    (parameters(p0=7.0), "outside the 320x288"),
    (parameters(p2=0.0), "focal lengths 0"),
    (parameters(p2=-0.5), "focal lengths -0.5"),
    (parameters(p10=0.1), "codx 0.1"),
    (changed("ModelType", "CALIBRATION_LensDistortionModelTheta"), "lens model 'Theta'"),
    (changed("Rotation", [1, 0, 0, 0, 1, 0, 0, 0, 2], "Rt"), "no rotation"),
    (changed("Rotation", [1, 0, 0, 0, 1, 0, 0, 0, -1], "Rt"), "no rotation"),
    (changed("Translation", [0, 0, float("inf")], "Rt", 1), "values, not 14"),
    (changed("SensorWidth", 640, ""), "of a sensor of 640x1024"),
    (changed("SensorWidth", 3072, "", 1), "3072x3072, neither"),
    (b" " * 2**21, "has 2097152 bytes"),
]  # fmt: skip


def check_one_line(error: InputError, name: str) -> None:
    assert name in str(error)
    assert "\n" not in str(error)
    assert error.remedy
    assert len(str(error)) < 400


@pytest.mark.parametrize(("entries", "tags", "problem"), REFUSED_TRACKS)
def test_refused_tracks(tmp_path: Path, entries: list[bytes], tags: Sequence[bytes], problem: str) -> None:
    path = write(tmp_path / "clip.mkv", entries, tags=tags)
    with pytest.raises(InputError, match=problem) as refused:
        READER.streams(path)
    check_one_line(refused.value, "clip.mkv")


@pytest.mark.parametrize(("data", "problem"), REFUSED_CALIBRATIONS)
def test_refused_calibrations(tmp_path: Path, data: bytes, problem: str) -> None:
    path = write(tmp_path / "clip.mkv", camera=data)
    with pytest.raises(InputError, match=problem) as refused:
        READER.streams(path)
    check_one_line(refused.value, "clip.mkv")


def test_a_file_without_calibration_or_pictures_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "clip.mkv"
    path.write_bytes(head(tracks(), None, []) + cluster(0, [(1, 0, b"a")]))
    with pytest.raises(InputError, match="no attachment calibration"):
        READER.streams(path)
    with pytest.raises(InputError, match=r"clip\.mkv holds no pictures"):
        READER.streams(write(path, frames=0))
    with pytest.raises(InputError, match="no picture of track 'COLOR'"):
        READER.streams(write(path, pictures=lambda k: [(2, 0, depth_bytes(k))]))
    with pytest.raises(InputError, match="laced"):
        READER.streams(write(path, flags=0x84))


PNG = pack_color(picture(0), "MPNG")
JPEG = pack_color(picture(0), "MJPG")
BAD_PICTURES: list[tuple[str, bytes, bytes, str]] = [
    ("MPNG", PNG, depth_bytes(0)[:-2], "has 184318 bytes, 320x288 b16g have 184320"),
    ("MPNG", PNG, b"", "has 0 of 0 bytes"),
    ("MPNG", PNG[:-20], depth_bytes(0), "truncated"),
    ("MPNG", PNG[:60] + bytes(len(PNG) - 80) + PNG[-20:], depth_bytes(0), "picture 0 of track 'COLOR'"),
    ("MPNG", PNG[:16] + b"\0\1\0\0" * 2 + PNG[24:], depth_bytes(0), "is 65536x65536, its track 96x72"),
    ("MJPG", pack_color(picture(0)[:, :48], "MJPG"), depth_bytes(0), "is 48x72, its track 96x72"),
    ("MJPG", JPEG[:300], depth_bytes(0), "COLOR"),
    ("MJPG", JPEG[:-200], depth_bytes(0), "truncated"),
    ("MJPG", b"\xff" * 5000, depth_bytes(0), "says no size"),
    ("BGRA", bytes(99), depth_bytes(0), "has 99 bytes, 96x72 BGRA have 27648"),
    ("NV12", bytes(99), depth_bytes(0), "has 99 bytes, 96x72 NV12 have 10368"),
]  # fmt: skip


@pytest.mark.parametrize(("color", "image", "depth", "problem"), BAD_PICTURES)
def test_bad_pictures_are_named_when_they_are_asked_for(
    tmp_path: Path, color: str, image: bytes, depth: bytes, problem: str
) -> None:
    path = write(tmp_path / "clip.mkv", tracks(color), lambda _: [(1, 0, image), (2, 0, depth)])
    recording = recording_of(READER.streams(path))
    with pytest.raises(InputError, match=problem) as refused:
        recording.frame(0)
    check_one_line(refused.value, "clip.mkv: picture 0")


BLOCK = element(0xA3, b"\x81\0\0\x80abc")
FRAME = element(0x1F43B675, number(0xE7, 0) + BLOCK)
HOSTILE = {
    "empty elements": (b"\xec\x80" * 60_000, "more than 50000 elements"),
    "groups in groups": (b"\xa0\x80" * 60_000, "more than 50000 elements"),
    "tracks": (element(0x1654AE6B, b"\xae\x80" * 30_000), "more than 20000 elements"),
    "video in video": (
        element(0x1654AE6B, element(0xAE, b"".join(b"\xe0\x01" + (9 * k).to_bytes(7) for k in range(30_000, -1, -1)))),
        "more than 20000 elements",
    ),
    "an end past the file": (element(0xEC, b"", b"\x01" + b"\x7f" * 7), "no pictures"),
    "no end": (element(0x1C53BB6B, bytes(127) + FRAME, b"\xff"), "no pictures"),
    "a name of a gigabyte": (
        element(0x1654AE6B, element(0xAE, element(0x536E, b"a", b"\x01\0\0\0\x40\0\0\0"))), "no pictures"
    ),
    "a number of 200 bytes": (element(0x1F43B675, element(0xE7, b"\xff" * 200) + BLOCK), "no pictures"),
    "no id": (bytes(100), "no pictures"),
    "a block before its time": (element(0x1F43B675, BLOCK), "no pictures"),
    "an empty block": (element(0x1F43B675, number(0xE7, 0) + element(0xA3)), "no pictures"),
}  # fmt: skip


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_files_end_soon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    monkeypatch.setattr(ebml, "MAX_ELEMENTS", 50_000)
    path, (data, problem) = tmp_path / "clip.mkv", HOSTILE[kind]
    path.write_bytes(head(tracks(), calibration(), []) + data)
    READER.recognises(path)
    with pytest.raises(InputError, match=problem) as refused:
        READER.streams(path)
    check_one_line(refused.value, "clip.mkv")


def test_a_cluster_without_a_time_ends_what_is_read(tmp_path: Path) -> None:
    path = write(tmp_path / "clip.mkv")
    good = path.stat().st_size
    with path.open("ab") as file:
        file.write(element(0x1F43B675, BLOCK))
    found = read_contents(path)
    assert len(found.frames[1].ticks) == 12
    assert good < found.whole_until < found.size


def test_flipped_bits_are_refused_or_read(tmp_path: Path) -> None:
    data = bytearray(
        write(tmp_path / "clip.mkv", frames=10, tags=[tag("K4A_DEPTH_DELAY_NS", "0")]).read_bytes()
    )
    start = data.index(b"\x1f\x43\xb6\x75")
    rng, read = random.Random(7), 0  # noqa: S311
    said: list[str] = []
    for trial in range(100):
        at = rng.randrange(start + 100) if trial % 4 else rng.randrange(len(data))
        kept = data[at]
        data[at] ^= 1 << rng.randrange(8)
        (tmp_path / "clip.mkv").write_bytes(data)
        data[at] = kept
        READER.recognises(tmp_path / "clip.mkv")
        try:
            recording = recording_of(READER.streams(tmp_path / "clip.mkv"))
            recording.frame(0)
            read += 1
        except InputError as error:
            said.append(str(error))
    assert not any("\n" in text for text in said)
    assert 10 < read < 90

"""Azure Kinect files that are refused: tracks, calibrations and pictures, each in one line that names it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from benchmarks.layouts.azure_kinect import (
    calibration_of,
    cluster,
    element,
    head,
    pack_color,
    tag,
    track,
)
from recon.readers.streams import recording_of
from tests.makers.recon.azure_recording import (
    PINHOLE,
    READER,
    calibration,
    check_one_line,
    depth_bytes,
    picture,
    tracks,
    write,
)
from twin.errors import InputError


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

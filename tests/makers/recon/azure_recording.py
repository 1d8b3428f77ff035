"""Azure Kinect files of our own for the tests: their tracks, calibration and captures, whole or changed."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from benchmarks.layouts.azure_kinect import (
    calibration_of,
    cluster,
    head,
    pack_color,
    track,
)
from recon.readers.kinect import AzureKinectReader
from recon.readers.kinect.matroska import Contents, read_contents
from recon.readers.streams import recording_of
from recon.recording import Intrinsics, Recording
from twin.errors import InputError

COLOR = (96, 72)
DEPTH = (320, 288)  # the smallest mode
PINHOLE = Intrinsics(*COLOR, 80.0, 81.0, 47.0, 35.0)
READER = AzureKinectReader()


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


def check_one_line(error: InputError, name: str) -> None:
    assert name in str(error)
    assert "\n" not in str(error)
    assert error.remedy
    assert len(str(error)) < 400

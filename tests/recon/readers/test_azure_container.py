"""The container of Azure Kinect recordings: walked as ffmpeg walks it, opened by its headers, and hostile
files end soon."""

from __future__ import annotations

import io
import random
import time
from pathlib import Path

import av
import numpy as np
import pytest

from benchmarks.layouts.azure_kinect import (
    UNKNOWN,
    element,
    head,
    number,
    tag,
    track,
)
from recon.readers.kinect import ebml
from recon.readers.kinect.matroska import read_contents, walk
from recon.readers.streams import recording_of
from tests.makers.recon.azure_recording import (
    DEPTH,
    READER,
    calibration,
    check_against_ffmpeg,
    check_one_line,
    tracks,
    write,
)
from twin.errors import InputError


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

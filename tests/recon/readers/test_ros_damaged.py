"""ROS bags that were cut or changed: one line each, no hang, no room made for what headers claim."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from benchmarks.layouts import ros as layouts
from benchmarks.layouts.ros import Style
from benchmarks.layouts.ros_mcap import write_plain_mcap
from recon.readers.ros import RosReader
from recon.recording import Intrinsics, Recording
from tests.makers.recon import bags
from tests.makers.recon.bags import problem, read_all
from twin.errors import InputError


@pytest.fixture(scope="module")
def original() -> Recording:
    return bags.frames()


def write_all(original: Recording, folder: Path) -> list[Path]:
    mcap = layouts.write_ros2(original, folder / "b", storage="mcap") / "b.mcap"
    packed = layouts.write_ros2(original, folder / "c", storage="mcap", compression="storage") / "c.mcap"
    db3 = layouts.write_ros2(original, folder / "d", Style(color="png")) / "d.db3"
    lz4 = layouts.write_ros1(original, folder / "e.bag", compression="lz4")
    return [layouts.write_ros1(original, folder / "a.bag"), mcap, packed, db3, lz4]


def test_truncated_bags_are_told(tmp_path: Path, original: Recording) -> None:
    for path in write_all(original, tmp_path):
        data = path.read_bytes()
        told = 0
        for size in (20, 200, len(data) // 3, len(data) // 2, len(data) - 40):
            cut = tmp_path / f"cut{path.suffix}"
            cut.write_bytes(data[:size])
            if RosReader().recognises(cut):
                assert problem(cut)
                told += 1
        assert told > 0  # a head alone is that of no bag


def test_flipped_bytes_give_one_line_or_a_recording(tmp_path: Path) -> None:
    small = Intrinsics(8, 6, 8.0, 8.0, 3.5, 2.5)
    tiny = Recording.from_arrays(
        np.zeros((10, 6, 8, 3), np.uint8), np.ones((10, 6, 8), np.float32), small, fps=15
    )
    rng = np.random.default_rng(7)
    outcomes = {"read": 0, "told": 0}
    for path in write_all(tiny, tmp_path):
        data = path.read_bytes()
        for n in range(40):
            bad = bytearray(data)
            at = int(rng.integers(len(bad) if n % 2 else min(len(bad), 6000)))
            at = len(bad) - 1 - at if n % 4 == 2 else at  # anywhere, or near the beginning or the end
            bad[at] = int(rng.integers(256))
            path.write_bytes(bytes(bad))
            if RosReader().recognises(path):
                try:
                    read_all(path)
                    outcomes["read"] += 1
                except InputError as error:
                    outcomes["told"] += "\n" not in str(error)
    assert min(outcomes.values()) > 0
    assert sum(outcomes.values()) > 150  # of 200; others are no bags any more


def test_header_that_claims_gigabytes_takes_none(tmp_path: Path, original: Recording) -> None:
    path = write_plain_mcap(original, tmp_path / "a.mcap")
    data = path.read_bytes()
    at = data.index(b"rgb8\0")  # behind height, width and its own length
    claimed = bytearray(data)
    claimed[at - 12 : at - 4] = struct.pack("<II", 2**31, 2**31)
    path.write_bytes(bytes(claimed))
    assert "claims" in problem(path)
    stamp = round(original.times[0] * 1e9)
    start = data.index(struct.pack("<HIQQ", 0, 0, stamp, stamp)) - 9
    path.write_bytes(data[:start] + struct.pack("<BQ", 5, 2**60) + data[start + 9 :])
    assert "truncated" in problem(path)

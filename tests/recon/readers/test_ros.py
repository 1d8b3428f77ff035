"""ROS bags: containers, clocks, and which topics are taken."""

from __future__ import annotations

import shutil
import sqlite3
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks.layouts import ros as layouts
from benchmarks.layouts.ros import Style
from benchmarks.layouts.ros_mcap import write_plain_mcap
from recon.readers.ros import RosReader
from recon.readers.ros import chunks as ros_chunks
from recon.recording import Recording
from tests.makers.recon import bags
from tests.makers.recon.bags import CAMERA, FRAMES, check_same, opened, problem
from twin.errors import InputError, MissingDependencyError


@pytest.fixture(scope="module")
def original() -> Recording:
    return bags.frames()


@pytest.mark.parametrize("compression", ["", "bz2", "lz4"])
def test_ros1_bag_is_the_recording(tmp_path: Path, original: Recording, compression: str) -> None:
    check_same(opened(layouts.write_ros1(original, tmp_path / "a.bag", compression=compression)), original)


@pytest.mark.parametrize(
    ("storage", "compression"),
    [("sqlite3", ""), ("sqlite3", "message"), ("mcap", ""), ("mcap", "message"), ("mcap", "storage")],
)
def test_ros2_folder_and_its_lone_file_are_the_recording(
    tmp_path: Path, original: Recording, storage: str, compression: str
) -> None:
    folder = layouts.write_ros2(original, tmp_path / "my bag", storage=storage, compression=compression)
    check_same(opened(folder), original)
    lone = next(p for p in folder.iterdir() if p.suffix in (".db3", ".mcap"))
    moved = shutil.copy(lone, tmp_path / f"alone{lone.suffix}")
    check_same(opened(Path(moved)), original)
    (folder / "metadata.yaml").unlink()  # as a killed recorder leaves it
    check_same(opened(folder), original)


@pytest.mark.parametrize("chunked", [False, True])
def test_mcap_without_any_index_is_the_recording(tmp_path: Path, original: Recording, chunked: bool) -> None:
    check_same(opened(write_plain_mcap(original, tmp_path / "a.mcap", chunked)), original)


def test_bag_in_several_files_is_one_recording(tmp_path: Path, original: Recording) -> None:
    folder = tmp_path / "split"
    folder.mkdir()
    for n, part in enumerate((original[:10], original[2:])):
        whole = layouts.write_ros2(part, tmp_path / f"part_{n}")
        shutil.move(whole / f"part_{n}.db3", folder / f"split_{n}.db3")
    recording = opened(folder)
    check_same(recording, original)  # what both files hold counts once
    assert "8 colour pictures have the time stamp of another" in recording.warnings[0]


def test_folder_of_several_bags_is_none(tmp_path: Path, original: Recording) -> None:
    for name in ("one", "two"):
        write_plain_mcap(original, tmp_path / f"{name}.mcap")
    assert not RosReader().recognises(tmp_path)
    (tmp_path / "two.mcap").rename(tmp_path / "one_1.mcap")
    assert RosReader().recognises(tmp_path)
    (tmp_path / "intrinsic.json").write_text("{}")  # what it was turned into is read instead
    assert not RosReader().recognises(tmp_path)


def test_reading_writes_nothing_beside_the_bag(tmp_path: Path, original: Recording) -> None:
    folder = layouts.write_ros2(original, tmp_path / "bag")
    with sqlite3.connect(folder / "bag.db3") as base:
        base.execute("PRAGMA journal_mode = WAL")  # as rosbag2 records; closing it leaves one file
    base.close()
    before = {p.name: (p.stat().st_mtime_ns, p.read_bytes()) for p in folder.iterdir()}
    check_same(opened(folder), original)
    assert {p.name: (p.stat().st_mtime_ns, p.read_bytes()) for p in folder.iterdir()} == before


def test_database_that_was_not_closed_is_told(tmp_path: Path, original: Recording) -> None:
    folder = layouts.write_ros2(original, tmp_path / "bag")
    (folder / "bag.db3-wal").write_bytes(b"1234")
    assert "wal_checkpoint" in problem(folder)


def test_stamps_count_not_the_times_of_logging(tmp_path: Path, original: Recording) -> None:
    late = Style(lag=lambda k: (0, 90, 20)[k % 3] * 10**6)  # frame 2 is logged before frame 1
    check_same(opened(layouts.write_ros2(original, tmp_path / "a", late, storage="mcap")), original)
    # in packed chunks a sample of the stamps is not enough here, and is where they are late by one number
    for n, lag in enumerate((late.lag, lambda _: 5 * 10**8)):
        path = layouts.write_ros1(original, tmp_path / f"{n}.bag", Style(lag=lag), "lz4")
        check_same(opened(path), original)


def test_stamps_in_packed_chunks_are_sampled_only_if_that_suffices(tmp_path: Path) -> None:
    long = Recording.from_arrays(
        np.zeros((40, 24, 32, 3), np.uint8), np.ones((40, 24, 32), np.float32), CAMERA, fps=30
    )
    lags: list[Callable[[int], int]] = [lambda _: 3 * 10**8, lambda k: 10**7 * k, lambda k: 10**7 * (k % 5)]
    for n, lag in enumerate(lags):
        path = layouts.write_ros1(long, tmp_path / f"{n}.bag", Style(lag=lag), "lz4")
        np.testing.assert_allclose(opened(path).times, long.times, rtol=0, atol=1e-6)


def test_messages_without_stamps_take_the_log_s(tmp_path: Path, original: Recording) -> None:
    recording = opened(layouts.write_ros1(original, tmp_path / "a.bag", Style(stamped=False)))
    check_same(recording, original)
    assert "no time stamps" in recording.warnings[0]


def test_messages_of_one_log_time_are_all_reached(tmp_path: Path, original: Recording) -> None:
    times = [round(t * 1e9) for t in original.times]
    style = Style(lag=lambda k: times[k - k % 3] - times[k])
    for path in (
        layouts.write_ros1(original, tmp_path / "a.bag", style),
        layouts.write_ros2(original, tmp_path / "sqlite", style),
        layouts.write_ros2(original, tmp_path / "mcap", style, storage="mcap"),
    ):
        check_same(opened(path), original)


def test_named_topics_go_before_what_is_found(tmp_path: Path, original: Recording) -> None:
    style = Style(extra=("/camera/rgb/image_raw",), color="bgr8")
    path = layouts.write_ros1(original, tmp_path / "a.bag", style)
    with pytest.raises(InputError, match=r"2 colour topics: .*--color-topic"):
        opened(path)
    assert (
        opened(path, color_topic="/camera/rgb/image_raw").metadata["color_topic"] == "/camera/rgb/image_raw"
    )
    one, two = (opened(path, color_topic=t) for t in ("/camera/rgb/image_raw", layouts.COLOR))
    assert one.fingerprint != two.fingerprint
    assert "did you mean '/camera/color/image_raw'" in problem(path, color_topic="/camera/colour/image_raw")
    assert "type sensor_msgs/msg/CameraInfo" in problem(path, depth_topic="/camera/color/camera_info")
    assert "no depth" in problem(path, depth_topic="/camera/rgb/image_raw", color_topic=layouts.COLOR)


def test_depth_that_lies_on_color_is_preferred(tmp_path: Path, original: Recording) -> None:
    with layouts.ros1_bag(tmp_path / "a.bag") as bag:
        layouts.write_into(bag, original, Style(T_color_depth=np.eye(4)))
        layouts.write_into(bag, original, Style())
    recording = opened(tmp_path / "a.bag")
    assert recording.metadata["depth_topic"] == layouts.ALIGNED
    assert "time stamp of another" in recording.warnings[0]


def test_bag_without_depth_or_color_lists_what_it_has(tmp_path: Path, original: Recording) -> None:
    with layouts.ros1_bag(tmp_path / "a.bag") as bag:
        for k in range(FRAMES):
            layouts.put_color(bag, "/cam/image", original.color(k), 1 + k, 1 + k, Style())
    said = problem(tmp_path / "a.bag")
    assert "no depth topic" in said
    assert "/cam/image (rgb8, 12)" in said
    with layouts.ros2_bag(tmp_path / "empty") as bag:
        bag.put("/chatter", "std_msgs/msg/String", bag.make("std_msgs/msg/String", "hello"), 5)
    assert "/chatter (String, 1)" in problem(tmp_path / "empty")


def test_names_with_line_breaks_stay_one_line(tmp_path: Path, original: Recording) -> None:
    path = layouts.write_ros2(original, tmp_path / "a", storage="mcap") / "a.mcap"
    data = path.read_bytes()
    path.write_bytes(data.replace(b"sensor_msgs/msg/Image", b"sensor_msgs/msg/Im\nge"))
    assert "Im ge" in problem(path)


def test_index_that_leads_to_a_connection_before_the_message(tmp_path: Path) -> None:
    def record(op: int, data: bytes) -> bytes:
        header = struct.pack("<I", 4) + b"op=" + bytes([op])
        return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data

    path = tmp_path / "records"
    path.write_bytes(record(7, b"a connection") + record(2, b"the message") + record(4, b"index"))
    file = ros_chunks.ChunkFile(path)
    with path.open("rb") as stream:
        view = file.view(stream, ros_chunks.Chunk(0, file.size))
        assert view.read(*ros_chunks._ros1_message(view, 0)) == b"the message"
        with pytest.raises(InputError, match="not to a message"):
            ros_chunks._ros1_message(view, file.size - len(record(4, b"index")))


def test_without_the_library_opening_says_what_to_install(
    tmp_path: Path, original: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = layouts.write_ros1(original, tmp_path / "a.bag")
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    assert RosReader().recognises(path)
    with pytest.raises(MissingDependencyError, match="rosbags"):
        RosReader().streams(path)


def test_other_files_are_not_recognised(tmp_path: Path) -> None:
    base = sqlite3.connect(tmp_path / "notes.db3")
    base.execute("CREATE TABLE notes (text)")
    base.commit()
    base.close()
    (tmp_path / "video.mcap").write_bytes(b"\x1aE\xdf\xa3" + bytes(64))
    (tmp_path / "empty.bag").write_bytes(b"")
    (tmp_path / "metadata.yaml").write_text("rosbag: none\n")
    for path in (tmp_path, *tmp_path.iterdir()):
        assert not RosReader().recognises(path)


def test_folder_that_lacks_a_file_says_which(tmp_path: Path, original: Recording) -> None:
    folder = layouts.write_ros2(original, tmp_path / "bag")
    (folder / "bag.db3").rename(folder / "other.db3")
    assert "lacks bag.db3" in problem(folder)
    packed = layouts.write_ros2(original, tmp_path / "packed", compression="file")
    assert "zstd -d packed.db3.zstd" in problem(packed)

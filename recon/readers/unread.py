"""Recordings that are recognised but not read: what each is, and what to do with it today.

`UNREAD` is the one table. A file is known by its first bytes, so that a renamed one is known as well, and by its name only
where its format has no signature or its bytes are not those of its name; a folder is known by the files in it.
"""

from __future__ import annotations

import shlex
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from recon.readers.record3d import is_record3d
from twin.errors import InputError

__all__ = ["UNREAD", "Unread", "refuse_unread", "refuse_unread_inside"]

Test = Callable[[Path], bool]

_SEARCHED = 2**20  # bytes at each end of a bag or video in which its maker's name is looked for; chosen by us
_LOOKED_AT = 50  # files of a folder that are looked at; chosen by us
_ARCHIVES = (
    b"PK\x03\x04",
    b"PK\x05\x06",
    b"\x1f\x8b",
    b"BZh",
    b"\xfd7zXZ\0",
    b"7z\xbc\xaf\x27\x1c",
    b"\x28\xb5\x2f\xfd",
)
_BY_ARRAYS = "and give colour and depth to recon.Recording.from_arrays"
_ROSBAGS = f"read its image topics with the Python library rosbags (rosbags.highlevel.AnyReader) {_BY_ARRAYS}"
_WITH_DEPTH = "record with a depth camera, or on a phone with Record3D"


@dataclass(frozen=True)
class Unread:
    """One format: what it is, what to do today, and how it is known.

    `{path}` in `remedy` is replaced by the path as a shell takes it, `{literal}` by the path as Python writes it. has: whether a path holds it, by content; None where only the name tells.
    suffixes: names that files of this format have.
    """

    what: str
    remedy: str
    has: Test | None = None
    suffixes: tuple[str, ...] = ()


def _edge(path: Path, start: int, count: int) -> bytes:
    """Up to `count` bytes of a file from `start` (from its end when negative); none of what can't be read."""
    with suppress(OSError), path.open("rb") as stream:
        stream.seek(start if start >= 0 else max(0, path.stat().st_size + start))
        return stream.read(count)
    return b""


def _begins(*magic: bytes, at: int = 0) -> Test:
    return lambda path: path.is_file() and _edge(path, at, 16).startswith(magic)


def _mentions(word: bytes, begins: Test) -> Test:
    """Whether a file begins like this and holds a word near its beginning or its end."""

    def has(path: Path) -> bool:
        return begins(path) and any(word in _edge(path, s, _SEARCHED) for s in (0, -_SEARCHED))

    return has


def _topics(path: Path) -> tuple[str, ...] | None:
    """Topics of a ROS 2 bag in SQLite; None for another file."""
    if not _SQLITE(path):
        return None
    tables = _sqlite(path, "SELECT name FROM sqlite_master WHERE type = 'table'")
    return _sqlite(path, "SELECT name FROM topics") if {"topics", "messages"} <= set(tables) else None


def _sqlite(path: Path, query: str) -> tuple[str, ...]:
    source = (
        f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1"  # changes nothing, not even beside the file
    )
    with suppress(sqlite3.Error), closing(sqlite3.connect(source, uri=True)) as base:
        return tuple(str(row[0]) for row in base.execute(query))
    return ()


def _is_rtabmap(path: Path) -> bool:
    tables = _sqlite(path, "SELECT name FROM sqlite_master WHERE type = 'table'") if _SQLITE(path) else ()
    return {"Node", "Data", "Link"} <= set(tables)


def _is_sens(path: Path) -> bool:
    """ScanNet's header: uint32 version 4, uint64 length of the sensor's name, the name."""
    head = _edge(path, 0, 12 + 256) if path.is_file() else b""
    if len(head) < 16:
        return False
    version, length = struct.unpack("<IQ", head[:12])
    return version == 4 and 0 < length <= 256 and head[12 : 12 + length].isascii() and head[12:13].isalpha()


def _holds(*names: str) -> Test:
    """Whether a folder holds each of these names or patterns."""
    return lambda path: path.is_dir() and all(any(path.glob(n)) for n in names)


def _either(*tests: Test) -> Test:
    return lambda path: any(test(path) for test in tests)


_ROSBAG = _begins(b"#ROSBAG V")
_SQLITE = _begins(b"SQLite format 3\0")
_MCAP = _begins(b"\x89MCAP0\r\n")
_EBML = _begins(b"\x1aE\xdf\xa3")
_AVI = _begins(b"AVI ", at=8)
_QUICKTIME = _begins(b"ftyp", b"moov", b"wide", b"mdat", at=4)


def _is_ros2_folder(path: Path) -> bool:
    return path.is_dir() and b"rosbag2_bagfile_information" in _edge(path / "metadata.yaml", 0, 4096)


# The first that has a path tells. Commands are those of the tools' own documentation.
UNREAD: dict[str, Unread] = {
    "zed": Unread(
        "a ZED recording",
        "export it with the ZED SDK's sample `python svo_export.py --mode 4 --input_svo_file {path} --output_path_dir FOLDER`, "
        "put left*.png into color/ and depth*.png into depth/, and write intrinsic.json",
        suffixes=(".svo", ".svo2"),
    ),
    "realsense_bag": Unread(
        "a RealSense recording (ROS 1 bag)",
        "unpack it in Python with open3d.t.io.RGBDVideoReader.create({literal}).save_frames('FOLDER'), then give FOLDER",
        _mentions(b"/device_0/sensor_", _ROSBAG),
    ),
    "rosbag": Unread("a ROS 1 bag", _ROSBAGS, _ROSBAG, (".bag",)),
    "realsense_db3": Unread(
        "a RealSense recording (ROS 2 bag)",
        "play it with pyrealsense2 (config.enable_device_from_file, align(stream.color)) " + _BY_ARRAYS,
        lambda path: any(t.startswith("/device_0/") for t in _topics(path) or ()),
    ),
    "rosbag2": Unread(
        "a ROS 2 bag", _ROSBAGS, _either(lambda path: _topics(path) is not None, _is_ros2_folder), (".db3",)
    ),
    "mcap": Unread("an MCAP log (ROS 2)", _ROSBAGS, _MCAP, (".mcap",)),
    "rtabmap": Unread(
        "an RTAB-Map database",
        "write its images with `rtabmap-export --images --output_dir FOLDER {path}`; by itself RTAB-Map keeps one frame a "
        "second, too few to see a motion",
        _is_rtabmap,
    ),
    "azure_kinect": Unread(
        "an Azure Kinect recording",
        "unpack it with `python -m open3d.examples.reconstruction_system.sensors.azure_kinect_mkv_reader --input {path} "
        "--output FOLDER` (needs the Azure Kinect SDK), then give FOLDER",
        _mentions(b"K4A_", _EBML),
    ),
    "video": Unread(
        "a video, colour without depth",
        f"{_WITH_DEPTH}; if depth was saved beside it, write both as images "
        "(`ffmpeg -i {path} -start_number 0 color/%06d.jpg`, depth/ as 16-bit PNG in mm) with intrinsic.json",
        _either(_EBML, _AVI, _QUICKTIME),
        (".mp4", ".mov", ".m4v", ".mkv", ".avi", ".webm"),
    ),
    "openni": Unread(
        "an OpenNI recording",
        "extract it with pyoni: `pyonitool.py --extractcolor color --extractdepth depth {path}`, and write intrinsic.json",
        _begins(b"NI10"),
        (".oni",),
    ),
    "klg": Unread(
        "a Kintinuous/ElasticFusion log",
        "extract it with `klg2png {path} color depth 640 480` (its image size), and write intrinsic.json",
        suffixes=(".klg",),
    ),
    "scannet": Unread(
        "a ScanNet recording",
        "export it with ScanNet's SensReader `python reader.py --filename {path} --output_path FOLDER --export_color_images "
        "--export_depth_images --export_intrinsics`, and write intrinsic.json and depth_intrinsic.json from FOLDER/intrinsic",
        _is_sens,
        (".sens",),
    ),
    "aria": Unread(
        "a Project Aria recording, which has no depth camera", _WITH_DEPTH, suffixes=(".vrs",)
    ),
    "archive": Unread(
        "an archive",
        "unpack it (`unzip {path} -d FOLDER`, `tar -xf {path} -C FOLDER`) and give the folder of the recording",
        _either(_begins(*_ARCHIVES), _begins(b"ustar", at=257)),
        (".zip", ".tar", ".gz", ".tgz", ".bz2", ".xz", ".7z", ".zst", ".rar"),
    ),
    "stray_scanner": Unread(
        "a Stray Scanner recording",
        "turn it into a folder that is read with `python benchmarks/stray_scanner.py {path} RECORDING` from Funtwin's "
        "repository, or record with Record3D",
        _either(_holds("odometry.csv", "rgb.mp4"), _holds("odometry.csv", "camera_matrix.csv")),
    ),
    "record3d_exr": Unread(
        "Record3D's export as EXR and RGB",
        "export the recording from Record3D as .r3d, which is read",
        _either(_holds("rgb", "depth/*.exr"), _holds("EXR_RGBD")),
    ),
    "polycam": Unread(
        "Polycam's raw data: key frames of a scene that stands still",
        "record the motion with depth in every frame, on a phone with Record3D",
        _either(_holds("keyframes/images"), _holds("keyframes/corrected_images")),
    ),
    "scanner_app": Unread(
        "an export of 3D Scanner App",
        "put frame_*.jpg into color/ and depth_*.png into depth/, and write intrinsic.json and depth_intrinsic.json from the "
        "intrinsics in frame_*.json",
        _holds("frame_*.json", "frame_*.jpg"),
    ),
    "arkit_scenes": Unread(
        "an ARKitScenes sequence",
        "rename lowres_wide to color and lowres_depth to depth, and write intrinsic.json from a .pincam file "
        "(width height fx fy cx cy) and timestamps.txt from the images' names",
        _holds("*lowres_depth*"),
    ),
    "euroc": Unread(
        "an EuRoC sequence: grey stereo and inertia without depth", _WITH_DEPTH, _either(_holds("mav0/cam0"), _holds("cam0/data.csv"))
    ),
}  # fmt: skip


def refuse_unread(path: Path) -> None:
    """Raise InputError that tells what the path is and what to do, when it is one of `UNREAD`.

    A folder with intrinsic.json is one that was converted, and a Record3D archive is read.
    """
    if (path / "intrinsic.json").is_file() or is_record3d(path):
        return
    kind = _kind(path)
    if kind is not None:
        raise _refusal(path, f"{path} is {kind.what}", kind)
    named = next((k for k in UNREAD.values() if path.is_file() and path.suffix.lower() in k.suffixes), None)
    if named is not None:
        doubt = (
            f"{path} is named like {named.what}, but its {path.stat().st_size} bytes do not begin like one"
        )
        raise _refusal(path, doubt, named)


def _kind(path: Path) -> Unread | None:
    """The format that a path holds, by its content, or by its name where only that tells."""
    for kind in UNREAD.values():
        if (
            kind.has(path)
            if kind.has is not None
            else path.is_file() and path.suffix.lower() in kind.suffixes
        ):
            return kind
    return None


def refuse_unread_inside(folder: Path) -> None:
    """Raise InputError when a folder that no reader knows holds a file or a folder that is one of `UNREAD`."""
    inside = sorted(folder.iterdir())[:_LOOKED_AT] if folder.is_dir() else []
    for path in inside:
        kind = None if is_record3d(path) else _kind(path)
        if kind is not None:
            raise _refusal(path, f"{folder} is no recording, but holds {path.name}, {kind.what}", kind)


def _refusal(path: Path, problem: str, kind: Unread) -> InputError:
    remedy = kind.remedy.replace("{path}", shlex.quote(str(path))).replace("{literal}", repr(str(path)))
    return InputError(f"{problem}, which is not read", remedy)

"""Recordings that are recognised but not read: what each is, and what to do with it today.

`UNREAD` is the one table. A file is known by its first bytes, so that a renamed one is known as well, and by
its name only if its format has no signature or its bytes are others; a folder is known by the files in it.
"""

from __future__ import annotations

import shlex
import sqlite3
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from recon.readers.files import COLOR_SUFFIXES, FLOAT_DEPTH_SUFFIXES
from twin.errors import InputError

__all__ = [
    "COLOUR_ALONE", "LOOKED_AT", "READ", "UNREAD", "Unread",
    "refuse_colour_alone", "refuse_named", "refuse_unread", "refuse_unread_inside",
]  # fmt: skip

Test = Callable[[Path], bool]

LOOKED_AT = 50  # files of a folder that are looked at; chosen by us
_ARCHIVES = (
    b"PK\x03\x04",
    b"PK\x05\x06",
    b"\x1f\x8b",
    b"BZh",
    b"\xfd7zXZ\0",
    b"7z\xbc\xaf\x27\x1c",
    b"\x28\xb5\x2f\xfd",
)
_WITH_DEPTH = "record with a depth camera, or on a phone with Record3D"
_COLOUR_SUFFIXES = (*COLOR_SUFFIXES, ".webp", ".heic")
_GREY_16_BITS = b"\x10\x00"  # of a PNG's header at byte 24: bits of a value and the kind of pixels
# What colour alone lacks, and what helps: of a folder of pictures as of one without depth/.
COLOUR_ALONE = (
    f"colour alone is not enough, it tells no distances: {_WITH_DEPTH}; if depth was saved beside it, put it into depth/ "
    "(16-bit PNG in mm, one for each picture of color/), with intrinsic.json"
)


@dataclass(frozen=True)
class Unread:
    """One format: what it is, what to do today, and how it is known.

    `{path}` in `remedy` is replaced by the path as a shell takes it. has: whether a path holds it, by
    content; None where only the name tells. suffixes: names that files of this format have.
    """

    what: str
    remedy: str
    has: Test | None = None
    suffixes: tuple[str, ...] = ()


def _edge(path: Path, start: int, count: int) -> bytes:
    """Up to `count` bytes of a file from `start`; none of what can't be read."""
    with suppress(OSError), path.open("rb") as stream:
        stream.seek(start)
        return stream.read(count)
    return b""


def _begins(*magic: bytes, at: int = 0) -> Test:
    return lambda path: path.is_file() and _edge(path, at, 16).startswith(magic)


def _sqlite(path: Path, query: str) -> tuple[str, ...]:
    # changes nothing, not even beside the file
    source = f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1"
    with suppress(sqlite3.Error), closing(sqlite3.connect(source, uri=True)) as base:
        return tuple(str(row[0]) for row in base.execute(query))
    return ()


def _is_rtabmap(path: Path) -> bool:
    tables = _sqlite(path, "SELECT name FROM sqlite_master WHERE type = 'table'") if _SQLITE(path) else ()
    return {"Node", "Data", "Link"} <= set(tables)


def _holds(*names: str) -> Test:
    """Whether a folder holds each of these names or patterns."""
    return lambda path: path.is_dir() and all(any(path.glob(n)) for n in names)


def _either(*tests: Test) -> Test:
    return lambda path: any(test(path) for test in tests)


_SQLITE = _begins(b"SQLite format 3\0")
_EBML = _begins(b"\x1aE\xdf\xa3")
_AVI = _begins(b"AVI ", at=8)
_QUICKTIME = _begins(b"ftyp", b"moov", b"wide", b"mdat", at=4)


# The first that has a path tells. Commands are those of the tools' own documentation.
UNREAD: dict[str, Unread] = {
    "zed": Unread(
        "a ZED recording",
        "export it with the ZED SDK's sample `python svo_export.py --mode 4 --input_svo_file {path} --output_path_dir FOLDER`, "
        "put left*.png into color/ and depth*.png into depth/, and write intrinsic.json",
        suffixes=(".svo", ".svo2"),
    ),
    "klg": Unread(
        "a Kintinuous/ElasticFusion log",
        "extract it with `klg2png {path} color depth 640 480` (its image size), and write intrinsic.json",
        suffixes=(".klg",),
    ),
    "aria": Unread("a Project Aria recording, which has no depth camera", _WITH_DEPTH, suffixes=(".vrs",)),
    "hololens": Unread(
        "a HoloLens 2 stream of hl2ss",
        "export it with hl2ss's own viewer scripts: colour and depth of the long-throw camera registered to it, as images with "
        "intrinsic.json, or give them to recon.Recording.from_arrays",
        _begins(b"HL2SS"),
    ),
    "rtabmap": Unread(
        "an RTAB-Map database",
        "write its images with `rtabmap-export --images --output_dir FOLDER {path}`; by itself RTAB-Map keeps one frame a "
        "second, too few to see a motion",
        _is_rtabmap,
    ),
    "video": Unread(
        "a video, colour without depth",
        f"{_WITH_DEPTH}; if depth was saved beside it, put the video, depth/ (16-bit PNG in mm) and intrinsic.json into one folder "
        "and give that",
        _either(_EBML, _AVI, _QUICKTIME),
        (".mp4", ".mov", ".m4v", ".mkv", ".avi", ".webm"),
    ),
    "openni": Unread(
        "an OpenNI recording",
        "extract it with pyoni: `pyonitool.py --extractcolor color --extractdepth depth {path}`, and write intrinsic.json",
        _begins(b"NI10"),
        (".oni",),
    ),
    "archive": Unread(
        "an archive",
        "unpack it (`unzip {path} -d FOLDER`, `tar -xf {path} -C FOLDER`) and give the folder of the recording",
        _either(_begins(*_ARCHIVES), _begins(b"ustar", at=257)),
        (".zip", ".tar", ".gz", ".tgz", ".bz2", ".xz", ".7z", ".zst", ".rar"),
    ),
    "euroc": Unread(
        "an EuRoC sequence: grey stereo and inertia without depth", _WITH_DEPTH, _either(_holds("mav0/cam0"), _holds("cam0/data.csv"))
    ),
}  # fmt: skip
# Names of files that are read where their bytes are such a file's.
READ = {".bag": "a ROS 1 bag", ".db3": "a ROS 2 bag", ".mcap": "an MCAP log", ".sens": "a ScanNet recording"}


def refuse_named(path: Path) -> None:
    """Raise InputError for a format that only its name tells, whatever its bytes look like."""
    for kind in UNREAD.values():
        if kind.has is None and path.is_file() and path.suffix.lower() in kind.suffixes:
            raise _refusal(path, f"{path} is {kind.what}", kind)


def refuse_unread(path: Path) -> None:
    """Raise InputError with the remedy, when `UNREAD` has the path or it is named like a recording.

    A folder with intrinsic.json is one that was converted.
    """
    if (path / "intrinsic.json").is_file():
        return
    kind = _kind(path)
    if kind is not None:
        raise _refusal(path, f"{path} is {kind.what}", kind)
    suffix = path.suffix.lower()
    named = next((k.what for k in UNREAD.values() if suffix in k.suffixes), READ.get(suffix))
    if path.is_file() and named is not None:
        raise InputError(
            f"{path} is named like {named}, but its {path.stat().st_size} bytes do not begin like one",
            "copy it again, or give the file under its right name",
        )


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
    """Raise InputError when a folder that no reader knows holds one of `UNREAD`."""
    inside = sorted(folder.iterdir())[:LOOKED_AT] if folder.is_dir() else []
    for path in inside:
        kind = _kind(path)
        if kind is not None:
            raise _refusal(path, f"{folder} is no recording, but holds {path.name}, {kind.what}", kind)


def refuse_colour_alone(folder: Path) -> None:
    """Raise InputError when most files of a folder tree are pictures, and none is depth by name or kind."""
    if not folder.is_dir():
        return
    inside = sorted(folder.iterdir())[:LOOKED_AT]
    inside += [f for place in inside if place.is_dir() for f in sorted(place.iterdir())[:LOOKED_AT]]
    found = [f for f in inside if f.suffix.lower() in _COLOUR_SUFFIXES]
    depth = any("depth" in f.name.lower() or f.suffix.lower() in FLOAT_DEPTH_SUFFIXES for f in inside)
    depth = depth or any(_edge(f, 24, 2) == _GREY_16_BITS for f in found)
    if 2 * len(found) > sum(f.is_file() for f in inside) and not depth:
        raise InputError(f"{folder} holds pictures without depth", COLOUR_ALONE)


def _refusal(path: Path, problem: str, kind: Unread) -> InputError:
    remedy = kind.remedy.replace("{path}", shlex.quote(str(path)))
    return InputError(f"{problem}, which is not read", remedy)

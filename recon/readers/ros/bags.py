"""Bags of ROS 1 and ROS 2: which container a path is, and its topics."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any

from recon.readers import files
from recon.readers.ros import sqlite as ros_sqlite
from recon.readers.ros.chunks import ros1_topics
from recon.readers.ros.mcap import MAGIC as MCAP
from recon.readers.ros.mcap import mcap_topics
from recon.readers.ros.sqlite import MAGIC as SQLITE
from recon.readers.ros.sqlite import sqlite_topics
from recon.readers.ros.topics import Bag, Topic, guarded, merged
from twin.errors import InputError, MissingDependencyError
from twin.packages import to_install

ROS1 = b"#ROSBAG V"
TRANSFORMS = "tf2_msgs/msg/TFMessage"  # not among the library's types of ROS 1
_METADATA = "metadata.yaml"
# in metadata.yaml
_STORED = re.compile(r"^\s*-\s+(?:path:\s*)?['\"]?([^'\"\n]*\.(?:db3|mcap)(?:\.zstd)?)['\"]?\s*$", re.M)
_PART = re.compile(r"_\d+$")
_MAX_METADATA = 2**20  # bytes, chosen by us: one has a few kilobytes


def is_bag(path: Path) -> bool:
    """Whether a path is a bag, by its first bytes and tables; a folder, by the bags in it."""
    if path.is_dir():
        return b"rosbag2_bagfile_information" in _start(path / _METADATA, 4096) or bool(_stored(path))
    if not path.is_file():
        return False
    start = _start(path, 16)
    return start.startswith((ROS1, MCAP)) or (start.startswith(SQLITE) and ros_sqlite.is_bag(path))


def open_bag(path: Path) -> Bag:
    """The topics of a bag: a .bag, .db3 or .mcap file, or a ROS 2 folder, also without metadata.yaml.

    Reads indexes only. Raises MissingDependencyError without the library rosbags, InputError for damage.
    """
    stores = _stores()
    members = _members(path) if path.is_dir() else (path,)
    parts: dict[str, list[Topic]] = defaultdict(list)
    for member in members:
        with guarded(files.shown(member)):
            for topic in _container(member)(member):
                parts[topic.name].append(topic)
    topics = {}
    for name, found in parts.items():
        filled = [t for t in found if len(t.times)] or found[:1]
        if len({(t.type, t.encoding) for t in filled}) > 1:
            kinds = ", ".join(sorted({t.type for t in filled}))
            raise InputError(
                f"{files.shown(path)}: the topic {name} has messages of several types ({kinds})",
                "record each under its own name",
            )
        topics[name] = merged(filled)
    return Bag(path, members, topics, stores)


def _stores() -> dict[str, Any]:
    try:
        import rosbags.typesys  # noqa: F401
    except ImportError:
        raise MissingDependencyError(
            "a ROS bag needs a decoder that is not installed", to_install("rosbags", "ros")
        ) from None
    return _built_stores()


@cache
def _built_stores() -> dict[str, Any]:
    """The library's types by encoding. Our message types have the same bytes in every ROS 2."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    ros1 = get_typestore(Stores.ROS1_NOETIC)
    ros1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
    return {"cdr": get_typestore(Stores.ROS2_HUMBLE), "ros1": ros1}


def _container(path: Path) -> Callable[[Path], list[Topic]]:
    start = _start(path, 16)
    for magic, read in ((ROS1, ros1_topics), (MCAP, mcap_topics), (SQLITE, sqlite_topics)):
        if start.startswith(magic):
            return read
    size = path.stat().st_size
    raise InputError(
        f"{files.shown(path)} is no bag: its {size} bytes begin with {start[:8]!r}",
        "copy the recording again",
    )


def _members(folder: Path) -> tuple[Path, ...]:
    """Files of a folder that hold messages: those that its metadata.yaml names, else all bags in it."""
    text = _start(folder / _METADATA, _MAX_METADATA).decode("utf-8", "replace")
    named = list(dict.fromkeys(PurePosixPath(n).name for n in _STORED.findall(text)))
    packed = next((n for n in named if n.endswith(".zstd")), None)
    if packed is not None and not (folder / packed[: -len(".zstd")]).is_file():
        raise InputError(
            f"{files.shown(folder)}: {packed} is compressed as a whole",
            f"unpack it beside itself with `zstd -d {packed}`, or record with --compression-mode message",
        )
    found = tuple(folder / n.removesuffix(".zstd") for n in named) or tuple(_stored(folder))
    missing = [p.name for p in found if not p.is_file()]
    if missing:
        raise InputError(
            f"{files.shown(folder)} lacks {', '.join(missing[:4])}, which its {_METADATA} names; it has "
            f"{files.listing(folder)}",
            "copy the whole folder",
        )
    if not found:
        raise InputError(
            f"{files.shown(folder)} holds no .db3 and no .mcap file; it has {files.listing(folder)}",
            "copy the whole folder",
        )
    return found


def _stored(folder: Path) -> list[Path]:
    """The bag in a folder without metadata.yaml, as a killed recorder leaves it: one file or numbered parts.

    None where there are several bags, or where the folder is one that a bag was turned into.
    """
    if (folder / "intrinsic.json").is_file():
        return []
    found = [p for p in folder.iterdir() if p.suffix in (".db3", ".mcap") and is_bag(p)]
    names = {_PART.sub("", p.stem) for p in found}
    return sorted(found, key=files.natural_key) if len(names) == 1 else []


def _start(path: Path, count: int) -> bytes:
    try:
        with path.open("rb") as stream:
            return stream.read(count)
    except OSError:
        return b""

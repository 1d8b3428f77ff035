"""Topics of a bag: what was logged under one name, read by its index whatever container holds it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from twin.errors import FuntwinError, InputError

MAX_MESSAGE = 512 * 2**20  # bytes, chosen by us: an 8K image with 16 bits a channel has 265 MB
MAX_CHUNK = 2**30  # bytes, chosen by us: recorders cut chunks at 1 to 4 MB, or at one message
HEAD = 512  # bytes of a message that hold an image's stamp, frame and encoding; chosen by us
_STEP = 16 * 2**20  # bytes that are decompressed at once, so that a small file can't ask for much
# zstd's magic: no message begins like it, ROS 2's begin with 0, ROS 1's are never packed
PACKED = b"\x28\xb5\x2f\xfd"
PACKED_HEAD = 2**18  # bytes, more than zstd's largest block, so that they unpack to a message's first bytes

Many = Callable[[Iterable[int], int | None], Iterator[bytes]]


@dataclass(frozen=True, eq=False)
class Topic:
    """Messages of one name.

    Attributes:
        name: as logged.
        type: as ROS 2 writes it, "sensor_msgs/msg/Image".
        encoding: "cdr" (ROS 2) or "ros1".
        times: (n,) ns, log times in ascending order; messages of equal time in the order of the file.
        many: indices into `times` and a number of bytes (None: whole messages) -> the messages' bytes, the
            file opened once.
        cheap: whether a message's first bytes can be read without the rest of the bag.
    """

    name: str
    type: str
    encoding: str
    times: NDArray[np.int64]
    many: Many
    cheap: bool = True

    def read(self, index: int) -> bytes:
        """The bytes of one message."""
        return next(self.many((index,), None))


@dataclass(frozen=True, eq=False)
class Bag:
    """A bag's files and its topics by name; `path` is what the user gave."""

    path: Path
    files: tuple[Path, ...]
    topics: dict[str, Topic]
    stores: dict[str, Any]

    @property
    def shown(self) -> str:
        return files.shown(self.path)

    def of_type(self, *types: str) -> list[Topic]:
        """Topics with messages of these types, by name."""
        found = [t for t in self.topics.values() if t.type in types and len(t.times)]
        return sorted(found, key=lambda t: t.name)

    def message(self, topic: Topic, index: int, like: str | None = None) -> Any:
        """One message as an object of the library rosbags; `like`: a type with the same bytes."""
        return self.decoded(topic, topic.read(index), like)

    def decoded(self, topic: Topic, raw: bytes, like: str | None = None) -> Any:
        """The object that a message's bytes stand for. Raises InputError when they don't."""
        with guarded(f"{self.shown}: a message of {topic.name}"):
            store = self.stores[topic.encoding]
            name = like or topic.type
            return (
                store.deserialize_cdr(raw, name)
                if topic.encoding == "cdr"
                else store.deserialize_ros1(raw, name)
            )


@contextmanager
def guarded(what: str) -> Iterator[None]:
    """Turn whatever a decoder raises over damaged bytes into one InputError.

    The decoders (rosbags, sqlite3, lz4, zstd, OpenCV, struct) state no closed list of what bad bytes raise:
    here alone every Exception counts as damage; errors that already say what is wrong pass.
    """
    try:
        yield
    except InputError as error:
        raise one_line(error) from None
    except FuntwinError:
        raise
    except Exception as error:
        said = printable(str(error))[:120]
        raise one_line(
            InputError(
                f"{what} can't be read ({type(error).__name__}{f': {said}' if said else ''})",
                "copy the recording again, or record again",
            )
        ) from None


def one_line(error: InputError) -> InputError:
    """The same error without line breaks and control characters, which a bag's names may bring in."""
    return InputError(printable(error.problem), printable(error.remedy))


def printable(text: str) -> str:
    """A text on one line, with ? for what can't be printed."""
    return "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))


def in_order(times: NDArray[np.int64], *columns: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Times and columns in ascending order of time, equal times as they come."""
    order = np.argsort(times, kind="stable")
    return [times[order], *(c[order] for c in columns)]


def merged(parts: Sequence[Topic]) -> Topic:
    """One topic of the same topic's parts in several files."""
    if len(parts) == 1:
        return parts[0]
    times = np.concatenate([p.times for p in parts])
    part = np.repeat(np.arange(len(parts)), [len(p.times) for p in parts])
    inside = np.concatenate([np.arange(len(p.times)) for p in parts])
    times, part, inside = in_order(times, part, inside)

    def many(indices: Iterable[int], count: int | None) -> Iterator[bytes]:
        for k in indices:
            yield from parts[int(part[k])].many((int(inside[k]),), count)

    return Topic(parts[0].name, parts[0].type, parts[0].encoding, times, many, all(p.cheap for p in parts))


def decompressed(compression: str, data: bytes, count: int | None = None) -> bytes:
    """The first `count` bytes (None: all) of what a compressor packed; never more than `MAX_CHUNK`.

    Raises InputError for another compression, a truncated stream, and one that unpacks to more.
    """
    stream = _decompressor(compression)
    limit = MAX_CHUNK if count is None else count
    step = min(limit, _STEP)
    pieces = [stream.decompress(data, max_length=step)]
    total = len(pieces[0])
    while not stream.eof and total < limit:
        if stream.needs_input:
            raise InputError(
                f"a {compression} stream of {len(data)} bytes is truncated", "copy the recording again"
            )
        pieces.append(stream.decompress(b"", max_length=step))
        total += len(pieces[-1])
    if count is None and not stream.eof:
        raise InputError(
            f"a {compression} stream of {len(data)} bytes unpacks to more than {MAX_CHUNK} bytes",
            "record with smaller chunks",
        )
    return b"".join(pieces)


def _decompressor(compression: str) -> Any:
    if compression == "bz2":
        from bz2 import BZ2Decompressor

        return BZ2Decompressor()
    if compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        return LZ4FrameDecompressor()
    if compression == "zstd":
        from backports import zstd

        return zstd.ZstdDecompressor()
    raise InputError(
        f"its compression {compression[:20]!r} is not known", "record without compression, or with zstd"
    )


def unpacked(data: bytes, count: int | None) -> bytes:
    """A message's bytes, decompressed if packed. Raises InputError as `decompressed`."""
    return decompressed("zstd", data, count) if data.startswith(PACKED) else data[:count]


def listed(topics: Iterable[Topic], limit: int = 12) -> str:
    """Names, types and counts for messages."""
    found = sorted(topics, key=lambda t: t.name)
    more = f" and {len(found) - limit} more" if len(found) > limit else ""
    return (
        ", ".join(f"{t.name} ({t.type.split('/')[-1]}, {len(t.times)})" for t in found[:limit]) + more
    ) or "none"


def digest(*parts: str) -> str:
    """SHA-256 of several texts."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()

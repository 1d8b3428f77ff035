"""ROS 1 bags and MCAP logs: messages in chunks of one file, found through the chunks' indexes.

ROS 1's format is "rosbag 2.0" of the ROS wiki, whose index the library rosbags reads; MCAP's is its published
specification, version 0 (`mcap.py` says why rosbags does not read that here).
"""

from __future__ import annotations

import io
import struct
from collections import OrderedDict, defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from recon.readers.files import shown
from recon.readers.ros.topics import (
    MAX_CHUNK,
    MAX_MESSAGE,
    PACKED,
    PACKED_HEAD,
    Topic,
    decompressed,
    guarded,
    in_order,
    unpacked,
)
from twin.errors import InputError

_KEPT = 3  # decompressed chunks: colour and depth of one frame lie in neighbours; chosen by us
_MAX_HEADER = 65536  # bytes of a ROS 1 record's header; chosen by us: topic names are short
_CUT = "copy the recording again; if the recorder was killed, `rosbag reindex` or `mcap recover` repairs what is there"


@dataclass(frozen=True)
class Chunk:
    """Records at `at` in a file, `size` bytes as stored; compression "" for none."""

    at: int
    size: int
    compression: str = ""


class View:
    """Bytes of a chunk."""

    def __init__(self, name: str, stream: BinaryIO, chunk: Chunk, data: bytes | None) -> None:
        self._name, self._stream, self._chunk, self._data = name, stream, chunk, data
        self._size = chunk.size if data is None else len(data)

    def read(self, offset: int, count: int) -> bytes:
        """Raises InputError where the chunk ends before."""
        if count > MAX_MESSAGE or offset < 0 or offset + count > self._size:
            raise InputError(
                f"{self._name} is damaged: {count} bytes at {offset} of a chunk of {self._size} bytes",
                "copy the recording again",
            )
        if self._data is not None:
            return self._data[offset : offset + count]
        self._stream.seek(self._chunk.at + offset)
        data = self._stream.read(count)
        if len(data) != count:
            raise InputError(
                f"{self._name} is truncated: {count} bytes wanted at {self._chunk.at + offset}, {len(data)} there",
                _CUT,
            )
        return data

    @property
    def size(self) -> int:
        return self._size


class ChunkFile:
    """A file of chunks; the last decompressed ones are kept."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = path.stat().st_size
        self._kept: OrderedDict[int, bytes] = OrderedDict()
        self._lock = Lock()

    def view(self, stream: BinaryIO, chunk: Chunk) -> View:
        return View(
            shown(self.path), stream, chunk, self._unpacked(stream, chunk) if chunk.compression else None
        )

    def _unpacked(self, stream: BinaryIO, chunk: Chunk) -> bytes:
        with self._lock:
            if chunk.at in self._kept:
                self._kept.move_to_end(chunk.at)
                return self._kept[chunk.at]
        packed = View(shown(self.path), stream, Chunk(chunk.at, min(chunk.size, MAX_CHUNK)), None)
        data = decompressed(chunk.compression, packed.read(0, packed.size))
        with self._lock:
            self._kept[chunk.at] = data
            while len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
        return data


Find = Callable[[View, int], tuple[int, int]]  # a record's offset in a view -> offset and size of its message


def topic_in_chunks(
    file: ChunkFile,
    named: tuple[str, str, str],
    entries: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]],
    chunks: list[Chunk],
    find: Find,
) -> Topic:
    """A topic of name, type and encoding; entries: times (ns), numbers of chunks and offsets in them."""
    times, number, offset = in_order(*entries)
    name = f"{shown(file.path)}: a message of {named[0]}"

    def many(indices: Iterable[int], count: int | None) -> Iterator[bytes]:
        with guarded(name), file.path.open("rb") as stream:
            for k in indices:
                view = file.view(stream, chunks[int(number[k])])
                start, size = find(view, int(offset[k]))
                packed = view.read(start, min(size, 4)).startswith(PACKED)
                wanted = size if count is None else PACKED_HEAD if packed else count
                yield unpacked(view.read(start, min(size, wanted)), count)

    cheap = not any(chunks[int(c)].compression for c in np.unique(number)[:64])
    return Topic(*named, times, many, cheap)


class _Bounded(io.BufferedReader):
    """A file that never makes room for more bytes than it has left."""

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path, "rb"))
        self._end = path.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        left = max(0, self._end - self.tell())
        return super().read(left if size is None or size < 0 else min(size, left))


@dataclass(frozen=True)
class _Openable:
    """What rosbags' reader asks of a path."""

    path: Path

    def exists(self) -> bool:
        return True

    def open(self, _mode: str) -> _Bounded:
        return _Bounded(self.path)


def ros1_topics(path: Path) -> list[Topic]:
    """Topics of a ROS 1 bag. Raises InputError when it has no index or another version."""
    from rosbags.rosbag1 import Reader
    from rosbags.rosbag1.reader import ReaderError, decompressors

    file = ChunkFile(path)
    names = {function: name for name, function in decompressors.items()}
    reader = Reader(_Openable(path))  # type: ignore[arg-type]
    try:
        reader.open()
    except ReaderError as error:
        raise InputError(f"{shown(path)} can't be opened: {error}", _CUT) from None
    try:
        places = {at: k for k, at in enumerate(reader.chunks)}
        kinds = [names.get(c.decompressor, "?") for c in reader.chunks.values()]
        chunks = [
            Chunk(c.datapos, c.datasize, "" if kind == "none" else kind)
            for c, kind in zip(reader.chunks.values(), kinds, strict=True)
        ]
        found: dict[tuple[str, str], list[tuple[int, int, int]]] = defaultdict(list)
        for connection in reader.connections:
            entries = found[connection.topic, connection.msgtype]
            entries += [(e.time, places[e.chunk_pos], e.offset) for e in reader.indexes[connection.id]]
    finally:
        reader.close()
    topics = []
    for (topic, kind), entries in found.items():
        table = np.array(entries, dtype=np.int64).reshape(-1, 3)
        columns = (table[:, 0], table[:, 1], table[:, 2])
        topics.append(topic_in_chunks(file, (topic, kind, "ros1"), columns, chunks, _ros1_message))
    return topics


def _ros1_message(view: View, offset: int) -> tuple[int, int]:
    """Where the data of the message record at an offset lie; a connection's record may stand before it."""
    while True:
        (length,) = struct.unpack("<I", view.read(offset, 4))
        if length > _MAX_HEADER:
            raise InputError(f"a record's header claims {length} bytes", "copy the recording again")
        header = view.read(offset + 4, length)
        (size,) = struct.unpack("<I", view.read(offset + 4 + length, 4))
        start = offset + 8 + length
        op = _field(header, b"op")
        if op == b"\x02":
            return start, size
        if op != b"\x07":
            raise InputError(
                f"the index leads to a record of kind {op!r}, not to a message", "`rosbag reindex` repairs it"
            )
        offset = start + size


def _field(header: bytes, name: bytes) -> bytes:
    at = 0
    while at + 4 <= len(header):
        (length,) = struct.unpack_from("<I", header, at)
        key, _, value = header[at + 4 : at + 4 + length].partition(b"=")
        if key == name:
            return value
        at += 4 + length
    return b""

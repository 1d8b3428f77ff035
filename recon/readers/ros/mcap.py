"""MCAP logs, by their published specification (version 0): one walk over the file's records, past their data.

Chunks are followed by indexes of messages; what the summary lacks is taken from the chunks.

The library rosbags (0.11) reads MCAP too, but tells times by a pass over all messages alone, and a message by
its time, not by its place. Of 600 pictures in 461 MB, times take it 1.2 s and this walk 0.3 s, every tenth
picture of a topic 0.19 s and 0.05 s. A log that is cut has an invalid end for it, where the walk names the
place.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from recon.readers.files import shown
from recon.readers.ros.chunks import Chunk, ChunkFile, View, topic_in_chunks
from recon.readers.ros.topics import MAX_CHUNK, MAX_MESSAGE, Topic
from twin.errors import InputError

MAGIC = b"\x89MCAP0\r\n"
_RECORD = struct.Struct("<BQ")  # kind, length
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence number, log time, time of publication
_CHUNK = struct.Struct("<QQQI")  # first and last time, size unpacked, checksum
_FOOTER, _SCHEMA, _CHANNEL, _DATA, _CHUNKS, _INDEX = 2, 3, 4, 5, 6, 7
_MAX_RECORD = 16 * 2**20  # bytes of a schema, channel or index; chosen by us
_CUT = "`mcap recover` repairs what is there, or copy the recording again"


class _Log:
    """What a walk over the records collects."""

    def __init__(self, path: Path) -> None:
        self.file = ChunkFile(path)
        self.name = shown(path)
        self.schemas: dict[int, str] = {}
        self.channels: dict[int, tuple[int, str, str]] = {}  # schema, topic, encoding
        self.chunks: list[Chunk] = []
        self.found: dict[int, list[NDArray[np.int64]]] = defaultdict(list)  # (n, 3) time, chunk, offset
        self.loose: dict[int, list[tuple[int, int, int]]] = defaultdict(list)
        self.indexed: set[int] = set()  # chunks with an index
        self.ended = False

    def walk(self) -> None:
        """Collect all records of the file. Raises InputError when one is cut off."""
        size = self.file.size
        with self.file.path.open("rb") as stream:
            at = len(MAGIC)
            while at + _RECORD.size <= size and not self.ended:
                stream.seek(at)
                kind, length = _RECORD.unpack(stream.read(_RECORD.size))
                if length > size - at - _RECORD.size:
                    raise InputError(
                        f"{self.name} is truncated: a record of {length} bytes at {at} of {size} bytes", _CUT
                    )
                self._record(stream, kind, at, length)
                at += _RECORD.size + length
            if not self.ended:
                raise InputError(f"{self.name} is truncated: it has no end after {size} bytes", _CUT)
            self._open_chunks(stream)

    def _record(self, stream: BinaryIO, kind: int, at: int, length: int) -> None:
        if kind == _FOOTER:
            self.ended = True
        elif kind in (_SCHEMA, _CHANNEL, _INDEX):
            if length > _MAX_RECORD:
                raise InputError(f"{self.name}: a record of kind {kind} has {length} bytes", _CUT)
            self._described(kind, stream.read(length))
        elif kind == _CHUNKS:
            head = stream.read(_CHUNK.size + 4)
            (name,) = struct.unpack_from("<I", head, _CHUNK.size)
            if name > 32:
                raise InputError(f"{self.name}: a chunk's compression has a name of {name} characters", _CUT)
            compression = stream.read(name).decode()
            (stored,) = struct.unpack("<Q", stream.read(8))
            start = at + _RECORD.size + _CHUNK.size + 4 + name + 8
            (unpacked,) = struct.unpack_from("<Q", head, 16)
            if stored > at + _RECORD.size + length - start or unpacked > MAX_CHUNK:
                raise InputError(
                    f"{self.name}: a chunk at {at} claims {stored} bytes, unpacked {unpacked}", _CUT
                )
            self.chunks.append(Chunk(start, stored, compression))
        elif kind == _DATA:
            channel, _, time, _ = _MESSAGE.unpack(stream.read(_MESSAGE.size))
            self.loose[channel].append((time, -1, at))

    def _described(self, kind: int, record: bytes) -> None:
        """A schema, a channel, or the index of the last chunk for one channel."""
        (number,) = struct.unpack_from("<H", record)
        if kind == _SCHEMA:
            self.schemas[number] = _text(record, 2)[0]
        elif kind == _CHANNEL:
            (schema,) = struct.unpack_from("<H", record, 2)
            topic, at = _text(record, 4)
            encoding, _ = _text(record, at)
            self.channels[number] = (schema, topic, encoding)
        elif self.chunks:
            (count,) = struct.unpack_from("<I", record, 2)
            pairs = np.frombuffer(record, "<u8", count=count // 8, offset=6).reshape(-1, 2)
            if pairs.size and pairs.max() >= 2**63:
                raise InputError(f"{self.name}: an index holds times after the year 2262", _CUT)
            rows = np.full((len(pairs), 3), len(self.chunks) - 1, dtype=np.int64)
            rows[:, ::2] = pairs
            self.found[number].append(rows)
            self.indexed.add(len(self.chunks) - 1)

    def _open_chunks(self, stream: BinaryIO) -> None:
        """Look into the chunks that have no index, and for channels that are told nowhere else."""
        for k, chunk in enumerate(self.chunks):
            indexed = k in self.indexed
            if indexed and all(c in self.channels for c in self.found):
                continue
            view = self.file.view(stream, chunk)
            at = 0
            while at + _RECORD.size <= view.size:
                kind, length = _RECORD.unpack(view.read(at, _RECORD.size))
                if kind in (_SCHEMA, _CHANNEL):
                    self._described(kind, view.read(at + _RECORD.size, min(length, _MAX_RECORD)))
                elif kind == _DATA and not indexed:
                    channel, _, time, _ = _MESSAGE.unpack(view.read(at + _RECORD.size, _MESSAGE.size))
                    self.loose[channel].append((time, k, at))
                at += _RECORD.size + length


def mcap_topics(path: Path) -> list[Topic]:
    """Topics of an MCAP log. Raises InputError when it is truncated or damaged."""
    log = _Log(path)
    log.walk()
    whole = Chunk(0, log.file.size)  # for messages outside chunks: number -1
    by_topic: dict[tuple[str, str, str], list[NDArray[np.int64]]] = defaultdict(list)
    for number, (schema, topic, encoding) in log.channels.items():
        kind = log.schemas.get(schema, "")
        package, _, name = kind.partition("/")
        if name and "/" not in name:
            kind = f"{package}/msg/{name}"  # as ROS 1 writes it
        rows = by_topic[topic, kind, encoding]
        rows += log.found.get(number, [])
        rows.append(np.array(log.loose.get(number, []), dtype=np.int64).reshape(-1, 3))
    topics = []
    for named, tables in by_topic.items():
        table = np.concatenate(tables)
        columns = (table[:, 0], table[:, 1], table[:, 2])
        topics.append(topic_in_chunks(log.file, named, columns, [*log.chunks, whole], _message))
    return topics


def _message(view: View, offset: int) -> tuple[int, int]:
    kind, length = _RECORD.unpack(view.read(offset, _RECORD.size))
    if kind != _DATA or not _MESSAGE.size <= length <= MAX_MESSAGE:
        raise InputError(f"the index leads to a record of kind {kind} with {length} bytes", _CUT)
    return offset + _RECORD.size + _MESSAGE.size, length - _MESSAGE.size


def _text(record: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", record, at)
    text = record[at + 4 : at + 4 + length]
    return text.decode(), at + 4 + length

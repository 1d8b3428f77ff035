"""Matroska files (.mkv): their tracks, tags and attachments, and every frame's place, from headers alone.

A file is a tree of elements: an id, a size, and that many bytes (EBML: RFC 8794; Matroska's ids: RFC 9559).
We walk it ourselves since demuxers read the bytes of every frame to know the times of the frames, 3 GB where
this reads less than 1 MB. Frames that share a block (lacing) are told, not taken apart.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from recon.readers.files import shown
from recon.readers.kinect.ebml import Damage, Elements
from twin.errors import InputError
from twin.geometry import Array

MAGIC = b"\x1a\x45\xdf\xa3"  # the id of the EBML header, which every file starts with

# Ids, by the part of the file that they are in.
_SEGMENT, _CLUSTER, _BLOCK_GROUP = 0x18538067, 0x1F43B675, 0xA0
_TIME, _SIMPLE_BLOCK, _BLOCK = 0xE7, 0xA3, 0xA1
_INFO, _TRACKS, _ATTACHMENTS, _TAGS = 0x1549A966, 0x1654AE6B, 0x1941A469, 0x1254C367
_SCALE, _TRACK, _TAG, _ATTACHED_FILE = 0x2AD7B1, 0xAE, 0x7373, 0x61A7
_NUMBER, _UID, _NAME, _CODEC, _PRIVATE, _WIDTH, _HEIGHT = 0xD7, 0x73C5, 0x536E, 0x86, 0x63A2, 0xB0, 0xBA
_ENCODING, _ENCRYPTION, _METHOD, _CUT = 0x6240, 0x5035, 0x4254, 0x4255
_TRACK_MASTERS = (0xE0, 0x6D80, _ENCODING, 0x5034)  # Video, ContentEncodings, ContentCompression
_TARGETS, _TRACK_UID, _ATTACHMENT_UID, _SIMPLE_TAG = 0x63C0, 0x63C5, 0x63C6, 0x67C8
_TAG_NAME, _TAG_STRING = 0x45A3, 0x4487
_FILE_NAME, _FILE_UID, _FILE_DATA = 0x466E, 0x46AE, 0x465C

# The ends of these say nothing that the next id doesn't, and while a recording goes on they have no size yet.
_ENTERED = (_SEGMENT, _CLUSTER, _BLOCK_GROUP)
_LACING = 0x06  # flags of a block
_CUT_OFF = 3  # the compression that cuts bytes off the front


@dataclass(frozen=True)
class Track:
    """A stream. private: what its codec needs; width, height: px, 0 where not told.

    encoding: "" for frames as they are, else what was done to them ("compression 0", "encryption"); prefix:
    bytes that were cut off the front of every frame.
    """

    number: int
    uid: int
    name: str
    codec: str
    private: bytes
    width: int
    height: int
    prefix: bytes = b""
    encoding: str = ""


@dataclass(frozen=True)
class Tag:
    """A name and its value. uids: of the tracks or attachments that it is about; empty for the whole file."""

    name: str
    value: str
    uids: tuple[int, ...]


@dataclass(frozen=True)
class Attachment:
    """A file inside: `size` bytes from byte `start` on."""

    name: str
    uid: int
    start: int
    size: int


@dataclass(frozen=True, eq=False)
class Frames:
    """A track's frames in file order: ticks (n,), first byte (n,), bytes (n,), shared or not (n,)."""

    ticks: Array
    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    laced: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Contents:
    """What a file holds.

    scale: ns a tick; None where the file doesn't say. frames: by track number. size: bytes of the file.
    whole_until: byte as far as it makes sense, less than its size where it is cut off or damaged.
    """

    size: int
    whole_until: int
    scale: int | None
    tracks: tuple[Track, ...]
    tags: tuple[Tag, ...]
    attachments: tuple[Attachment, ...]
    frames: dict[int, Frames]

    def tag(self, name: str) -> Tag | None:
        """The first tag of a name."""
        return next((t for t in self.tags if t.name == name), None)


def read_contents(path: Path, head_only: bool = False) -> Contents:
    """What a file holds; head_only: up to its first frame. Raises InputError for other files."""
    try:
        with path.open("rb", buffering=0) as stream:
            return walk(stream, path.stat().st_size, shown(path), head_only)
    except OSError as error:
        raise InputError(
            f"{shown(path)} can't be read ({error.strerror})", "copy the recording again"
        ) from None


def walk(stream: BinaryIO, size: int, name: str, head_only: bool = False) -> Contents:
    """What a stream of `size` bytes holds; `name` is for messages. Raises InputError as `read_contents`."""
    source = Elements(stream, name)
    if source.read(0, 4) != MAGIC:
        raise InputError(f"{name} is no Matroska file ({size} bytes)", "give the recording as it was written")
    at, found = 0, _Found()
    try:
        while at < size:
            element, start, length = source.element(at)
            if element in _ENTERED:
                if element == _CLUSTER:
                    if head_only:
                        break
                    found.time = None
                at = start
                continue
            end = source.end(start, length, size)
            _take(source, found, element, start, end)
            at = end
    except Damage:
        pass  # `at` is where it begins
    return found.contents(size, at)


@dataclass
class _Found:
    """What the walk has met so far."""

    scale: int | None = None
    time: int | None = None
    tracks: list[Track] = field(default_factory=list)
    tags: list[Tag] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)
    frames: dict[int, tuple[array[float], array[int], array[int], array[int]]] = field(default_factory=dict)

    def contents(self, size: int, whole_until: int) -> Contents:
        frames = {
            number: Frames(
                np.array(ticks, dtype=np.float64),
                np.array(starts, dtype=np.int64),
                np.array(sizes, dtype=np.int64),
                np.array(flags, dtype=np.int64) & _LACING != 0,
            )
            for number, (ticks, starts, sizes, flags) in self.frames.items()
        }
        lists = tuple(self.tracks), tuple(self.tags), tuple(self.attachments)
        return Contents(size, whole_until, self.scale, *lists, frames)


def _take(source: Elements, found: _Found, element: int, start: int, end: int) -> None:
    """Note what an element of the segment, a cluster or a block group says."""
    if element in (_SIMPLE_BLOCK, _BLOCK):
        _block(source, found, start, end)
    elif element == _TIME:
        found.time = source.number(start, end)
    elif element == _INFO:
        for child, first, after in source.children(start, end):
            if child == _SCALE:
                found.scale = source.number(first, after) or None
    elif element == _TRACKS:
        for child, first, after in source.children(start, end):
            if child == _TRACK:
                track = _track(source, first, after)
                found.tracks.append(track)
                found.frames.setdefault(track.number, (array("d"), array("q"), array("q"), array("b")))
    elif element == _TAGS:
        for child, first, after in source.children(start, end):
            if child == _TAG:
                found.tags.extend(_tag(source, first, after))
    elif element == _ATTACHMENTS:
        for child, first, after in source.children(start, end):
            if child == _ATTACHED_FILE:
                found.attachments.append(_attachment(source, first, after))


def _block(source: Elements, found: _Found, start: int, end: int) -> None:
    """A block: track number, 16-bit time after its cluster's, flags, frame."""
    head = source.read(start, min(end - start, 12))
    n = 9 - head[0].bit_length() if head else 9
    if n > 8 or len(head) < n + 3 or found.time is None:
        raise Damage
    number = int.from_bytes(head[:n]) & ((1 << 7 * n) - 1)
    if number in found.frames:
        ticks, starts, sizes, flags = found.frames[number]
        ticks.append(found.time + int.from_bytes(head[n : n + 2], signed=True))
        starts.append(start + n + 3)
        sizes.append(end - start - n - 3)
        flags.append(head[n + 2] & _LACING)


def _track(source: Elements, start: int, end: int) -> Track:
    numbers: dict[int, int] = {}
    texts: dict[int, str] = {}
    raw: dict[int, bytes] = {}
    encrypted = False
    for child, first, after in source.children(start, end, _TRACK_MASTERS):
        if child in (_NUMBER, _UID, _WIDTH, _HEIGHT, _METHOD):
            numbers[child] = source.number(first, after)
        elif child in (_NAME, _CODEC):
            texts[child] = source.text(first, after)
        elif child in (_PRIVATE, _CUT):
            raw[child] = source.bytes(first, after)
        elif child == _ENCODING:
            numbers.setdefault(_METHOD, 0)  # zlib, where nothing is said
        encrypted |= child == _ENCRYPTION
    method = numbers.get(_METHOD, _CUT_OFF)
    number, uid, width, height = (numbers.get(k, 0) for k in (_NUMBER, _UID, _WIDTH, _HEIGHT))
    encoding = "encryption" if encrypted else "" if method == _CUT_OFF else f"compression {method}"
    names = texts.get(_NAME, ""), texts.get(_CODEC, "")
    return Track(number, uid, *names, raw.get(_PRIVATE, b""), width, height, raw.get(_CUT, b""), encoding)


def _tag(source: Elements, start: int, end: int) -> list[Tag]:
    uids: list[int] = []
    pairs: list[list[str]] = []
    for child, first, after in source.children(start, end, (_TARGETS, _SIMPLE_TAG)):
        if child in (_TRACK_UID, _ATTACHMENT_UID):
            uids.append(source.number(first, after))
        elif child == _SIMPLE_TAG:
            pairs.append(["", ""])
        elif child in (_TAG_NAME, _TAG_STRING) and pairs:
            pairs[-1][child == _TAG_STRING] = source.text(first, after)
    return [Tag(name, value, tuple(uids)) for name, value in pairs]


def _attachment(source: Elements, start: int, end: int) -> Attachment:
    name, uid, place = "", 0, (start, start)
    for child, first, after in source.children(start, end):
        if child == _FILE_NAME:
            name = source.text(first, after)
        elif child == _FILE_UID:
            uid = source.number(first, after)
        elif child == _FILE_DATA:
            place = first, after
    return Attachment(name, uid, place[0], place[1] - place[0])

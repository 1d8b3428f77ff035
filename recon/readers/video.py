"""Frames of a video file by their number, in display order.

Opening reads the container's index or, without display times, its packets; nothing is decoded. A frame is
decoded from the key frame before, frames in order each once. Threads may share a video.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import OrderedDict
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from recon.readers.files import read_head, shown
from twin.errors import InputError
from twin.geometry import Array

if TYPE_CHECKING:
    from av import VideoFrame

VIDEO_SUFFIXES = (".mp4", ".mov", ".m4v", ".mkv", ".avi")
MAX_SIDE = 8192  # px, chosen by us: 8K is 7680 wide; bounds what a hostile header makes the decoder allocate
KEPT = 16  # decoded frames at most, chosen by us: threads ask for frames a few places out of order
KEPT_BYTES = 64 * 2**20  # of them, chosen by us: sixteen of 1920x1440
_AHEAD = 2  # frames, chosen by us: MP4 lands a key frame early for times too near after one
# key frames that are tried, chosen by us: of frames that are all key frames, seeking lands a few too late
_BACK = 4

# FFmpeg's demuxer and the bytes that its files begin with. Others are not tried: some follow links.
_SIGNATURES = (
    ("mov", 4, (b"ftyp", b"moov", b"wide", b"mdat", b"free", b"skip")),
    ("matroska", 0, (b"\x1aE\xdf\xa3",)),
    ("avi", 8, (b"AVI ",)),
)


class _Entry(NamedTuple):
    """A frame in a container's index: where its bytes end, when it is decoded (ticks)."""

    end: int
    at: int
    is_key: bool
    is_cut_off: bool


class Video:
    """One file's first video track.

    `times` (n,) s are display times, strictly increasing; `width` and `height` px as stored: a flag that
    turns the picture for display is not followed; `decoded` counts the frames decoded so far.
    """

    def __init__(self, path: Path, every_stored: bool = False) -> None:
        """Open a video. every_stored: frames that the file's edit list cuts off count too.

        Raises InputError for a file that is no video, holds no frame, or is truncated.
        """
        self.path = path
        self.decoded = 0
        self._format = _format(path)
        self._options = {"protocol_whitelist": "file"} | ({"ignore_editlist": "1"} if every_stored else {})
        self._open()
        self._lock = Lock()  # one decoder, which several threads ask
        codec = self._stream.codec_context
        if codec is None:
            raise InputError(f"{shown(path)} is of a codec that FFmpeg here can't decode", _REENCODE)
        self.width, self.height = int(codec.width), int(codec.height)
        if not (0 < self.width <= MAX_SIDE and 0 < self.height <= MAX_SIDE):
            raise InputError(
                f"{shown(path)} has frames of {self.width}x{self.height}", "copy the recording again"
            )
        pts, keys = self._index()
        self.times: Array = np.array([float(t * self._stream.time_base) for t in pts])
        self._ticks = pts
        self._position = {t: k for k, t in enumerate(pts)}
        self._key_ticks = sorted(keys)
        self._keys = [bisect_left(pts, ticks[0]) for ticks in self._key_ticks]
        self._frames: Iterator[tuple[int, VideoFrame]] | None = None
        self._next = 0
        self._kept: OrderedDict[int, VideoFrame] = OrderedDict()
        self._room = max(2, min(KEPT, KEPT_BYTES // (self.width * self.height * 3 // 2 + 1)))

    def __len__(self) -> int:
        return len(self.times)

    def read(self, index: int) -> NDArray[np.uint8]:
        """Frame (H, W, 3) uint8 RGB. Raises InputError naming file and frame if damaged or missing."""
        if not 0 <= index < len(self):
            raise InputError(f"{shown(self.path)} has frames 0..{len(self) - 1}, not {index}")
        with self._lock:  # the conversion too: it has state that belongs to the frame
            if index not in self._kept:
                self._decode(index)
            frame = self._kept[index]
            if frame.is_corrupt:
                raise self._damaged(index, "parts of it are lost")
            if (frame.width, frame.height) != (self.width, self.height):
                raise self._damaged(
                    index, f"it is {frame.width}x{frame.height}, the file says {self.width}x{self.height}"
                )
            return np.asarray(frame.to_ndarray(format="rgb24"), dtype=np.uint8)

    def _open(self) -> None:
        import av  # here: what is wrong with a recording is told without it

        try:
            self._container: Any = av.open(
                str(self.path.resolve()), format=self._format, options=dict(self._options)
            )
            self._stream: Any = next((s for s in self._container.streams.video), None)
        except (av.FFmpegError, OSError, ValueError) as error:
            raise InputError(
                f"{shown(self.path)} can't be opened as a video of {self.path.stat().st_size} bytes ({_said(error)})",
                "copy the recording again; a video that was cut off has lost its index",
            ) from None
        if self._stream is None or not self._stream.time_base:
            raise InputError(
                f"{shown(self.path)} holds no video track", "give the file that holds the pictures"
            )

    def _index(self) -> tuple[list[int], list[tuple[int, int]]]:
        """Display times (n,) of frames in order, and each key frame's display and decoding time; ticks."""
        # copied: reading packets moves the container's own entries
        listed = self._stream.index_entries if self._format == "mov" else ()
        entries = [_Entry(e.pos + e.size, e.timestamp, e.is_keyframe, e.is_discard) for e in listed]
        size = self.path.stat().st_size
        cut = next((k for k, e in enumerate(entries) if e.end > size), None)
        if cut is not None:
            raise InputError(
                f"{shown(self.path)} is truncated: frame {cut} of {len(entries)} lies beyond its {size} bytes",
                "copy the recording again",
            )
        packets = self._packets()
        # times to decode at are display times without B-frames; a file in fragments has no full index
        if entries and self._stream.frames and not self._stream.codec_context.has_b_frames:
            first = next(packets, None)
            late = 0 if first is None or first.pts is None else first.pts - entries[0].at
            found = [(e.at + late, e.at, e.is_key, e.is_cut_off) for e in entries]
        else:
            found = [(p.pts, p.dts, p.is_keyframe, p.is_discard) for p in packets]
        if any(shown_at is None for shown_at, *_ in found):
            raise InputError(f"{shown(self.path)} does not tell when its frames are shown", _REENCODE)
        pts = sorted(shown_at for shown_at, _, _, discard in found if not discard)
        if not pts:
            raise InputError(f"{shown(self.path)} holds no frame", "copy the recording again")
        again = next((k for k in range(1, len(pts)) if pts[k] == pts[k - 1]), None)
        if again is not None:
            raise InputError(f"{shown(self.path)}: frames {again - 1} and {again} have one time", _REENCODE)
        return pts, [(shown_at, shown_at if at is None else at) for shown_at, at, key, _ in found if key]

    def _packets(self) -> Iterator[Any]:
        """The track's packets from where the container stands. Raises InputError where one can't be read."""
        import av

        count = 0
        try:
            for packet in self._container.demux(self._stream):
                if packet.size:
                    count += 1
                    yield packet
        except (av.FFmpegError, OSError, ValueError) as error:
            raise InputError(
                f"{shown(self.path)} can't be read beyond frame {count} ({_said(error)})",
                "copy the recording again",
            ) from None

    def _decode(self, index: int) -> None:
        """Decode until `index` is among the kept frames."""
        import av

        try:
            if self._frames is None or index < self._next or self._key_before(index) > self._next:
                self._frames = self._from_key(index)
            for k, frame in self._frames:
                if k < self._next:
                    raise self._damaged(index, f"frame {k} comes after frame {self._next - 1}")
                self._next = k + 1
                self._kept[k] = frame
                while len(self._kept) > self._room:
                    self._kept.popitem(last=False)
                if k >= index:
                    break
        except (av.FFmpegError, OSError, ValueError) as error:
            self._frames = None
            raise self._damaged(index, _said(error)) from None
        except InputError:
            self._frames = None
            raise
        if index not in self._kept:
            self._frames = None
            raise self._damaged(index, "the decoder gives no picture for it")

    def _key_before(self, index: int) -> int:
        k = bisect_right(self._keys, index) - 1
        return self._keys[k] if k >= 0 else 0

    def _from_key(self, index: int) -> Iterator[tuple[int, VideoFrame]]:
        """Frames with their numbers, from a key frame on that is not after `index`, best the last such."""
        nearest = self._key_before(index)
        for earliest in (nearest, 0):
            for tick in self._places(index):
                self._container.seek(tick, stream=self._stream, backward=True)
                start, packets = self._landed()
                if earliest <= start <= index:
                    self._next = start
                    return self._numbered(packets, start)
        self._container.close()
        self._open()
        start, packets = self._landed()
        if start > index:
            raise self._damaged(index, "no key frame stands before it")
        self._next = start
        return self._numbered(packets, start)

    def _places(self, index: int) -> list[int]:
        """Ticks to seek to for a frame. What a container seeks by, and where it lands, varies."""
        last = bisect_right(self._keys, index) - 1
        keys = self._key_ticks[max(last - _BACK + 1, 0) : last + 1]
        near = [self._ticks[index], self._ticks[min(index + _AHEAD, len(self) - 1)]]
        return near + [tick for ticks in reversed(keys) for tick in ticks]

    def _landed(self) -> tuple[int, Iterator[Any]]:
        """Number of the first frame from where the container stands, len(self) for none; its packets."""
        packets = self._container.demux(self._stream)
        first = next(packets, None)
        if first is None or first.pts is None:
            return len(self), packets
        return bisect_left(self._ticks, first.pts), chain([first], packets)

    def _numbered(self, packets: Iterator[Any], start: int) -> Iterator[tuple[int, VideoFrame]]:
        for packet in packets:
            for frame in packet.decode():
                self.decoded += 1
                k = self._position.get(frame.pts, -1)
                if k >= start:  # those before were shown from the key frame before, which was skipped
                    yield k, frame

    def _damaged(self, index: int, why: str) -> InputError:
        return InputError(f"{shown(self.path)} frame {index} can't be decoded: {why}", _REENCODE)


_REENCODE = "copy the recording again, or re-encode it with `ffmpeg -i IN -fps_mode passthrough OUT.mp4`"


def _format(path: Path) -> str:
    head = read_head(path, 16)
    for name, at, magics in _SIGNATURES:
        if head[at:].startswith(magics):
            return name
    raise InputError(
        f"{shown(path)} is no MP4, MOV, MKV or AVI video; it begins with {head[:8]!r}",
        "copy the recording again" if head else "it is empty: copy the recording again",
    )


def _said(error: BaseException) -> str:
    """The library's words without its numbers and file names."""
    return getattr(error, "strerror", None) or str(error).splitlines()[0][:80] or type(error).__name__

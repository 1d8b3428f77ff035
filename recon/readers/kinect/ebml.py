"""EBML, the base of Matroska files (RFC 8794): a tree of elements: id, size, that many bytes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

from twin.errors import InputError

MAX_ELEMENTS = 2_000_000  # chosen by us: two hours of three video tracks at 30 Hz, some seconds to walk
MAX_DESCRIBING = 20_000  # chosen by us: elements that describe the file; recorders write some hundred
MAX_TEXT = 4096  # bytes of a name or a value, chosen by us
_WINDOW = 64  # bytes read at once: the headers between two frames


class Damage(Exception):
    """An element that can't be, or whose bytes are not all there."""


class Elements:
    """Elements of a file by their place in it; never reads a payload unless asked."""

    def __init__(self, stream: BinaryIO, name: str) -> None:
        self._stream, self._name = stream, name
        self._start, self._window = 0, b""
        self._elements = self._describing = 0

    def read(self, start: int, count: int) -> bytes:
        """Up to `count` bytes, fewer at the file's end."""
        offset = start - self._start
        if offset < 0 or offset + count > len(self._window):
            self._stream.seek(start)
            self._start, self._window = start, self._stream.read(max(count, _WINDOW)) or b""
            offset = 0
        return self._window[offset : offset + count]

    def element(self, at: int) -> tuple[int, int, int | None]:
        """Id, first byte of the content, and its bytes, None for "until it ends"."""
        self._elements += 1
        if self._elements > MAX_ELEMENTS:
            raise self._too_many(MAX_ELEMENTS)
        head = self.read(at, 12)
        n = 9 - head[0].bit_length() if head else 9
        if n > 4 or len(head) <= n:
            raise Damage
        m = 9 - head[n].bit_length()
        if m > 8 or len(head) < n + m:
            raise Damage
        unknown = (1 << 7 * m) - 1
        length = int.from_bytes(head[n : n + m]) & unknown
        return int.from_bytes(head[:n]), at + n + m, None if length == unknown else length

    def end(self, start: int, length: int | None, limit: int) -> int:
        """The byte after an element. Raises Damage when it reaches over `limit`."""
        if length is None or start + length > limit:
            raise Damage
        return start + length

    def children(self, start: int, end: int, masters: tuple[int, ...] = ()) -> Iterator[tuple[int, int, int]]:
        """(id, first byte, byte after the last one) of the elements inside, and of those inside `masters`."""
        while start < end:
            self._describing += 1
            if self._describing > MAX_DESCRIBING:
                raise self._too_many(MAX_DESCRIBING)
            element, first, length = self.element(start)
            after = self.end(first, length, end)
            yield element, first, after
            start = first if element in masters else after

    def number(self, start: int, end: int) -> int:
        """An unsigned value."""
        if end - start > 8:
            raise Damage
        return int.from_bytes(self.read(start, end - start))

    def bytes(self, start: int, end: int) -> bytes:
        """The first `MAX_TEXT` bytes of a value."""
        return self.read(start, min(end - start, MAX_TEXT))

    def text(self, start: int, end: int) -> str:
        """A value in UTF-8; what is not is replaced."""
        return self.bytes(start, end).split(b"\0")[0].decode("utf-8", "replace")

    def _too_many(self, limit: int) -> InputError:
        return InputError(f"{self._name} holds more than {limit} elements", "record shorter, or cut it")

"""What a PNG or a JPEG claims before it is decoded: decoders allocate what a header says."""

from __future__ import annotations

import struct

from twin.errors import InputError

MAX_PIXELS = 2**26  # chosen by us: 8192x8192; no camera here has more
_TABLES = (0xC4, 0xC8, 0xCC)  # JPEG markers among those of frames


def picture_size(data: bytes | memoryview) -> tuple[int, int]:
    """(width, height) px that a PNG or a JPEG claims, (0, 0) for other bytes."""
    head = bytes(data[:24])
    if head.startswith(b"\x89PNG\r\n\x1a\n") and len(head) == 24:
        width, height = struct.unpack(">II", head[16:24])
        return width, height
    at = 2  # segments of a marker and a length each, as far as the frame header
    while head.startswith(b"\xff\xd8") and at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if 0xC0 <= marker <= 0xCF and marker not in _TABLES:
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        at += 1 if marker == 0xFF else 2 + (data[at + 2] << 8 | data[at + 3])
    return 0, 0


def require_pixels(name: str, width: int, height: int) -> None:
    """Raise InputError for a picture that claims more pixels than any camera has."""
    if width * height > MAX_PIXELS:
        raise InputError(f"{name} claims {width}x{height} pixels", "copy the recording again")


def require_sane_size(name: str, data: bytes | memoryview) -> None:
    """The same, for a PNG or JPEG that is not decoded yet."""
    require_pixels(name, *picture_size(data))

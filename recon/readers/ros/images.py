"""ROS's images: sensor_msgs Image and CompressedImage from their bytes, and their pixels.

Both are parsed here, not by the library: RealSense's recorder appends a depth unit to a ROS 1 Image, which
makes it no message of its type to others, and a first look needs the fields before the pixels alone. Fields
and encodings are those of the message definitions and of sensor_msgs/image_encodings.hpp; the compressed
kinds those of image_transport_plugins.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from recon.readers.encoded import MAX_PIXELS, require_sane_size
from recon.readers.ros.topics import decompressed
from twin.errors import InputError

RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
COLOR = {
    "rgb8": 3,
    "bgr8": 3,
    "rgba8": 4,
    "bgra8": 4,
    "8uc3": 3,
    "8uc4": 4,
    "rgb16": 6,
    "bgr16": 6,
    "rgba16": 8,
    "bgra16": 8,
    "yuv422": 2,
    "uyvy": 2,
    "yuv422_yuy2": 2,
    "yuyv": 2,
    "bayer_rggb8": 1,
    "bayer_bggr8": 1,
    "bayer_gbrg8": 1,
    "bayer_grbg8": 1,
}  # bytes a pixel; fmt: skip
GREY = {"mono8": 1, "8uc1": 1}
DEPTH = {"16uc1": 2, "mono16": 2, "z16": 2, "32fc1": 4}
# What the data of compressed depth are: behind a 12-byte header, or PNG alone, of whole numbers or of floats
PACKED_DEPTH = re.compile(r"^(16uc1|mono16|32fc1)\s*;.*\b(compresseddepth|png)\b")
# JPEG has 8 bits a value: of depth it keeps no distances
JPEG_DEPTH = re.compile(r"^(16uc1|mono16|32fc1)\s*;.*\bjpe?g\b")
_ZSTD = re.compile(r"^(\w+); zstd; (\d+)x(\d+) step=(\d+)$")  # RealSense's, for what PNG can't hold
_HEADER = struct.Struct("<iff")  # kind of compressed depth, and how floats were quantised
METRES_PER_COUNT = 0.001  # REP 118: whole numbers are millimetres, floats metres


@dataclass(frozen=True)
class Image:
    """An image as logged; `encoding` in lower case, of a compressed one its `format`.

    stamp: ns, 0 for none. unit: metres per count if sent (RealSense), else 0. Compressed: size 0.
    """

    stamp: int
    frame: str
    encoding: str
    data: memoryview
    width: int = 0
    height: int = 0
    step: int = 0
    big_endian: bool = False
    unit: float = 0.0


class _Fields:
    """Fields of a message, one after the other, by the rules of ROS 1 or of CDR, which aligns them."""

    def __init__(self, raw: bytes, encoding: str) -> None:
        self._raw, self._cdr = raw, encoding == "cdr"
        self._order = "<"
        if self._cdr:
            if len(raw) < 4 or raw[0] != 0 or raw[1] not in (0, 1):
                raise InputError(
                    f"a message begins with {raw[:4].hex(' ')}, not as plain CDR",
                    "record with ROS 2's default",
                )
            self._order = "<" if raw[1] else ">"
        self.at = 4 if self._cdr else 0

    def number(self, kind: str = "I") -> int:
        size = struct.calcsize(kind)
        if self._cdr:
            self.at += -(self.at - 4) % size
        (value,) = struct.unpack_from(self._order + kind, self._raw, self.at)
        self.at += size
        return int(value)

    def text(self) -> str:
        length = self.number()
        if length > 4096:
            raise InputError(f"a text claims {length} bytes", "copy the recording again")
        piece = bytes(self._raw[self.at : self.at + length])
        self.at += length
        return piece.rstrip(b"\0").decode("utf-8", "replace")

    def header(self) -> tuple[int, str]:
        """Stamp (ns) and frame."""
        if not self._cdr:
            self.number()  # sequence number
        seconds, rest = self.number("i" if self._cdr else "I"), self.number()
        return seconds * 10**9 + rest, self.text()

    def data(self) -> memoryview:
        length = self.number()
        piece = memoryview(self._raw)[self.at : self.at + length]
        self.at += length
        return piece


def stamp_of(head: bytes, encoding: str) -> int:
    """ns, the stamp of a message with a header, by its first 16 bytes. struct.error if it has fewer."""
    if encoding == "cdr":
        seconds, rest = struct.unpack_from("<iI" if head[1] else ">iI", head, 4)
    else:
        seconds, rest = struct.unpack_from("<II", head, 4)
    return int(seconds) * 10**9 + int(rest)


def parsed(raw: bytes, kind: str, encoding: str) -> Image:
    """The image of a message of type `RAW` or `COMPRESSED`, also from its first bytes (`data`) alone."""
    fields = _Fields(raw, encoding)
    stamp, frame = fields.header()
    if kind == COMPRESSED:
        name = fields.text().lower()
        return Image(stamp, frame, name, fields.data())
    height, width = fields.number(), fields.number()
    name = fields.text().lower()
    big, step = bool(fields.number("B")), fields.number()
    data = fields.data()
    unit = 0.0
    # RealSense's recorder: the frame is a version
    if encoding == "ros1" and frame == "1" and len(raw) == fields.at + 4:
        (unit,) = struct.unpack_from("<f", raw, fields.at)
    return Image(stamp, frame, name, data, width, height, step, big, unit)


def color_of(name: str, image: Image) -> NDArray[np.uint8]:
    """Pixels (H, W, 3) uint8 RGB. Raises InputError for what holds none, or less than it claims."""
    if not image.width:
        return _unpacked_color(name, image)
    size = COLOR.get(image.encoding) or GREY.get(image.encoding)
    if size is None:
        raise InputError(f"{name} is encoded as {image.encoding!r}, which is no colour", "record it as rgb8")
    rows = _rows(name, image, size)
    if image.encoding.startswith("bayer") or size == 2:
        return _converted(image, rows)
    if size in (6, 8):
        rows = np.ascontiguousarray(rows)[:, 0 if image.big_endian else 1 :: 2]  # the upper byte of each
        size //= 2
    pixels = rows.reshape(image.height, image.width, size)
    if size == 1:
        return np.repeat(pixels, 3, axis=2)
    # OpenCV's kinds without an order are blue first, as its bridge to ROS takes them
    order = slice(0, 3) if image.encoding.startswith("rgb") else slice(2, None, -1)
    return np.ascontiguousarray(pixels[..., order])


def _converted(image: Image, rows: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """RGB of a colour filter's raw values, or of pixel pairs that share chroma (BT.601, studio range)."""
    import cv2  # here: what is wrong with a recording is told without it

    if image.encoding.startswith("bayer"):
        # OpenCV's long names are of the first two pixels of the first two rows, as ROS's are
        return np.asarray(
            cv2.cvtColor(rows, getattr(cv2, f"COLOR_Bayer{image.encoding[6:10].upper()}2RGB")), dtype=np.uint8
        )
    code = cv2.COLOR_YUV2RGB_YUY2 if "yuy" in image.encoding else cv2.COLOR_YUV2RGB_UYVY
    pairs = rows.reshape(image.height, image.width, 2)
    return np.asarray(cv2.cvtColor(pairs, code), dtype=np.uint8)


def depth_of(name: str, image: Image, unit: float) -> NDArray[np.float32]:
    """Depth (H, W) float32 m, 0 = unknown; unit: metres a count (integers). InputError as `color_of`."""
    if not image.width:
        return _clean(_unpacked_depth(name, image, unit))
    size = DEPTH.get(image.encoding)
    if size is None:
        raise InputError(
            f"{name} is encoded as {image.encoding!r}, which is no depth",
            "record it as 16UC1 in mm or 32FC1 in m",
        )
    order = ">" if image.big_endian else "<"
    rows = np.ascontiguousarray(_rows(name, image, size))
    if size == 4:
        return _clean(rows.view(f"{order}f4").astype(np.float32))
    return _metres(rows.view(f"{order}u2"), unit)


def _rows(name: str, image: Image, size: int) -> NDArray[np.uint8]:
    """(H, W * size) uint8 without what pads the rows."""
    row = image.width * size
    step = image.step or row
    if not 0 < image.width * image.height <= MAX_PIXELS or step < row:
        raise InputError(
            f"{name} claims {image.width}x{image.height} pixels of {size} bytes in rows of {image.step} bytes",
            "copy the recording again",
        )
    if len(image.data) < step * image.height:
        raise InputError(
            f"{name} is truncated: {len(image.data)} bytes, not {step * image.height} for {image.width}x{image.height}",
            "copy the recording again",
        )
    flat = np.frombuffer(image.data, np.uint8, count=step * image.height)
    return flat.reshape(image.height, step)[:, :row]


def _unpacked_color(name: str, image: Image) -> NDArray[np.uint8]:
    raw = _ZSTD.match(image.encoding)
    if raw is not None:
        width, height, step = (int(g) for g in raw.groups()[1:])
        if step * height > 4 * MAX_PIXELS:
            raise InputError(f"{name} claims {height} rows of {step} bytes", "copy the recording again")
        data = memoryview(decompressed("zstd", bytes(image.data), step * height))
        return color_of(name, Image(image.stamp, image.frame, raw[1], data, width, height, step))
    return files.decode_color(name, bytes(image.data))


def _unpacked_depth(name: str, image: Image, unit: float) -> NDArray[np.float32]:
    """Of a PNG of whole numbers, or of inverse depths that were quantised; the latter have a header."""
    import cv2  # here: what is wrong with a recording is told without it

    data, (a, b) = bytes(image.data), (0.0, 0.0)
    if "compresseddepth" in image.encoding or not data.startswith(b"\x89PNG"):
        if len(data) < _HEADER.size or not data[_HEADER.size :].startswith(b"\x89PNG"):
            raise InputError(
                f"{name} ({image.encoding!r}, {len(data)} bytes) holds no PNG",
                "record depth raw, or compressed as PNG (compressedDepth's format png, not rvl)",
            )
        _, a, b = _HEADER.unpack_from(data)
        data = data[_HEADER.size :]
    require_sane_size(name, data)
    files.check_complete(name, data)
    values = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if values is None or values.dtype != np.uint16 or values.ndim != 2:
        raise InputError(f"{name} is no readable 16-bit depth image", "record depth raw")
    if not image.encoding.startswith("32fc1"):
        return _metres(np.asarray(values), unit)
    if not np.isfinite([a, b]).all() or a <= 0.0:
        raise InputError(
            f"{name}: its depths are quantised with A = {a:.4g} and B = {b:.4g}", "record depth raw"
        )
    with np.errstate(divide="ignore"):
        metres = a / (values.astype(np.float32) - np.float32(b))
    return np.where(values > 0, metres, np.float32(0.0)).astype(np.float32)


def _metres(values: NDArray[np.uint16], unit: float) -> NDArray[np.float32]:
    """Divides where the unit is a whole part of a metre, so that millimetres are as other readers'."""
    per_metre = round(1.0 / unit)
    if abs(per_metre * unit - 1.0) < 1e-6:
        return (values.astype(np.float32) / np.float32(per_metre)).astype(np.float32)
    return (values.astype(np.float32) * np.float32(unit)).astype(np.float32)


def _clean(metres: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.where(np.isfinite(metres) & (metres > 0), metres, np.float32(0.0))

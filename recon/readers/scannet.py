"""ScanNet's .sens: one file of compressed colour and depth with two cameras and a pose a frame.

After ScanNet's own reader (SensReader/src/sensorData.h): little-endian; uint32 version 4; uint64 length and
the sensor's name; four row-major float32 4x4: K and E of colour, K and E of depth; int32 compression of
colour and of depth; uint32 colour width and height, depth width and height; float32 depth values in a metre;
uint64 frames; then each frame: float32 4x4 T_world_cam of the DEPTH camera (-inf where tracking was lost),
uint64 times of colour and depth in microseconds, uint64 sizes of colour and depth, their bytes. E takes
points of its camera to the frame that both share, in general colour's.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from recon.readers.fingerprint import fingerprint_of
from recon.readers.pictures import camera_of, rigid
from recon.readers.streams import Streams
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array, invert_pose

DEFAULT_FPS = 30.0  # of the structure sensor that ScanNet was recorded with
VERSION = 4
COLOR_TYPES = {0: "raw", 1: "PNG", 2: "JPEG"}
RAW_DEPTH, ZLIB_DEPTH = 0, 1
DEPTH_TYPES = {RAW_DEPTH: "raw", ZLIB_DEPTH: "zlib"}
MAX_NAME = 256  # bytes, chosen by us
MAX_SIDE = 2**14  # px, chosen by us, of a picture
MAX_FRAMES = 400_000  # chosen by us: almost four hours; guards against hostile headers
MAX_BASELINE = 1.0  # m, chosen by us: colour and depth are on one device
MAX_PAYLOAD = 256 * 2**20  # bytes, chosen by us, of one picture
_FRAME = struct.Struct("<16f4Q")
_HEAD = struct.Struct("<64f2i4IfQ")
_COPY = "copy the recording again"


@dataclass(frozen=True)
class ScanNetReader:
    """Reads a .sens file; its index is found by walking the frames' headers, no picture is read for it."""

    layout: str = "a ScanNet file .sens"

    def recognises(self, path: Path) -> bool:
        if not path.is_file():
            return False
        try:
            with path.open("rb") as stream:
                head = stream.read(12 + MAX_NAME)
        except OSError:
            return False
        if len(head) < 13:
            return False
        version, length = struct.unpack("<IQ", head[:12])
        name = head[12 : 12 + min(length, MAX_NAME)]
        return version == VERSION and 0 < length <= MAX_NAME and name.isascii() and name[:1].isalpha()

    def streams(self, path: Path) -> Streams:
        sens = _Sens(path)
        color_times, depth_times, warnings = sens.times()
        return Streams(
            name=path.stem,
            source=str(path),
            color_times=color_times,
            depth_times=depth_times,
            read_color=sens.color,
            read_depth=sens.depth,
            rig=sens.rig,
            fingerprint=fingerprint_of(path),
            poses=sens.poses(color_times),
            warnings=warnings,
            metadata={"sensor": sens.sensor},
        )


class _Sens:
    """Header and index of a .sens file."""

    def __init__(self, path: Path) -> None:
        self.path, self.name = path, files.shown(path)
        try:
            self.size = path.stat().st_size
            with path.open("rb") as stream:
                self.sensor, values = self._head(stream)
                self._take(values)
                self._walk(stream, int(values[-1]))
        except OSError as error:
            raise InputError(f"{self.name} can't be read ({error.strerror})", _COPY) from None

    def _head(self, stream: IO[bytes]) -> tuple[str, tuple[float, ...]]:
        version, length = struct.unpack("<IQ", self._bytes(stream, 12, "its header"))
        if version != VERSION:
            raise InputError(f"{self.name} is of version {version}, not {VERSION}", "export it again")
        if not 0 < length <= MAX_NAME:
            raise InputError(f"{self.name} has a sensor's name of {length} bytes", _COPY)
        sensor = self._bytes(stream, length, "its header").decode("ascii", "replace").strip("\0")
        return sensor, _HEAD.unpack(self._bytes(stream, _HEAD.size, "its header"))

    def _take(self, values: tuple[float, ...]) -> None:
        """Cameras, sizes and compression of the header's numbers."""
        color_k, color_e, depth_k, depth_e = np.array(values[:64], dtype=np.float64).reshape(4, 4, 4)
        color_type, depth_type, cw, ch, dw, dh = (int(v) for v in values[64:70])
        for what, kind, known in (("colour", color_type, COLOR_TYPES), ("depth", depth_type, DEPTH_TYPES)):
            if kind not in known:
                told = (
                    "occi, which only ScanNet's own library decodes" if (what, kind) == ("depth", 2) else kind
                )
                raise InputError(
                    f"{self.name}: the compression of {what} is {told}",
                    "unpack it with ScanNet's SensReader and give the folders of images",
                )
        for what, width, height in (("colour", cw, ch), ("depth", dw, dh)):
            if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE):
                raise InputError(f"{self.name}: {what} is {width}x{height}", _COPY)
        self.color_type, self.depth_type = color_type, depth_type
        color = camera_of(color_k[:3, :3], cw, ch, f"{self.name}, colour")
        depth = camera_of(depth_k[:3, :3], dw, dh, f"{self.name}, depth")
        E = rigid([color_e, depth_e], f"{self.name}, extrinsics of colour (0) and depth (1)")
        T = np.eye(4) if np.array_equal(E[0], E[1]) else invert_pose(E[0]) @ E[1]
        if np.linalg.norm(T[:3, 3]) > MAX_BASELINE:
            raise InputError(
                f"{self.name}: its cameras are {np.linalg.norm(T[:3, 3]):.4g} m apart",
                "give extrinsics in metres",
            )
        self.rig = Rig(Lens(color), Lens(depth), T)
        self.per_metre = float(values[70])
        if not (np.isfinite(self.per_metre) and 1.0 <= self.per_metre <= 1e6):
            raise InputError(
                f"{self.name}: a metre of depth is {self.per_metre:.4g}", "expected 1000 for millimetres"
            )

    def _walk(self, stream: IO[bytes], count: int) -> None:
        """Find every frame. Raises InputError that names the frame at which the file ends."""
        if not 0 < count <= min(MAX_FRAMES, self.size // _FRAME.size):
            raise InputError(f"{self.name} has {count} frames by its header in {self.size} bytes", _COPY)
        self.T = np.empty((count, 4, 4))
        self.stamps = np.empty((count, 2), dtype=np.float64)
        self.places: list[tuple[int, int, int]] = []  # start of colour, bytes of colour, bytes of depth
        for k in range(count):
            head = _FRAME.unpack(self._bytes(stream, _FRAME.size, f"frame {k} of {count}"))
            self.T[k] = np.array(head[:16]).reshape(4, 4)
            self.stamps[k] = head[16:18]
            color, depth = int(head[18]), int(head[19])
            start = stream.tell()
            if not (0 < color <= MAX_PAYLOAD and 0 < depth <= MAX_PAYLOAD):
                raise InputError(
                    f"{self.name}: frame {k} has {color} bytes of colour and {depth} of depth", _COPY
                )
            if start + color + depth > self.size:
                raise InputError(
                    f"{self.name} is truncated: it ends inside frame {k} of {count}, after {self.size} bytes",
                    _COPY,
                )
            self.places.append((start, color, depth))
            stream.seek(start + color + depth)

    def _bytes(self, stream: IO[bytes], count: int, where: str) -> bytes:
        data = stream.read(count)
        if len(data) != count:
            raise InputError(
                f"{self.name} is truncated: it ends inside {where}, after {self.size} bytes", _COPY
            )
        return data

    def times(self) -> tuple[Array, Array, tuple[str, ...]]:
        """Times (n,) s of colour and of depth, and warnings."""
        known = [bool(np.any(self.stamps[:, k])) for k in range(2)]
        if not any(known):
            assumed = np.arange(len(self.stamps)) / DEFAULT_FPS
            warning = f"{self.path.name} has no time stamps; taken to be recorded at {DEFAULT_FPS:g} frames a second"
            return assumed, assumed, (warning,)
        color, depth = (self.stamps[:, k if known[k] else 1 - k] * 1e-6 for k in range(2))
        return color, depth, ()

    def poses(self, times: Array) -> tuple[Array, Array] | None:
        """Times (k,) s and T_world_cam (k, 4, 4) of the colour camera; None without, or all equal."""
        found = np.isfinite(self.T).all(axis=(1, 2)) & self.T.any(axis=(1, 2))
        if not found.any() or np.array_equal(self.T[found], np.broadcast_to(np.eye(4), self.T[found].shape)):
            return None
        T_world_depth = rigid(self.T[found], self.name, np.flatnonzero(found))
        return times[found], T_world_depth @ invert_pose(self.rig.T_color_depth)

    def color(self, index: int) -> NDArray[np.uint8]:
        start, size, _ = self.places[index]
        data, name = self._payload(start, size), f"{self.name}:colour {index}"
        camera = self.rig.color.camera
        if COLOR_TYPES[self.color_type] != "raw":
            return files.decode_color(name, data)
        if len(data) != camera.width * camera.height * 3:
            raise InputError(
                f"{name} has {len(data)} bytes, not those of {camera.width}x{camera.height} pixels", _COPY
            )
        return np.frombuffer(data, np.uint8).reshape(camera.height, camera.width, 3)

    def depth(self, index: int) -> NDArray[np.float32]:
        start, before, size = self.places[index]
        data, name = self._payload(start + before, size), f"{self.name}:depth {index}"
        camera = self.rig.depth.camera
        expected = camera.width * camera.height * 2
        if self.depth_type == ZLIB_DEPTH:
            data = _inflated(name, data, expected)
        if len(data) != expected:
            raise InputError(
                f"{name} has {len(data)} bytes, not those of {camera.width}x{camera.height} pixels", _COPY
            )
        counts = np.frombuffer(data, "<u2").reshape(camera.height, camera.width)
        return (counts.astype(np.float32) / np.float32(self.per_metre)).astype(np.float32)

    def _payload(self, start: int, size: int) -> bytes:
        try:
            with self.path.open("rb") as stream:
                stream.seek(start)
                return self._bytes(stream, size, f"the picture at byte {start}")
        except OSError as error:
            raise InputError(f"{self.name} can't be read ({error.strerror})", _COPY) from None


def _inflated(name: str, data: bytes, most: int) -> bytes:
    """At most one byte more than `most` of what zlib packed, so that a zip bomb stays small."""
    try:
        return zlib.decompressobj().decompress(data, most + 1)
    except zlib.error as error:
        raise InputError(f"{name} is no zlib stream ({error})", _COPY) from None

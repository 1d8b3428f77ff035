"""Record3D's .r3d: a zip of JPEG colour, LZFSE-compressed float depth and confidence, and JSON metadata.

The app writes no specification; the layout is the one its users' readers agree on: `metadata` with w, h, dw,
dh, fps, K (column-major, at w x h), poses [qx, qy, qz, qw, tx, ty, tz] camera to world,
perFrameIntrinsicCoeffs and frameTimestamps; `rgbd/<i>.jpg`, `rgbd/<i>.depth` float32 m (dh x dw),
`rgbd/<i>.conf` uint8 0..2. Poses have ARKit's axes: camera x right, y up, looking along -z; world y up.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from recon.readers.arkit import MIN_CONFIDENCE, OwnCameras, camera_of, opencv_z_up
from recon.readers.fingerprint import fingerprint_of
from recon.readers.streams import Streams
from recon.readers.turned import with_turned_poses
from recon.recording import Intrinsics, ReadColor, ReadDepth
from recon.recording.rig import Lens, Rig
from twin.errors import InputError, MissingDependencyError
from twin.geometry import Array
from twin.packages import to_install

MAX_MEMBER_BYTES = 64 * 2**20  # chosen by us: no frame is larger; guards against hostile archives
# what zipfile raises for bytes that are no archive, or one of another kind: RuntimeError where the head of a
# member asks for a password or a compression that it doesn't know
_DAMAGED = (OSError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)


@dataclass(frozen=True)
class Record3DReader:
    """Reads a .r3d file."""

    layout: str = "a Record3D file .r3d"

    def recognises(self, path: Path) -> bool:
        return is_record3d(path)

    def streams(self, path: Path) -> Streams:
        archive = _Archive(path)
        meta = Metadata.read(archive)
        count = archive.frame_count()
        first = files.decode_color(archive.shown("rgbd/0.jpg"), archive.read("rgbd/0.jpg"))
        color, own, warnings = meta.cameras(first.shape[1], first.shape[0], range(count))
        read_depth = _depth_reader(archive, meta)
        height, width = read_depth(0).shape
        times = meta.times(count)
        return with_turned_poses(
            Streams(
                name=path.stem,
                source=str(path),
                color_times=times,
                depth_times=times,
                read_color=_color_reader(archive, color),
                read_depth=read_depth,
                rig=Rig(Lens(color), Lens(color.scaled(width, height))),
                own_cameras=own,
                fingerprint=fingerprint_of(path),
                poses=meta.poses(count, times),
                upright=True,
                warnings=warnings,
            )
        )


def is_record3d(path: Path) -> bool:
    """Whether a file is a Record3D archive, by its name or, renamed, by its members."""
    if not path.is_file():
        return False
    if path.suffix.lower() == ".r3d":
        return True
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except _DAMAGED:
        return False
    return "metadata" in names and any(n.startswith("rgbd/") for n in names)


class _Archive:
    """Members of a zip file, read without unpacking it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with zipfile.ZipFile(path) as archive:
                names = archive.namelist()
        except _DAMAGED as error:
            raise InputError(f"{path.name} is no readable zip archive ({error})", "export it again") from None
        for name in names:
            if name.startswith("/") or "\\" in name or ".." in PurePosixPath(name).parts:
                raise InputError(
                    f"{path.name} holds {name!r}, a path out of the archive", "don't trust this file"
                )
        self.names = frozenset(names)

    def shown(self, name: str) -> str:
        return f"{self.path.name}:{name}"

    def read(self, name: str) -> bytes:
        """Bytes of a member. Raises InputError when it is missing, damaged or too large."""
        if name not in self.names:
            raise InputError(f"{self.shown(name)} is missing", "export the recording again")
        try:
            with zipfile.ZipFile(self.path) as archive:
                size = archive.getinfo(name).file_size
                if size > MAX_MEMBER_BYTES:
                    raise InputError(f"{self.shown(name)} has {size} bytes", "don't trust this file")
                return archive.read(name)
        except _DAMAGED as error:
            raise InputError(
                f"{self.shown(name)} is damaged ({error})", "export the recording again"
            ) from None

    def frame_count(self) -> int:
        """Number of frames. Raises InputError when a number or one of its files is missing."""
        members = [PurePosixPath(n) for n in self.names if n.startswith("rgbd/")]
        kinds = {
            s: {int(m.stem) for m in members if m.suffix == s and m.stem.isdigit()}
            for s in (".jpg", ".depth")
        }
        count = max((max(k) + 1 for k in kinds.values() if k), default=0)
        if count == 0:
            raise InputError(f"{self.path.name} holds no rgbd/0.jpg", "export it as .r3d from Record3D")
        for suffix, numbers in kinds.items():
            if missing := sorted(set(range(count)) - numbers):
                raise InputError(
                    f"{self.path.name} has {count} frames, but rgbd/{missing[0]}{suffix} is missing",
                    "export the recording again",
                )
        return count


@dataclass(frozen=True)
class Metadata:
    """The metadata object, checked where it is used."""

    name: str
    values: dict[str, Any]

    @classmethod
    def read(cls, archive: _Archive) -> Metadata:
        name = archive.shown("metadata")
        try:
            values = json.loads(archive.read("metadata"))
        except (ValueError, UnicodeDecodeError, RecursionError) as error:
            raise InputError(f"{name} is not JSON ({error})", "export the recording again") from None
        missing = [k for k in ("w", "h", "K") if k not in (values if isinstance(values, dict) else {})]
        if missing:
            raise InputError(f"{name} lacks {', '.join(missing)}", "export the recording again")
        return cls(name, values)

    def table(self, key: str, columns: int) -> Array | None:
        """Numbers (n, columns) of a key; None when it is absent or empty."""
        value = self.values.get(key)
        if not value:
            return None
        try:
            return np.array(value, dtype=np.float64).reshape(len(value), columns)
        except (TypeError, ValueError, OverflowError):
            raise InputError(
                f"{self.name}: {key} is no table of {columns} numbers a row", "export the recording again"
            ) from None

    def cameras(self, width: int, height: int, numbers: Sequence[int]) -> OwnCameras:
        """Camera of the colour images as stored, width x height, and the frames' own by number."""
        k = self.table("K", 1)
        if k is None or k.size != 9:
            raise InputError(f"{self.name}: K is {self.values['K']}", "export the recording again")
        k = k[:, 0]
        coeffs = np.array([[k[0], k[4], k[6], k[7]]])
        own = self.table("perFrameIntrinsicCoeffs", 4)
        if own is not None and np.all(np.isfinite(own)) and np.all(own > 0) and max(numbers) < len(own):
            coeffs = own[list(numbers)]
        size = int(self.values["w"]), int(self.values["h"])
        if abs(size[0] / size[1] - width / height) > 0.01 * width / height:
            raise InputError(
                f"{self.name} says {size[0]}x{size[1]}, but the images are {width}x{height}",
                "export the recording again without turning or cropping it",
            )
        scale = np.array([width / size[0], height / size[1]])
        centre = (coeffs[:, 2:] + 0.5) * scale - 0.5
        return camera_of(np.hstack([coeffs[:, :2] * scale, centre]), width, height, self.name)

    def times(self, count: int) -> Array:
        """Times (count,) s: the frames' own time stamps, else from the frame rate."""
        stamps = self.table("frameTimestamps", 1)
        if stamps is not None:
            if len(stamps) != count:
                raise InputError(
                    f"{self.name} has {len(stamps)} time stamps for {count} frames", "export it again"
                )
            return stamps[:, 0]
        fps = self.values.get("fps")
        if not isinstance(fps, int | float) or not np.isfinite(fps) or fps <= 0:
            raise InputError(f"{self.name} has no time stamps, and fps is {fps!r}", "export it again")
        return np.arange(count) / float(fps)

    def poses(self, count: int, times: Array) -> tuple[Array, Array] | None:
        """Times and camera poses with OpenCV's camera axes in a z-up world; None when the file has none."""
        table = self.table("poses", 7)
        if table is None:
            return None
        if len(table) != count:
            raise InputError(f"{self.name} has {len(table)} poses for {count} frames", "export it again")
        arkit = files.poses_from_xyzw(table[:, 4:], table[:, :4], self.name, range(count))
        return times, opencv_z_up(arkit)

    def depth_size(self, values: int) -> tuple[int, int]:
        """(height, width) of a depth image, 256x192 turned like the colour image by default."""
        if "dw" in self.values and "dh" in self.values:
            return int(self.values["dh"]), int(self.values["dw"])
        short = (192, 256) if self.values["w"] > self.values["h"] else (256, 192)
        return short if values in (short[0] * short[1], 4 * short[0] * short[1]) else (0, 0)


def _color_reader(archive: _Archive, camera: Intrinsics) -> ReadColor:
    def read(index: int) -> NDArray[np.uint8]:
        name = f"rgbd/{index}"
        image = files.decode_color(archive.shown(f"{name}.jpg"), archive.read(f"{name}.jpg"))
        if image.shape[:2] != (camera.height, camera.width):
            raise InputError(
                f"{archive.shown(name)}.jpg is {image.shape[1]}x{image.shape[0]}, the first frame "
                f"{camera.width}x{camera.height}",
                "export the recording again",
            )
        return image

    return read


def _depth_reader(archive: _Archive, meta: Metadata) -> ReadDepth:
    def read(index: int) -> NDArray[np.float32]:
        name = f"rgbd/{index}"
        metres = _payload(archive, meta, f"{name}.depth", np.dtype("<f4")).astype(np.float32)
        metres = np.where(np.isfinite(metres) & (metres > 0), metres, np.float32(0.0))
        if f"{name}.conf" in archive.names:
            sure = _payload(archive, meta, f"{name}.conf", np.dtype("u1")) >= MIN_CONFIDENCE
            metres = np.where(sure, metres, np.float32(0.0))
        return metres

    return read


def _payload(archive: _Archive, meta: Metadata, name: str, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Image (dh, dw) of a member that is LZFSE-compressed or raw."""
    data = archive.read(name)
    height, width = meta.depth_size(len(data))
    expected = height * width * dtype.itemsize
    if len(data) != expected or expected == 0:
        data = _decompress(archive.shown(name), data)
    height, width = meta.depth_size(len(data))
    if len(data) != height * width * dtype.itemsize or not data:
        raise InputError(
            f"{archive.shown(name)} has {len(data)} bytes, not those of {width}x{height} {dtype.name} values",
            "export the recording again",
        )
    return np.frombuffer(data, dtype).reshape(height, width)


def _decompress(name: str, data: bytes) -> bytes:
    try:
        import lzfse
    except ImportError:
        raise MissingDependencyError(
            f"{name} is LZFSE-compressed and the decoder is not installed",
            to_install("lzfse", "record3d"),
        ) from None
    try:
        return bytes(lzfse.decompress(data))
    except (lzfse.error, MemoryError):  # the latter is what it says of a truncated stream
        raise InputError(
            f"{name} is no LZFSE stream ({len(data)} bytes)", "export the recording again"
        ) from None

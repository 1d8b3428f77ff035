"""Record3D's EXR and RGB export: metadata.json, rgb/<i>.jpg or .png, depth/<i>.exr (one half-float, metres).

metadata.json means what it does in a .r3d file (record3d.py). Numbers may have gaps where the app dropped a
picture; metadata.json keeps the pose and the time of every number.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.readers import arkit, files
from recon.readers.fingerprint import fingerprint
from recon.readers.record3d import Metadata
from recon.readers.streams import Streams
from recon.readers.turned import with_turned_poses
from recon.recording import ReadDepth
from twin.errors import InputError, MissingDependencyError
from twin.geometry import Array
from twin.packages import to_install

FOLDER = "EXR_RGBD"
MAX_RATE = 1e4  # frames a second, chosen by us: no phone has more
_AGAIN = "export the recording again"


@dataclass(frozen=True)
class Record3DExrReader:
    """Reads the folder EXR_RGBD, or the folder that holds it."""

    layout: str = "a Record3D export EXR_RGBD with metadata.json, rgb/ and depth/ (EXR)"

    def recognises(self, path: Path) -> bool:
        with suppress(OSError):
            folder = _folder(path)
            return (folder / "rgb").is_dir() and next((folder / "depth").glob("*.exr"), None) is not None
        return False

    def streams(self, path: Path) -> Streams:
        folder = _folder(path)
        meta = _metadata(folder / "metadata.json")
        color = _numbered(folder / "rgb", files.COLOR_SUFFIXES)
        depth = _numbered(folder / "depth", (".exr",))
        first = next(iter(color.values()))
        height, width = files.decode_color(files.shown(first), files.read_bytes(first)).shape[:2]
        in_color, in_depth = list(color), list(depth)
        camera, own, warnings = meta.cameras(width, height, in_color)
        size = exr_size(depth[in_depth[0]])
        table = meta.table("poses", 7)
        poses = None
        if table is not None:
            every = range(len(table))
            arkit_poses = files.poses_from_xyzw(table[:, 4:], table[:, :4], meta.name, every)
            poses = _times(meta, every), arkit.opencv_z_up(arkit_poses)
        return with_turned_poses(
            Streams(
                name=(path if path.name != FOLDER else path.resolve().parent).resolve().name,
                source=str(path),
                color_times=_times(meta, in_color),
                depth_times=_times(meta, in_depth),
                read_color=arkit.color_reader(list(color.values())),
                read_depth=_depth_reader(list(depth.values()), size),
                rig=arkit.rig_of(camera, size, str(path)),
                own_cameras=own,
                fingerprint=fingerprint(folder, [folder / "metadata.json", *color.values(), *depth.values()]),
                poses=poses,
                upright=True,
                tolerance=0.0,  # the images of one number are of one frame
                warnings=warnings,
            )
        )


def _folder(path: Path) -> Path:
    return path / FOLDER if (path / FOLDER).is_dir() else path


def _metadata(path: Path) -> Metadata:
    values = files.read_json(path)
    for key in ("w", "h"):
        value = values.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 1 <= value <= arkit.MAX_SIDE:
            raise InputError(f"{files.shown(path)}: {key} is {str(value)[:40]}, not a size in pixels", _AGAIN)
    if "K" not in values:
        raise InputError(f"{files.shown(path)} lacks K", _AGAIN)
    return Metadata(files.shown(path), values)


def _numbered(folder: Path, suffixes: Sequence[str]) -> dict[int, Path]:
    found = dict(sorted(arkit.numbered(folder, suffixes).items()))
    if not found:
        there = files.listing(folder) if folder.is_dir() else "nothing"
        raise InputError(
            f"{files.shown(folder)} holds no numbered {'/'.join(suffixes)} image, but {there}",
            "export it from Record3D as EXR + RGB",
        )
    return found


def _times(meta: Metadata, numbers: Sequence[int]) -> Array:
    """Times (n,) s of frames by their increasing numbers: their own stamps, else from the frame rate."""
    stamps = meta.table("frameTimestamps", 1)
    if stamps is None:
        fps = meta.values.get("fps")
        if isinstance(fps, bool) or not isinstance(fps, int | float) or not 0 < fps < MAX_RATE:
            raise InputError(f"{meta.name} has no time stamps, and fps is {str(fps)[:40]}", _AGAIN)
        return np.array(numbers, dtype=np.float64) / float(fps)
    if numbers[-1] >= len(stamps):
        raise InputError(
            f"{meta.name} has {len(stamps)} time stamps, but there is a frame {numbers[-1]}", _AGAIN
        )
    arkit.require_increasing(stamps[:, 0], f"{meta.name}: frameTimestamps", range(len(stamps)))
    return stamps[list(numbers), 0]


def _depth_reader(depth: Sequence[Path], size: tuple[int, int]) -> ReadDepth:
    def read(index: int) -> NDArray[np.float32]:
        found = exr_size(depth[index])
        if found != size:
            raise InputError(
                f"{files.shown(depth[index])} is {found[0]}x{found[1]}, the first one {size[0]}x{size[1]}",
                _AGAIN,
            )
        return exr_depth(depth[index])

    return read


def exr_size(path: Path) -> tuple[int, int]:
    """(width, height) of an EXR by its header. Raises InputError if it is none, or too large for depth."""
    header = _opened(path, header_only=True).header
    try:
        low, high = (np.asarray(corner, dtype=np.int64) for corner in header["dataWindow"])
        width, height = (int(n) for n in high - low + 1)
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{files.shown(path)} does not tell its size", _AGAIN) from None
    if not (0 < width <= arkit.MAX_SIDE and 0 < height <= arkit.MAX_SIDE):
        raise InputError(f"{files.shown(path)} says that it is {width}x{height}", _AGAIN)
    return width, height


def exr_depth(path: Path) -> NDArray[np.float32]:
    """Depth (h, w) m of a one-channel EXR image, 0 where it is not finite or not positive."""
    channels = _opened(path, header_only=False).channels
    if len(channels) != 1:
        raise InputError(
            f"{files.shown(path)} has the channels {', '.join(sorted(channels)) or 'none'}, depth has one",
            _AGAIN,
        )
    metres = np.asarray(next(iter(channels.values())).pixels)
    if metres.ndim != 2 or metres.dtype.kind != "f":
        raise InputError(
            f"{files.shown(path)} holds {metres.dtype} values {metres.shape}, not metres", _AGAIN
        )
    return np.where(np.isfinite(metres) & (metres > 0), metres, 0).astype(np.float32)


def _opened(path: Path, header_only: bool) -> Any:
    """The first part of an EXR file."""
    try:
        import OpenEXR
    except ImportError:
        raise MissingDependencyError(
            f"{files.shown(path)} is an EXR image and the decoder is not installed",
            to_install("OpenEXR", "record3d"),
        ) from None
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # the library prints what it raises as well
            return OpenEXR.File(str(path), separate_channels=True, header_only=header_only).parts[0]
    except (RuntimeError, ValueError, TypeError, IndexError, OSError):
        size = path.stat().st_size if path.is_file() else 0
        raise InputError(
            f"{files.shown(path)} is no readable EXR image, or truncated ({size} bytes)",
            "copy the recording again",
        ) from None

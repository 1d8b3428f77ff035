"""Folders of pictures whose names hold numbers, as data sets keep them."""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.readers import files
from recon.readers.encoded import MAX_PIXELS
from recon.readers.fingerprint import fingerprint
from recon.recording import Intrinsics
from twin.errors import InputError
from twin.geometry import Array

MM_PER_METRE = 1000.0
# chosen by us: rotations printed with three digits are within 1e-3; a scale or a wrong layout is far off
MAX_SHEAR = 0.02
FOCAL = (0.05, 50.0)  # of the longer side, chosen by us: fields of view from 1 to 168 degrees
# m, chosen by us: no camera is further from its world's origin, maps that count from the equator included
FARTHEST = 1e6
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}


def pictures(folder: Path, suffixes: Sequence[str], what: str) -> list[Path]:
    """Files of a folder with these suffixes, by the numbers in their names. Raises InputError without any."""
    if not folder.is_dir():
        raise InputError(
            f"{files.shown(folder.parent)} has no folder {folder.name}/; it holds {files.listing(folder.parent)}",
            f"put {what} there",
        )
    found = [p for p in folder.iterdir() if p.suffix.lower() in suffixes]
    if not found:
        raise InputError(
            f"{files.shown(folder)} holds no {what}, but {files.listing(folder)}", f"put {what} there"
        )
    return sorted(found, key=files.natural_key)


def numbers(paths: Sequence[Path]) -> NDArray[np.int64]:
    """(n,) the last number in each name. Raises InputError for a name without one or with one too large."""
    found = []
    for path in paths:
        digits = re.findall(r"\d+", path.stem)
        if not digits or len(digits[-1]) > 18:
            raise InputError(
                f"{files.shown(path)} has no frame number in its name", "name images by their frame, as 00012"
            )
        found.append(int(digits[-1]))
    return np.array(found, dtype=np.int64)


class PngHeader:
    """What the first bytes of a PNG tell: width, height, bits of a value, channels."""

    def __init__(self, path: Path) -> None:
        head = files.read_head(path, 26)
        if len(head) < 26 or not head.startswith(b"\x89PNG\r\n\x1a\n"):
            raise InputError(f"{files.shown(path)} is no PNG ({len(head)} bytes)", "copy the recording again")
        self.width, self.height, self.bits, kind = struct.unpack(">IIBB", head[16:26])
        self.channels = _CHANNELS.get(kind, 0)
        if not 0 < self.width * self.height <= MAX_PIXELS:
            raise InputError(
                f"{files.shown(path)} is {self.width}x{self.height} by its header", "copy the recording again"
            )


def color_of(path: Path) -> NDArray[np.uint8]:
    """A colour picture (H, W, 3) uint8 RGB. Raises InputError naming the file."""
    return files.decode_color(files.shown(path), files.read_bytes(path))


def depth_of(path: Path) -> NDArray[np.float32]:
    """A depth picture (H, W) float32 m from a 16-bit PNG (mm). Raises InputError naming the file."""
    PngHeader(path)  # tells what is no PNG at all
    return files.decode_depth(files.shown(path), files.read_bytes(path), MM_PER_METRE)


def tree_fingerprint(path: Path, inputs: Iterable[Path]) -> str:
    """The fingerprint of files, some in folders above the recording's: names from the lowest common one."""
    resolved = [p.resolve() for p in inputs]
    return fingerprint(Path(os.path.commonpath([path.resolve(), *resolved])), resolved)


def known_depth(metres: NDArray[np.floating], name: str) -> NDArray[np.float32]:
    """Depth (H, W) float32 m with 0 where not finite, not in front. Raises InputError for all along -z."""
    if metres.ndim != 2:
        raise InputError(f"{name} has shape {metres.shape}", "depth is one number a pixel, (height, width)")
    with np.errstate(invalid="ignore", over="ignore"):
        image = metres.astype(np.float32)
        known = np.isfinite(image) & (image > 0)
    if not known.any() and np.any(image < 0):
        raise InputError(
            f"{name} holds no positive depth, down to {np.nanmin(image):.4g}",
            "save the distance along the view, not OpenGL's z",
        )
    return np.where(known, image, np.float32(0.0))


def camera_of(K: ArrayLike, width: int, height: int, name: str) -> Intrinsics:
    """A camera from K (3, 3) in pixels. Raises InputError for no camera or another resolution."""
    k = np.asarray(K, dtype=np.float64)
    if k.shape != (3, 3):
        raise InputError(f"{name} is of shape {k.shape}, not (3, 3)", "write the camera matrix K")
    if (k[0, 2], k[1, 2]) == (0.0, 0.0) and (k[2, 0], k[2, 1]) != (0.0, 0.0):
        raise InputError(
            f"{name} holds K transposed: {k.ravel().tolist()}", "write it as fx 0 cx, 0 fy cy, 0 0 1"
        )
    try:
        camera = Intrinsics(width, height, *(float(v) for v in (k[0, 0], k[1, 1], k[0, 2], k[1, 2])))
    except InputError as error:
        raise InputError(f"{name}: {error.problem}", error.remedy) from None
    least, most = (f * max(width, height) for f in FOCAL)
    if not (least <= min(camera.fx, camera.fy) and max(camera.fx, camera.fy) <= most):
        raise InputError(
            f"{name}: the focal lengths ({camera.fx:.4g}, {camera.fy:.4g}) px are of no camera of {width}x{height} px",
            "give the intrinsics in pixels of these images",
        )
    return camera


def rigid(poses: ArrayLike, name: str, labels: Sequence[int] | NDArray[np.int64] | None = None) -> Array:
    """Poses (n, 4, 4) with rotations made exact. Raises InputError naming the first that is no pose.

    labels: what the n poses are called in messages, by default 0, 1, ...
    """
    T = np.array(poses, dtype=np.float64)
    R = T[:, :3, :3]
    finite = np.asarray(np.isfinite(T).all(axis=(1, 2)))
    safe = np.where(finite[:, None, None], T, np.eye(4))
    with np.errstate(all="ignore"):  # of hostile numbers
        gram = np.swapaxes(safe[:, :3, :3], 1, 2) @ safe[:, :3, :3]
        off = np.abs(gram - np.eye(3)).max(axis=(1, 2))
        good = np.asarray(finite & (off < MAX_SHEAR) & (np.linalg.det(safe[:, :3, :3]) > 0))
        good &= np.abs(safe[:, :3, 3]).max(axis=1) <= FARTHEST
        good &= np.abs(safe[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1) < MAX_SHEAR
    if not good.all():
        k = int(np.flatnonzero(~good)[0])
        called = k if labels is None else int(labels[k])
        raise InputError(
            f"{name}: pose {called} is no rigid motion: {np.round(T[k], 4).ravel().tolist()}"[:200],
            "leave out the poses that have no value",
        )
    u, _, vt = np.linalg.svd(R)
    T[:, :3, :3] = u @ vt
    T[:, 3] = [0.0, 0.0, 0.0, 1.0]
    return T

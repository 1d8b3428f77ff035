"""TUM RGB-D recordings: rgb.txt and depth.txt list stamped images, groundtruth.txt the camera's poses.

The layout, the depth factor of 5000, and the cameras' intrinsics are those that the Technical University of
Munich publishes with its RGB-D benchmark (Sturm et al., IROS 2012).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from recon.readers.fingerprint import fingerprint
from recon.readers.streams import Streams
from recon.recording import Intrinsics
from recon.recording.rig import Rig
from twin.errors import InputError
from twin.geometry import Array

DEPTH_PER_METRE = 5000.0
MAX_TIME_DIFFERENCE = 0.02  # s, the benchmark's own tool associates with it

# Colour and depth are registered to each other by the driver; for the first two cameras the benchmark's
# authors recommend the driver's default (uncorrected), the third one's images are undistorted.
PUBLISHED_INTRINSICS = {
    "freiburg1": Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5),
    "freiburg2": Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5),
    "freiburg3": Intrinsics(640, 480, 535.4, 539.2, 320.1, 247.6),
}


@dataclass(frozen=True)
class TumReader:
    """Reads a folder of the TUM RGB-D benchmark; an intrinsic.json overrides published values."""

    layout: str = "a TUM RGB-D folder with rgb.txt and depth.txt"

    def recognises(self, path: Path) -> bool:
        return path.is_dir() and ((path / "rgb.txt").is_file() or (path / "depth.txt").is_file())

    def streams(self, path: Path) -> Streams:
        color_times, color = _stamped_files(path, "rgb.txt")
        depth_times, depth = _stamped_files(path, "depth.txt")
        intrinsics, warnings = _intrinsics(path)
        truth = path / "groundtruth.txt"

        def read_color(index: int) -> NDArray[np.uint8]:
            image = files.decode_color(files.shown(color[index]), files.read_bytes(color[index]))
            _check_size(color[index], image.shape, intrinsics)
            return image

        def read_depth(index: int) -> NDArray[np.float32]:
            data = files.read_bytes(depth[index])
            metres = files.decode_depth(files.shown(depth[index]), data, DEPTH_PER_METRE)
            _check_size(depth[index], metres.shape, intrinsics)
            return metres

        lists = [path / n for n in ("rgb.txt", "depth.txt", "groundtruth.txt", "intrinsic.json")]
        return Streams(
            name=path.resolve().name,
            source=str(path),
            color_times=color_times,
            depth_times=depth_times,
            read_color=read_color,
            read_depth=read_depth,
            rig=Rig.one(intrinsics),
            fingerprint=fingerprint(path, {*color, *depth, *(p for p in lists if p.is_file())}),
            poses=files.read_tum_poses(truth) if truth.is_file() else None,
            tolerance=MAX_TIME_DIFFERENCE,
            longest=None,
            warnings=warnings,
        )


def _stamped_files(path: Path, name: str) -> tuple[Array, list[Path]]:
    """Sorted times (n,) s and image paths of a list `time relative/path`."""
    file = path / name
    if not file.is_file():
        raise InputError(
            f"{path} has no {name}; it holds {files.listing(path)}", "a TUM RGB-D folder needs both lists"
        )
    stamps: list[tuple[float, Path]] = []
    for k, words in files.read_lines(file):
        try:
            stamp, relative = float(words[0]), PurePosixPath(words[1])
        except (ValueError, IndexError):
            raise InputError(
                f"{files.shown(file)} line {k} is {' '.join(words)[:60]!r}", "write: time relative/path"
            ) from None
        if not np.isfinite(stamp) or relative.is_absolute() or ".." in relative.parts:
            raise InputError(
                f"{files.shown(file)} line {k} has time {stamp} and path {relative}",
                "write a finite time and a path inside the folder",
            )
        if not (path / relative).is_file():
            raise InputError(
                f"{files.shown(path / relative)}, line {k} of {name}, is missing", "add the image"
            )
        stamps.append((stamp, path / relative))
    if not stamps:
        raise InputError(f"{files.shown(file)} lists no image", "write: time relative/path")
    stamps.sort(key=lambda s: s[0])
    return np.array([s[0] for s in stamps]), [s[1] for s in stamps]


def _intrinsics(path: Path) -> tuple[Intrinsics, tuple[str, ...]]:
    own = path / "intrinsic.json"
    if own.is_file():
        return files.read_intrinsics(own), ()
    camera = next((c for c in PUBLISHED_INTRINSICS if c in path.resolve().name), None)
    if camera is None:
        raise InputError(
            f"{path} has no intrinsic.json, and its name is of no published camera "
            f"({', '.join(PUBLISHED_INTRINSICS)})",
            "write intrinsic.json with width, height, intrinsic_matrix [fx, 0, 0, 0, fy, 0, cx, cy, 1]",
        )
    warning = f"{path.name}: using the published intrinsics of {camera}; its lens distortion is not corrected"
    return PUBLISHED_INTRINSICS[camera], () if camera == "freiburg3" else (warning,)


def _check_size(file: Path, shape: tuple[int, ...], intrinsics: Intrinsics) -> None:
    if shape[:2] != (intrinsics.height, intrinsics.width):
        raise InputError(
            f"{files.shown(file)} is {shape[1]}x{shape[0]}, the intrinsics are of "
            f"{intrinsics.width}x{intrinsics.height}",
            "give the intrinsics of the images in intrinsic.json",
        )

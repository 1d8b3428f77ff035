"""TUM RGB-D recordings: rgb.txt and depth.txt list stamped images, groundtruth.txt the camera's poses.

The layout, the depth factor of 5000, and the cameras' intrinsics are those that the Technical University of Munich
publishes with its RGB-D benchmark (Sturm et al., IROS 2012).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from recon.recording import Intrinsics, Recording
from twin.errors import InputError
from twin.geometry import Array

DEPTH_PER_METRE = 5000.0
MAX_TIME_DIFFERENCE = 0.02  # s, the benchmark's own tool associates with it

# Colour and depth are registered to each other by the driver; for the first two cameras the benchmark's authors
# recommend the driver's default (their lens is not corrected), the third one's images are published undistorted.
PUBLISHED_INTRINSICS = {
    "freiburg1": Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5),
    "freiburg2": Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5),
    "freiburg3": Intrinsics(640, 480, 535.4, 539.2, 320.1, 247.6),
}


@dataclass(frozen=True)
class TumReader:
    """Reads a folder of the TUM RGB-D benchmark; intrinsic.json beside the lists goes before the published values."""

    layout: str = "a TUM RGB-D folder with rgb.txt and depth.txt"

    def recognises(self, path: Path) -> bool:
        return path.is_dir() and ((path / "rgb.txt").is_file() or (path / "depth.txt").is_file())

    def open(self, path: Path) -> Recording:
        color_times, color = _stamped_files(path, "rgb.txt")
        depth_times, depth = _stamped_files(path, "depth.txt")
        pairs = associate(color_times, depth_times, MAX_TIME_DIFFERENCE)
        if len(pairs) == 0:
            raise InputError(
                f"{path}: no image of rgb.txt (from {color_times[0]:.3f} s) is within {MAX_TIME_DIFFERENCE} s of one "
                f"of depth.txt (from {depth_times[0]:.3f} s)",
                "use one clock for both lists",
            )
        color, depth = [color[i] for i in pairs[:, 0]], [depth[j] for j in pairs[:, 1]]
        times = color_times[pairs[:, 0]]
        intrinsics, warnings = _intrinsics(path)
        lost = len(color_times) - len(pairs)
        if lost:
            warnings += (
                f"{path.name}: {lost} of {len(color_times)} colour images have no depth image in time",
            )
        truth = path / "groundtruth.txt"
        stamped = files.read_tum_poses(truth) if truth.is_file() else None

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
        recording = Recording(
            name=path.resolve().name,
            source=str(path),
            times=times,
            intrinsics=intrinsics,
            read_color=read_color,
            read_depth=read_depth,
            fingerprint=files.fingerprint(path, {*color, *depth, *(p for p in lists if p.is_file())}),
            poses=None if stamped is None else files.trajectory_at(*stamped, times, MAX_TIME_DIFFERENCE),
            warnings=warnings,
        )
        recording.frame(
            0
        )  # decodes once now, so that a wrong type or size is told before anything is computed
        return recording


def associate(first: Array, second: Array, tolerance: float) -> NDArray[np.int64]:
    """Pairs (n, 2) of indices into two sorted lists of times (s), nearest pairs first, each time used at most once.

    Pairs are further apart than `tolerance` nowhere, and come in the order of `first`.
    """
    low = np.searchsorted(second, first - tolerance, side="left")
    high = np.searchsorted(second, first + tolerance, side="right")
    candidates = [
        (abs(first[i] - second[j]), i, j) for i in range(len(first)) for j in range(int(low[i]), int(high[i]))
    ]
    used_first: set[int] = set()
    used_second: set[int] = set()
    pairs = []
    for _, i, j in sorted(candidates):
        if i not in used_first and j not in used_second:
            used_first.add(i)
            used_second.add(j)
            pairs.append((i, j))
    return np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2)


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

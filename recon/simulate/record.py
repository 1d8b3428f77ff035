"""Writing the images of a recording and their labels in the native layout."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.simulate.render import Camera
from twin.errors import InputError
from twin.files.atomic import put, staging

PART_ID, HAND_LABEL, STATIC_LABEL = 2, 255, 1
OTHER_LABEL = 254  # moves and is no part: a cup that is carried, a curtain, a second person
DEPTH_LEVEL = 4  # of PNG; noisy depth takes 12 ms instead of the 52 of level 6 and 1.6 % more bytes


def require_new(out: Path) -> None:
    """Raises InputError when `out` holds files already."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} exists and is not an empty folder", "choose a new folder for the recording")


@contextmanager
def new_recording(out: Path) -> Iterator[Path]:
    """A folder to write a recording into, which stands as `out` at the end, whole, or not at all.

    Raises InputError when `out` holds files already or can't be written.
    """
    require_new(out)
    try:
        with staging(out.resolve()) as staged:
            for name in ("color", "depth", "truth/labels"):
                (staged / name).mkdir(parents=True, exist_ok=True)
            yield staged
            put(staged, out.resolve(), ())
    except OSError as error:
        raise InputError(f"can't write the folder {out}: {error.strerror}", "choose another place") from error


def write_frame(
    out: Path,
    index: int,
    colour: NDArray[np.uint8],
    depth: NDArray[np.uint16],
    labels: NDArray[np.uint8],
    jpeg_quality: int,
) -> None:
    """Write one frame: colour (H, W, 3) RGB, depth (H, W) mm, labels (H, W)."""
    _image(out / "color" / f"{index:06d}.jpg", colour[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])
    _image(out / "depth" / f"{index:06d}.png", depth, [cv2.IMWRITE_PNG_COMPRESSION, DEPTH_LEVEL])
    _image(out / "truth" / "labels" / f"{index:06d}.png", labels, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def late_depth(out: Path, lag: int) -> None:
    """Give each frame the depth of the one `lag` before (after: negative), else the first or last."""
    files = sorted((out / "depth").iterdir())
    order = range(len(files) - 1, -1, -1) if lag > 0 else range(len(files) if lag else 0)
    for k in order:  # each is read before it is written
        files[k].write_bytes(files[min(max(k - lag, 0), len(files) - 1)].read_bytes())


def _image(path: Path, image: NDArray[Any], options: list[int]) -> None:
    good, data = cv2.imencode(path.suffix, np.ascontiguousarray(image), options)
    if not good:
        raise InputError(f"can't encode {path.name}", "check the size of the images")
    path.write_bytes(data.tobytes())


def write_intrinsics(out: Path, camera: Camera, focal_error: float, centre_error_px: float) -> None:
    """Write intrinsic.json with a relative error of the focal length and the principal point so far to the
    right; where they are wrong, the true ones to truth/intrinsic.json.
    """
    _intrinsics(out / "intrinsic.json", camera, camera.focal * (1.0 + focal_error), centre_error_px)
    if focal_error or centre_error_px:
        _intrinsics(out / "truth" / "intrinsic.json", camera, camera.focal, 0.0)


def _intrinsics(path: Path, camera: Camera, focal: float, right: float) -> None:
    cx, cy = camera.centre
    matrix = [focal, 0, 0, 0, focal, 0, cx + right, cy, 1]
    intrinsic = {"width": camera.width, "height": camera.height, "intrinsic_matrix": matrix}
    path.write_text(json.dumps(intrinsic, indent=1) + "\n")

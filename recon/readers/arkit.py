"""What recordings of ARKit's frames share, whichever app wrote them: axes, lens, depth and confidence.

ARKit's camera has x right, y up and looks along -z, its world has y up. Depth is of the colour camera at a
resolution of its own (256x192 on phones), so that the colour camera's numbers, scaled, are those of depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from recon.readers import files, streams
from recon.readers.pictures import PngHeader, color_of, depth_of
from recon.recording import Intrinsics, ReadColor, ReadDepth
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array

FLIP_YZ = np.diag([1.0, -1.0, -1.0, 1.0])  # T_arkitcam_opencvcam
Y_UP_TO_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
# chosen by us: 0 is ARKit's "low", edges and glass; apps write low, medium, high as 0, 1, 2 or 0, 127, 255
MIN_CONFIDENCE = 1
# px of a picture by which one camera for all frames may misplace a pixel; half of one, chosen by us
STEADY = 0.5
# Of the focal length, chosen by us: what changes by more is told
MAX_LENS_CHANGE = 0.01
# of the picture's size, chosen by us: phones have 0.02; more means numbers of another resolution
MAX_OFF_CENTRE = 0.15
MAX_ASPECT_CHANGE = 0.02  # chosen by us: 256x192 and 1920x1440 agree to 0.001
MAX_SIDE = 8192  # px, chosen by us: above every phone's camera; bounds what a header makes decoders allocate
KEY_FRAMES_ONLY = "key frames only: a static scene; a motion isn't seen"
_AGAIN = "export the recording again"


class OwnCameras(NamedTuple):
    """A recording's camera, the frames' own fx, fy, cx, cy (n, 4) if a lens moves, and notes for the user."""

    camera: Intrinsics
    own: Array | None
    warnings: tuple[str, ...]


def opencv_z_up(T_arkit: Array) -> Array:
    """T_world_cam (n, 4, 4) with OpenCV's camera axes in a z-up world, from poses with ARKit's axes."""
    return np.asarray(Y_UP_TO_Z_UP @ T_arkit @ FLIP_YZ)


def camera_of(coefficients: Array, width: int, height: int, source: str) -> OwnCameras:
    """One camera for the frames' own fx, fy, cx, cy (n, 4), their median, and their own if different."""
    if not np.isfinite(coefficients).all() or not (coefficients[:, :2] > 0).all():
        raise InputError(f"{source}: a camera has numbers that are not finite, or no focal length", _AGAIN)
    fx, fy, cx, cy = (float(v) for v in np.median(coefficients, axis=0))
    try:
        camera = Intrinsics(width, height, fx, fy, cx, cy)
    except InputError as error:
        raise InputError(f"{source}: {error.problem}", error.remedy) from None
    off = max(abs((cx + 0.5) / width - 0.5), abs((cy + 0.5) / height - 0.5))
    if off > MAX_OFF_CENTRE:
        raise InputError(
            f"{source}: the principal point ({cx:.1f}, {cy:.1f}) is far from the middle of {width}x{height} pictures",
            "give the camera's numbers at the pictures' own size, neither scaled nor cropped",
        )
    zoom = np.abs(coefficients[:, :2] / [fx, fy] - 1.0)
    shift = np.abs(coefficients[:, 2:] - [cx, cy])
    if (shift + zoom * [width / 2, height / 2]).max() <= STEADY * max(width, height) / streams.MAX_SIDE:
        return OwnCameras(camera, None, ())
    change = float((np.ptp(coefficients, axis=0) / np.array([fx, fy, fx, fy])).max())
    told = f"the camera's numbers change by {change:.1%} of the focal length"
    if shift.max() > zoom.max() * max(width, height) / 2:
        told = f"a stabilised lens moves the principal point by ± {shift.max():.1f} px: {told}"
    said = (f"{source}: {told}; each frame is taken by its own",) if change > MAX_LENS_CHANGE else ()
    return OwnCameras(camera, coefficients, said)


def rig_of(color: Intrinsics, depth_size: tuple[int, int], source: str) -> Rig:
    """Colour and depth through one lens. Raises InputError where one picture was turned or cropped."""
    width, height = depth_size
    if abs(color.width * height / (color.height * width) - 1.0) > MAX_ASPECT_CHANGE:
        turned = (color.width > color.height) != (width > height)
        raise InputError(
            f"{source}: colour is {color.width}x{color.height}, depth {width}x{height}: one of them was "
            + ("turned" if turned else "cropped"),
            "give both as the app wrote them, colour neither turned nor cropped when it was re-encoded",
        )
    return Rig(Lens(color), Lens(color.scaled(width, height)))


def require_increasing(times: Array, source: str, labels: Sequence[int]) -> None:
    """Raise InputError naming the first frame that is not later than the one before it."""
    bad = np.flatnonzero(~(np.diff(times) > 0))
    if len(bad) or not np.isfinite(times).all():
        k = int(bad[0]) + 1 if len(bad) else 0
        raise InputError(
            f"{source}: time stamps must strictly increase, that of {labels[k]} is {float(times[k])!r} s",
            _AGAIN,
        )


def numbered(folder: Path, suffixes: Sequence[str], prefix: str = "") -> dict[int, Path]:
    """Files of a folder named `prefix` and a number, by their number, which may have gaps."""
    try:
        paths = sorted(folder.iterdir()) if folder.is_dir() else []
    except OSError as error:
        raise InputError(
            f"{files.shown(folder)} can't be read ({error.strerror})", "change its permissions, or copy it"
        ) from None
    found = {}
    for path in paths:
        digits = path.stem[len(prefix) :]
        if (
            path.stem.startswith(prefix)
            and path.suffix.lower() in suffixes
            and digits.isascii()
            and digits.isdigit()
        ):
            found[int(digits)] = path
    return found


def color_reader(color: Sequence[Path]) -> ReadColor:
    """Reader of JPEGs and PNGs."""
    return lambda index: color_of(color[index])


def depth_reader(
    depth: Sequence[Path], confidence: Sequence[Path | None], size: tuple[int, int]
) -> ReadDepth:
    """Reader of 16-bit PNGs in mm of (width, height), unknown where ARKit's confidence is low."""

    def read(index: int) -> NDArray[np.float32]:
        _require_size(depth[index], size)
        metres = depth_of(depth[index])
        beside = confidence[index]
        if beside is None:
            return metres
        return np.where(_confidence(beside, size) >= MIN_CONFIDENCE, metres, np.float32(0.0))

    return read


def png_size(path: Path) -> tuple[int, int]:
    """(width, height) by a PNG's header. Raises InputError if it is none or too large for a camera's."""
    header = PngHeader(path)
    return header.width, header.height


def _require_size(path: Path, size: tuple[int, int]) -> None:
    found = png_size(path)
    if found != size:
        raise InputError(
            f"{files.shown(path)} is {found[0]}x{found[1]}, the first depth image {size[0]}x{size[1]}", _AGAIN
        )


def _confidence(path: Path, size: tuple[int, int]) -> NDArray[Any]:
    import cv2  # here: what is wrong with a recording is told without it

    _require_size(path, size)
    data = files.read_bytes(path)
    files.check_complete(files.shown(path), data)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim != 2 or image.dtype != np.uint8:
        kind = "unreadable" if image is None else f"{image.shape} {image.dtype}"
        raise InputError(f"{files.shown(path)} is {kind}, not a one-channel 8-bit image", _AGAIN)
    return np.asarray(image)

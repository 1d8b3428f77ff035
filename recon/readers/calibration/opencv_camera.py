"""One camera in OpenCV's YAML or XML, or in ROS' camera_info YAML.

Only what such files hold is looked for, by name: a 3x3 matrix, a list of coefficients, a width and a height.
Nothing is parsed as YAML or XML, whose parsers allow far more than a camera.
"""

from __future__ import annotations

import re

from recon.recording import Intrinsics
from recon.recording.rig import DISTORTION_COUNTS, Lens
from twin.errors import InputError

# Names in the files of OpenCV's calibration program and ROS; the last are of Azure Kinect's examples.
_MATRIX = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K")
_BENT = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "dist", "D")
_WIDTH, _HEIGHT = ("image_width", "image_Width", "width"), ("image_height", "image_Height", "height")
_SIZE = ("img_size", "image_size", "imageSize")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
MAX_DIGITS = 5  # of a picture's side


def opencv_camera(where: str, data: bytes) -> Lens:
    """The camera in such a file. Raises InputError that says what is missing."""
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(
            f"{where} is no calibration file", "name the calibration.json of twin calibrate"
        ) from None
    matrix, bent = _numbers(text, _MATRIX), _numbers(text, _BENT) or []
    if matrix is None:
        raise InputError(
            f"{where} is neither JSON nor OpenCV's YAML or XML with a camera_matrix",
            "name the calibration.json of twin calibrate",
        )
    if len(matrix) != 9 or any(matrix[k] for k in (1, 3, 6, 7)) or matrix[8] != 1.0:
        raise InputError(
            f"{where}: the camera matrix is {matrix}"[:160],
            "write it row by row, without skew: fx 0 cx 0 fy cy 0 0 1",
        )
    size = _size(text)
    if size is None:
        raise InputError(
            f"{where} does not tell the size of its pictures", "add image_width and image_height"
        )
    if len(bent) not in DISTORTION_COUNTS:
        raise InputError(
            f"{where} has {len(bent)} distortion coefficients",
            f"write {', '.join(map(str, DISTORTION_COUNTS))} of them",
        )
    try:
        camera = Intrinsics(*size, matrix[0], matrix[4], matrix[2], matrix[5])
        return Lens(camera, tuple(bent))
    except InputError as error:
        raise InputError(f"{where}: {error.problem}", error.remedy) from None


def _size(text: str) -> tuple[int, int] | None:
    both = _numbers(text, _SIZE)
    if both is None or len(both) != 2:
        sides = (_number(text, _WIDTH), _number(text, _HEIGHT))
        both = [s for s in sides if s is not None]
    if len(both) != 2 or any(s != int(s) or not 0 < s < 10**MAX_DIGITS for s in both):
        return None
    return int(both[0]), int(both[1])


def _number(text: str, names: tuple[str, ...]) -> float | None:
    """A number by one of its names, as `name: 1` at the start of a line or `<name>1</name>`."""
    for name in names:
        found = re.search(rf"(?:^{name}:[ \t]*|<{name}>[ \t]*)({_NUMBER})[ \t]*(?:$|<)", text, re.MULTILINE)
        if found:
            return float(found[1])
    return None


def _numbers(text: str, names: tuple[str, ...]) -> list[float] | None:
    """The numbers of a matrix by one of its names; None without it or where one is no number."""
    for name in names:
        start = re.search(rf"^{name}:|<{name}(?: [^>]*)?>", text, re.MULTILINE)
        if start is None:
            continue
        data = re.compile(r"data:[ \t]*\[([^\]]*)\]|<data>([^<]*)</data>").search(text, start.end())
        if data is None:
            return None
        words = re.split(r"[,\s]+", (data[1] if data[1] is not None else data[2]).strip(", \t\r\n"))
        if not all(re.fullmatch(_NUMBER, w) for w in words):
            return None
        return [float(w) for w in words]
    return None

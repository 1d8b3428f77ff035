"""Calibration files: what `twin calibrate` measured of a device, in place of a recording's own cameras.

The format, JSON:

    {"format": "funtwin-calibration/1",
     "color": {"width", "height", "intrinsic_matrix": [fx, 0, 0, 0, fy, 0, cx, cy, 1],
               "distortion": [k1, k2, p1, p2, k3, ...]},
     "depth": the same of the depth camera,
     "T_color_depth": four rows of a pose that takes points of the depth camera to the colour camera, m,
     "depth_scale": true depth = depth_scale x measured depth}

A camera is Open3D's intrinsic.json (column by column, pixel centres at integers) with OpenCV's distortion
coefficients, which may be left out. At least one of the four has to be there. Open3D's intrinsic.json alone,
OpenCV's camera_matrix and distortion_coefficients in YAML or XML, and ROS' camera_info YAML are read as the
colour camera.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from recon.readers.calibration.opencv_camera import opencv_camera
from recon.readers.streams import Streams
from recon.recording import Intrinsics
from recon.recording.rig import DISTORTION_COUNTS, Lens
from twin.errors import InputError, nearest_name
from twin.geometry import Array, is_rotation

FORMAT = "funtwin-calibration/1"
MAX_BYTES = 2**20  # chosen by us: a calibration is a kilobyte
MAX_SIDE = 2**16  # px, chosen by us: no camera has more
MAX_OFFSET = 1.0  # m, chosen by us: two cameras on one device are nearer; more are millimetres
DEPTH_SCALES = (0.5, 2.0)  # chosen by us: beyond, the unit of the depth is wrong and not its scale
MAX_ROTATION_ERROR = 1e-4  # chosen by us: four printed decimals are within 5e-5
MAX_ASPECT_ERROR = 1.0  # px of the height; a resized picture is rounded to whole pixels
_KEYS = ("format", "color", "depth", "T_color_depth", "depth_scale")
_CAMERA_KEYS = ("width", "height", "intrinsic_matrix", "distortion")
_OPEN3D_KEYS = (*_CAMERA_KEYS, "depth_scale", "fps")  # its video reader writes the last two
_WRITE = "write it as twin calibrate does"


@dataclass(frozen=True, eq=False)
class Calibration:
    """What is known of a device's cameras; None is unknown.

    color, depth: both cameras of stored pictures. T_color_depth (4, 4): depth camera's points to the colour
    camera's, m. depth_scale: true depth = depth_scale x measured depth. digest: of the text it was read from.
    """

    color: Lens | None
    depth: Lens | None
    T_color_depth: Array | None
    depth_scale: float | None
    digest: str = ""

    @property
    def text(self) -> str:
        """The JSON of this calibration; numbers come back bit by bit."""
        data: dict[str, Any] = {"format": FORMAT}
        for name, lens in (("color", self.color), ("depth", self.depth)):
            if lens is not None:
                data[name] = _camera_data(lens)
        if self.T_color_depth is not None:
            data["T_color_depth"] = np.asarray(self.T_color_depth, dtype=np.float64).tolist()
        if self.depth_scale is not None:
            data["depth_scale"] = float(self.depth_scale)
        return json.dumps(data, indent=1, allow_nan=False) + "\n"

    @property
    def contents(self) -> frozenset[str]:
        """Which of "color", "depth" (lenses) and "pose" (between them) it holds."""
        held = {"color": self.color, "depth": self.depth, "pose": self.T_color_depth}
        return frozenset(name for name, value in held.items() if value is not None)


def read_calibration(path: Path) -> Calibration:
    """Read a calibration file. Raises InputError naming the file, the key, the value and the remedy."""
    if path.is_dir():
        inside = path / "calibration.json"
        if not inside.is_file():
            raise InputError(f"{path} is a folder without calibration.json", "name the calibration file")
        path = inside
    if path.is_file() and path.stat().st_size > MAX_BYTES:
        raise InputError(
            f"{files.shown(path)} has {path.stat().st_size} bytes, a calibration has fewer than {MAX_BYTES}",
            "name the calibration file",
        )
    where, text = files.shown(path), files.read_bytes(path)
    digest = hashlib.sha256(text).hexdigest()
    if not text.lstrip().startswith(b"{"):
        return Calibration(opencv_camera(where, text), None, None, None, digest)
    data = _object(where, text)
    if "format" not in data and "intrinsic_matrix" in data:
        _only(where, data, _OPEN3D_KEYS)
        lens = _lens(where, "the camera", {k: data[k] for k in _CAMERA_KEYS if k in data})
        return Calibration(lens, None, None, None, digest)
    if data.get("format") != FORMAT:
        raise InputError(
            f"{where}: format is {data.get('format')!r}", f"write {FORMAT!r}, or Open3D's intrinsic.json"
        )
    return _of_format(where, data, digest)


def calibrated(streams: Streams, calibration: Calibration) -> Streams:
    """A recording with a calibration's cameras in the place of its own, at the size of its pictures.

    Depth that lies on colour as it is stored gets the colour camera's lens; a depth camera in the file is
    then no camera of this recording, and left out with a warning. Raises InputError when a camera's picture
    has another shape than the recording's.
    """
    rig, warnings = streams.rig, streams.warnings
    lies_on_color = (
        rig.color == rig.depth and not rig.along_ray and np.array_equal(rig.T_color_depth, np.eye(4))
    )
    color = _at_size(streams.source, "colour", calibration.color, rig.color)
    if lies_on_color:
        if calibration.color is None and calibration.depth is not None:
            raise InputError(
                f"{streams.source}: its depth lies on colour pixel by pixel, the calibration tells the depth camera alone",
                "calibrate the colour camera",
            )
        if calibration.depth is not None or calibration.T_color_depth is not None:
            warnings += (
                f"{streams.name}: depth lies on colour as it is stored; the calibration's depth camera and its pose are not used",
            )
        rig = replace(rig, color=color, depth=color)
    else:
        depth = _at_size(streams.source, "depth", calibration.depth, rig.depth)
        T = rig.T_color_depth if calibration.T_color_depth is None else calibration.T_color_depth
        rig = replace(rig, color=color, depth=depth, T_color_depth=T)
    scale = calibration.depth_scale
    read_depth = streams.read_depth
    if scale is not None:
        factor = np.float32(scale)

        def scaled(index: int) -> NDArray[np.float32]:
            return np.asarray(streams.read_depth(index) * factor, dtype=np.float32)

        read_depth = scaled
    both = hashlib.sha256((streams.fingerprint + calibration.digest).encode()).hexdigest()
    # a calibration goes before what the file tells
    own = streams.own_cameras if calibration.color is None else None
    return replace(
        streams, rig=rig, own_cameras=own, read_depth=read_depth, fingerprint=both, warnings=warnings
    )


def _at_size(source: str, name: str, known: Lens | None, stored: Lens) -> Lens:
    """The calibrated lens at the size of the stored pictures, or the recording's own if none."""
    if known is None:
        return stored
    own, size = known.camera, (stored.camera.width, stored.camera.height)
    if abs(own.height * size[0] / own.width - size[1]) >= MAX_ASPECT_ERROR:
        raise InputError(
            f"{source}: its {name} pictures are {size[0]}x{size[1]}, the calibration is of {own.width}x{own.height}, another shape",
            "calibrate with pictures of the camera mode that was recorded",
        )
    return known if (own.width, own.height) == size else known.scaled(*size)


def _of_format(where: str, data: Mapping[str, Any], digest: str) -> Calibration:
    _only(where, data, _KEYS)
    color, depth = (
        None if data.get(name) is None else _lens(where, name, data[name]) for name in ("color", "depth")
    )
    T, scale = data.get("T_color_depth"), data.get("depth_scale")
    if color is None and depth is None and T is None and scale is None:
        raise InputError(
            f"{where} tells nothing of a camera", f"write {', '.join(_KEYS[1:])}, or some of them"
        )
    return Calibration(
        color,
        depth,
        None if T is None else _pose(where, T),
        None if scale is None else _scale(where, scale),
        digest,
    )


def _object(where: str, text: bytes) -> dict[str, Any]:
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where} is not JSON ({str(error)[:80]})", "repair or replace it") from None
    return dict(data)


def _only(where: str, data: Mapping[str, Any], known: Iterable[str]) -> None:
    for key in data:
        if key not in known:
            near = nearest_name(key, list(known))
            raise InputError(
                f"{where} has the unknown key {key[:40]!r}",
                f"did you mean {near!r}?" if near else f"known are {', '.join(known)}",
            )


def _lens(where: str, name: str, data: Any) -> Lens:
    if not isinstance(data, dict):
        raise InputError(f"{where}: {name} is {str(data)[:40]!r}, not an object", _WRITE)
    _only(f"{where}: {name}", data, _CAMERA_KEYS)
    missing = [k for k in _CAMERA_KEYS[:3] if k not in data]
    if missing:
        raise InputError(
            f"{where}: {name} lacks {', '.join(missing)}", "write width, height and intrinsic_matrix"
        )
    width, height = (_side(f"{where}: {name}", k, data[k]) for k in ("width", "height"))
    m = _numbers(f"{where}: {name}", "intrinsic_matrix", data["intrinsic_matrix"])
    if m.size != 9 or m[[1, 2, 3, 5]].any() or m[8] != 1.0:
        raise InputError(
            f"{where}: {name}: intrinsic_matrix is {m.tolist()}"[:160],
            "write it column by column, without skew: [fx, 0, 0, 0, fy, 0, cx, cy, 1]",
        )
    bent = _numbers(f"{where}: {name}", "distortion", data.get("distortion", []))
    if bent.size not in DISTORTION_COUNTS:
        counts = ", ".join(map(str, DISTORTION_COUNTS))
        raise InputError(
            f"{where}: {name}: distortion has {bent.size} numbers",
            f"write {counts} in OpenCV's order k1 k2 p1 p2 k3 ...",
        )
    try:
        camera = Intrinsics(width, height, float(m[0]), float(m[4]), float(m[6]), float(m[7]))
    except InputError as error:
        raise InputError(f"{where}: {name}: {error.problem}", error.remedy) from None
    return Lens(camera, tuple(bent.tolist()))


def _side(where: str, key: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 < value <= MAX_SIDE:
        raise InputError(
            f"{where}: {key} is {str(value)[:40]!r}", "write the picture's pixels, a whole number"
        )
    return value


def _numbers(where: str, key: str, value: Any) -> Array:
    """Finite numbers (n,) of a JSON list."""
    good = isinstance(value, list) and all(
        isinstance(v, int | float) and not isinstance(v, bool) and abs(v) < 1e12 for v in value
    )
    if not good:
        raise InputError(f"{where}: {key} is {str(value)[:60]!r}", "write a list of finite numbers")
    return np.array(value, dtype=np.float64)


def _pose(where: str, value: Any) -> Array:
    remedy = "write four rows of a pose in metres: a rotation, a translation, and 0 0 0 1"
    if not isinstance(value, list) or len(value) != 4:
        raise InputError(f"{where}: T_color_depth is {str(value)[:60]!r}", remedy)
    T = [_numbers(where, "T_color_depth", row) for row in value]
    if any(row.size != 4 for row in T):
        raise InputError(f"{where}: T_color_depth has rows of {[row.size for row in T]} numbers", remedy)
    pose = np.stack(T)
    if not is_rotation(pose[:3, :3], MAX_ROTATION_ERROR) or not np.array_equal(pose[3], [0, 0, 0, 1]):
        raise InputError(f"{where}: T_color_depth is no rigid pose: {pose.tolist()}"[:200], remedy)
    offset = float(np.linalg.norm(pose[:3, 3]))
    if offset > MAX_OFFSET:
        raise InputError(
            f"{where}: T_color_depth puts the cameras {offset:.4g} m apart", "write metres, not millimetres"
        )
    return pose


def _scale(where: str, value: Any) -> float:
    low, high = DEPTH_SCALES
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise InputError(
            f"{where}: depth_scale is {str(value)[:40]!r}",
            f"write true depth / measured depth, between {low:g} and {high:g}, or leave it out",
        )
    return float(value)


def _camera_data(lens: Lens) -> dict[str, Any]:
    k = lens.camera
    matrix = [float(v) for v in (k.fx, 0, 0, 0, k.fy, 0, k.cx, k.cy, 1)]
    return {
        "width": k.width,
        "height": k.height,
        "intrinsic_matrix": matrix,
        "distortion": list(lens.distortion),
    }

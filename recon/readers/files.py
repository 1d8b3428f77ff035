"""Reading files at the door: images, time stamps, poses and intrinsics, with errors that name the file."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.readers.encoded import require_sane_size
from recon.recording import Intrinsics
from twin.errors import InputError
from twin.geometry import Array, make_pose, matrix_from_quat_wxyz
from twin.scene import Trajectory

COLOR_SUFFIXES = (".jpg", ".jpeg", ".png")
FLOAT_DEPTH_SUFFIXES = (".tif", ".tiff", ".exr", ".npy", ".npz", ".pfm", ".hdr")
MAX_QUATERNION_ERROR = 0.01  # chosen by us: printed with five decimals a unit quaternion is within 1e-4
METRES_NOT_MILLIMETRES = 30  # chosen by us: no depth camera sees only surfaces nearer than 3 cm
_SAVE_MM = "save depth as one-channel 16-bit PNG in millimetres, 0 = unknown"


def natural_key(path: Path | str) -> list[tuple[int, str]]:
    """Sort key that orders 2.jpg before 10.jpg."""
    pieces = re.split(r"(\d+)", path.name if isinstance(path, Path) else path)
    return [(int(p), "") if p.isdigit() else (-1, p) for p in pieces if p]


def listing(folder: Path, limit: int = 8) -> str:
    """Short text that tells what a folder holds."""
    names = sorted(p.name + ("/" if p.is_dir() else "") for p in folder.iterdir())
    more = f" and {len(names) - limit} more" if len(names) > limit else ""
    return (", ".join(names[:limit]) or "nothing") + more


def shown(path: Path) -> str:
    """Path for messages: its last three pieces, so that a message stays one line."""
    return "/".join(path.parts[-3:])


def read_bytes(path: Path) -> bytes:
    """Bytes of a file. Raises InputError when it is missing, unreadable or empty."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{shown(path)} can't be read ({error.strerror})", "copy the recording again"
        ) from None
    if not data:
        raise InputError(f"{shown(path)} is empty (0 bytes)", "copy the recording again")
    return data


def read_head(path: Path, count: int) -> bytes:
    """Up to `count` first bytes of a file. Raises InputError when it can't be read."""
    try:
        with path.open("rb") as stream:
            return stream.read(count)
    except OSError as error:
        raise InputError(
            f"{shown(path)} can't be read ({error.strerror})", "copy the recording again"
        ) from None


def check_complete(name: str, data: bytes) -> None:
    """Raise InputError when a PNG or JPEG lacks its end, which decoders fill with grey instead of failing."""
    cut = False
    if data.startswith(b"\x89PNG"):
        cut = b"IEND" not in data[-64:]
    elif data.startswith(b"\xff\xd8"):
        cut = data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda")
    if cut:
        raise InputError(
            f"{name} is truncated: {len(data)} bytes without the end of the image", "copy the recording again"
        )


def decode_color(name: str, data: bytes) -> NDArray[np.uint8]:
    """Colour image (H, W, 3) uint8 RGB, stored orientation. Raises InputError if damaged or truncated."""
    import cv2  # here: what is wrong with a recording is told without it

    require_sane_size(name, data)
    check_complete(name, data)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        raise InputError(f"{name} is not a readable image ({len(data)} bytes)", "copy the recording again")
    return np.ascontiguousarray(image[..., ::-1], dtype=np.uint8)


def decode_depth(name: str, data: bytes, per_metre: float) -> NDArray[np.float32]:
    """Depth image (H, W) float32 m from a 16-bit PNG that holds depth x `per_metre`, 0 = unknown.

    All pixels are 0 where the lens was covered. Raises InputError for other pixel types and damaged files.
    """
    import cv2  # here: what is wrong with a recording is told without it

    require_sane_size(name, data)
    check_complete(name, data)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise InputError(
            f"{name} is not a readable depth image ({len(data)} bytes)", "copy the recording again"
        )
    if image.ndim != 2:
        raise InputError(f"{name} has {image.shape[2]} channels, depth has one", _SAVE_MM)
    if image.dtype.kind == "f":
        raise InputError(f"{name} is a float image ({image.dtype}), values up to {image.max():.4g}", _SAVE_MM)
    if image.dtype != np.uint16:
        raise InputError(f"{name} is {8 * image.dtype.itemsize}-bit ({image.dtype}), not 16-bit", _SAVE_MM)
    top = int(image.max())
    if 0 < top < METRES_NOT_MILLIMETRES:
        raise InputError(f"{name} has no value above {top}, as if in metres", _SAVE_MM)
    return (image.astype(np.float32) / np.float32(per_metre)).astype(np.float32)


def read_lines(path: Path) -> list[tuple[int, list[str]]]:
    """Words of every line that holds data, with its line number from 1; # starts a comment."""
    try:
        text = read_bytes(path).decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{shown(path)} is not a text file", "replace it by plain text") from None
    lines = [(k, line.split("#")[0].split()) for k, line in enumerate(text.splitlines(), 1)]
    return [(k, words) for k, words in lines if words]


def read_numbers(path: Path, columns: int, what: str) -> tuple[Array, list[int]]:
    """Table (n, columns) of finite numbers and the line number of each row."""
    rows, numbers = [], []
    for k, words in read_lines(path):
        try:
            row = [float(w) for w in words]
        except ValueError:
            raise InputError(
                f"{shown(path)} line {k} is not numbers: {' '.join(words)[:60]!r}", f"write {what}"
            ) from None
        if len(row) != columns:
            raise InputError(f"{shown(path)} line {k} has {len(row)} numbers, not {columns}", f"write {what}")
        if not np.all(np.isfinite(row)):
            raise InputError(
                f"{shown(path)} line {k} holds {' '.join(words)[:60]!r}, which is not finite",
                "leave out the lines that have no value",
            )
        rows.append(row)
        numbers.append(k)
    return np.array(rows, dtype=np.float64).reshape(-1, columns), numbers


def read_tum_poses(path: Path) -> tuple[Array, Array]:
    """Times (n,) s and poses T_world_cam (n, 4, 4) of a TUM trajectory `t tx ty tz qx qy qz qw`."""
    table, lines = read_numbers(path, 8, "t tx ty tz qx qy qz qw")
    if len(table) == 0:
        raise InputError(f"{shown(path)} holds no pose", "delete it, or fill it")
    return table[:, 0], poses_from_xyzw(table[:, 1:4], table[:, 4:], shown(path), lines)


def poses_from_xyzw(translation: Array, quat_xyzw: Array, source: str, lines: Sequence[int]) -> Array:
    """Poses (n, 4, 4). Raises InputError naming the line of a value not finite or no unit quaternion."""
    ok = np.isfinite(translation).all(1) & np.isfinite(quat_xyzw).all(1)
    if not ok.all():
        k = int(np.flatnonzero(~ok)[0])
        values = [*translation[k].tolist(), *quat_xyzw[k].tolist()]
        raise InputError(
            f"{source} pose {lines[k]} is not finite: {values}", "leave out the poses that have no value"
        )
    norm = np.linalg.norm(quat_xyzw, axis=1)
    bad = np.flatnonzero(np.abs(norm - 1.0) > MAX_QUATERNION_ERROR)
    if len(bad):
        k = int(bad[0])
        raise InputError(
            f"{source} pose {lines[k]} has a quaternion of length {norm[k]:.4g}, not 1",
            "write quaternions as qx qy qz qw of length 1",
        )
    poses = np.stack([make_pose(translation=t) for t in translation])
    poses[:, :3, :3] = matrix_from_quat_wxyz(quat_xyzw[:, [3, 0, 1, 2]])
    return poses


def nearest_frames(stamps: Array, times: Array, tolerance: float) -> NDArray[np.int64]:
    """Index of the nearest of the sorted `times` for every stamp, -1 beyond `tolerance` s."""
    right = np.clip(np.searchsorted(times, stamps), 1, max(len(times) - 1, 1))
    left = right - 1
    right = np.minimum(right, len(times) - 1)
    best = np.where(np.abs(times[left] - stamps) <= np.abs(times[right] - stamps), left, right)
    return np.where(np.abs(times[best] - stamps) <= tolerance, best, -1).astype(np.int64)


def trajectory_at(stamps: Array, poses: Array, times: Array, tolerance: float) -> Trajectory | None:
    """The pose nearest in time to every recording time within `tolerance` s; None without any."""
    order = np.argsort(stamps, kind="stable")
    nearest = nearest_frames(times, stamps[order], tolerance)
    frames = np.flatnonzero(nearest >= 0)
    if len(frames) == 0:
        return None
    return Trajectory(frames, times[frames], poses[order][nearest[frames]])


def read_json(path: Path) -> dict[str, Any]:
    """A JSON object. Raises InputError that names the file and the place of the mistake."""
    try:
        value = json.loads(read_bytes(path))
    except (ValueError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{shown(path)} is not JSON ({error})", "repair or replace it") from None
    if not isinstance(value, dict):
        raise InputError(f"{shown(path)} holds a {type(value).__name__}, not an object", "replace it")
    return value


def read_intrinsics(path: Path) -> Intrinsics:
    """Intrinsics from Open3D's PinholeCameraIntrinsic JSON (column-major matrix)."""
    data = read_json(path)
    missing = [k for k in ("width", "height", "intrinsic_matrix") if k not in data]
    if missing:
        raise InputError(
            f"{shown(path)} lacks {', '.join(missing)}; it has {', '.join(data) or 'nothing'}",
            "write Open3D's PinholeCameraIntrinsic: width, height, intrinsic_matrix",
        )
    try:
        m = np.array(data["intrinsic_matrix"], dtype=np.float64).reshape(-1)
        width, height = int(data["width"]), int(data["height"])
    except (TypeError, ValueError):
        raise InputError(
            f"{shown(path)} does not hold numbers: {data}"[:150], "write the nine numbers"
        ) from None
    if m.shape != (9,):
        raise InputError(
            f"{shown(path)}: intrinsic_matrix has {m.size} numbers, not 9", "write the 3x3 matrix"
        )
    if (m[2], m[5]) != (0.0, 0.0) and (m[6], m[7]) == (0.0, 0.0):
        raise InputError(
            f"{shown(path)}: intrinsic_matrix is row-major ({m.tolist()})",
            "write it column by column: [fx, 0, 0, 0, fy, 0, cx, cy, 1]",
        )
    try:
        return Intrinsics(width, height, float(m[0]), float(m[4]), float(m[6]), float(m[7]))
    except InputError as error:
        raise InputError(f"{shown(path)}: {error.problem}", error.remedy) from None

"""Arti4D: raw/<room>/<scene>/ with rgb/, depth/ and the camera's odometry, from an Azure Kinect.

After the data set's own loader (artipoint/dataloader/arti4d.py): rgb and depth are paired in sorted order;
the name's last piece after `_` is the time in ns; depth is 16-bit PNG in millimetres on colour's pixels;
odom/<scene>.csv holds poses of the tracker on the camera, which azure_tf.json takes to colour's: T_map_base *
base_T_depth * depth_T_rgb, turned by half a turn about the view, as the pictures are turned upright.
cam_trajectory.csv, where there is no odometry, is DROID-SLAM's, whose quaternion stands one column off, and
registration_matrix.json takes it to the map.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from recon.readers import files
from recon.readers.pictures import camera_of, color_of, depth_of, pictures, rigid, tree_fingerprint
from recon.readers.streams import Streams
from recon.recording import Intrinsics
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array, make_pose, matrix_from_quat_wxyz

NS = 1e-9
# chosen by us: stamps above are nanoseconds, as seconds they would be 30 000 years after 1970
SECONDS_UP_TO = 1e12
T_UPRIGHT = np.diag([-1.0, -1.0, 1.0, 1.0])  # half a turn about the view: all recordings' pictures are turned
MAX_LINE = 2**20  # bytes, chosen by us, of camera_info.txt
COLUMNS = ("timestamp", "x", "y", "z", "qx", "qy", "qz", "qw")
_CALIBRATION = ("azure_tf.json", "meta/calibration/azure_tf.json", "calibration/azure_tf.json")
_UP = 4  # folders above the scene in which the calibration is looked for; chosen by us


@dataclass(frozen=True)
class Arti4dReader:
    """Reads a scene's folder."""

    layout: str = "an Arti4D scene with rgb/, depth/ and odom/"

    def recognises(self, path: Path) -> bool:
        if not ((path / "rgb").is_dir() and (path / "depth").is_dir()):
            return False
        marks = ("odom", "cam_trajectory.csv", "rgb/camera_info.txt", "depth/camera_info.txt")
        return any((path / m).exists() for m in marks)

    def streams(self, path: Path) -> Streams:
        color = pictures(path / "rgb", files.COLOR_SUFFIXES, "JPEG or PNG images")
        depth = pictures(path / "depth", (".png",), "16-bit PNG depth images")
        if len(color) != len(depth):
            raise InputError(
                f"{files.shown(path)} has {len(color)} colour and {len(depth)} depth images",
                "the scene pairs them in order: copy both folders whole",
            )
        times = frame_times(color)
        rig, warnings = _rig(path, color[0])
        found = camera_poses(path)
        told = [path / f / "camera_info.txt" for f in ("rgb", "depth")]
        inputs = [*color, *depth, *(p for p in told if p.is_file()), *found.files]
        return Streams(
            name=path.resolve().name,
            source=str(path),
            color_times=times,
            depth_times=times,
            read_color=lambda k: color_of(color[k]),
            read_depth=lambda k: depth_of(depth[k]),
            rig=rig,
            fingerprint=tree_fingerprint(path, inputs),
            poses=found.poses,
            warnings=warnings + found.warnings,
        )


@dataclass(frozen=True, eq=False)
class CameraPoses:
    """Poses of colour's camera: times (k,) s and T_world_cam (k, 4, 4), or None. in_map: whether the world is
    the map in which joints are annotated. files: what was read."""

    poses: tuple[Array, Array] | None = None
    in_map: bool = False
    warnings: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()


def frame_times(paths: Sequence[Path]) -> Array:
    """(n,) s, from the nanoseconds at the end of each image's name. Raises InputError for another name."""
    stamps = []
    for path in paths:
        last = path.stem.split("_")[-1]
        if not (last.isascii() and last.isdigit() and len(last) <= 19):
            raise InputError(
                f"{files.shown(path)} has no time in its name",
                "name images ..._<nanoseconds>, as Arti4D does",
            )
        stamps.append(int(last))
    return np.array(stamps, dtype=np.float64) * NS


def camera_poses(path: Path) -> CameraPoses:
    """Poses of colour's camera: from the tracker where the scene has its odometry, else DROID-SLAM's."""
    odometry, slam = _odometry(path), path / "cam_trajectory.csv"
    if odometry is not None:
        calibration = _above(path, _CALIBRATION)
        if calibration is None:
            warning = (
                f"{path.name}: {odometry.name} holds the tracker's poses, and there is no azure_tf.json that takes them to the "
                "camera: they are left out (put Arti4D's meta/ beside the scenes)"
            )
            return CameraPoses(warnings=(warning,))
        times, T_map_base = _read_poses(odometry, COLUMNS)
        T = T_map_base @ _transform(calibration, "base_T_depth") @ _transform(calibration, "depth_T_rgb")
        return CameraPoses((times, T @ T_UPRIGHT), True, (), (odometry, calibration))
    if not slam.is_file():
        return CameraPoses()
    # the columns that it names qx qy qz qw hold qy qz qw qx
    times, T = _read_poses(slam, ("timestamp", "x", "y", "z", "qw", "qx", "qy", "qz"))
    registration = path / "registration_matrix.json"
    if not registration.is_file():
        return CameraPoses((times, T), False, (), (slam,))
    return CameraPoses((times, _registration(registration) @ T), True, (), (slam, registration))


def _odometry(path: Path) -> Path | None:
    """odom/<scene>.csv, or the only table there."""
    folder = path / "odom"
    named = folder / f"{path.resolve().name}.csv"
    if named.is_file() or not folder.is_dir():
        return named if named.is_file() else None
    found = sorted(folder.glob("*.csv"))
    if len(found) > 1:
        raise InputError(
            f"{files.shown(folder)} holds {files.listing(folder)}, and none is of the scene's name",
            f"name the camera's odometry {named.name}",
        )
    return found[0] if found else None


def _above(path: Path, names: Sequence[str]) -> Path | None:
    """The first of these files in the folder or in those above it."""
    resolved = path.resolve()
    found = (f / n for f in (resolved, *resolved.parents[:_UP]) for n in names)
    return next((p for p in found if p.is_file()), None)


def read_table(path: Path) -> tuple[list[str], list[list[str]]]:
    """Column names, lower case without blanks, and rows of a CSV. Raises InputError for other files."""
    try:
        text = files.read_bytes(path).decode("utf-8-sig")
        rows = [
            [w.strip() for w in row] for row in csv.reader(io.StringIO(text)) if any(w.strip() for w in row)
        ]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{files.shown(path)} is no table ({error})", "copy the scene again") from None
    if not rows:
        raise InputError(f"{files.shown(path)} holds no row", "copy the scene again")
    return [name.lower() for name in rows[0]], rows[1:]


def _read_poses(path: Path, columns: Sequence[str]) -> tuple[Array, Array]:
    """Times (n,) s and poses (n, 4, 4); columns: of time, position and qx qy qz qw, in this order."""
    head, rows = read_table(path)
    missing = [c for c in columns if c not in head]
    if missing or not rows:
        raise InputError(
            f"{files.shown(path)} lacks {', '.join(missing) or 'poses'}; its columns are {', '.join(head)}"[
                :200
            ],
            f"expected {', '.join(COLUMNS)}",
        )
    places = [head.index(c) for c in columns]
    values = []
    for k, row in enumerate(rows, 2):
        try:
            values.append([float(row[p]) for p in places])
        except (ValueError, IndexError):
            raise InputError(
                f"{files.shown(path)} row {k} is {','.join(row)[:60]!r}", "write numbers, one pose a row"
            ) from None
    table = np.array(values)
    with np.errstate(over="ignore"):  # of hostile numbers
        poses = files.poses_from_xyzw(
            table[:, 1:4], table[:, 4:], files.shown(path), range(2, len(table) + 2)
        )
    times = table[:, 0]
    if not np.all(np.isfinite(times)):
        raise InputError(f"{files.shown(path)} holds a time that is not finite", "leave out such rows")
    return np.where(times > SECONDS_UP_TO, times * NS, times), rigid(poses, files.shown(path))


def _transform(path: Path, key: str) -> Array:
    """T (4, 4) of azure_tf.json: rotation x y z w and translation x y z, as objects or lists."""
    entry = files.read_json(path).get(key)
    try:
        if not isinstance(entry, dict):
            raise TypeError
        rotation, translation = (
            [float(v[k]) for k in keys] if isinstance(v, dict) else [float(x) for x in v]
            for v, keys in ((entry["rotation"], "xyzw"), (entry["translation"], "xyz"))
        )
        if (len(rotation), len(translation)) != (4, 3) or not np.all(np.isfinite([*rotation, *translation])):
            raise ValueError
        x, y, z, w = rotation
        return make_pose(matrix_from_quat_wxyz(np.array([w, x, y, z])), np.array(translation))
    except (KeyError, TypeError, ValueError, OverflowError):
        raise InputError(
            f"{files.shown(path)} holds no rotation x y z w and translation x y z of {key}",
            "copy Arti4D's meta/ again",
        ) from None


def _registration(path: Path) -> Array:
    try:
        T = np.array(files.read_json(path)["transformation_matrix"], dtype=np.float64).reshape(4, 4)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise InputError(
            f"{files.shown(path)} holds no transformation_matrix of 16 numbers", "copy it again"
        ) from None
    return rigid([T], files.shown(path))[0]


def _rig(path: Path, first: Path) -> tuple[Rig, tuple[str, ...]]:
    """Both cameras, which are one: the driver brings depth into colour's place."""
    height, width = color_of(first).shape[:2]
    found = {n: _camera_info(path / n / "camera_info.txt") for n in ("rgb", "depth")}
    known = {n: info for n, info in found.items() if info is not None}
    if not known:
        raise InputError(
            f"{files.shown(path)} has no rgb/camera_info.txt nor depth/camera_info.txt",
            "copy the scene again",
        )
    warnings: list[str] = []
    for name, info in known.items():
        if info.size not in (None, (width, height)):
            raise InputError(
                f"{files.shown(path)}/{name}/camera_info.txt is of {info.size[0]}x{info.size[1]} images, "
                f"{first.name} is {width}x{height}",
                "give the camera_info.txt of these images",
            )
        if any(info.D):
            warnings.append(
                f"{path.name}: the distortion in {name}/camera_info.txt is not applied, as in the data set's own loader"
            )
    either = next(iter(known.values()))
    color, depth = (known.get(n, either).camera(width, height) for n in ("rgb", "depth"))
    return Rig(Lens(color), Lens(depth)), tuple(warnings)


@dataclass(frozen=True)
class _CameraInfo:
    """K (3, 3), D and the size (width, height), None where it isn't told, of one camera_info.txt."""

    name: str
    K: Array
    D: tuple[float, ...]
    size: tuple[int, int] | None

    def camera(self, width: int, height: int) -> Intrinsics:
        return camera_of(self.K, width, height, self.name)


def _camera_info(path: Path) -> _CameraInfo | None:
    if not path.is_file():
        return None
    entries: dict[str, str] = {}
    try:
        for line in files.read_bytes(path)[:MAX_LINE].decode("utf-8").splitlines():
            key, colon, value = line.partition(":")
            if colon:
                entries.setdefault(key.strip(), value.strip())
        K = np.array([float(v) for v in entries["K"].strip("()[]").split(",") if v.strip()]).reshape(3, 3)
        D = tuple(float(v) for v in entries.get("D", "").strip("()[]").split(",") if v.strip())
        size = int(entries.get("width", 0)), int(entries.get("height", 0))
    except (UnicodeDecodeError, KeyError, ValueError, OverflowError):
        raise InputError(
            f"{files.shown(path)} has no line K: (fx, 0, cx, 0, fy, cy, 0, 0, 1)", "copy the scene again"
        ) from None
    return _CameraInfo(files.shown(path), K, D, size if min(size) > 0 else None)

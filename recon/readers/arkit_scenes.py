"""ARKitScenes: lowres_wide/, lowres_depth/, confidence/, lowres_wide_intrinsics/ (<video>_<time>), .traj.

The layout is that of the data set's own documentation and loader (github.com/apple/ARKitScenes): depth in mm,
a .pincam with "w h fx fy cx cy" for each frame, and a .traj with "t", the rotation as axis times angle, and
the translation of world to camera, with OpenCV's camera axes and z up (by z the data set's tool tells which
way a picture is held).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from recon.readers import arkit, files
from recon.readers.fingerprint import fingerprint
from recon.readers.streams import Streams
from twin.errors import InputError
from twin.geometry import Array, exp_so3, invert_pose

COLOR, DEPTH, CONFIDENCE = "lowres_wide", "lowres_depth", "confidence"
CAMERAS, POSES = "lowres_wide_intrinsics", "lowres_wide.traj"
MAX_ROTATION = 2 * np.pi  # rad: an axis times an angle needs no more; degrees do
_AGAIN = "download the sequence again"


@dataclass(frozen=True)
class ArkitScenesReader:
    """Reads the folder of one video, or the folder that holds <video>_frames/."""

    layout: str = "an ARKitScenes sequence with lowres_wide/, lowres_depth/ and lowres_wide_intrinsics/"

    def recognises(self, path: Path) -> bool:
        with suppress(OSError):
            return (_folder(path) / DEPTH).is_dir()
        return False

    def streams(self, path: Path) -> Streams:
        folder = _folder(path)
        color, depth = _stamped(folder / COLOR, ".png"), _stamped(folder / DEPTH, ".png")
        cameras = _stamped(folder / CAMERAS, ".pincam")
        sure = {p.name: p for p in _stamped(folder / CONFIDENCE, ".png", needed=False).values()}
        camera, own, warnings = _camera([cameras[t] for t in sorted(cameras)], files.shown(folder / CAMERAS))
        in_color, in_depth = sorted(color), sorted(depth)
        if own is not None:
            own = own[files.nearest_frames(np.array(in_color), np.array(sorted(cameras)), np.inf)]
        found = arkit.png_size(color[in_color[0]])
        if found != (camera.width, camera.height):
            raise InputError(
                f"{files.shown(color[in_color[0]])} is {found[0]}x{found[1]}, its .pincam of {camera.width}x{camera.height}",
                f"give the images of {COLOR}, neither scaled nor turned",
            )
        size = arkit.png_size(depth[in_depth[0]])
        confidence = [sure.get(depth[t].name) for t in in_depth]
        file = folder / POSES
        poses = _poses(file) if file.is_file() else None
        used = [*color.values(), *depth.values(), *cameras.values(), *([file] if poses else [])]
        return Streams(
            name=path.resolve().name,
            source=str(path),
            color_times=np.array(in_color),
            depth_times=np.array(in_depth),
            read_color=arkit.color_reader([color[t] for t in in_color]),
            read_depth=arkit.depth_reader([depth[t] for t in in_depth], confidence, size),
            rig=arkit.rig_of(camera, size, str(path)),
            own_cameras=own,
            fingerprint=fingerprint(folder, [*used, *(p for p in confidence if p is not None)]),
            poses=poses,
            upright=True,
            warnings=warnings,
        )


def _folder(path: Path) -> Path:
    if not path.is_dir() or (path / DEPTH).is_dir():
        return path
    return next((p.parent for p in path.glob(f"*_frames/{DEPTH}")), path)


def _stamped(folder: Path, suffix: str, needed: bool = True) -> dict[float, Path]:
    """Files by the time (s) at the end of their names."""
    found: dict[float, Path] = {}
    for path in sorted(folder.glob(f"*{suffix}")) if folder.is_dir() else ():
        try:
            time = float(path.stem.rsplit("_", 1)[-1])
        except ValueError:
            time = np.nan
        if not np.isfinite(time):
            raise InputError(
                f"{files.shown(path)} has no time in its name", "name it <video>_<seconds>" + suffix
            )
        if time in found:
            raise InputError(
                f"{files.shown(path)} and {found[time].name} are of one time", "keep one video a folder"
            )
        found[time] = path
    if needed and not found:
        there = files.listing(folder) if folder.is_dir() else "is missing"
        raise InputError(f"{files.shown(folder)} holds no {suffix} file: {there}", _AGAIN)
    return found


def _camera(cameras: Sequence[Path], source: str) -> arkit.OwnCameras:
    tables = []
    for path in cameras:
        table, _ = files.read_numbers(path, 6, "w h fx fy cx cy")
        if len(table) != 1:
            raise InputError(f"{files.shown(path)} has {len(table)} lines, not one", _AGAIN)
        tables.append(table[0])
    values = np.array(tables)
    width, height = values[0, :2]
    if (
        not np.all(values[:, :2] == values[0, :2])
        or not 1 <= min(width, height) <= max(width, height) <= arkit.MAX_SIDE
    ):
        raise InputError(f"{source} are of {values[:, :2].min(0)} to {values[:, :2].max(0)} pixels", _AGAIN)
    return arkit.camera_of(values[:, 2:], int(width), int(height), source)


def _poses(path: Path) -> tuple[Array, Array]:
    """Times (n,) s and T_world_cam (n, 4, 4)."""
    table, lines = files.read_numbers(path, 7, "t, axis times angle (3), translation (3)")
    if len(table) == 0:
        raise InputError(f"{files.shown(path)} holds no pose", "delete it, or download it again")
    turns = np.abs(table[:, 1:4]).max(axis=1)
    if turns.max() > MAX_ROTATION:
        k = int(turns.argmax())
        raise InputError(
            f"{files.shown(path)} line {lines[k]} turns by {turns[k]:.4g} rad",
            "write rotations as axis times angle in rad",
        )
    T_cam_world = np.tile(np.eye(4), (len(table), 1, 1))
    T_cam_world[:, :3, :3] = exp_so3(table[:, 1:4])
    T_cam_world[:, :3, 3] = table[:, 4:]
    return table[:, 0], invert_pose(T_cam_world)

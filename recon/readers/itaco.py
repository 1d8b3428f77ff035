"""iTACO's recordings: rendered views of PartNet-Mobility objects, and a phone's with refined depth.

After the project's own loader (data.py). Rendered, view_<k>/: rgb/%06d.jpg, depth/%06d.npz with `a` (H, W)
float m along the view, intrinsics.npy K (3, 3), camera_pose.npy (n, 7) = position and quaternion w x y z of
the camera in SAPIEN's axes (x forward, y left, z up) in a z-up world. Real: rgb/<i>.jpg and metadata.json as
Record3D exports them (K column by column at w x h, poses qx qy qz qw tx ty tz in ARKit's axes),
prompt_depth_video/<i>.npy (H, W) float m. Neither tells times beside the export's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from recon.readers.arkit import FLIP_YZ, Y_UP_TO_Z_UP
from recon.readers.fingerprint import fingerprint
from recon.readers.numpy_files import read_npy, read_npz
from recon.readers.pictures import camera_of, color_of, known_depth, numbers, pictures, rigid
from recon.readers.streams import Streams
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array, make_pose

DEFAULT_FPS = 30.0  # chosen by us; the data tell none
MAX_SMALL = 2**24  # bytes, chosen by us, of poses and intrinsics
MAX_STRETCH = 0.01  # chosen by us: how far two pictures' shapes may differ and be the same view
# columns: where OpenCV's x right, y down, z forward point in SAPIEN's x forward, y left, z up
R_SAPIEN_OPENCV = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_FOLDERS = ("prompt_depth_video", "preprocess/prompt_depth_video")

ReadMetres = Callable[[Path], NDArray[Any]]


@dataclass(frozen=True)
class ItacoReader:
    """Reads a view's folder; frames are counted by the numbers in the images' names."""

    layout: str = "an iTACO view with rgb/, depth/*.npz and intrinsics.npy, or rgb/, prompt_depth_video/ and metadata.json"

    def recognises(self, path: Path) -> bool:
        if not (path / "rgb").is_dir():
            return False
        rendered = (path / "intrinsics.npy").is_file() or (path / "camera_pose.npy").is_file()
        if rendered and (path / "depth").is_dir():
            return any((path / "depth").glob("*.npz"))
        return any((path / f).is_dir() for f in _FOLDERS)

    def streams(self, path: Path) -> Streams:
        refined = next((path / f for f in _FOLDERS if (path / f).is_dir()), None)
        return _rendered(path) if refined is None else _real(path, refined)


def _rendered(path: Path) -> Streams:
    color = pictures(path / "rgb", files.COLOR_SUFFIXES, "JPEG or PNG images")
    depth = pictures(path / "depth", (".npz",), ".npz depth images")
    K_file = path / "intrinsics.npy"
    if not K_file.is_file():
        raise InputError(f"{files.shown(path)} has no intrinsics.npy", "copy the view again")
    poses, pose_file = None, path / "camera_pose.npy"
    if pose_file.is_file():
        poses = _sapien_poses(read_npy(pose_file, MAX_SMALL), files.shown(pose_file))
    return _streams(
        path,
        color,
        depth,
        lambda file: read_npz(file, "a"),
        np.squeeze(read_npy(K_file, MAX_SMALL)),
        K_file,
        _Clock(DEFAULT_FPS, None),
        poses,
        [K_file, *([pose_file] if pose_file.is_file() else [])],
    )


def _real(path: Path, refined: Path) -> Streams:
    color = pictures(path / "rgb", files.COLOR_SUFFIXES, "JPEG or PNG images")
    depth = pictures(refined, (".npy",), ".npy depth images")
    file = path / "metadata.json"
    if not file.is_file():
        raise InputError(f"{files.shown(path)} has no metadata.json", "copy Record3D's export into it")
    meta = files.read_json(file)
    K = _numbers(meta, "K", 9, file)
    if K is None:
        raise InputError(f"{files.shown(file)} has no K", "copy Record3D's export again")
    poses = _numbers(meta, "poses", 7, file)
    T = None if poses is None else _arkit_poses(poses, files.shown(file))
    return _streams(
        path, color, depth, read_npy, _of_image(meta, K.reshape(3, 3).T, color[0], file), file, _clock(meta, file), T, [file]
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Clock:
    """Frames a second, None where they are assumed, or times (n,) s by frame number."""

    fps: float
    stamps: Array | None
    known: bool = False

    def __call__(self, frames: NDArray[np.int64]) -> Array:
        if self.stamps is not None and frames.max() < len(self.stamps):
            return self.stamps[frames]
        return frames / self.fps


def _clock(meta: dict[str, Any], file: Path) -> _Clock:
    stamps = _numbers(meta, "frameTimestamps", 1, file)
    fps = meta.get("fps")
    if stamps is not None:
        return _Clock(DEFAULT_FPS, stamps[:, 0], True)
    if isinstance(fps, int | float) and 0 < fps <= 1000:
        return _Clock(float(fps), None, True)
    return _Clock(DEFAULT_FPS, None)


def _streams(
    path: Path,
    color: Sequence[Path],
    depth: Sequence[Path],
    read: ReadMetres,
    K: NDArray[Any],
    K_file: Path,
    clock: _Clock,
    T: Array | None,
    others: Sequence[Path],
) -> Streams:
    """T: T_world_cam (n, 4, 4) in a z-up world, one for every frame number."""
    height, width = color_of(color[0]).shape[:2]
    camera = camera_of(K, width, height, files.shown(K_file))
    first = known_depth(read(depth[0]), files.shown(depth[0]))
    seen = camera if first.shape == (height, width) else camera.scaled(first.shape[1], first.shape[0])
    if abs(first.shape[1] / first.shape[0] - width / height) > MAX_STRETCH * width / height:
        raise InputError(
            f"{files.shown(depth[0])} is {first.shape[1]}x{first.shape[0]}, colour {width}x{height}",
            "give depth of the whole picture, neither turned nor cropped",
        )
    frames = np.arange(0 if T is None else len(T))
    warnings = () if clock.known else (
        f"{path.name} tells no times; taken to be recorded at {DEFAULT_FPS:g} frames a second",
    )  # fmt: skip
    return Streams(
        name=path.resolve().name,
        source=str(path),
        color_times=clock(numbers(color)),
        depth_times=clock(numbers(depth)),
        read_color=lambda k: color_of(color[k]),
        read_depth=lambda k: known_depth(read(depth[k]), files.shown(depth[k])),
        rig=Rig(Lens(camera), Lens(seen)),
        fingerprint=fingerprint(path, [*color, *depth, *others]),
        poses=None if T is None else (clock(frames), T),
        upright=True,
        warnings=warnings,
    )


def _of_image(meta: dict[str, Any], K: Array, first: Path, file: Path) -> Array:
    """K of the images as they are stored; the export tells it at w x h."""
    height, width = color_of(first).shape[:2]
    try:
        w, h = (
            int(v if (v := meta.get(k)) is not None else side) for k, side in (("w", width), ("h", height))
        )
        turned = not (w > 0 and h > 0) or abs(w / h - width / height) > MAX_STRETCH * width / height
    except (TypeError, ValueError, OverflowError):
        w, h, turned = 0, 0, True
    if turned:
        raise InputError(
            f"{files.shown(file)} says {meta.get('w')}x{meta.get('h')}, {first.name} is {width}x{height}"[
                :200
            ],
            "copy Record3D's export again without turning or cropping it",
        )
    return camera_of(K, w, h, files.shown(file)).scaled(width, height).matrix


def _numbers(meta: dict[str, Any], key: str, columns: int, file: Path) -> Array | None:
    """Finite numbers (n, columns) of a key of metadata.json; None when it is absent or empty."""
    value = meta.get(key)
    if not value:
        return None
    try:
        table = np.array(value, dtype=np.float64).reshape(-1, columns)
    except (TypeError, ValueError, OverflowError):
        table = np.full((1, columns), np.nan)
    if not np.all(np.isfinite(table)):
        raise InputError(
            f"{files.shown(file)}: {key} is no table of {columns} numbers a row", "copy it again"
        )
    return table


def _sapien_poses(table: NDArray[Any], name: str) -> Array:
    if table.ndim != 2 or table.shape[1] != 7:
        raise InputError(f"{name} has shape {table.shape}, not (n, 7)", "copy the view again")
    values = table.astype(np.float64)
    with np.errstate(over="ignore"):  # of hostile numbers
        T = files.poses_from_xyzw(values[:, :3], values[:, [4, 5, 6, 3]], name, range(len(values)))
    return rigid(T @ make_pose(R_SAPIEN_OPENCV), name)


def _arkit_poses(table: Array, name: str) -> Array:
    with np.errstate(over="ignore"):  # of hostile numbers
        T = files.poses_from_xyzw(table[:, 4:], table[:, :4], name, range(len(table)))
    return rigid(Y_UP_TO_Z_UP @ T @ FLIP_YZ, name)

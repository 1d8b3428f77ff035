"""Polycam's raw data: keyframes/ with an image, a camera, depth and confidence a key frame, named by time.

The layout is that of the app's own description (github.com/PolyCam/polyform): names are microseconds; camera
files hold fx, fy, cx, cy at width x height and the rows t_00 .. t_23 of the pose, camera to world with
ARKit's axes; depth is in mm, confidence 0, 127 or 255. Images and cameras come as recorded and, where the app
could, corrected: undistorted and with optimised poses.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from recon.readers import arkit, files
from recon.readers.fingerprint import fingerprint
from recon.readers.pictures import rigid
from recon.readers.streams import Streams
from twin.errors import InputError
from twin.geometry import Array

PER_SECOND = 1e6
_AGAIN = "export the raw data again (developer mode)"
_SETS = (("corrected_images", "corrected_cameras"), ("images", "cameras"))
_POSE = [f"t_{i}{j}" for i in range(3) for j in range(4)]
_KEYS = ("fx", "fy", "cx", "cy", "width", "height", *_POSE)


@dataclass(frozen=True)
class PolycamReader:
    """Reads the folder that holds keyframes/, or keyframes/ itself."""

    layout: str = "a Polycam raw export with keyframes/images, keyframes/cameras and keyframes/depth"

    def recognises(self, path: Path) -> bool:
        with suppress(OSError):
            folder = _folder(path)
            inside = folder != path  # in a folder keyframes/, which says enough where cameras are lost
            return any(
                (folder / image).is_dir() and (inside or (folder / camera).is_dir())
                for image, camera in _SETS
            )
        return False

    def streams(self, path: Path) -> Streams:
        folder = _folder(path)
        images, cameras, chosen = _chosen(folder)
        color_times = sorted(images.keys() & cameras.keys())
        depth = arkit.numbered(folder / "depth", (".png",))
        if not color_times or not depth:
            raise InputError(
                f"{folder} holds {len(images)} {chosen[0]}, {len(cameras)} {chosen[1]} and {len(depth)} depth images, "
                "none of them of one time",
                "record in LiDAR or Room mode, and export the raw data again",
            )
        depth_times = sorted(depth)
        values = np.array([_camera(cameras[t]) for t in color_times])
        width, height = (int(v) for v in values[0, 4:6])
        color, own, warnings = arkit.camera_of(
            values[:, :4], width, height, f"{files.shown(folder)}/{chosen[1]}"
        )
        size = arkit.png_size(depth[depth_times[0]])
        sure = arkit.numbered(folder / "confidence", (".png",))
        confidence = [sure.get(t) for t in depth_times]
        used = [*(images[t] for t in color_times), *(cameras[t] for t in color_times), *depth.values()]
        stamps = np.array(color_times, dtype=np.float64) / PER_SECOND
        return Streams(
            name=path.resolve().name,
            source=str(path),
            color_times=stamps,
            depth_times=np.array(depth_times, dtype=np.float64) / PER_SECOND,
            read_color=arkit.color_reader([images[t] for t in color_times]),
            read_depth=arkit.depth_reader([depth[t] for t in depth_times], confidence, size),
            rig=arkit.rig_of(color, size, str(path)),
            own_cameras=own,
            fingerprint=fingerprint(folder, [*used, *(p for p in confidence if p is not None)]),
            poses=(stamps, _poses(values, f"{files.shown(folder)}/{chosen[1]}", color_times)),
            upright=True,
            tolerance=0.0,  # the names of one key frame are the same
            warnings=(
                f"{path.name}: {arkit.KEY_FRAMES_ONLY}",
                *_lost(path, images, cameras, chosen),
                *warnings,
            ),
        )


def _folder(path: Path) -> Path:
    return path / "keyframes" if (path / "keyframes").is_dir() else path


def _chosen(folder: Path) -> tuple[dict[int, Path], dict[int, Path], tuple[str, str]]:
    """Images and cameras by time, from one set: an optimised pose does not go with a raw one."""
    for names in _SETS:
        images = arkit.numbered(folder / names[0], files.COLOR_SUFFIXES)
        cameras = arkit.numbered(folder / names[1], (".json",))
        if images and cameras:
            return images, cameras, names
    return images, cameras, names


def _lost(
    path: Path, images: dict[int, Path], cameras: dict[int, Path], chosen: tuple[str, str]
) -> tuple[str, ...]:
    odd = images.keys() ^ cameras.keys()
    if not odd:
        return ()
    return (f"{path.name}: {len(odd)} key frames are not in both {chosen[0]} and {chosen[1]}, and left out",)


def _camera(path: Path) -> list[float]:
    data = files.read_json(path)
    missing = [k for k in _KEYS if k not in data]
    if missing:
        raise InputError(f"{files.shown(path)} lacks {', '.join(missing)}", _AGAIN)
    wrong = next((k for k in _KEYS if not _is_number(data[k])), None)
    if wrong is not None:
        raise InputError(f"{files.shown(path)}: {wrong} is {str(data[wrong])[:40]}, not a number", _AGAIN)
    if not (1 <= data["width"] <= arkit.MAX_SIDE and 1 <= data["height"] <= arkit.MAX_SIDE):
        raise InputError(f"{files.shown(path)} is of {data['width']}x{data['height']} pixels", _AGAIN)
    return [float(data[k]) for k in _KEYS]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e9


def _poses(values: Array, name: str, times: list[int]) -> Array:
    matrices = np.tile(np.eye(4), (len(values), 1, 1))
    matrices[:, :3] = values[:, 6:].reshape(-1, 3, 4)
    return arkit.opencv_z_up(rigid(matrices, name, times))

"""Stray Scanner: rgb.mp4, depth/ and confidence/ of numbered PNGs, odometry.csv with each frame's pose.

The layout is that of the app's own encoders (github.com/strayrobots/scanner). The video counts frames where
odometry.csv has their times, so that only the latter tells the clock; its first frame lies before the start
that its edit list gives, where players cut it off. Quaternions are x y z w, camera to world, with OpenCV's
camera axes; the world is ARKit's, y up. imu.csv is not read: the poses tell gravity.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from recon.readers import arkit, files
from recon.readers.fingerprint import fingerprint
from recon.readers.native import COLOR_FOLDERS
from recon.readers.streams import Streams
from recon.readers.video import Video
from twin.errors import InputError
from twin.geometry import Array

MAX_COUNT_DIFFERENCE = 1  # chosen by us: the app stops its three encoders one after the other
_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_CAMERA = ("fx", "fy", "cx", "cy")
_AGAIN = "export the recording again"


@dataclass(frozen=True)
class StrayScannerReader:
    """Reads a folder that Stray Scanner exported."""

    layout: str = "a Stray Scanner folder with rgb.mp4, odometry.csv and depth/"

    def recognises(self, path: Path) -> bool:
        if any((path / n).is_dir() for n in COLOR_FOLDERS):
            return False  # it was converted
        pieces = ("odometry.csv", "rgb.mp4", "camera_matrix.csv")
        return sum((path / n).is_file() for n in pieces) > 1  # the third may be lost, which is told then

    def streams(self, path: Path) -> Streams:
        missing = [n for n in ("rgb.mp4", "odometry.csv", "depth") if not (path / n).exists()]
        if missing:
            raise InputError(f"{path} has no {', '.join(missing)}; it holds {files.listing(path)}", _AGAIN)
        odometry = _Odometry.read(path / "odometry.csv")
        video = Video(path / "rgb.mp4", every_stored=True)
        rows = len(odometry.times)
        count, warnings = _common(path, len(video), rows)
        in_depth = arkit.numbered(path / "depth", (".png",))
        with_depth = [k for k in range(rows) if odometry.frames[k] in in_depth]
        if not with_depth:
            raise InputError(
                f"{files.shown(path / 'depth')} holds {files.listing(path / 'depth')}, none of odometry.csv's frames "
                f"{odometry.frames[0]:06d} to {odometry.frames[-1]:06d}",
                "record with depth, and export the whole folder",
            )
        depth = [in_depth[odometry.frames[k]] for k in with_depth]
        sure = arkit.numbered(path / "confidence", (".png",))
        confidence = [sure.get(odometry.frames[k]) for k in with_depth]
        color, own, said = _camera(path, odometry, video)
        size = arkit.png_size(depth[0])
        used = [path / n for n in ("rgb.mp4", "odometry.csv", "camera_matrix.csv") if (path / n).is_file()]
        return Streams(
            name=path.resolve().name,
            source=str(path),
            color_times=odometry.times[:count],
            depth_times=odometry.times[with_depth],
            read_color=video.read,
            read_depth=arkit.depth_reader(depth, confidence, size),
            rig=arkit.rig_of(color, size, str(path)),
            own_cameras=None if own is None else own[:count],
            fingerprint=fingerprint(path, [*used, *depth, *(p for p in confidence if p is not None)]),
            poses=(odometry.times, odometry.T_world_cam),
            upright=True,
            tolerance=0.0,  # the images of one number are of one frame
            warnings=warnings + said,
        )


@dataclass(frozen=True, eq=False)
class _Odometry:
    """odometry.csv: times (n,) s, depth image numbers, T_world_cam (n, 4, 4) z-up, fx fy cx cy (n, 4)."""

    times: Array
    frames: list[int]
    T_world_cam: Array
    coefficients: Array | None

    @classmethod
    def read(cls, path: Path) -> _Odometry:
        table = _table(path)
        lines = [k for k, _ in table[1:]]
        names = [w.lower() for w in table[0][1]]
        missing = [n for n in ("timestamp", "frame", *_POSE) if n not in names]
        if missing:
            raise InputError(
                f"{files.shown(path)} has no column {', '.join(missing)}; it begins with {','.join(names)[:60]!r}",
                "record with a version of the app that writes time stamps (2021 or later)",
            )
        if not lines:
            raise InputError(f"{files.shown(path)} holds no frame", "record again")
        own = all(n in names for n in _CAMERA)
        wanted = [names.index(n) for n in ("timestamp", *_POSE, *(_CAMERA if own else ()))]
        number = names.index("frame")
        values, frames = [], []
        for k, words in table[1:]:
            try:
                values.append([float(words[i]) for i in wanted])
                frames.append(int(words[number]))
            except (ValueError, IndexError):
                raise InputError(
                    f"{files.shown(path)} line {k} is {','.join(words)[:60]!r}, not the values of {','.join(names)[:80]}",
                    "delete the line, or export the recording again",
                ) from None
        numbers = np.array(values, dtype=np.float64)
        if len(set(frames)) < len(frames):
            twice = next(f for f in frames if frames.count(f) > 1)
            raise InputError(f"{files.shown(path)} has frame {twice} twice", _AGAIN)
        arkit.require_increasing(numbers[:, 0], files.shown(path), frames)
        poses = files.poses_from_xyzw(numbers[:, 1:4], numbers[:, 4:8], files.shown(path), lines)
        return cls(numbers[:, 0], frames, arkit.Y_UP_TO_Z_UP @ poses, numbers[:, 8:] if own else None)


def _table(path: Path) -> list[tuple[int, list[str]]]:
    """Comma-separated words of each line that is not empty, with its line number from 1."""
    try:
        text = files.read_bytes(path).decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{files.shown(path)} is not a text file", _AGAIN) from None
    rows = [(k, [w.strip() for w in line.split(",")]) for k, line in enumerate(text.splitlines(), 1)]
    found = [(k, words) for k, words in rows if any(words)]
    if not found:
        raise InputError(f"{files.shown(path)} holds no line", _AGAIN)
    return found


def _common(path: Path, video: int, rows: int) -> tuple[int, tuple[str, ...]]:
    """How many frames the video and odometry.csv share from the first on."""
    if abs(video - rows) > MAX_COUNT_DIFFERENCE:
        raise InputError(
            f"{path}: rgb.mp4 holds {video} frames, odometry.csv {rows}, so that it's unknown which belong together",
            _AGAIN,
        )
    if video == rows:
        return rows, ()
    return min(video, rows), (
        f"{path.name}: rgb.mp4 holds {video} frames, odometry.csv {rows}: the last one is left out",
    )


def _camera(path: Path, odometry: _Odometry, video: Video) -> arkit.OwnCameras:
    """The colour camera: the frames' own if in odometry.csv, else camera_matrix.csv (the last's)."""
    file = path / "camera_matrix.csv"
    if odometry.coefficients is not None:
        return arkit.camera_of(
            odometry.coefficients, video.width, video.height, files.shown(path / "odometry.csv")
        )
    if not file.is_file():
        raise InputError(
            f"{path} has neither camera_matrix.csv nor fx, fy, cx, cy in odometry.csv",
            "export the whole folder",
        )
    try:
        K = np.array([[float(w) for w in words] for _, words in _table(file)])
    except ValueError:
        K = np.empty(0)
    if K.shape != (3, 3) or not np.isfinite(K).all():
        raise InputError(
            f"{files.shown(file)} is no 3x3 matrix of numbers", "write fx,0,cx / 0,fy,cy / 0,0,1"
        )
    if not np.allclose(K[2], [0, 0, 1]):
        raise InputError(
            f"{files.shown(file)}: the last row is {K[2].tolist()}, not 0,0,1",
            "write fx,0,cx / 0,fy,cy / 0,0,1",
        )
    values = np.array([[K[0, 0], K[1, 1], K[0, 2], K[1, 2]]])
    return arkit.camera_of(values, video.width, video.height, files.shown(file))

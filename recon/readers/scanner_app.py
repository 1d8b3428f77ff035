"""3D Scanner App's "All Data" export: frame_<i>.json, depth_<i>.png, conf_<i>.png, some frame_<i>.jpg.

The app writes no specification; the layout is the one its users' readers agree on: json with `time` (s),
`intrinsics` (9 numbers, row by row, at the size of the JPEGs) and `cameraPoseARFrame` (16 numbers, row by
row, camera to world with ARKit's axes); depth in mm. Only about every sixth frame has a JPEG.
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

COUNTS = {"time": 1, "intrinsics": 9, "cameraPoseARFrame": 16}
_AGAIN = 'export the scan again as "All Data"'


@dataclass(frozen=True)
class ScannerAppReader:
    """Reads the folder that holds frame_00000.json."""

    layout: str = "a 3D Scanner App export (All Data) with frame_*.json, frame_*.jpg and depth_*.png"

    def recognises(self, path: Path) -> bool:
        with suppress(OSError):
            return path.is_dir() and all(
                next(path.glob(n), None) is not None for n in ("frame_*.json", "frame_*.jpg")
            )
        return False

    def streams(self, path: Path) -> Streams:
        described = arkit.numbered(path, (".json",), "frame_")
        color = {k: p for k, p in arkit.numbered(path, (".jpg", ".jpeg"), "frame_").items() if k in described}
        depth = {k: p for k, p in arkit.numbered(path, (".png",), "depth_").items() if k in described}
        for what, found in (("frame_*.jpg", color), ("depth_*.png", depth)):
            if not found:
                raise InputError(
                    f"{path} holds no {what} with a frame_*.json of its number, but {files.listing(path)}",
                    "scan with the LiDAR sensor, and " + _AGAIN,
                )
        read = {k: _Frame.read(p) for k, p in sorted(described.items())}
        stamps = np.array([f.time for f in read.values()])
        arkit.require_increasing(stamps, f"{files.shown(path)}/frame_*.json", list(read))
        in_color, in_depth = sorted(color), sorted(depth)
        first = color[in_color[0]]
        height, width = files.decode_color(files.shown(first), files.read_bytes(first)).shape[:2]
        coefficients = np.array([read[k].coefficients for k in in_color])
        camera, own, warnings = arkit.camera_of(
            coefficients, width, height, f"{files.shown(path)}/frame_*.json"
        )
        size = arkit.png_size(depth[in_depth[0]])
        sure = arkit.numbered(path, (".png",), "conf_")
        confidence = [sure.get(k) for k in in_depth]
        matrices = np.array([read[k].matrix for k in read])
        poses = arkit.opencv_z_up(rigid(matrices, f"{files.shown(path)}/frame_*.json", list(read)))
        used = [*described.values(), *color.values(), *depth.values()]
        return Streams(
            name=path.resolve().name,
            source=str(path),
            color_times=np.array([read[k].time for k in in_color]),
            depth_times=np.array([read[k].time for k in in_depth]),
            read_color=arkit.color_reader([color[k] for k in in_color]),
            read_depth=arkit.depth_reader([depth[k] for k in in_depth], confidence, size),
            rig=arkit.rig_of(camera, size, str(path)),
            own_cameras=own,
            fingerprint=fingerprint(path, [*used, *(p for p in confidence if p is not None)]),
            poses=(stamps, poses),
            upright=True,
            tolerance=0.0,  # the images of one number are of one frame
            warnings=(f"{path.name}: {arkit.KEY_FRAMES_ONLY}", *warnings),
        )


@dataclass(frozen=True)
class _Frame:
    """One frame_<i>.json: time s, (fx, fy, cx, cy), pose (4, 4) as nested lists."""

    time: float
    coefficients: tuple[float, float, float, float]
    matrix: list[list[float]]

    @classmethod
    def read(cls, path: Path) -> _Frame:
        data = files.read_json(path)
        values = {}
        for key, count in COUNTS.items():
            try:
                found = np.array(data.get(key), dtype=np.float64).reshape(-1)
            except (TypeError, ValueError, OverflowError):
                found = np.empty(0)
            if found.size != count or not np.isfinite(found).all():
                there = f"is {str(data[key])[:40]}" if key in data else "is missing"
                raise InputError(f"{files.shown(path)}: {key} {there}, not {count} numbers", _AGAIN)
            values[key] = found
        k = values["intrinsics"]
        if (k[2], k[5]) == (0.0, 0.0) and (k[6], k[7]) != (0.0, 0.0):
            raise InputError(
                f"{files.shown(path)}: intrinsics are column by column ({k.tolist()})"[:200],
                "write them row by row",
            )
        matrix = values["cameraPoseARFrame"].reshape(4, 4)
        if np.any(matrix[3, :3]) and not np.any(matrix[:3, 3]):
            raise InputError(
                f"{files.shown(path)}: cameraPoseARFrame is column by column ({matrix[3].tolist()} is its last row)",
                "write it row by row",
            )
        return cls(
            float(values["time"][0]), (float(k[0]), float(k[4]), float(k[2]), float(k[5])), matrix.tolist()
        )

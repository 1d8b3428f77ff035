"""Turn a Stray Scanner recording into the native layout (docs/recordings.md).

    python benchmarks/stray_scanner.py STRAY_FOLDER RECORDING

writes RECORDING/ with color/, depth/, intrinsic.json, depth_intrinsic.json and timestamps.txt; the Stray folder stays as it is.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

import av
import cv2
import numpy as np

from recon.readers import open_recording
from recon.recording import Intrinsics
from twin.errors import FuntwinError, InputError

MAX_SIDE = 640  # px, as the Record3D reader takes; chosen by us
JPEG_QUALITY = 95  # chosen by us


def stray_to_native(stray: Path, out: Path) -> Path:
    """Write a Stray Scanner folder in the native layout. Depth of confidence 0 is left out.

    Raises InputError when a file is missing or the output folder exists.
    """
    missing = [
        n for n in ("rgb.mp4", "odometry.csv", "camera_matrix.csv", "depth") if not (stray / n).exists()
    ]
    if missing:
        raise InputError(
            f"{stray} has no {', '.join(missing)}", "give the folder that Stray Scanner exported"
        )
    if out.exists():
        raise InputError(f"{out} exists already", "name a new folder")
    K = np.loadtxt(stray / "camera_matrix.csv", delimiter=",")
    with (stray / "odometry.csv").open(encoding="utf-8") as file:
        rows = [{k.strip(): v.strip() for k, v in row.items()} for row in csv.DictReader(file)]
    depth = sorted((stray / "depth").glob("*.png"))
    for name in ("color", "depth"):
        (out / name).mkdir(parents=True)
    times, color_size, depth_size = [], (0, 0), (0, 0)
    with av.open(str(stray / "rgb.mp4")) as video:
        # the video may hold a frame more or less than the lists
        for picture, row, file in zip_longest(video.decode(video=0), rows, depth):
            if picture is None or row is None or file is None:
                break
            scale = min(1.0, MAX_SIDE / max(picture.width, picture.height))
            size = round(picture.width * scale), round(picture.height * scale)
            image = cv2.resize(picture.to_ndarray(format="bgr24"), size, interpolation=cv2.INTER_AREA)
            name = f"{len(times):06d}"
            cv2.imwrite(str(out / "color" / f"{name}.jpg"), image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
            millimetres = _sure_depth(file)
            cv2.imwrite(str(out / "depth" / f"{name}.png"), millimetres)
            times.append(float(row["timestamp"]))
            color_size, depth_size = (picture.width, picture.height), millimetres.shape[::-1]
    if not times:
        raise InputError(
            f"{stray} holds no frame with colour, depth and a time", "export the recording again"
        )
    camera = Intrinsics(*color_size, K[0, 0], K[1, 1], K[0, 2], K[1, 2])
    _write_camera(out / "intrinsic.json", camera.scaled(*size))
    _write_camera(out / "depth_intrinsic.json", camera.scaled(*depth_size))
    (out / "timestamps.txt").write_text("".join(f"{t:.6f}\n" for t in times), encoding="utf-8")
    return out


def _sure_depth(file: Path) -> np.ndarray:
    millimetres = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    confidence = cv2.imread(str(file.parents[1] / "confidence" / file.name), cv2.IMREAD_UNCHANGED)
    if millimetres is None:
        raise InputError(f"{file} is no readable image", "export the recording again")
    return millimetres if confidence is None else np.where(confidence > 0, millimetres, 0).astype(np.uint16)


def _write_camera(path: Path, k: Intrinsics) -> None:
    values = {"width": k.width, "height": k.height, "intrinsic_matrix": k.matrix.T.reshape(-1).tolist()}
    path.write_text(json.dumps(values, indent=1), encoding="utf-8")


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stray", type=Path)
    parser.add_argument("out", type=Path)
    args = parser.parse_args(argv)
    try:
        print(open_recording(stray_to_native(args.stray, args.out)))
    except FuntwinError as e:
        print(f"stray_scanner: {e}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

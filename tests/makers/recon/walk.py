"""A walk of the shipped recording's frames, small ones: the drawer is opened, closed, and opened again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2

from recon.readers import open_recording
from twin.files.assets import asset
from twin.files.text import write_json

# s between frames: twice the clip's, every second one left out, so that two visits are no clip any more.
STEP = 0.25
WIDTH, HEIGHT = 240, 180


def walk_folder(folder: Path, visits: int) -> Path:
    """So many visits one after the other, each the other way round, as a recording; what is there stays."""
    clip = open_recording(asset("recordings/cabinet_drawer"))
    for name in ("color", "depth"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    order = [k for v in range(visits) for k in _there_or_back(len(clip), v)]
    for number, k in enumerate(order):
        place = folder / "color" / f"{number:06d}.jpg"
        if place.exists():
            continue
        color, depth = clip.frame(k)
        small = cv2.resize(color, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(place), small[..., ::-1])
        near = cv2.resize(depth, (WIDTH, HEIGHT), interpolation=cv2.INTER_NEAREST)
        cv2.imwrite(str(folder / "depth" / f"{number:06d}.png"), (near * 1000.0).round().astype("uint16"))
    k = clip.intrinsics.scaled(WIDTH, HEIGHT)
    matrix = [k.fx, 0, 0, 0, k.fy, 0, k.cx, k.cy, 1]  # column by column
    write_json(folder / "intrinsic.json", {"width": WIDTH, "height": HEIGHT, "intrinsic_matrix": matrix})
    (folder / "timestamps.txt").write_text("".join(f"{i * STEP:.6f}\n" for i in range(len(order))))
    return folder


def _there_or_back(frames: int, visit: int) -> Sequence[int]:
    some = range(0, frames, 2)
    return some if visit % 2 == 0 else some[::-1]

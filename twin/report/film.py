"""The recording beside the scene: small pictures of it with the time of each, kept by the reconstruction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from twin.files.atomic import write_file
from twin.files.paths import AnyPath
from twin.files.text import read_json, write_json
from twin.report.frames import HAND_COLOR, Image, part_color
from twin.report.pictures import uri
from twin.scene import HAND_LABEL, Twin

# Chosen by us: 240 pictures of 320 px are 3 MB, and a clip has fewer frames.
_MOST, _WIDTH, _QUALITY = 240, 320, 75
_OPACITY = 140  # of labels over a picture, of 255


def film_frames(twin: Twin) -> list[int]:
    """Recording frames of the film: those with labels, and `_MOST` at most, evenly spread, of those with a
    camera."""
    posed = [] if twin.cameras is None else [int(f) for f in twin.cameras.frames]
    step = max(1, -(-len(posed) // _MOST))
    return sorted({*posed[::step], *(set(posed) & set(twin.labels))})


def save_film(run: AnyPath, frames: Sequence[int], color: Callable[[int], Image]) -> None:
    """Write RUN/report/film/NNNNNN.jpg and film.json.

    Args:
        run: the run folder.
        frames: recording frames.
        color: a frame's picture (H, W, 3) uint8 RGB.
    """
    import cv2

    folder = Path(run) / "report" / "film"
    folder.mkdir(parents=True, exist_ok=True)
    before = read_json(folder / "film.json").get("frames", [])
    size, of = (0, 0), (0, 0)
    for frame in frames:
        image = color(frame)
        of = (image.shape[1], image.shape[0])
        scale = min(1.0, _WIDTH / image.shape[1])
        size = (round(image.shape[1] * scale), round(image.shape[0] * scale))
        small = cv2.resize(image[:, :, ::-1], size, interpolation=cv2.INTER_AREA)
        _, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        write_file(folder / f"{frame:06d}.jpg", jpeg.tobytes())
    write_json(folder / "film.json", {"frames": list(frames), "size": size, "of": of})
    for old in set(before) - set(frames):
        (folder / f"{old:06d}.jpg").unlink(missing_ok=True)


def film_pictures_of(run: Path) -> dict[int, Path]:
    """The film's pictures, JPEG files, by recording frame."""
    folder = run / "report" / "film"
    frames = read_json(folder / "film.json").get("frames", [])
    return {f: folder / f"{f:06d}.jpg" for f in frames if (folder / f"{f:06d}.jpg").is_file()}


def film(run: Path, twin: Twin, start: float) -> dict[str, Any]:
    """The film of a run, JSON types: `frames`, each with number, time (s from `start`), picture and, where it
    has some, labels as data URIs, and `of`, the width and height of the recording's pictures. Without frames
    where none was kept."""
    index, pictures = read_json(run / "report" / "film" / "film.json"), film_pictures_of(run)
    if not index or twin.cameras is None:
        return {"frames": []}
    times = dict(zip(twin.cameras.frames.tolist(), twin.cameras.times.tolist(), strict=True))
    rows = []
    for frame, picture in pictures.items():
        if frame not in times:
            continue
        row = {
            "frame": frame,
            "time": round(times[frame] - start, 4),
            "image": uri(picture.read_bytes(), "image/jpeg"),
        }
        if frame in twin.labels:
            row["labels"] = uri(_labels(twin.labels[frame], twin, index["size"]), "image/png")
        rows.append(row)
    return {"frames": rows, "of": index.get("of", [0, 0])}


def _labels(labels: Image, twin: Twin, size: Sequence[int]) -> bytes:
    """Parts and hand in their colours, the rest clear, as PNG."""
    import cv2

    small = cv2.resize(labels, size, interpolation=cv2.INTER_NEAREST)
    out = np.zeros((*small.shape[:2], 4), np.uint8)
    for label, color in {**{p.id: part_color(p) for p in twin.parts}, HAND_LABEL: HAND_COLOR}.items():
        out[small == label] = (*color[::-1], _OPACITY)
    _, png = cv2.imencode(".png", out)
    return png.tobytes()

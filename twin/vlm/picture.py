"""The picture that is sent: the frame with most of the part, or the reconstructed part; the part marked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.text import read_json
from twin.scene import HAND_LABEL, Part, Twin

Image = NDArray[np.uint8]
_LONGEST = 1024  # px; larger pictures cost more and tell no more about a piece of furniture (chosen by us)
_QUALITY = 90
_MARK = (255, 0, 255)
_LEAST = 0.002  # of the picture that the part must cover to be told from a speck


@dataclass(frozen=True, eq=False)
class Picture:
    """JPEG bytes, and how the text describes them: where it is from and how the part is marked."""

    jpeg: bytes
    origin: str
    mark: str


def part_picture(twin: Twin, part: Part, run: Path, frame: Callable[[int], Image] | None = None) -> Picture:
    """The part's picture: the recording's best frame if `frame` reads it, else a key frame, else its mesh.

    Args:
        frame: colour (H, W, 3) RGB of a recording frame.

    Raises:
        InputError: the twin holds nothing that could be shown.
    """
    if frame is not None:
        chosen = best_frame(twin, part, sorted(twin.labels))
        if chosen is None:
            raise InputError(f"no labelled frame shows {part.name}", "leave --recording out")
        return _outlined(frame(chosen), twin.labels[chosen], part, f"frame {chosen} of the recording")
    kept = read_json(run / "report" / "frames.json").get("frames", [])
    chosen = best_frame(twin, part, [f for f in kept if f in twin.labels])
    if chosen is not None:
        image = _read(run / "report" / f"frame_{chosen:06d}.jpg")
        return _outlined(image, twin.labels[chosen], part, f"key frame {chosen} of the run")
    if not len(part.mesh.faces):
        raise InputError(
            f"{part.name} has neither a picture nor a mesh to show", "give --recording RECORDING"
        )
    from twin.report.meshes import opening

    image = opening(twin, 2)[1]
    return Picture(jpeg(image), "a drawing of the reconstructed scene, opened", "tinted")


def best_frame(twin: Twin, part: Part, frames: Sequence[int]) -> int | None:
    """The frame with the most part and least hand: part pixels times part / (part + hand). None without."""
    best, score = None, 0.0
    for f in frames:
        labels = twin.labels[f]
        shown, hand = float((labels == part.id).sum()), float((labels == HAND_LABEL).sum())
        if shown > _LEAST * labels.size and shown**2 / (shown + hand) > score:
            best, score = f, shown**2 / (shown + hand)
    return best


def _outlined(image: Image, labels: Image, part: Part, origin: str) -> Picture:
    import cv2

    size = (image.shape[1], image.shape[0])
    mask = cv2.resize((labels == part.id).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    edges, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    drawn = np.ascontiguousarray(image)
    drawn = drawn.copy()
    cv2.drawContours(drawn, edges, -1, _MARK, max(2, image.shape[1] // 320), cv2.LINE_AA)
    return Picture(jpeg(drawn), origin, "outlined in magenta")


def jpeg(image: Image, longest: int = _LONGEST) -> bytes:
    """A picture (H, W, 3) RGB as JPEG, shrunk to at most `longest` pixels a side."""
    import cv2

    scale = longest / max(image.shape[:2])
    if scale < 1:
        size = (round(image.shape[1] * scale), round(image.shape[0] * scale))
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    _, data = cv2.imencode(".jpg", image[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return bytes(data.tobytes())


def _read(path: Path) -> Image:
    import cv2

    bgr = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if bgr is None:
        raise InputError(f"{path} is no picture", "give --recording RECORDING")
    return np.asarray(bgr[:, :, ::-1], dtype=np.uint8)

"""Where a part is seen best in the recording's pictures."""

from __future__ import annotations

import cv2
import numpy as np

from twin.errors import InputError
from twin.scene import Twin


def pixel_of(twin: Twin, name: str) -> str:
    """The pixel of a labelled frame that lies deepest within a part, as X,Y@FRAME; of the frames in which it
    moves, where it has labels in some.

    Raises InputError for a part that no label shows.
    """
    part = twin.part(name)
    masks = {f: np.asarray(image == part.id, np.uint8) for f, image in twin.labels.items()}
    shown = {f: m for f, m in masks.items() if m.any()}
    moving = {f: m for f, m in shown.items() if any(a <= f <= b for a, b in part.motion.intervals)}
    best = (0.0, "")
    for frame, mask in (moving or shown).items():
        depth = cv2.distanceTransform(np.pad(mask, 1), cv2.DIST_L2, 3)[1:-1, 1:-1]
        y, x = np.unravel_index(int(np.argmax(depth)), depth.shape)
        best = max(best, (float(depth[y, x]), f"{x},{y}@{frame}"))
    if not best[1]:
        raise InputError(f"no picture shows {name}", "point at it yourself")
    return best[1]

"""PNG pictures with a mask in their alpha channel: the same bytes every time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError


def png_bytes(image: NDArray[np.uint8], mask: NDArray[np.bool_] | None = None) -> bytes:
    """Encode an image (H, W, 3) sRGB, and a mask (H, W) as alpha: 255 where it holds, 0 elsewhere."""
    import cv2

    channels = np.ascontiguousarray(image[..., ::-1])
    if mask is not None:
        channels = np.dstack([channels, np.where(mask, 255, 0).astype(np.uint8)])
    ok, data = cv2.imencode(".png", channels)
    if not ok:
        raise OSError(f"an image of {image.shape} can't be encoded")
    return data.tobytes()


def read_png(path: Path) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Image (H, W, 3) sRGB and mask (H, W) of `png_bytes` with a mask. Raises InputError naming the file."""
    import cv2

    remedy = "texture images are 8-bit PNG with red, green, blue and alpha: make the twin again"
    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
        channels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
    except (OSError, cv2.error) as e:
        told = e.strerror if isinstance(e, OSError) else "no picture"
        raise InputError(f"{path} can't be read: {told}", remedy) from e
    if channels is None:
        raise InputError(f"{path} is no picture", remedy)
    if channels.dtype != np.uint8 or channels.ndim != 3 or channels.shape[2] != 4:
        raise InputError(f"{path} holds {channels.dtype} of shape {channels.shape}", remedy)
    return np.ascontiguousarray(channels[..., 2::-1]), channels[..., 3] > 127

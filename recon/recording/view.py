"""How a recording shows itself: a line, and a small table for notebooks."""

from __future__ import annotations

import html as markup
from base64 import b64encode
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from recon.recording import Recording

THUMBNAIL = 160  # px, width of a frame; chosen by us


def facts(recording: Recording) -> dict[str, str]:
    """What to know about a recording, in a few words each."""
    k = recording.intrinsics
    known = recording.poses
    count = len(recording)
    return {
        "frames": f"{count} frames of {k.width}x{k.height}",
        "length": f"{recording.times[-1] - recording.times[0]:.1f} s",
        "cameras": "no known poses" if known is None else f"known poses of {len(known.frames)} frames",
        "gravity": "gravity to be estimated" if recording.gravity_camera0 is None else "gravity known",
    }


def html(recording: Recording) -> str:
    """A small table for notebooks, with the first, middle and last frame."""
    rows = "".join(
        f"<tr><th>{markup.escape(k)}</th><td>{markup.escape(v)}</td></tr>"
        for k, v in {**facts(recording), "source": recording.source}.items()
    )
    frames = [0, len(recording) // 2, len(recording) - 1]
    images = "".join(_thumbnail(recording.color(k), f"frame {k}") for k in frames)
    return f"<b>Recording {markup.escape(recording.name)}</b><table>{rows}</table><div>{images}</div>"


def _thumbnail(image: NDArray[np.uint8], title: str) -> str:
    height = max(1, round(image.shape[0] * THUMBNAIL / image.shape[1]))
    small = cv2.resize(image, (THUMBNAIL, height), interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", np.asarray(small)[..., ::-1])
    return f'<img title="{title}" src="data:image/jpeg;base64,{b64encode(data.tobytes()).decode()}">'

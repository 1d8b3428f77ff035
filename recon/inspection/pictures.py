"""A few numbers about one frame's pictures: light, sharpness, and where depth is missing."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.inspection.cuts import Thumbnail, thumbnail
from recon.recording import Frame
from twin.geometry import Array

F32 = NDArray[np.float32]

# grey levels of 255 from where on JPEG's noise can't be told from clipping
BRIGHT = 252
# grey levels below which it can't be told from black
DARK = 12
_BLUR_WIDTH = 640  # px: blur is measured, and told, in pixels of a picture this wide
_REBLUR = 1.5  # px, standard deviation of the known blur that edges are compared under
_EDGE = 3.0  # grey levels per pixel of the weakest edge: over the noise of JPEG
# pixels on edges in each direction: a quartile of fewer is uncertain
_MIN_EDGES = 100
# pixels on edges in each direction that are used: the strongest
_MAX_EDGES = 400
DIRECTIONS = ("horizontal", "falling", "vertical", "rising")  # of a motion that blurs, as seen in the picture


@dataclass(frozen=True, eq=False)
class PictureFacts:
    """Of one frame. saturated, black: shares of pixels. blur (4,): standard deviation of the blur along each
    of DIRECTIONS, px of a picture 640 wide, NaN without edges. known, known_centre: shares of pixels with
    depth, in the whole picture and in its middle half by width and height. near, far: m, depths that 5 % of
    the known pixels are nearer, farther than. mark: a number that only equal pictures share. thumbnail: see
    `cuts`."""

    saturated: float
    black: float
    blur: Array
    known: float
    known_centre: float
    near: float
    far: float
    mark: int
    thumbnail: Thumbnail


def facts_of(color: NDArray[np.uint8], depth: F32) -> PictureFacts:
    """Measure one frame, colour (H, W, 3) RGB and depth (H, W) m."""
    h, w = depth.shape
    grey = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
    if w > _BLUR_WIDTH:
        grey = cv2.resize(grey, (_BLUR_WIDTH, round(h * _BLUR_WIDTH / w)), interpolation=cv2.INTER_AREA)
    counts = np.bincount(np.asarray(grey).ravel(), minlength=256) / grey.size
    has = depth > 0
    some = depth[::4, ::4]
    some = some[some > 0]
    near, far = np.quantile(some, [0.05, 0.95]) if len(some) else (np.nan, np.nan)
    return PictureFacts(
        saturated=float(counts[BRIGHT:].sum()),
        black=float(counts[: DARK + 1].sum()),
        blur=edge_blur(np.asarray(grey, dtype=np.float32)) * (_BLUR_WIDTH / min(w, _BLUR_WIDTH)),
        known=float(has.mean()),
        known_centre=float(has[h // 4 : h - h // 4, w // 4 : w - w // 4].mean()),
        near=float(near),
        far=float(far),
        mark=hash(color[::4, ::4].tobytes()),
        thumbnail=thumbnail(Frame(color, depth)),
    )


def edge_blur(grey: F32) -> Array:
    """Standard deviation (4,) px of blur along each of DIRECTIONS, from edges across it; NaN with too few.

    An edge blurred by s has a gradient that a further, known blur b lowers by sqrt(s^2 + b^2) / s (Zhuo and
    Sim 2011). The first quartile over edges counts: scenes have soft edges, only sharp pictures sharp ones.
    """
    again = cv2.GaussianBlur(grey, (0, 0), _REBLUR)
    (gx, gy), (bx, by) = _gradients(grey), _gradients(np.asarray(again))
    strength, after = np.hypot(gx, gy), np.hypot(bx, by)
    peak = (strength > _EDGE) & (strength >= cv2.dilate(strength, np.ones((3, 3), np.uint8)))
    strong, after = strength[peak], after[peak]
    angle = np.arctan2(gy[peak], gx[peak])  # of the gradient: blur along it widens this edge
    along = np.rint(angle / (np.pi / 4)).astype(int) % 4
    ratio = strong / np.maximum(after, 1e-3)
    sigma = _REBLUR / np.sqrt(np.maximum(ratio**2 - 1.0, 1e-3))
    out = np.full(4, np.nan)
    for k in range(4):
        here = np.flatnonzero(along == k)
        if len(here) >= _MIN_EDGES:
            here = here[np.argsort(strong[here])[-_MAX_EDGES:]]
            out[k] = np.quantile(sigma[here], 0.25)
    return out


def _gradients(image: F32) -> tuple[F32, F32]:
    return tuple(np.asarray(cv2.Sobel(image, cv2.CV_32F, *d, ksize=3, scale=0.125)) for d in ((1, 0), (0, 1)))  # type: ignore[return-value]

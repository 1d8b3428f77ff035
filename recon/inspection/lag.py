"""By how much depth lags behind colour: where an edge passes, both change at the same time.

For every lag and every shift in space, the changes of depth from frame to frame are laid over the changes of
colour (cross-correlation by the Fourier transform). At the true lag they meet. The shift is free at each lag:
depth beside colour is not taken for late depth; where both explain the pictures alike, no lag stands out.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from recon.inspection.glance import Stretch
from recon.inspection.registration import filled, jackknife
from twin.geometry import Array

F32 = NDArray[np.float32]
C64 = NDArray[np.complex64]

# px: at this size edges in colour and depth are a pixel or two wide, moving ones some pixels apart
_WIDTH = 320
# Frames of a stretch; lags are told up to one less, a quarter of a second at 15 frames a second
MOST = 5
# px at `_WIDTH`, 6 % of the picture: how far beside colour depth may lie
_REACH = 10
# Relative step of depth between frames where an edge has passed: above noise and slanted surfaces
_JUMP = 0.05
# px, of the window that a change of colour is compared with
_AROUND = 21
# times the window's change by which a change of colour counts at most
_CLIP = 4.0
_BLOCKS = 6  # of the jackknife over times
# Standard deviations by which the sum at the lag exceeds that at every lag two frames from it and farther. In
# 35 recordings 5 and more, 2 at most where one of the two was shuffled or turned around
SURE = 3.0


@dataclass(frozen=True)
class Lag:
    """Frames by which a stretch's depth lags behind colour (early: negative). sigma: jackknife over times."""

    frames: float
    sigma: float


def fit_lag(stretches: list[Stretch]) -> Lag | None:
    """None where no lag stands out: nothing moves, or depth changes where colour does not."""
    blocks = [b for s in stretches for b in _sums(s, max(1, _BLOCKS // len(stretches)))]
    if len(blocks) < _BLOCKS:
        return None
    sums = np.array(blocks)
    best = _profile(sums.sum(axis=0))
    k = int(np.argmax(best))
    if best[k] <= 0 or k in (0, len(best) - 1):
        return None
    parts = np.array([_profile(sums.sum(axis=0) - block) for block in sums])
    share = parts / np.maximum(parts[:, [k]], 1e-9)
    away = np.abs(np.arange(len(best)) - k) > 1
    if not np.all((1 - best / best[k])[away] > SURE * jackknife(share)[away]):
        return None
    places = np.array([_place(p, k) for p in parts])
    return Lag(_place(best, k), float(jackknife(places)))


def _profile(sums: Array) -> Array:
    """The greatest sum over all shifts, for each lag."""
    return np.asarray(sums.reshape(len(sums), -1).max(axis=1))


def _place(profile: Array, k: int) -> float:
    """Lag between samples about the highest one: edges passing at any time in a frame make a triangle."""
    before, top, after = profile[k - 1 : k + 2]
    base = min(before, after)
    return float(k - MOST + (0.5 * (after - before) / (top - base) if top > base else 0.0))


def _sums(stretch: Stretch, blocks: int) -> list[Array]:
    """Sums (2 MOST + 1, 2 _REACH + 1, 2 _REACH + 1) over lags and shifts of the frames of each block."""
    color, depth, size = _changes(stretch)
    frames = np.arange(MOST, len(depth) - MOST)
    if len(frames) < blocks:
        return []
    return [_sum(color, depth, size, block) for block in np.array_split(frames, blocks)]


def _sum(color: list[C64], depth: list[C64], size: tuple[int, int], frames: NDArray[np.int64]) -> Array:
    out = []
    for lag in range(-MOST, MOST + 1):
        both = np.zeros_like(depth[0])
        for t in frames.tolist():
            both += np.conj(color[t - lag]) * depth[t]
        everywhere = scipy.fft.irfft2(both, s=size)
        near = np.roll(everywhere, (_REACH, _REACH), axis=(0, 1))
        out.append(near[: 2 * _REACH + 1, : 2 * _REACH + 1])
    return np.array(out, dtype=np.float64)


def _changes(stretch: Stretch) -> tuple[list[C64], list[C64], tuple[int, int]]:
    """Transforms of the changes of colour and depth from each frame to the next, and the pictures' size."""
    k = stretch.small.intrinsics
    size = (_WIDTH, max(2 * _REACH + 1, round(k.height * _WIDTH / k.width)))
    color, depth = [], []
    before = None
    for i in range(len(stretch.small)):
        now = _pictures(*stretch.small.frame(i), size)
        if before is not None:
            color.append(_transformed(_change(before[0], now[0])))
            depth.append(_transformed(_jumps(before[1], now[1])))
        before = now
    return color, depth, size[::-1]


def _pictures(color: NDArray[np.uint8], depth: F32, size: tuple[int, int]) -> tuple[F32, F32]:
    """Grey (h, w), a little blurred, and depth (h, w) m without holes."""
    grey = cv2.resize(color[..., 0], size, interpolation=cv2.INTER_AREA).astype(np.float32)
    near = cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST_EXACT)
    return np.asarray(cv2.GaussianBlur(grey, (0, 0), 0.7)), filled(np.asarray(near))[0]


def _change(before: F32, now: F32) -> F32:
    """Change of grey over that around it: bright and dark edges count alike, a change of light nowhere."""
    size = np.abs(now - before)
    around = cv2.blur(size, (_AROUND, _AROUND))
    return np.asarray(np.minimum(size / (around + 1.0), _CLIP), dtype=np.float32)


def _jumps(before: F32, now: F32) -> F32:
    near = np.minimum(before, now)
    return ((near > 0) & (np.abs(now - before) > _JUMP * near)).astype(np.float32)


def _transformed(picture: F32) -> C64:
    return np.asarray(scipy.fft.rfft2(picture - picture.mean()), dtype=np.complex64)

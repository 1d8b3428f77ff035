"""Brightness of photographs made equal: a gain a frame and channel from places that several show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twin.geometry import Array

# Chosen by us and the same for every recording.
_DARK = 20.0  # level of 255 above which a ratio of colours tells of exposure
_BRIGHT = 235.0  # level below which it does
# of the logarithm, about 5 %: a colour that is off by as much counts half, as a shadow or a highlight
_USUAL = 0.05
# that scale at first, when the gains are not known
_WIDE = 1.0
# how often that scale shrinks by 0.6 or stays
_ROUNDS = 16
_FEWEST = 40  # places that a frame shares with others, below which its gain stays near 1
_MOST = 2.0  # largest gain: what differs by more is no exposure


def gains(seen: Sequence[tuple[Array, Array]], frames: int) -> Array:
    """Gains (frames, 3) on photographs' sRGB levels; their geometric mean, weighted by information, is 1.

    A gain of light is nearly one of sRGB levels, whose curve is nearly a power. Weighted least squares of log
    colour = place + frame, by turns, with the weights of Geman and McClure 1987.

    Args:
        seen: per body, colours (n, frames, 3) 0..255 and weights (n, frames) of places, 0 where a frame does
            not show one.
    """
    color = np.concatenate([c for c, _ in seen]) if seen else np.zeros((0, frames, 3))
    weight = np.concatenate([w for _, w in seen]) if seen else np.zeros((0, frames))
    fair = ((color > _DARK) & (color < _BRIGHT)).all(axis=2) & (weight > 0)
    fair &= (fair.sum(axis=1) >= 2)[:, None]
    shared = fair.any(axis=1)
    fair, logs = fair[shared].astype(float), np.log(np.clip(color[shared], 1.0, None))
    if not len(logs):
        return np.ones((frames, 3))
    frame, weights = np.zeros((frames, 3)), fair
    for k in range(_ROUNDS):
        total = np.maximum(weights.sum(axis=1), 1e-9)
        place = np.einsum("nk,nkc->nc", weights, logs - frame) / total[:, None]
        anchor = weights.sum(axis=0)
        frame = np.einsum("nk,nkc->kc", weights, logs - place[:, None]) / np.maximum(anchor, 1e-9)[:, None]
        frame -= anchor @ frame / max(float(anchor.sum()), 1e-9)
        off = np.abs(logs - place[:, None] - frame).max(axis=2)
        weights = fair / (1.0 + (off / max(_USUAL, _WIDE * 0.6**k)) ** 2) ** 2
    told = fair.sum(axis=0)
    frame *= (told / (told + _FEWEST))[:, None]
    return np.clip(np.exp(-frame), 1.0 / _MOST, _MOST)

"""Keyframes of an MJCF file that say where its joints are closed and open."""

from __future__ import annotations

import re
from typing import Any, Literal

import numpy as np

_SAME = 0.01  # of the range, chosen by us: a keyframe that moves a joint by less says nothing of it


def ends(model: Any, joint: int, names: tuple[str, ...]) -> tuple[float | None, float | None]:
    """Where keyframes have a joint closed and open. Closed or at rest is not open."""
    closed, opened = (_keyed(model, joint, word, names) for word in ("closed", "open"))
    if opened is not None:
        start = closed if closed is not None else float(model.qpos0[model.jnt_qposadr[joint]])
        if abs(opened - start) <= _SAME * float(np.ptp(model.jnt_range[joint])):
            opened = None
    return closed, opened


def _keyed(model: Any, joint: int, word: Literal["closed", "open"], names: tuple[str, ...]) -> float | None:
    """The position (m or rad) of a joint in the first keyframe of that name that speaks of it; None without.

    `closed` speaks of every joint, `drawer_closed` of those that have the word drawer in one of their `names`
    (their own, that of the body). Upper and lower case don't matter.
    """
    mine = [_words(n) for n in names]
    for k in range(int(model.nkey)):
        said = _words(str(model.key(k).name))
        of = said - {word}
        if word in said and (not of or any(of <= own for own in mine)):
            return float(model.key_qpos[k, model.jnt_qposadr[joint]])
    return None


def _words(name: str) -> set[str]:
    return set(re.findall(r"[a-z]+|[0-9]+", name.lower()))

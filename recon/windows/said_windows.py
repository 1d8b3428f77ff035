"""The windows that the user's word on parts is about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recon.recording.said import Said, Word
from recon.windows.windows import Window, padded
from twin.geometry import Array

# s about a frame in which the user points at a part: it moves then, or not long before or after.
_ABOUT_S = 3.0


def said_windows(windows: Sequence[Window], said: Said, times: Array) -> list[tuple[Window, Said]]:
    """Each window with what the user says of it, frames counted from the window's first.

    A type without a word on a part holds in all windows. A word on frames in which nothing was seen to be
    handled gets a window of its own.
    """
    out: dict[Window, list[Word]] = {w: [] for w in windows}
    for word in said.words:
        first, last = _frames(word)
        found = next((w for w in windows if w.first <= first and last <= w.last), None)
        out.setdefault(found or _about(word, times), []).append(word)
    in_order = sorted(out.items(), key=lambda item: item[0].first)
    return [
        (w, replace(said, parts=tuple(str(k.counted_from(w.first)) for k in kept))) for w, kept in in_order
    ]


def _frames(word: Word) -> tuple[int, int]:
    """First and last frame that a word is about."""
    told = [*(word.interval or ()), *([word.point[2]] if word.point is not None else [])]
    return min(told), max(told)


def _about(word: Word, times: Array) -> Window:
    """A window about a word, with rest around."""
    first, last = _frames(word)
    if word.interval is None:
        first = int(np.searchsorted(times, times[first] - _ABOUT_S))
        last = int(np.searchsorted(times, times[last] + _ABOUT_S, side="right")) - 1
    return padded([(first, last)], times)[0]

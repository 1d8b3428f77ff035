"""What the person did, as pictures, and which of them show a part as the robot has it."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Motion

Image = NDArray[np.uint8]
Indices = NDArray[np.int64]

# share of the largest travel at which a movement counts as whole: hands are rarely still at its ends
_COMPLETE = 0.99
# a movement in the robot's direction is shown unless it covers less than this share of one in the other
_OWN_WAY = 0.8


@dataclass(frozen=True, eq=False)
class Demonstration:
    """The colour frames of the recording that a twin was made from.

    frames: how many there are. image: frame index, as `Motion.frames` counts them, to (H, W, 3) uint8 RGB;
    called for the frames that are shown. name: what the film calls them.
    """

    frames: int
    image: Callable[[int], Image]
    name: str = "recording"

    def picture(self, frame: int) -> Image:
        """One frame. Raises InputError when there is none with this index, or it is no colour image."""
        if not 0 <= frame < self.frames:
            raise InputError(
                f"the twin's motion names frame {frame}, the recording has {self.frames} frames",
                "give the recording that the twin was made from",
            )
        image = self.image(frame)
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or 0 in image.shape:
            raise InputError(
                f"frame {frame} is {image.dtype} with shape {image.shape}",
                "give (H, W, 3) uint8 images",
            )
        return image


def matching_samples(motion: Motion, start: float, goal: float, states: Array) -> Indices:
    """Indices (f,) into `motion` of the samples whose frames show the part at the robot's `states` (f,).

    One movement of the recording is shown: the first that covers the way from `start` to `goal` in the
    robot's direction as far as any does; when the recording has none worth it, the first in the other
    direction, then seen backwards. Of its samples the longest subsequence of growing (or falling) states
    counts, without pauses and reversals of the hand. Each state gets the nearest of these: a function of the
    state alone, monotone, so the frame stays while the part rests and goes back when the part does.

    Raises InputError when the recorded states don't move between `start` and `goal`.
    """
    low, high = sorted((start, goal))
    way = 1.0 if goal > start else -1.0
    inside = way * np.clip(motion.state, low, high)
    forth, back = _first_movement(inside), _first_movement(-inside)
    chosen = forth if _rise(inside, forth) >= _OWN_WAY * _rise(-inside, back) else back
    if not _rise(inside if chosen is forth else -inside, chosen):
        raise InputError(
            f"the recorded motion has no frames of the way from {start:.3f} to {goal:.3f}",
            "give the recording that the twin was made from",
        )
    window = np.arange(chosen[0], chosen[1] + 1)
    rising = np.sign(motion.state[window[-1]] - motion.state[window[0]])
    kept = window[_longest_rise(rising * motion.state[window])]
    kept = kept[np.argsort(motion.state[kept])]
    between = (motion.state[kept][1:] + motion.state[kept][:-1]) / 2
    return np.asarray(kept[np.searchsorted(between, states)], dtype=np.int64)


def _rise(values: Array, window: tuple[int, int]) -> float:
    return float(values[window[1]] - values[window[0]]) if len(values) else 0.0


def _first_movement(values: Array) -> tuple[int, int]:
    """First and last sample of the first climb as high as the highest one, without rests at its ends."""
    if not len(values):
        return 0, 0
    climb = values - np.minimum.accumulate(values)
    enough = _COMPLETE * climb.max()
    last = int(np.argmax(climb >= enough))
    first = int(np.flatnonzero(values[: last + 1] <= values[last] - enough)[-1])
    while last + 1 < len(values) and values[last + 1] > values[last]:
        last += 1
    while first > 0 and values[first - 1] < values[first]:
        first -= 1
    return first, last


def _longest_rise(values: Array) -> Indices:
    """Indices of a longest strictly increasing subsequence (patience sorting, Schensted 1961)."""
    tails: list[float] = []  # the smallest value at which a rise of this length ends
    ends: list[int] = []
    before = np.full(len(values), -1, dtype=np.int64)
    for k, value in enumerate(values.tolist()):
        place = bisect_left(tails, value)
        before[k] = ends[place - 1] if place else -1
        tails[place : place + 1] = [value]
        ends[place : place + 1] = [k]
    chain = [ends[-1]]
    while before[chain[-1]] >= 0:
        chain.append(int(before[chain[-1]]))
    return np.array(chain[::-1], dtype=np.int64)

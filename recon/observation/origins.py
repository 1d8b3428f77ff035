"""Where the surface of each pixel comes from: the static scene, something that moves, or nobody can tell.

A surface that other frames see *through* is not there at all times. A surface that others see at the same
place, that none sees through, and that nothing hides while all rests, is static.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.dense.looks import HIDDEN, SAME, THROUGH
from recon.dense.looks import UNKNOWN as UNSEEN
from recon.observation.pictures import Pictures
from twin.runs.threads import each

# What is known of a pixel's surface. AMID: of something that moves, and is there neither in the first nor in
# the last row, as far as these see its place.
UNKNOWN, STATIC, NEW, AMID = 0, 1, 2, 3
# All chosen by us. Rows that are asked beside the first and the last one.
_OTHERS = 14
# Looks of which a verdict is made; the first and the last row count as two, since nothing moves there.
_LOOKS = 2
# Standard deviations of noise, and m, within which depths are equal.
_SIGMAS, _LEAST_M = 2.5, 0.01


def origins(pictures: Pictures) -> NDArray[np.uint8]:
    """The origin (T, h, w) of each pixel's surface; UNKNOWN where no depth is known."""
    count = len(pictures.frames)
    asked = np.unique(np.linspace(0, count - 1, min(count, _OTHERS + 2)).round().astype(int)).tolist()

    def of_row(row: int) -> NDArray[np.uint8]:
        known = pictures.depth[row] > 0
        points = pictures.points(row)[known]
        through, same = np.zeros((2, len(points)), np.int64)
        amid, hidden = np.ones(len(points), bool), np.zeros(len(points), bool)
        for other in asked:
            if other == row:
                continue
            seen, end = pictures.look(points, other, _SIGMAS, _LEAST_M), other in (0, count - 1)
            through += (2 if end else 1) * (seen == THROUGH)
            same += (2 if end else 1) * (seen == SAME)
            amid &= (seen == THROUGH) | (seen == UNSEEN) | (not end)
            hidden |= (seen == HIDDEN) & end
        out = np.zeros(known.shape, np.uint8)
        moves = through >= _LOOKS
        out[known] = np.select(
            [moves & amid, moves, (same >= _LOOKS) & ~hidden], [AMID, NEW, STATIC], UNKNOWN
        )
        return out

    return np.stack(list(each(of_row, range(count))))

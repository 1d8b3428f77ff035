"""Whether what is labelled hand is one.

A hand stands in front of what the twin shows. It reaches in from the viewer, or it moves. What has the twin's
depth, or rests without reaching in or in furniture's size, is what labels could not explain. An arm that
slides along itself, without reaching the border, would be taken for furniture.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import look_up
from recon.interaction.boards.arms import has_shape_of_arm
from recon.verdict.posed import PosedTwin, gate
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import HAND_LABEL

# s after a labelled frame, before it or both: a hand that reaches for something gets 10 cm or more in that
# time, three gates. Chosen by us
SECONDS = 0.5
# Frames of them that are looked at. Chosen by us
FRAMES = 3
# Share of a piece that keeps its place: where it is less, fingers may rest while the arm comes. 0.2 in the
# one true hand among open recordings, .46 to .98 in most false ones
STILL = 0.4
# m^2 across the view. Two arms with sleeves, hand to elbow, 45 cm by 12 cm each, have half of it
ARMS_M2 = 0.2
# An arm's depth where it leaves the picture, over that of its hand: a forearm is 40 cm long, and what it
# opens seldom farther than 1.3 m. Chosen by us
REACHES_IN = 0.7
_FEWEST = 30  # px of the thinned picture that have a shape; chosen by us


def hand_in_view(twin: PosedTwin, frame: int, image: NDArray[np.uint8], sign: int) -> NDArray[np.bool_]:
    """Pixels (H, W) of a frame that are labelled hand and are no furniture at rest: pieces that mostly move
    in the frames after (sign 1) or before (-1), and arms from the border."""
    hand = twin.thinned(image) == HAND_LABEL
    if not hand.any():
        return hand
    kept = hand & _keeps_place(twin, frame, _near(twin, frame, sign))
    still, pieces = _still_pieces(twin, frame, hand, kept)
    return np.asarray(hand & ~still[pieces])


def _still_pieces(
    twin: PosedTwin, frame: int, hand: NDArray[np.bool_], kept: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.int32]]:
    """Which pieces of a hand (H, W) mostly keep their place and are no arm, by reaching in from the border or
    by its shape where labels have lost its end; and the piece of each pixel. kept (H, W): what keeps its
    place."""
    seen = twin.seen(frame)
    pieces = np.asarray(cv2.connectedComponents(hand.astype(np.uint8), connectivity=8)[1], np.int32)
    still = np.bincount(pieces.ravel(), kept.ravel()) > STILL * np.bincount(pieces.ravel())
    area = np.square(seen.astype(np.float64)) / (twin.camera.fx * twin.camera.fy)
    border, small = _at_border(pieces), np.bincount(pieces.ravel(), area.ravel()) <= ARMS_M2
    for k in np.flatnonzero(small & still):
        piece = pieces == k
        still[k] = not (
            (border[k] and _reaches_in(piece, seen)) or _shaped_as_arm(twin, piece & (seen > 0), seen)
        )
    return still, pieces


def _shaped_as_arm(twin: PosedTwin, piece: NDArray[np.bool_], seen: NDArray[np.float32]) -> bool:
    """Whether a piece (H, W) of known depth is narrow, stands off and comes nearer towards the border."""
    y, x = np.nonzero(piece)
    if len(y) < _FEWEST:
        return False
    pixels = np.stack([x, y], axis=1).astype(np.float64)
    return has_shape_of_arm(piece, seen, twin.camera.backproject(pixels, seen[y, x].astype(np.float64)))


def _at_border(pieces: NDArray[Any]) -> NDArray[np.bool_]:
    """Which of the numbered pieces (H, W) reach the border of the picture."""
    out = np.zeros(int(pieces.max()) + 1, bool)
    out[[*pieces[0], *pieces[-1], *pieces[:, 0], *pieces[:, -1]]] = True
    return out


def _reaches_in(piece: NDArray[np.bool_], seen: NDArray[np.float32]) -> bool:
    """Whether a piece (H, W) comes from the viewer: nearer at the border than at its far end."""
    at_border = np.zeros_like(piece)
    at_border[[0, -1]], at_border[:, [0, -1]] = piece[[0, -1]], piece[:, [0, -1]]
    there = seen[at_border & (seen > 0)]
    near = float(np.median(there)) if len(there) else 0.0  # nearer than the sensor can see
    return near < REACHES_IN * float(np.quantile(seen[piece], 0.95))


def _near(twin: PosedTwin, frame: int, sign: int) -> list[int]:
    """Some frames within `SECONDS` after (sign 1) or before (-1) a frame."""
    times, posed = twin.recording.times, twin.cameras.frames
    since = sign * (times[posed] - times[frame])
    wanted = SECONDS * np.arange(1, FRAMES + 1) / FRAMES
    return sorted({int(posed[np.argmin(np.abs(since - t))]) for t in wanted} - {frame})


def _keeps_place(twin: PosedTwin, frame: int, others: Sequence[int]) -> NDArray[np.bool_]:
    """Pixels (H, W) whose point of the world is seen again in the other frames and seen through in none."""
    seen = twin.seen(frame)
    off = gate(seen, twin.expected(frame).depth)[1]
    grid = np.stack(np.meshgrid(*map(np.arange, seen.shape[::-1])), axis=-1).astype(np.float64)
    points = geo.transform(twin.T_world_cam(frame), twin.camera.backproject(grid, seen.astype(np.float64)))
    again, through = np.zeros(seen.shape, np.int64), np.zeros(seen.shape, bool)
    for other in others:
        there = geo.transform(geo.invert_pose(twin.T_world_cam(other)), points)
        behind = _looked_up(twin, other, there) - there[..., 2]
        again += np.abs(behind) <= off
        through |= behind > off
    return np.asarray((seen > 0) & ~through & (2 * again > len(others)))


def _looked_up(twin: PosedTwin, frame: int, points: Array) -> Array:
    """Depth (H, W) m recorded where a camera's points (H, W, 3) are; NaN out of view or unknown."""
    found = look_up(twin.seen(frame), twin.camera, points.reshape(-1, 3), near=0.0).z
    return np.where(found > 0, found, np.nan).reshape(points.shape[:2])

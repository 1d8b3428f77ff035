"""Camera poses over minutes: submaps of some seconds, each solved by itself, laid onto each other.

Neighbouring submaps share frames. Where tracking is lost (a covered lens, a blank wall), what follows starts
a piece of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.cameras.places import Seen
from twin import geometry as geo
from twin.geometry import Array

# Frames of a recording that is solved as one. A clip of one interaction has 120 to 300 frames.
WHOLE = 360
# Frames of a submap, 12 s at 15 a second: an interaction lies in one or two. Chosen by us.
LENGTH = 180
# Frames that neighbouring submaps share: more than the largest gap between frames that are compared.
SHARED = 45
# Frames without a pose after which what follows is another piece. Chosen by us.
_HOLE = 5
# m and m/s^2 by which a camera's step differs from the one before where tracking has slipped: a head that
# walks or turns stays below 10 m/s^2. Chosen by us.
_LEAP_M, _LEAP_M_S2 = 0.05, 18.0
# Fewest frames of a piece: fewer are noise between two losses. Chosen by us.
_FEWEST = 10

Solve = Callable[[int, int], tuple[Array, NDArray[np.bool_]]]


@dataclass(frozen=True, eq=False)
class Piece:
    """Poses T_piece_cam (n, 4, 4) of rising frames (n,) that hang together.

    bridge: how its first frame lies to the piece before, which a recognised place must confirm.
    """

    frames: NDArray[np.int64]
    poses: Array
    bridge: Seen | None = None


def regular_spans(count: int) -> list[tuple[int, int]]:
    """First and last frame of the submaps of `count` frames, unless tracking is lost on the way."""
    spans = [(0, _last(0, count))]
    while spans[-1][1] < count - 1:
        first = spans[-1][1] + 1 - SHARED
        spans.append((first, _last(first, count)))
    return spans


def _last(first: int, count: int) -> int:
    """Last frame of the submap that starts at a frame."""
    if not first and count <= WHOLE:
        return count - 1
    return count - 1 if count - first < LENGTH + SHARED else first + LENGTH - 1


def solve_pieces(count: int, solve: Solve, times: Array | None = None) -> tuple[Piece, ...]:
    """Poses of `count` frames, in pieces in the order of the frames.

    A piece ends where no frame is posed for a while, and where the camera leaps.

    Args:
        solve: poses (n, 4, 4) of the frames first..last, and which of them are known (n,).
        times: (count,) s of the frames; None: nothing is known of leaps.
    """
    if count <= WHOLE:
        poses, posed = solve(0, count - 1)
        return (Piece(np.flatnonzero(posed), poses[posed]),) if posed.any() else ()
    out: list[Piece] = []
    first = 0
    while count - first >= _FEWEST:
        last = _last(first, count)
        poses, posed = solve(first, last)
        frames = np.flatnonzero(posed)
        if times is not None:
            frames = frames[: _before_leap(frames, poses[frames], times[first : last + 1])]
        for k, some in enumerate(np.split(frames, np.flatnonzero(np.diff(frames) > _HOLE) + 1)):
            if len(some) >= _FEWEST:
                piece = Piece(some + first, poses[some], _bridge(out, poses, first, some) if k else None)
                joined = _joined(out[-1], piece) if out and not k else None
                out = [*out, piece] if joined is None else [*out[:-1], joined]
        end = first + (int(frames[-1]) if len(frames) else 0)
        if last - end >= _FEWEST:  # lost on the way: what follows is solved anew
            first = max(
                end + 1, first + _FEWEST
            )  # a path that leaps all the time is not solved for each frame
        elif last == count - 1:
            break
        else:
            first = last + 1 - SHARED
    return tuple(out)


def _bridge(out: Sequence[Piece], poses: Array, first: int, after: NDArray[np.int64]) -> Seen | None:
    """How the first frame of a piece lies to the last one of the piece before, by the submap of both."""
    before = int(out[-1].frames[-1]) - first if out else -1
    if not 0 <= before < int(after[0]):
        return None
    lay = geo.invert_pose(poses[before]) @ poses[after[0]]
    return Seen(before + first, int(after[0]) + first, lay, 0, 0.0)


def _before_leap(frames: NDArray[np.int64], poses: Array, times: Array) -> int:
    """How many of the rising frames (n,) come before the camera leaps as no head does."""
    if len(frames) < 3:
        return len(frames)
    centres, seconds = poses[:, :3, 3], np.diff(times[frames])
    way = np.diff(centres, axis=0)
    turn = np.linalg.norm(way[1:] - way[:-1] * (seconds[1:] / seconds[:-1])[:, None], axis=1)
    leaps = turn > np.maximum(_LEAP_M, _LEAP_M_S2 * seconds[1:] ** 2)
    leaps &= (np.diff(frames)[1:] == 1) & (np.diff(frames)[:-1] == 1)
    return int(np.argmax(leaps)) + 2 if leaps.any() else len(frames)


def _joined(before: Piece, after: Piece) -> Piece | None:
    """Both in the first one's frame, None where they share too few frames.

    The shared frames change from one to the other little by little: no pose jumps.
    """
    both, mine, its = np.intersect1d(before.frames, after.frames, return_indices=True)
    if len(both) < _FEWEST:
        return None
    lays = before.poses[mine] @ geo.invert_pose(after.poses[its])
    lay = _middle(lays)
    share = ((np.arange(len(both)) + 0.5) / len(both))[:, None]
    moved = lay @ after.poses
    step = geo.log_se3(geo.invert_pose(before.poses[mine]) @ moved[its])
    blended = before.poses[mine] @ geo.exp_se3(share * step)
    new = after.frames > both[-1]
    kept = before.frames < both[0]
    return Piece(
        np.concatenate([before.frames[kept], both, after.frames[new]]),
        np.concatenate([before.poses[kept], blended, moved[new]]),
        before.bridge,
    )


def _middle(poses: Sequence[Array] | Array) -> Array:
    """The pose (4, 4) in the middle of some (n, 4, 4): the median of their logarithms about one of them."""
    about = np.asarray(poses)[len(poses) // 2]
    for _ in range(3):
        about = about @ geo.exp_se3(np.median(geo.log_se3(geo.invert_pose(about) @ poses), axis=0))
    return np.asarray(about)

"""What the user's word leaves to choose from: tracks that move in the given frames along with the point.

Tracks near the point are its seeds: those of them that keep their distances to most of each other while they
move are one body. A hand, corners that drift and what stands still don't. The joint of the seeds alone tells
which of the tracks that keep their distances to them belong to what is seen there, however far away they are:
a radius would cut a large door, or reach what is beside a small one. Without the seeds' joint a hand would
come along, which follows most of a door's way at almost the same distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import depth_sigma
from recon.interaction.joints.config import JointConfig
from recon.interaction.joints.group_fits import AS_WELL, GroupFit, fit_group, support
from recon.interaction.joints.type_selection import TypeHint
from recon.interaction.motion.intervals import MIN_DISPLACEMENT, REST_SECONDS
from recon.interaction.motion.movers import Movers, find_movers
from recon.interaction.parts.static_spans import REST_MARGIN, restless
from recon.recording import Recording
from recon.recording.said import Word
from recon.tracking.tracks import Tracks
from twin import geometry as geo
from twin.errors import ReconstructionError
from twin.geometry import Array
from twin.scene import Trajectory

# m. Surface farther than that from a part's tracks is doubted (`recon.verdict.of_parts`): so are seeds.
REACH_M = 0.3
# Of the tracks in reach so many, the nearest. Chosen by us.
_SEEDS = 24
# Tracks of a rigid motion: it needs 3, and one to agree. Chosen by us.
_FEWEST = 4
_SIGMAS = 3.0  # of depth: nine of ten distances between two points lie within 2.3 (1.64 times the root of 2)
# Support of tracks that join the seeds, by rounds: those that follow well settle the joint before the others
# are asked. A wrong joint has a quarter or less (`AS_WELL` of `joints.group_fits`). Chosen by us.
_FOLLOWS = (0.6, 0.5, 0.4)
_COMMON = 5  # frames in which two tracks are seen together, fewest; as many as a running median takes
_CLOSE_M = 0.05  # a seed so near counts twice as much as one at thrice the distance; chosen by us


@dataclass(frozen=True, eq=False)
class Observed:
    """What parts are sought in, and the settings of that."""

    recording: Recording
    tracks: Tracks
    cameras: Trajectory
    movers: Movers
    joints: JointConfig


@dataclass(frozen=True, eq=False)
class SearchSpace:
    """Where one part is looked for: movers in the frames that were said, the tracks (K,) that may be the
    part's, and the joint of those that move with the point; None where no point was said."""

    movers: Movers
    group: NDArray[np.bool_]
    fit: GroupFit | None


def search_space(
    word: Word, seen: Observed, free: NDArray[np.bool_], hints: Sequence[TypeHint]
) -> SearchSpace:
    """What may be the part that a word is about, among the free tracks (K,).

    Raises ReconstructionError where no followed track moves near the point, or its frame has no camera.
    """
    movers = seen.movers
    if word.interval is not None:
        movers = _within(word.interval, seen)
        rests = outside([word.interval], len(movers.visible))
        free = free & ~restless(seen.movers, movers.moving, rests)
    group = np.asarray(movers.moving & free)
    if word.point is None:
        return SearchSpace(movers, group, None)
    there = _seen_there(seen.movers, word.point[2], word.interval)
    return _with_point(word.point, there, replace(seen, movers=movers), group, hints)


def _seen_there(movers: Movers, frame: int, interval: tuple[int, int] | None) -> Array:
    """Where each track (K, 3) is in a frame, NaN for those not seen in it or in the nearest of the few frames
    around it. Before and after the interval the part rests: then all frames up to it will do."""
    first, last = frame - REST_MARGIN, frame + REST_MARGIN
    if interval is not None and frame < interval[0]:
        first, last = 0, max(last, interval[0])
    if interval is not None and frame > interval[1]:
        first, last = min(first, interval[1]), len(movers.visible) - 1
    frames = np.arange(max(first, 0), min(last, len(movers.visible) - 1) + 1)
    nearest = frames[np.argsort(np.abs(frames - frame), kind="stable")]
    visible = movers.visible[nearest]
    earliest = np.asarray(nearest[np.argmax(visible, axis=0)])
    points = movers.points_world[earliest, np.arange(len(earliest))]
    return np.asarray(np.where(np.any(visible, axis=0)[:, None], points, np.nan))


def outside(intervals: Sequence[tuple[int, int]], frames: int) -> list[tuple[int, int]]:
    """Spans (first, last) of a recording's frames that lie in no interval, a few frames away from each."""
    spans, start = [], 0
    for first, last in (*sorted(intervals), (frames + REST_MARGIN - 1, frames)):
        if first - REST_MARGIN - start >= REST_MARGIN:
            spans.append((start, first - REST_MARGIN))
        start = max(start, last + REST_MARGIN)
    return spans


def _within(interval: tuple[int, int], seen: Observed) -> Movers:
    """The movers as the frames of an interval show them, and as many frames around it as a rest takes."""
    times, tracks = seen.recording.times, seen.tracks
    rest = max(REST_MARGIN, round(REST_SECONDS / float(np.median(np.diff(times)))))
    kept = np.zeros((len(times), 1), dtype=bool)
    kept[max(interval[0] - rest, 0) : interval[1] + rest + 1] = True
    visible = tracks.visible & kept
    points, pixels = (np.where(visible[..., None], p, np.nan) for p in (tracks.points_cam, tracks.pixels))
    shown = find_movers(Tracks(points, pixels, visible), seen.cameras, times)
    return replace(shown, rested=seen.movers.rested)


def _place(point: tuple[int, int, int], recording: Recording, cameras: Trajectory) -> tuple[Array, float]:
    """Where a point is in the world (3,), m, and by how much distances there may change by noise, m."""
    x, y, frame = point
    T_world_cam = cameras.pose(frame)
    if T_world_cam is None:
        raise ReconstructionError(f"the camera of frame {frame} is not known", "point at it in another frame")
    depth = float(recording.depth(frame)[y, x])
    at = recording.intrinsics.backproject(np.array([float(x), float(y)]), np.array(depth))
    tolerance = max(MIN_DISPLACEMENT, _SIGMAS * float(depth_sigma(depth)))
    return geo.transform(T_world_cam, at), tolerance


def _with_point(
    point: tuple[int, int, int],
    there: Array,
    seen: Observed,
    group: NDArray[np.bool_],
    hints: Sequence[TypeHint],
) -> SearchSpace:
    """The joint of the tracks (K,) of a group that move with a point; left are these, those never seen with
    it, and those seen mostly when its state is not known: on its other face, say.

    there: where the tracks (K, 3) are when the point is seen.
    """
    movers = seen.movers
    at, tolerance = _place(point, seen.recording, seen.cameras)
    away = np.linalg.norm(there - at, axis=1)
    away[~group | ~np.isfinite(away)] = np.inf
    near = np.argsort(away, kind="stable")[:_SEEDS]
    near = near[away[near] < REACH_M]
    body = _one_body(movers, near, away[near], tolerance)
    if len(body) < _FEWEST:
        raise ReconstructionError(
            f"{len(body)} of {len(near)} tracks within {100 * REACH_M:.0f} cm move together, {_FEWEST} are needed",
            "point at it in another frame, where it moves and shows some pattern",
        )
    tracks = np.flatnonzero(group)
    agreeing = _agreeing(movers, body, tracks, tolerance)
    seeds, rigid, untold = (np.zeros_like(group) for _ in range(3))
    seeds[body], rigid[tracks], untold[tracks] = True, agreeing > 0, agreeing == 0
    fit = _grown(seeds, rigid | seeds, movers, seen.joints, hints)
    known = movers.visible[fit.fit.frames].sum(axis=0) >= 0.5 * movers.visible.sum(axis=0)
    return SearchSpace(movers, fit.members | (untold & ~seeds) | (rigid & ~known), fit)


def _grown(
    seeds: NDArray[np.bool_],
    group: NDArray[np.bool_],
    movers: Movers,
    joints: JointConfig,
    hints: Sequence[TypeHint],
) -> GroupFit:
    """The joint of the seeds (K,), then of all of a group that follow it, while the seeds follow too."""
    best = fit_group((seeds,), seeds, movers, joints, hints)
    chosen = seeds
    for least in _FOLLOWS:
        follow = seeds | (support(best.fit, group, movers) > least)
        if np.array_equal(follow, chosen):
            continue
        chosen = follow
        same = (TypeHint(best.fit.joint.kind, 0, 1, "the seeds", weight=np.inf),)
        for of_type in (hints, same):
            try:
                more = fit_group((chosen,), seeds, movers, joints, of_type)
            except ReconstructionError:
                continue
            if more.support >= AS_WELL * best.support:
                break
        else:
            break
        source = best.fit.type_source if of_type is same else more.fit.type_source
        best = replace(more, fit=replace(more.fit, type_source=source))
    return best


def _one_body(movers: Movers, near: NDArray[np.int64], away: Array, tolerance: float) -> NDArray[np.int64]:
    """Tracks (n,) near a point, `away` m, that move rigidly with the one that has the nearest company."""
    if not len(near):
        return near
    rigid = np.stack([_rigid(movers, k, near, tolerance) for k in near]) > 0
    np.fill_diagonal(rigid, True)
    company = (rigid | rigid.T) @ (1.0 / (away + _CLOSE_M))
    body = near[(rigid | rigid.T)[int(np.argmax(company))]]
    return body[_agreeing(movers, body, body, tolerance) >= 0] if len(body) >= _FEWEST else body


def _agreeing(
    movers: Movers, seeds: NDArray[np.int64], tracks: NDArray[np.int64], tolerance: float
) -> NDArray[np.int64]:
    """For each of the tracks (n,): with how many more seeds it moves rigidly than not."""
    return np.asarray(sum(_rigid(movers, s, tracks, tolerance) for s in seeds))


def _rigid(movers: Movers, one: int, others: NDArray[np.int64], tolerance: float) -> NDArray[np.int64]:
    """Whether the tracks (n,) keep their distance to `one` while it moves: 1 yes, -1 no, 0 not told.

    It is told by frames that see both, in which `one` goes farther than twice the tolerance (m); what is
    beyond it in more than one frame of ten is no noise.
    """
    p = movers.points_world[:, one, None]
    distance = np.linalg.norm(movers.points_world[:, others] - p, axis=2)
    both = np.isfinite(distance)
    count = both.sum(axis=0)
    high = np.where(both[..., None], p, -np.inf).max(axis=0)
    low = np.where(both[..., None], p, np.inf).min(axis=0)
    told = (count >= _COMMON) & (np.linalg.norm(np.maximum(high - low, 0.0), axis=1) > 2 * tolerance)
    told &= others != one
    out = np.zeros(len(others), dtype=np.int64)
    if told.any():
        d, n = distance[:, told], count[told]
        off = np.sort(np.abs(d - np.nanmedian(d, axis=0)), axis=0)  # NaN last
        out[told] = np.where(off[(0.9 * (n - 1)).astype(int), np.arange(len(n))] < tolerance, 1, -1)
    return out

"""Working-resolution views of a recording, and the choice of frames at rest which show no hand.

FunREC, supplement 1.3: frames without a hand in place of keyframes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32, depth_normals, in_mid_air, look_up
from recon.dense.noise import GOOD_SENSOR, DepthNoise
from recon.interaction.labels.evidence import Errors, Others, Pixels, compare, depth_range, median_depth
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics, Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.threads import each
from twin.scene import Trajectory

# Chosen by us: lightness changes with shading when a part turns, hue and chroma hardly do.
_LIGHTNESS_WEIGHT = 0.5
_MIN_COLOR_SIGMA = 2.0
_STEP = 0.05  # of the depth, within five pixels: more is an edge; chosen by us
# references at rest; they see through a pixel together or not at all where their errors are the same
_ASKED = 6
COLOR_SIGMAS = 3.0  # a surface that moves changes its shading: three times the noise is still alike


@dataclass(frozen=True, eq=False)
class View:
    """On the working grid: depth (h, w) m, Lab color (h, w, 3), normals (h, w, 3) or None; 0 unknown."""

    frame: int
    depth: F32
    color: F32
    normals: F32 | None = None


@dataclass(frozen=True, eq=False)
class References:
    """Frames that others are compared with.

    frames: (R,). depth: (R, h, w). color: (R, h, w, 3). depth_range: least and greatest depth around each
    pixel (`evidence.depth_range`). trusted: (R,) bool, at rest and (nearly) without hand, so their surfaces
    support a hypothesis; the others show empty space. rest_without_hand: (phases,) bool. color_sigma: colour
    difference of one resting surface seen from two frames.
    """

    frames: tuple[int, ...]
    depth: F32
    color: F32
    depth_range: tuple[F32, F32]
    trusted: NDArray[np.bool_]
    rest_without_hand: tuple[bool, ...]
    color_sigma: float


def as_references(views: Sequence[View], trusted: NDArray[np.bool_], color_sigma: float) -> References:
    """Stack views of equal size."""
    depth, color = np.stack([v.depth for v in views]), np.stack([v.color for v in views])
    near, far = (np.stack(part) for part in zip(*(depth_range(d) for d in depth), strict=True))
    return References(tuple(v.frame for v in views), depth, color, (near, far), trusted, (), color_sigma)


def lab(color: NDArray[np.uint8]) -> F32:
    """CIE Lab (h, w, 3) of an RGB image, lightness damped."""
    out = np.asarray(
        cv2.cvtColor(color.astype(np.float32) / np.float32(255.0), cv2.COLOR_RGB2Lab), dtype=np.float32
    )
    out[..., 0] *= _LIGHTNESS_WEIGHT
    return out


def view(recording: Recording, frame: int, factor: int) -> View:
    """The frame on a grid that is `factor` times smaller."""
    color, depth = recording.frame(frame)
    z = median_depth(np.ascontiguousarray(depth, dtype=np.float32), factor)
    h, w = z.shape
    small = cv2.resize(color[: h * factor, : w * factor], (w, h), interpolation=cv2.INTER_AREA)
    return View(frame, z, lab(np.asarray(small, np.uint8)), _normals(z, recording.intrinsics.binned(factor)))


def _normals(depth: F32, camera: Intrinsics) -> F32:
    """Unit normals (h, w, 3), 0 where they are unknown."""
    return np.nan_to_num(depth_normals(depth, camera, np.inf)).astype(np.float32)


def says_nothing(seen: View, noise: DepthNoise) -> NDArray[np.bool_]:
    """Pixels (h, w) whose depth may be no surface's: that nothing explains them makes them no hand."""
    return in_mid_air(seen.depth, noise.sigma(seen.depth), _STEP)


def halved(seen: View) -> View:
    """Every other pixel of a view."""
    normals = None if seen.normals is None else seen.normals[::2, ::2].copy()
    return View(seen.frame, seen.depth[::2, ::2].copy(), seen.color[::2, ::2].copy(), normals)


def _views(recording: Recording, frames: NDArray[np.int64], factor: int) -> list[View]:
    return list(each(lambda f: view(recording, int(f), factor), frames))


def relative_moves(
    cameras: Trajectory, parts: Sequence[MovingPart], frame: int, others: Sequence[int]
) -> Array:
    """Poses (1 + P, R, 3, 4) from a frame's camera to others: as static scene, then as each part.

    NaN where a pose or a state is not known.
    """
    nowhere = np.full((4, 4), np.nan)
    out = np.empty((1 + len(parts), len(others), 3, 4))
    here = cameras.pose(frame)
    here = nowhere if here is None else here
    to_part = [p.pose(frame) for p in parts]
    for r, other in enumerate(others):
        there = cameras.pose(other)
        back = nowhere if there is None else geo.invert_pose(there)
        out[0, r] = (back @ here)[:3]
        for k, part in enumerate(parts):
            now, then = to_part[k], part.pose(other)
            if now is None or then is None:
                out[k + 1, r] = np.nan
            else:
                out[k + 1, r] = (back @ then @ geo.invert_pose(now) @ here)[:3]
    return out


def gather(
    seen: View,
    refs: References,
    moves: Array,
    camera: Intrinsics,
    slack: float,
    noise: DepthNoise,
    wanted: NDArray[np.bool_] | None = None,
    side: NDArray[np.int8] | None = None,
) -> F32:
    """Evidence (4, h, w) for one motion of a view by the references, see `evidence.compare`."""
    out = np.zeros((4, *seen.depth.shape), np.float32)
    none = np.zeros(len(refs.frames), np.int8)
    everywhere = np.ones(seen.depth.shape, bool) if wanted is None else wanted
    compare(
        Pixels(
            seen.depth, seen.color, normals_of(seen, camera), everywhere, camera.vector.astype(np.float32)
        ),
        Others(
            moves.astype(np.float32),
            refs.depth,
            refs.color,
            refs.depth_range,
            refs.trusted,
            none if side is None else side,
        ),
        Errors(COLOR_SIGMAS * refs.color_sigma, slack, noise.curve, noise.of_mean(_ASKED)),
        out,
    )
    return out


def normals_of(seen: View, camera: Intrinsics) -> F32:
    """Normals (h, w, 3) of a view in its camera, 0 where unknown."""
    return _normals(seen.depth, camera) if seen.normals is None else seen.normals


def rest_phases(parts: Sequence[MovingPart], frames: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Frames with a camera, split into the phases in which no part moves."""
    moving = np.zeros(int(frames.max()) + 2, bool)
    for part in parts:
        for first, last in part.motion.intervals:
            moving[first : last + 1] = True
    rest = frames[~moving[frames]]
    if not len(rest):
        return [frames]
    cuts = [k + 1 for k in range(len(rest) - 1) if moving[rest[k] : rest[k + 1]].any()]
    return np.split(rest, cuts)


def _spread(frames: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    pick = np.linspace(0, len(frames) - 1, min(count, len(frames))).round().astype(int)
    return frames[np.unique(pick)]


def _unexplained(
    views: list[View],
    cameras: Trajectory,
    parts: Sequence[MovingPart],
    camera: Intrinsics,
    sigma: float,
    slack: float,
    noise: DepthNoise,
) -> list[NDArray[np.bool_]]:
    """For each view the pixels (h, w) that neither static scene nor parts explain, by other views.

    At least two of the others, and a seventh of them, must look through a pixel under every hypothesis.
    """
    refs = as_references(views, np.zeros(len(views), bool), sigma)
    enough = max(1.5, len(views) / 7)

    def odd_pixels(k: int) -> NDArray[np.bool_]:
        seen = views[k]
        moves = relative_moves(cameras, parts, seen.frame, refs.frames)
        moves[:, k] = np.nan
        odd = (seen.depth > 0) & ~says_nothing(seen, noise)
        for move in moves:
            odd &= gather(seen, refs, move, camera, slack, noise, odd)[1] > enough
        return odd

    return list(each(odd_pixels, range(len(views))))


def _color_sigma(seen: View, other: View, move: Array, camera: Intrinsics) -> float:
    """Robust spread of colour between two frames at rest, at pixels whose depth agrees."""
    y, x = np.nonzero(seen.depth > 0)
    p = (
        camera.backproject(np.stack([x, y], axis=1), seen.depth[y, x].astype(np.float64)) @ move[:, :3].T
        + move[:, 3]
    )
    inside, u, v, z = look_up(other.depth, camera, p, near=0.05)
    same = inside & (np.abs(z - p[:, 2]) < 0.02)
    if same.sum() < 100:
        return _MIN_COLOR_SIGMA
    d = np.linalg.norm(seen.color[y[same], x[same]] - other.color[v[same], u[same]], axis=1)
    return max(float(np.median(d)), _MIN_COLOR_SIGMA)


def find_references(
    recording: Recording,
    cameras: Trajectory,
    parts: Sequence[MovingPart],
    *,
    factor: int,
    slack: float,
    noise: DepthNoise = GOOD_SENSOR,
    per_phase: int = 6,
    witnesses: int = 8,
    hand_share: float = 0.003,
) -> References:
    """Choose reference frames: for every rest phase the frames with the least that nothing explains (a hand).

    What neither hypothesis explains is removed from the chosen frames. Frames of the motion see free space.

    Args:
        factor: shrinking of the working grid.
        slack: m, depth error that poses may cause.
        noise: of depth.
        per_phase: reference frames for each rest phase.
        witnesses: frames of the motion, and half as many of the whole recording, that may only violate.
        hand_share: share of unexplained pixels up to which a frame counts as without hand (chosen by us: a
            third of the smallest hand worth a label).
    """
    phases = rest_phases(parts, cameras.frames)
    pools = [_spread(phase, 2 * per_phase) for phase in phases]
    candidates = _views(recording, np.concatenate(pools), factor)
    camera = recording.intrinsics.binned(factor)
    sigma = _estimate_color_sigma(candidates, pools, cameras, camera)
    coarse = [halved(v) for v in candidates]
    masks = _unexplained(coarse, cameras, parts, camera.strided(2), sigma, slack, noise)
    share = np.array([m.sum() / max(int((v.depth > 0).sum()), 1) for m, v in zip(masks, coarse, strict=True)])
    chosen, clean, start = [], [], 0
    for pool in pools:
        inside = np.arange(start, start + len(pool))
        start += len(pool)
        free = inside[share[inside] <= max(hand_share, 1.5 * float(share.min()))]
        clean.append(bool(share[inside].min() <= hand_share))
        best = inside[np.argsort(share[inside], kind="stable")][: max(per_phase // 2, 1)]
        chosen.extend(_spread(free if len(free) else np.sort(best), per_phase).tolist())
    views = [_without(candidates[k], masks[k]) for k in chosen]
    others = np.setdiff1d(cameras.frames, [v.frame for v in views])
    moving = np.setdiff1d(others, np.concatenate(phases))
    frames = np.union1d(_spread(moving, witnesses), _spread(others, witnesses // 2))
    views += _views(recording, frames, factor)
    refs = as_references(views, np.arange(len(views)) < len(chosen), sigma)
    return replace(refs, rest_without_hand=tuple(clean))


def _estimate_color_sigma(
    candidates: list[View], pools: list[NDArray[np.int64]], cameras: Trajectory, camera: Intrinsics
) -> float:
    """Median over the rest phases of the colour spread between their first and last candidate."""
    values, start = [], 0
    for pool in pools:
        a, b = candidates[start], candidates[start + len(pool) - 1]
        start += len(pool)
        if a.frame != b.frame:
            values.append(_color_sigma(a, b, relative_moves(cameras, (), a.frame, [b.frame])[0, 0], camera))
    return float(np.median(values)) if values else 2 * _MIN_COLOR_SIGMA


def _without(seen: View, mask: NDArray[np.bool_]) -> View:
    if not mask.any():
        return seen
    h, w = seen.depth.shape
    big = cv2.resize(mask.astype(np.uint8), (w, h), interpolation=cv2.INTER_NEAREST)
    wide = cv2.dilate(big, np.ones((7, 7), np.uint8)) > 0
    return replace(seen, depth=np.where(wide, np.float32(0), seen.depth))

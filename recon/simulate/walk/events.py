"""What happens on a walk besides: pauses, fast turns, a covered lens, a moved chair, a carried thing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.simulate.actors import Actor
from recon.simulate.hand_path import HandMotion
from recon.simulate.record import OTHER_LABEL
from recon.simulate.render import Body, Camera
from recon.simulate.surfaces import Surface
from recon.simulate.timeline import minimum_jerk
from recon.simulate.walk.journey import Journey
from recon.simulate.walk.layout import Stand
from twin.geometry import Array, invert_pose, make_pose, transform

Rng = np.random.Generator
# How likely each is on a walk; chosen by us
_PAUSE, _TURN, _EMPTY, _CARRY, _COVER, _CHAIR = 0.45, 0.4, 0.35, 0.35, 0.4, 0.6
# s that a pause takes, that a lens is covered, that a chair moves
_PAUSE_S, _COVER_S, _CHAIR_S = (2.0, 6.0), (0.3, 2.0), (1.0, 2.2)
# s around what is handled in which no lens is covered, and from the ends of the walk
_FREE = 0.4
# Moments that are tried for a chair, times of each at which it is looked at, share of it that is then in view
_MOMENTS, _LOOKS, _SEEN = 60, 5, 0.6


@dataclass(frozen=True)
class Wishes:
    """Before which interactions what happens, if there is time; whether a lens is covered, a chair moved."""

    pauses: dict[int, float]
    turns: tuple[int, ...]
    touches: tuple[int, ...]
    carry: int | None
    cover: bool
    chair: bool


def draw_wishes(rng: Rng, interactions: int) -> Wishes:
    """What shall happen on a walk of so many interactions; on long walks more of each."""

    def some(share: float) -> list[int]:
        return [
            int(rng.integers(interactions)) for _ in range(1 + interactions // 10) if rng.random() < share
        ]

    pauses = {k: float(rng.uniform(*_PAUSE_S)) for k in some(_PAUSE)}
    turns, touches = tuple(some(_TURN)), tuple(some(_EMPTY))
    carry = int(rng.integers(interactions)) if rng.random() < _CARRY else None
    return Wishes(pauses, turns, touches, carry, bool(rng.random() < _COVER), bool(rng.random() < _CHAIR))


def cover_lens(
    journey: Journey, hands: list[tuple[int, HandMotion]], frames: int, rng: Rng
) -> NDArray[np.bool_]:
    """Whether something lies on the lens (frames,): once, while nothing is handled, if there is time."""
    fps = journey.config.fps
    free = np.ones(frames, dtype=bool)
    edge = round(_FREE * fps)
    free[: 2 * edge] = free[-2 * edge - 1 :] = False
    busy = [(line.enter, line.gone) for _, line, _ in journey.acts]
    busy += [(first, first + len(motion.closure)) for first, motion in hands]
    for first, last in busy:
        free[max(0, first - edge) : last + edge] = False
    covered = np.zeros(frames, dtype=bool)
    length = max(2, round(float(rng.uniform(*_COVER_S)) * fps))
    count = np.convolve(free, np.ones(length), mode="valid")
    starts = np.flatnonzero(count == length)
    if len(starts):
        first = int(rng.choice(starts))
        covered[first : first + length] = True
        journey.events.append({"kind": "covered_lens", "frames": [first, first + length - 1]})
    return covered


def move_chair(
    journey: Journey, surfaces: tuple[Surface, ...], cameras: Array, camera: Camera, rng: Rng
) -> Actor | None:
    """The loose chair, moved when all of its way is in view, or none of it; None: at no moment."""
    layout = journey.room.layout
    loose = layout.loose
    if loose is None or layout.put is None:
        return None
    frames = len(cameras)
    seen_wanted = bool(rng.random() < 0.5)
    for wanted in (seen_wanted, not seen_wanted):
        for _ in range(_MOMENTS):
            length = max(2, round(float(rng.uniform(*_CHAIR_S)) * journey.config.fps))
            first = int(rng.integers(1, frames - length - 1))
            times = np.linspace(first, first + length, _LOOKS).astype(int)
            some = _slid(loose.pose, layout.put, minimum_jerk((times - first) / length))
            share = [_share_in_view(loose, T, cameras[k], camera) for k, T in zip(times, some, strict=True)]
            if (wanted and min(share) >= _SEEN) or (not wanted and max(share) == 0.0):
                kind = "chair_moved_in_view" if wanted else "chair_moved_out_of_view"
                ends = {"from": loose.pose[:3, 3].tolist(), "to": layout.put[:3, 3].tolist()}
                journey.events.append({"kind": kind, "frames": [first, first + length], **ends})
                way = _slid(loose.pose, layout.put, minimum_jerk((np.arange(frames) - first) / length))
                return Actor.moving(Body(surfaces, OTHER_LABEL), way)
    return None


def _share_in_view(stand: Stand, pose: Array, T_world_camera: Array, camera: Camera) -> float:
    """Share of a piece's corners that are in the picture."""
    corners = replace(stand, pose=pose).still.corners.reshape(-1, 3)
    pixels = camera.project(transform(invert_pose(T_world_camera), corners))
    size = np.array([camera.width, camera.height])
    return float(np.mean(np.all((pixels > 0.0) & (pixels < size - 1.0), axis=1)))


def _slid(start: Array, end: Array, shares: Array) -> Array:
    """Poses (n, 4, 4) between two on the floor, at shares (n,)."""
    angles = [float(np.arctan2(T[1, 0], T[0, 0])) for T in (start, end)]
    turn = (angles[1] - angles[0] + np.pi) % (2.0 * np.pi) - np.pi
    out = []
    for s in shares:
        a = angles[0] + s * turn
        rotation = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
        out.append(make_pose(rotation, (1.0 - s) * start[:3, 3] + s * end[:3, 3]))
    return np.stack(out)

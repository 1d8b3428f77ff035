"""What a recording holds, and what its reconstruction takes: length, motions, minutes and memory."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.cameras.poses import MIN_CORRESPONDENCES
from recon.cameras.rigid import point_sigmas, ransac_pose
from recon.inspection.changes import Depths, moving_shares
from recon.interaction.motion.intervals import REST_SECONDS
from recon.recording import Frame, Intrinsics, Recording
from recon.tracking.follow import followed
from recon.tracking.tracks import PIXEL_SIGMA
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.threads import each
from twin.scene import Trajectory

# px, width of the pictures that corners are followed in
_WIDTH = 320
# px, width of the depth that is compared
_DEPTH_WIDTH = 160
# Frames that are looked at: two minutes, `REST_SECONDS` apart; of a longer recording they are farther apart
_MOST = 360
# Share of the picture that something other than the camera changes between two, as for rest at ends
_MOVES = 0.003
# s of rest between two motions: a hand that waits on a handle for less does not end one
_REST = 2.0
# Steps in a row in which something moves: one alone may be noise
_LEAST = 2
_CORNERS = 300  # corners followed
_APART = 6  # px between corners
_TRIES = 60  # as for the focal length
_GATE = 4.0  # as for the focal length


# What a reconstruction takes, by runs of the kitchens and the shipped recording, alone and four times
_VGA = 640 * 480
# s before and after all frames, on the two cores of two machines
_START_S = 5.0
# s a frame of VGA, least and most, on the same
_FRAME_S = (0.3, 0.7)
# Frames after which twice as much is taken for a frame at most: what looks at all tracks in all frames
_TWICE = 1000
# MB without frames
_BASE_MB = 800.0
# MB of textures at VGA
_TEXTURE_MB = 700.0
# Tracks that a frame of VGA begins
_TRACKS = 60
# Bytes of a track in a frame
_BYTES = 41
# Copies of the tracks held at once
_COPIES = 4
# MB beyond which a piece is advised: what many a computer has to spare
_MUCH_MB = 6000


@dataclass(frozen=True)
class Outlook:
    """seconds: length. motions: stretches of time in which something other than the camera moves, None if
    unknown. minutes: least and most for a reconstruction on two cores. memory_mb: its most memory."""

    seconds: float
    motions: int | None
    minutes: tuple[float, float]
    memory_mb: int

    @property
    def text(self) -> str:
        """One line."""
        n = self.motions
        seen = "motions not known" if n is None else f"{n} motion{'s' * (n != 1)} seen"
        low, high = (f"{m:.1f}" if m < 2 else f"{m:.0f}" for m in self.minutes)
        took = f"about {low} to {high} minutes on two cores and {self.memory_mb / 1000:.1f} GB of memory"
        piece = (
            "; take the piece with one motion, with --start and --end" if self.memory_mb > _MUCH_MB else ""
        )
        return f"{self.seconds:.0f} s long, {seen}; a reconstruction takes {took}{piece}"

    def as_dict(self) -> dict[str, Any]:
        """JSON types."""
        return asdict(self) | {"minutes": list(self.minutes)}


def outlook(recording: Recording) -> Outlook:
    """Look at a frame every third of a second, at fewer of a long recording."""
    minutes, memory = cost(len(recording), recording.intrinsics.width * recording.intrinsics.height)
    return Outlook(float(np.ptp(recording.times)), _motions(recording), minutes, memory)


def cost(frames: int, pixels: int) -> tuple[tuple[float, float], int]:
    """Minutes, least and most, and MB that the reconstruction of so many frames of so many pixels takes.

    Memory grows with the square of the frames: each track has a place in each, and each begins new ones.
    """
    area = pixels / _VGA
    low, high = (s * frames * area for s in _FRAME_S)
    minutes = (_START_S + low) / 60, (_START_S + high * (1 + frames / _TWICE)) / 60
    tracks = _TRACKS * min(area, 1.0) * frames
    memory = _BASE_MB + max(_TEXTURE_MB * area, _COPIES * _BYTES * tracks * frames / 1e6)
    return minutes, round(memory)


def _motions(recording: Recording) -> int | None:
    """How often something other than the camera moves."""
    times = recording.times
    step = max(REST_SECONDS / float(np.median(np.diff(times))), len(times) / _MOST, 1.0)
    frames = np.unique(np.arange(0, len(times), step).astype(int))
    small = each(lambda i: _small(recording.frame(i), recording.intrinsics), frames.tolist())
    before, shares = next(small), []
    for now in small:
        shares.append(_share(before, now))
        before = now
    known = np.isfinite(shares)
    if known.mean() < 0.5:
        return None
    moving = np.asarray(shares) > _MOVES  # what is not known rests
    return _runs(moving, round(_REST / float(np.median(np.diff(times[frames])))))


def _runs(moving: NDArray[np.bool_], rest: int) -> int:
    """Runs of at least `_LEAST` steps, which fewer than `rest` steps of rest don't end."""
    at = np.flatnonzero(moving)
    groups = np.split(at, np.flatnonzero(np.diff(at) > max(rest, 1)) + 1)
    return sum(len(g) >= _LEAST for g in groups)


@dataclass(frozen=True, eq=False)
class _Small:
    """A small frame: grey (h, w), its depth (h, w) m, and its camera."""

    grey: NDArray[np.uint8]
    depth: NDArray[np.float32]
    camera: Intrinsics


def _small(frame: Frame, camera: Intrinsics) -> _Small:
    size = (_WIDTH, max(1, round(camera.height * _WIDTH / camera.width)))
    grey = cv2.resize(cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA)
    depth = cv2.resize(frame.depth, size, interpolation=cv2.INTER_NEAREST_EXACT)
    return _Small(np.asarray(grey, np.uint8), np.asarray(depth, np.float32), camera.scaled(*size))


def _share(before: _Small, now: _Small) -> float:
    """Share of the picture that changes not by the camera; NaN with too few corners for its motion."""
    pose = _camera_motion(before, now)
    if pose is None:
        return float("nan")
    camera = now.camera.scaled(
        _DEPTH_WIDTH, max(1, round(now.camera.height * _DEPTH_WIDTH / now.camera.width))
    )
    size = (camera.width, camera.height)
    depth = [cv2.resize(s.depth, size, interpolation=cv2.INTER_NEAREST_EXACT) for s in (before, now)]
    cameras = Trajectory(np.arange(2), np.arange(2.0), np.stack([np.eye(4), geo.invert_pose(pose)]))
    return float(
        moving_shares(Depths(np.array(depth, dtype=np.float64), camera, cameras), 1, np.zeros(1, np.int64))[0]
    )


def _camera_motion(before: _Small, now: _Small) -> Array | None:
    """T_now_before (4, 4) by corners with depth in both; None where they are too few."""
    corners = cv2.goodFeaturesToTrack(before.grey, _CORNERS, 0.01, _APART)
    if corners is None:
        return None
    start = np.asarray(corners[:, 0], dtype=np.float32)
    there, good = followed(before.grey, now.grey, start)
    points = []
    for xy, small in ((start, before), (there, now)):
        x, y = (
            np.clip(np.rint(v), 0, n - 1).astype(int)
            for v, n in zip(xy.T, small.grey.shape[::-1], strict=True)
        )
        z = small.depth[y, x].astype(np.float64)
        good &= z > 0
        points.append(small.camera.backproject(xy.astype(np.float64), z))
    if good.sum() < MIN_CORRESPONDENCES:
        return None
    a, b = (p[good] for p in points)
    lateral = PIXEL_SIGMA / now.camera.fx
    sigma = np.sqrt(sum(s**2 for p in (a, b) for s in point_sigmas(p, lateral)))
    return ransac_pose(a, b, sigma, np.random.default_rng(0), tries=_TRIES, gate=_GATE)

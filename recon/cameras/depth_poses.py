"""Camera poses from depth and tracks together, frame by frame: a second witness beside tracks' poses.

Each frame is laid onto earlier ones, up to some 40 frames back, by its surfaces (point to plane: Chen and
Medioni 1992) and its tracks. Moving surface agrees with the last frame only, and a near part covers little
area: a door that fills the view takes no camera along. FunREC, supplement 1.2: without masks of what moves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.cameras.depth_kernels import block_means, planes, refine, system
from recon.dense.depth import F32
from recon.recording import Intrinsics, Recording
from recon.tracking.tracks import Tracks
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.loop import Loop, untold
from twin.runs.threads import each

WIDTH = 160  # px to which depth is thinned out
REACH = 2  # px around a pixel in which it is a plane
FLAT = 0.01  # share of the depth that the plane may leave
# every so many pixels of a frame are laid onto others: enough for half a millimetre
_EVERY = 5
# tracks of a frame that are laid onto others, at most
_MOST_TRACKS = 250
FARTHEST = 6.0  # m; noise beyond
_GAPS = (1, 3, 6, 10, 15, 21, 28, 36)  # frames back: most of them farther than a part is slow
_AHEAD = (1, 3, 6)  # the frame is looked for where the motion since so many frames leads
_GATES = (6.0, 3.0, 2.0)  # sigmas
_ROUNDS = (3, 2, 3)  # steps at each gate
_LEAST = 5e-4  # m and rad, the last step
_SAME = 2e-3  # m and rad: two searches that have come so near end in one place
# Errors of depth are alike over patches and frames: they count as so many times fewer looks.
_ALIKE = 100.0
_UNSURE = 0.03  # m: a frame whose place is less sure than that is lost
# All chosen by us.


@dataclass(frozen=True, eq=False)
class DepthPoses:
    """Poses T_world_cam (T, 4, 4), which of them are known (T,), their information (T, 6, 6) for T exp(d),
    and how well they (`good`) and the poses they were compared with (`theirs`) agree with the same earlier
    frames, (T,)."""

    T_world_cam: Array
    posed: NDArray[np.bool_]
    information: Array
    good: Array
    theirs: Array


def poses_by_depth(
    recording: Recording,
    tracks: Tracks,
    others: Array,
    lateral: float,
    progress: Loop = untold,
) -> DepthPoses:
    """Poses of a recording's frames, the first with depth at its place in `others`, poses (T, 4, 4) that are
    tried and judged as well, identity where unknown. lateral: standard deviation of tracks across the view,
    rad."""
    step = max(1, recording.intrinsics.width // WIDTH)
    camera = recording.intrinsics.binned(step)

    def prepared(i: int) -> tuple[F32, Array, Array]:
        inverse = block_means(recording.depth(i), step, 2 if step > 2 else 1)
        plane = planes(inverse, camera.vector, REACH, FLAT)
        return plane, *surface_of(plane, camera)

    count = len(recording)
    path = _Path(camera, tracks, others, lateral)
    frames = each(prepared, range(count))
    for i in progress(range(count), "cameras, depth"):
        path.step(i, *next(frames))
    return path.poses


def surface_of(plane: F32, camera: Intrinsics) -> tuple[Array, Array]:
    """Points and normals (n, 3) of some of a frame's pixels."""
    some = plane[_EVERY // 2 :: _EVERY, _EVERY // 2 :: _EVERY].astype(np.float64)
    v, u = np.mgrid[_EVERY // 2 : camera.height : _EVERY, _EVERY // 2 : camera.width : _EVERY]
    rays = camera.backproject(np.stack([u, v], axis=-1).astype(np.float64), np.ones(u.shape))
    known = np.isfinite(some[..., 0])
    normals, rays = some[known][:, :3], rays[known]
    facing = (normals * rays).sum(axis=1)
    z = some[known][:, 3] / facing
    good = (z > 0.1) & (z < FARTHEST) & (facing < -0.15)
    return rays[good] * z[good, None], normals[good]


class _Path:
    """The poses so far and the surfaces of the last frames that have one."""

    def __init__(self, camera: Intrinsics, tracks: Tracks, others: Array, lateral: float) -> None:
        n = len(others)
        self._camera, self._tracks, self._others, self._lateral = camera, tracks, others, lateral
        self._planes = np.zeros((_GAPS[-1] + 1, camera.height, camera.width, 4), np.float32)
        self._frames: list[int] = []  # that are posed
        self.poses = DepthPoses(
            np.tile(np.eye(4), (n, 1, 1)),
            np.zeros(n, dtype=bool),
            np.zeros((n, 6, 6)),
            np.zeros(n),
            np.zeros(n),
        )

    def step(self, frame: int, plane: F32, points: Array, normals: Array) -> None:
        """Find the pose of the next frame."""
        if not self._frames:
            if len(points):
                self._keep(frame, plane, self._others[frame])
            return
        p = self.poses
        back = [g for g in _GAPS if g <= len(self._frames)]
        references = np.array([self._frames[-g] for g in back])
        rows = np.array([(len(self._frames) - g) % len(self._planes) for g in back])
        seen = (rows, (points, normals, self._planes, self._camera.vector), self._pairs(frame, references))
        inverse = geo.invert_pose(p.T_world_cam[references])
        best, pose, information, held = -1.0, p.T_world_cam[frame], np.zeros((6, 6)), np.zeros((3, 3))
        for candidate in self._refined(self._guesses(frame), inverse, *seen):
            h, _, good, shift = system(candidate, inverse, *seen, _GATES[-1])
            if good > best:
                best, pose, information, held = good, candidate, h / _ALIKE, shift / _ALIKE
        theirs = geo.invert_pose(self._others[references])
        p.theirs[frame] = system(self._others[frame], theirs, *seen, _GATES[-1])[2]
        p.good[frame], p.information[frame] = best, information
        if np.linalg.eigvalsh(held)[0] * _UNSURE**2 >= 1.0:
            self._keep(frame, plane, pose)

    def _keep(self, frame: int, plane: F32, pose: Array) -> None:
        u, _, vt = np.linalg.svd(pose[:3, :3])  # many small turns leave it a little off
        self.poses.T_world_cam[frame] = geo.make_pose(u @ vt, pose[:3, 3])
        self.poses.posed[frame] = True
        self._planes[len(self._frames) % len(self._planes)] = plane
        self._frames.append(frame)

    def _guesses(self, frame: int) -> list[Array]:
        """Where the frame may be: as the last one, as the tracks alone tell, as the motion of late leads."""
        T, last = self.poses.T_world_cam, self._frames[-1]
        out = [T[last] @ geo.invert_pose(self._others[last]) @ self._others[frame], T[last]]
        for gap in _AHEAD:
            if len(self._frames) > 2 * gap:
                a, b = self._frames[-2 * gap], self._frames[-gap]
                moved = geo.log_se3(geo.invert_pose(T[a]) @ T[b]) / (b - a)
                out.append(T[b] @ geo.exp_se3(moved * (frame - b)))
        return out

    def _refined(self, guesses: list[Array], *seen: Any) -> list[Array]:
        """The guesses after least squares under ever narrower gates, without those that coincide."""
        out: list[Array] = []
        for guess in guesses:
            if all(np.abs(guess - other).max() > _SAME for other in out):
                near = refine(guess, *seen, _GATES[0], _ROUNDS[0], _LEAST)  # type: ignore[call-arg]
                if all(np.abs(near - other).max() > _SAME for other in out):
                    out.append(near)
        for gate, rounds in zip(_GATES[1:], _ROUNDS[1:], strict=True):
            out = [refine(pose, *seen, gate, rounds, _LEAST) for pose in out]  # type: ignore[call-arg]
        return out

    def _pairs(self, frame: int, references: NDArray[np.int64]) -> tuple[Any, ...]:
        """Where tracks of the frame were in the references, for `track_system`."""
        t = self._tracks
        ids = np.flatnonzero(t.visible[frame])
        seen = t.visible[references[:, None], ids]
        ids = ids[seen.any(axis=0)]
        ids = ids[:: max(1, -(-len(ids) // _MOST_TRACKS))]
        track, reference = np.nonzero(t.visible[references[:, None], ids].T)
        starts = np.searchsorted(track, np.arange(len(ids) + 1))
        there = t.points_cam[references[reference], ids[track]]
        return np.ascontiguousarray(reference), starts, t.points_cam[frame, ids], there, self._lateral

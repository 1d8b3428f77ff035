"""Camera poses for every frame from point tracks.

Start: robust rigid alignment of each frame to a keyframe (measured: chaining frame to frame drifts by 4 cm
and no refinement recovers from it; from keyframes it always converged). Refinement: a robust bundle over all
tracks that alternates landmarks and poses, in which moving things lose their weight; no mask is needed.

FunREC, supplement 1.2: no learned matches, no masks.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.cameras.depth_poses import poses_by_depth
from recon.cameras.join import joined
from recon.cameras.kernels import chi_squares, landmarks_of, pose_systems
from recon.cameras.rigid import point_sigmas, ransac_pose
from recon.cameras.rival import followed_part
from recon.cameras.submaps import Piece, Solve, solve_pieces
from recon.recording import Recording
from recon.tracking.tracks import PIXEL_SIGMA, SparseTracks, Tracks
from twin import geometry as geo
from twin.errors import InputError, ReconstructionError
from twin.geometry import Array
from twin.robust import chi2_scale, geman_mcclure
from twin.runs.keys import Stage
from twin.runs.loop import Loop, untold
from twin.runs.setting import Settings, setting
from twin.scene import Trajectory

CAMERAS = Stage("cameras", 6, ("cameras",))
SUBMAPS = Stage("submaps", 2, ("cameras",))
_BUNDLE_ROUNDS = 60  # at most; it ends earlier when the poses stand still
_CONVERGED = 5e-5  # m and rad, largest step of a round; a tenth of the accuracy that is reached
# Frames after which two paths are compared.
_SINCE = (1, 10, 40)
# m, least difference of two paths: ten times their errors.
_DIVERGED_M = 0.01
# rad, the same of their turns.
_DIVERGED_RAD = float(np.radians(0.5))
# of the frames that all tracks pose are posed without those of a part, or they are kept; chosen by us
_AS_MANY = 0.9
# by what the other path agrees more with frames before; chosen by us: noise is 3 %, a lost camera 20
_BETTER = 1.1


@dataclass(frozen=True)
class CameraConfig(Settings):
    """Camera poses."""

    use_known_poses: bool = setting(
        False, "take the poses that the recording holds instead of estimating them"
    )


_DEFAULT = CameraConfig()
# Frames that a keyframe serves at most. Measured.
_KEYFRAME_EVERY = 15
# Share of inliers below which a new keyframe is taken. Chosen by us.
_KEYFRAME_MIN_INLIERS = 0.5
# A frame that shares fewer tracks with its keyframe is lost. Chosen by us.
MIN_CORRESPONDENCES = 12
# Poses tried for a frame. Chosen by us.
_TRIES = 300
# Standard deviations within which a track agrees with a pose. Chosen by us.
INLIER_SIGMA = 4.0


def camera_poses(
    recording: Recording,
    tracks: SparseTracks,
    config: CameraConfig = _DEFAULT,
    progress: Loop = untold,
    pieces: Sequence[Piece] | None = None,
) -> Trajectory:
    """The recording's own poses where the settings say so, else those by tracks and depth.

    The world is the first posed frame's camera. pieces: of the path, where they are solved already. Raises
    InputError when the recording holds none, ReconstructionError when too few frames can be posed.
    """
    if config.use_known_poses:
        if recording.poses is None:
            raise InputError(
                f"{recording.source} holds no camera poses",
                "leave cameras.use_known_poses off to estimate them",
            )
        return recording.poses
    if pieces is None:
        pieces = solve_pieces(
            len(recording), _solver(recording, tracks, progress), np.asarray(recording.times)
        )
    found = _largest(recording, joined(recording, pieces))
    lost = len(recording) - len(found.frames)
    if lost:
        spans = ", ".join(f"{a}-{b}" if b > a else str(a) for a, b in found.gaps(len(recording)))
        warnings.warn(f"{lost} of {len(recording)} frames have no camera pose: {spans}", stacklevel=2)
    return found


def _solver(recording: Recording, tracks: SparseTracks, progress: Loop) -> Solve:
    """Solves the submaps of a recording."""

    def solve(first: int, last: int) -> tuple[Array, NDArray[np.bool_]]:
        whole = first == 0 and last == len(recording) - 1
        part = recording if whole else recording[first : last + 1]
        return submap_poses(part, tracks.dense(first, last), progress if whole else untold)

    return solve


def _largest(recording: Recording, pieces: Sequence[Piece]) -> Trajectory:
    """The first of the pieces, which is the largest, as a trajectory."""
    largest = pieces[0] if pieces else Piece(np.zeros(0, np.int64), np.zeros((0, 4, 4)))
    posed = np.zeros(len(recording), dtype=bool)
    posed[largest.frames] = True
    _enough(posed)
    start = geo.invert_pose(largest.poses[0])
    return Trajectory(largest.frames, recording.times[largest.frames], start @ largest.poses)


def submap_poses(
    recording: Recording, tracks: Tracks, progress: Loop = untold
) -> tuple[Array, NDArray[np.bool_]]:
    """The poses by which the room keeps its place: by all other tracks if they follow a part.

    Poses (T, 4, 4) and which of them are known (T,).
    """
    lateral, rng = PIXEL_SIGMA / recording.intrinsics.fx, np.random.default_rng(0)
    poses, posed = _of_two(recording, tracks, progress)
    sigma = np.hypot(*point_sigmas(tracks.points_cam, lateral))
    part = followed_part(tracks, poses, posed, sigma, rng)
    if part.any():
        others = tracks.without(part)
        room, known = _of_two(recording, others, progress)
        if known.sum() >= _AS_MANY * posed.sum() and not followed_part(others, room, known, sigma, rng).any():
            poses, posed = room, known
    return poses, posed


def _of_two(recording: Recording, tracks: Tracks, progress: Loop) -> tuple[Array, NDArray[np.bool_]]:
    """Poses (T, 4, 4) and which of them are known (T,): the tracks' where those from depth and tracks agree
    with them; else those that explain more of the depth, bundled."""
    focal = recording.intrinsics.fx
    start, posed = _start_poses(tracks, focal, progress)
    poses = _bundle(tracks, start, posed, focal) if posed.any() else start
    depth = poses_by_depth(recording, tracks, poses, PIXEL_SIGMA / focal, progress)
    diverged = _diverged(poses, depth.T_world_cam, posed & depth.posed)
    if (diverged & (depth.good > _BETTER * depth.theirs)).any() or depth.posed.sum() > posed.sum():
        posed = depth.posed
        poses = _bundle(tracks, depth.T_world_cam, posed, focal, depth.information)
    return poses, posed


def _diverged(a: Array, b: Array, both: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Frames (T,) at which two paths (T, 4, 4), known in `both`, have moved apart since earlier."""
    out = np.zeros(len(a), dtype=bool)
    rows = np.flatnonzero(both)
    for gap in _SINCE:
        if len(rows) > gap:
            i, j = rows[:-gap], rows[gap:]
            off = geo.invert_pose(geo.invert_pose(a[i]) @ a[j]) @ geo.invert_pose(b[i]) @ b[j]
            out[j] |= np.linalg.norm(off[:, :3, 3], axis=1) > _DIVERGED_M
            out[j] |= geo.rotation_angle(off[:, :3, :3]) > _DIVERGED_RAD
    return out


def _enough(posed: NDArray[np.bool_]) -> None:
    """Raises ReconstructionError when fewer than half of the frames (T,) are posed."""
    if posed.mean() < 0.5:
        raise ReconstructionError(
            f"only {int(posed.sum())} of {len(posed)} frames share enough tracked points with their neighbours",
            "record with more texture and light in view, or move the camera more slowly",
        )


def estimate_cameras(
    tracks: Tracks,
    times: Array,
    focal: float,
    tries: int = _TRIES,
    progress: Loop = untold,
) -> Trajectory:
    """Poses T_world_cam of all frames that can be posed; the world is the first posed frame's camera.

    Args:
        tracks: T frames of tracks.
        times: (T,) s.
        focal: focal length in pixels of the recording.
        tries: poses tried for a frame.

    Raises ReconstructionError when fewer than half of the frames can be posed.
    """
    start, posed = _start_poses(tracks, focal, progress, tries)
    _enough(posed)
    return _from_first(_bundle(tracks, start, posed, focal), posed, times)


def _from_first(poses: Array, posed: NDArray[np.bool_], times: Array) -> Trajectory:
    """The posed frames of (T, 4, 4) in the first one's camera."""
    frames = np.flatnonzero(posed)
    return Trajectory(frames, times[frames], geo.invert_pose(poses[frames[0]]) @ poses[frames])


def _start_poses(
    tracks: Tracks, focal: float, progress: Loop, tries: int = _TRIES
) -> tuple[Array, NDArray[np.bool_]]:
    """Poses (T, 4, 4) by alignment to keyframes and a mask (T,) of the frames that could be posed."""
    rng = np.random.default_rng(0)
    n_frames = len(tracks.visible)
    poses = np.tile(np.eye(4), (n_frames, 1, 1))
    posed = np.zeros(n_frames, dtype=bool)
    key, last = -1, -1
    for i in progress(range(n_frames), "cameras"):
        if key < 0:
            posed[i] = tracks.visible[i].sum() >= MIN_CORRESPONDENCES
            key = last = i if posed[i] else -1
            continue
        found = _align(tracks, key, i, tries, focal, rng)
        if (found is None or found[1] < _KEYFRAME_MIN_INLIERS or i - key >= _KEYFRAME_EVERY) and last != key:
            key = last
            found = _align(tracks, key, i, tries, focal, rng) or found
        if found is None:
            continue
        poses[i] = poses[key] @ found[0]
        posed[i], last = True, i
    return poses, posed


def _align(
    tracks: Tracks, key: int, frame: int, tries: int, focal: float, rng: np.random.Generator
) -> tuple[Array, float] | None:
    """T_key_frame and its inlier share, None when they share too few tracks."""
    both = tracks.visible[key] & tracks.visible[frame]
    if both.sum() < MIN_CORRESPONDENCES:
        return None
    a, b = tracks.points_cam[frame, both], tracks.points_cam[key, both]
    lateral_a, axial_a = point_sigmas(a, PIXEL_SIGMA / focal)
    lateral_b, axial_b = point_sigmas(b, PIXEL_SIGMA / focal)
    sigma = np.sqrt(axial_a**2 + axial_b**2 + lateral_a**2 + lateral_b**2)
    gate = INLIER_SIGMA
    pose = ransac_pose(a, b, sigma, rng, tries=tries, gate=gate)
    inlier = np.linalg.norm(geo.transform(pose, a) - b, axis=-1) < gate * sigma
    return (pose, float(inlier.mean())) if inlier.sum() >= MIN_CORRESPONDENCES else None


def _bundle(
    tracks: Tracks,
    start: Array,
    posed: NDArray[np.bool_],
    focal: float,
    held: Array | None = None,
) -> Array:
    """Robust alternation of landmarks and poses over every observation; returns poses (T, 4, 4).

    held: information (T, 6, 6) by which each pose is held to its start.
    """
    visible = tracks.visible & posed[:, None]
    frame_index, track_index = np.nonzero(visible)
    points = tracks.points_cam[frame_index, track_index]
    if not len(points):
        return start.copy()
    lateral, axial = point_sigmas(points, PIXEL_SIGMA / focal)
    info = np.stack([1 / lateral**2, 1 / axial**2], axis=-1)
    poses = start.copy()
    weights = np.ones(len(points))
    landmarks = landmarks_of(poses, frame_index, track_index, points, info, weights, len(tracks))
    for round_ in range(_BUNDLE_ROUNDS):
        chi2 = chi_squares(poses, frame_index, track_index, points, info, landmarks)
        # The scale comes from the data; early rounds are wide so that nothing static is lost to a poor start.
        scale2 = max(chi2_scale(chi2, dof=3), 0.05) * (9.0 if round_ < 8 else 4.0)
        weights = geman_mcclure(chi2, scale2)
        track_weight = np.bincount(track_index, weights, len(tracks)) / np.maximum(
            np.bincount(track_index, minlength=len(tracks)), 1
        )
        weights *= track_weight[track_index] ** 2  # a point that moves part of the time is not static
        h, g = pose_systems(poses, frame_index, track_index, points, info, weights, landmarks)
        usable = np.flatnonzero(posed)
        if held is not None:
            h += held
            off = geo.log_se3(geo.invert_pose(poses) @ start)
            g -= (held @ off[..., None])[..., 0]
        step = -np.linalg.solve(h[usable] + 1e-6 * np.eye(6), g[usable][..., None])[..., 0]
        poses[usable] = poses[usable] @ geo.exp_se3(step)
        landmarks = landmarks_of(poses, frame_index, track_index, points, info, weights, len(tracks))
        if round_ > 8 and np.abs(step).max() < _CONVERGED:
            break
    return poses

"""Poses stated for a picture held another way: by which quarter turn do they move pictures as they moved?

Record3D stored portrait pictures up to 1.10 and stores landscape ones since 1.10.1, whose poses may still be
those of the portrait picture. No version is written into the file, so the pictures decide.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from recon.readers.streams import Streams, recording_of
from recon.recording import Frame, Intrinsics
from twin.errors import InputError
from twin.geometry import Array, exp_so3, invert_pose, make_pose, rotation_angle, transform

# s between the two pictures of a pair
_GAP = 0.3
# Pairs that are looked at
_PAIRS = 6
# rad by which the view of something a metre away moves in a pair, at least: less moves the picture hardly
# farther than noise does. Chosen by us
_LEAST = np.radians(1.5)
# rad, at most: after more the two share too little. Chosen by us
_MOST = np.radians(15.0)
# Corners
_CORNERS = 300
# px between corners
_APART = 6
# px by which a corner followed there and back ends beside its start
_BACK = 0.7
_FEWEST = 30  # corners in all
# Of the error of the second best turn, chosen by us: the right one leaves noise, the others all of the motion
_CLEAR = 0.5


def with_turned_poses(streams: Streams) -> Streams:
    """The same with poses of stored pictures: landscape ones of Record3D >= 1.10.1 may have portrait's."""
    camera = streams.rig.color.camera
    if streams.poses is None or camera.width <= camera.height:
        return streams
    made = recording_of(streams)
    if made.poses is None:
        return streams
    turns = quarter_turn(made.times, made.poses.T_world_cam, made.intrinsics, made.frame)
    name = "its landscape pictures have poses turned by"
    if turns is None:
        said = f"{streams.name}: whether {name} 90° can't be told, the camera moves too little; they are taken as they are"
        return replace(streams, warnings=(*streams.warnings, said))
    if turns == 0:
        return streams
    times, poses = streams.poses
    said = f"{streams.name}: {name} {90 * turns if turns < 3 else -90}°, as Record3D 1.10.1 stores them; turned back"
    poses = poses @ make_pose(exp_so3([0.0, 0.0, turns * np.pi / 2]))
    return replace(streams, poses=(times, poses), warnings=(*streams.warnings, said))


def quarter_turn(
    times: Array, T_world_cam: Array, camera: Intrinsics, frame: Callable[[int], Frame]
) -> int | None:
    """Quarter turns about the optical axis, 0 to 3, after which poses (n, 4, 4) of frames at `times` (n,) s
    move the pictures as these move; None where the camera moves too little to tell."""
    turns = [make_pose(exp_so3([0.0, 0.0, k * np.pi / 2])) for k in range(4)]
    off: list[list[Array]] = [[], [], [], []]
    for i, j in _pairs(times, T_world_cam):
        try:
            before, after = frame(i), frame(j)
        except InputError:  # told when the frame itself is asked for
            continue
        start, there = _followed(before, after)
        z = before.depth[tuple(np.rint(start[:, ::-1]).astype(int).T)].astype(np.float64)
        points = camera.backproject(start[z > 0], z[z > 0])
        for k, turn in enumerate(turns):
            moved = transform(invert_pose(T_world_cam[j] @ turn) @ T_world_cam[i] @ turn, points)
            seen = moved[:, 2] > 0.05
            error = np.full(len(points), np.inf)
            error[seen] = np.linalg.norm(camera.project(moved[seen]) - there[z > 0][seen], axis=1)
            off[k].append(error)
    if sum(len(e) for e in off[0]) < _FEWEST:
        return None
    errors = np.array([np.median(np.concatenate(e)) for e in off])
    best, second = np.argsort(errors)[:2]
    return int(best) if errors[best] < _CLEAR * errors[second] else None


def _pairs(times: Array, poses: Array) -> list[tuple[int, int]]:
    """Pairs of frames between which the view moves most across the optical axis."""
    later = np.searchsorted(times, times + _GAP)
    first = np.flatnonzero(later < len(times))
    between = invert_pose(poses[first]) @ poses[later[first]]
    turn = np.arccos(np.clip(between[:, 2, 2], -1.0, 1.0))
    moves = turn + np.linalg.norm(between[:, :2, 3], axis=1)
    good = (moves > _LEAST) & (rotation_angle(between[:, :3, :3]) < _MOST)
    best = first[good][np.argsort(-moves[good], kind="stable")]
    return [(int(i), int(later[i])) for i in best[:: max(1, len(best) // _PAIRS)][:_PAIRS]]


def _followed(before: Frame, after: Frame) -> tuple[Array, Array]:
    """Corners (n, 2) px of one picture, and where they are in the other."""
    import cv2  # here: what is wrong with a recording is told without it

    one, other = (cv2.cvtColor(f.color, cv2.COLOR_RGB2GRAY) for f in (before, after))
    corners = cv2.goodFeaturesToTrack(one, _CORNERS, 0.01, _APART)
    if corners is None:
        return np.zeros((0, 2)), np.zeros((0, 2))
    there, found, _ = cv2.calcOpticalFlowPyrLK(one, other, corners, None)  # type: ignore[call-overload]
    back, again, _ = cv2.calcOpticalFlowPyrLK(other, one, there, None)  # type: ignore[call-overload]
    good = (found[:, 0] == 1) & (again[:, 0] == 1) & (np.linalg.norm((back - corners)[:, 0], axis=1) < _BACK)
    return corners[good, 0].astype(np.float64), there[good, 0].astype(np.float64)

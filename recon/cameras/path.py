"""The path over minutes: loops closed, bent between windows and never inside one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recon.cameras.join import keyframes_every
from recon.cameras.places import Seen, places_seen_again
from recon.cameras.submaps import WHOLE
from recon.recording import Recording
from twin.runs.keys import Stage
from twin.scene import Trajectory

LOOPS = Stage("loops", 2, ())
PATH = Stage("path", 3, ())
# s between two views of a place that make a loop: less is odometry's own.
_LATER_S = 8.0
# m and rad by which odometry may be off after a loop, and their growth with the way: what contradicts it by
# more is another place that looks alike.
_OFF_M, _OFF_SHARE = 0.08, 0.02
_OFF_RAD = float(np.radians(4.0))


def find_loops(recording: Recording, cameras: Trajectory) -> tuple[Seen, ...]:
    """Places seen again, as far as the path may be off; a recording of one submap has none."""
    if len(recording) <= WHOLE:
        return ()
    keys = keyframes_every(recording, cameras.frames)
    seconds = np.asarray(recording.times)[[k.frame for k in keys]]
    rows = np.searchsorted(cameras.frames, [k.frame for k in keys])
    poses = cameras.T_world_cam
    centres = poses[:, :3, 3]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(centres, axis=0), axis=1))])[rows]
    apart = np.abs(seconds[:, None] - seconds) > _LATER_S
    row = {k.frame: int(r) for k, r in zip(keys, rows, strict=True)}
    allowance = {k.frame: float(w) for k, w in zip(keys, way, strict=True)}
    loops = []
    for seen in places_seen_again(keys, apart, recording.intrinsics):
        expected = np.linalg.inv(poses[row[seen.a]]) @ poses[row[seen.b]]
        off = np.linalg.inv(expected) @ seen.T_a_b
        far = _OFF_M + _OFF_SHARE * abs(allowance[seen.b] - allowance[seen.a])
        turn = np.arccos(np.clip((np.trace(off[:3, :3]) - 1) / 2, -1, 1))
        if np.linalg.norm(off[:3, 3]) < far and turn < _OFF_RAD:
            loops.append(seen)
    return tuple(loops)


def close_loops(cameras: Trajectory, loops: Sequence[Seen], rigid: Sequence[tuple[int, int]]) -> Trajectory:
    """The cameras with loops closed, the first one held. rigid: first and last frames of what stays rigid."""
    if not loops:
        return cameras
    from recon.cameras.graph import bent  # gtsam takes time to import

    return replace(cameras, T_world_cam=bent(cameras.frames, cameras.T_world_cam, loops, rigid))

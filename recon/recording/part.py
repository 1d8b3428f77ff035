"""A recording of some frames of another one."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Trajectory

if TYPE_CHECKING:
    from recon.recording import Recording


MIN_FRAMES = 10  # chosen by us: rest, motion and rest again need a few frames each


def part_of(recording: Recording, index: slice) -> Recording:
    """A recording of the frames of a slice, read from `recording` if asked. Its first frame is frame 0.

    Known poses and gravity come along; gravity is turned to the new first camera by poses, or dropped.
    """
    kept = np.arange(len(recording))[index]
    if index.step is not None and index.step < 0:
        raise InputError(
            f"a slice with step {index.step} turns time around", "slice forwards; times must increase"
        )
    said = ":".join("" if v is None else str(v) for v in (index.start, index.stop, index.step)).removesuffix(
        ":"
    )
    return of_frames(recording, kept, f"{recording.source}[{said}]")


def of_frames(recording: Recording, kept: NDArray[np.int64], source: str) -> Recording:
    """A recording of frames of another one, by their rising numbers (n,). source: what messages call it."""
    poses = None if recording.poses is None else _poses_of(recording.poses, kept, recording.times)
    gravity, notes = recording.gravity_camera0, recording.warnings
    if gravity is not None and len(kept) and kept[0] != 0:
        first, now = (None if recording.poses is None else recording.poses.pose(int(k)) for k in (0, kept[0]))
        if first is None or now is None:
            gravity = None
            notes = (
                *notes,
                f"gravity was known in frame 0 only, and frame {kept[0]} has no known pose: estimating it",
            )
        else:
            gravity = geo.unit(now[:3, :3].T @ first[:3, :3] @ gravity)
    digest = hashlib.sha256(recording.fingerprint.encode() + kept.astype("<i8").tobytes())
    return replace(
        recording,
        source=source,
        times=recording.times[kept],
        read_color=lambda k: recording.color(int(kept[k])),
        read_depth=lambda k: recording.depth(int(kept[k])),
        fingerprint=digest.hexdigest(),
        poses=poses,
        gravity_camera0=gravity,
        warnings=notes,
        path=None,
        opened_with={},
    )


def _poses_of(poses: Trajectory, kept: NDArray[np.int64], times: Array) -> Trajectory | None:
    rows = np.flatnonzero(np.isin(poses.frames, kept))
    if len(rows) == 0:
        return None
    return Trajectory(
        np.searchsorted(kept, poses.frames[rows]), times[poses.frames[rows]], poses.T_world_cam[rows]
    )

"""The part's tracks that are a witness of its joint: a leading hand goes along and turns about the handle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import look_up
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.found import PartTracks
from recon.recording import Intrinsics
from twin import geometry as geo
from twin.scene import HAND_LABEL, Trajectory


def without_hand(
    tracks: PartTracks,
    movers: Movers,
    camera: Intrinsics,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
) -> PartTracks:
    """Those tracks of a part that are labelled hand in no more frames than they are labelled part."""
    members = np.flatnonzero(tracks.members)
    more = np.zeros(len(members), np.int64)
    row = {int(f): k for k, f in enumerate(cameras.frames)}
    for frame in (f for f in labels if f in row):
        T_cam_world = geo.invert_pose(cameras.T_world_cam[row[frame]])
        points = geo.transform(T_cam_world, movers.points_world[frame, members])
        shown = look_up(labels[frame].astype(np.float32), camera, points)
        seen = shown.inside & movers.visible[frame, members]
        more += (seen & (shown.z == HAND_LABEL)).astype(np.int64) - (seen & (shown.z == tracks.part.id))
    own = tracks.members.copy()
    own[members[more > 0]] = False
    return replace(tracks, members=own)

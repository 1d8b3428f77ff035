"""Tracks and cameras of a recording: of a clip as one, of minutes in stretches that are stored one by one.

A stretch's key is what it reads: its own frames, and the corners that come into it. A minute appended to a
recording leaves those before it as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.cameras.poses import CAMERAS, SUBMAPS, camera_poses, submap_poses
from recon.cameras.submaps import Piece, regular_spans, solve_pieces
from recon.recording import Recording
from recon.recording.contents import content_of
from recon.stages.ahead import solve_ahead
from recon.tracking.follow import CORNERS, TRACKS, Stretch, follow, track_points, tracks_of
from recon.tracking.tracks import SparseTracks
from twin.geometry import Array
from twin.runs.chain import Chain
from twin.runs.keys import Content
from twin.runs.stages import StageResult
from twin.scene import Trajectory

# Frames of a stretch of tracks: what a killed run loses of them.
STRETCH = 180


def odometry(
    stage: Chain, recording: Recording, contents: StageResult[NDArray[np.uint8]] | None
) -> tuple[StageResult[SparseTracks], StageResult[Trajectory]]:
    """Sparse 3D tracks and camera poses. contents: digests of the frames; None of a clip.

    Camera poses in spite of hands and moving parts: FunREC, supplement 1.2. Tracks are without weights; the
    paper's tracker is learned.
    """
    c, loop = stage.config, stage.run.loop
    if contents is None:
        tracks = stage(TRACKS, [], lambda: track_points(recording, c.tracks, loop("tracks")))
        return tracks, stage(
            CAMERAS, [tracks], lambda: camera_poses(recording, tracks.value, c.cameras, loop("cameras"))
        )
    tracks = _tracks(stage, recording, contents.value)
    if c.cameras.use_known_poses:
        return tracks, stage(CAMERAS, [tracks], lambda: camera_poses(recording, tracks.value, c.cameras))
    pieces, submaps = _pieces(stage, recording, contents, tracks)
    cameras = stage(
        CAMERAS,
        [tracks, *submaps],
        lambda: camera_poses(recording, tracks.value, c.cameras, pieces=pieces),
    )
    stage.run.forget(submaps)
    return tracks, cameras


def _tracks(stage: Chain, recording: Recording, digests: NDArray[np.uint8]) -> StageResult[SparseTracks]:
    config = stage.config.tracks
    found: list[StageResult[Stretch]] = []
    for first in range(0, len(recording), STRETCH):
        last = min(first + STRETCH, len(recording)) - 1
        before = found[-1].value.live if found else None
        found.append(
            replace(stage, source=content_of(recording, digests, first, last))(
                CORNERS,
                found[-1:],
                lambda: follow(recording, first, last, before, config=config),  # noqa: B023 (called at once)
                item=f"{first:06d}-{last:06d}",
            )
        )
        stage.run.report("corners", (last + 1) / len(recording), "frames")
    tracks = stage(TRACKS, found, lambda: tracks_of(recording, [s.value for s in found], config))
    stage.run.forget(found)
    return tracks


def _pieces(
    stage: Chain,
    recording: Recording,
    contents: StageResult[NDArray[np.uint8]],
    tracks: StageResult[SparseTracks],
) -> tuple[tuple[Piece, ...], list[StageResult[Any]]]:
    """The path in pieces that hang together, and the results of the submaps."""
    reads, count = (contents, tracks), len(recording)
    solve_ahead(stage, recording, reads, _submap, regular_spans(count), "submaps")
    solved: list[StageResult[Any]] = []

    def solve(first: int, last: int) -> tuple[Array, NDArray[np.bool_]]:
        submap = _submap(stage, recording, reads, (first, last))
        solved.append(submap)
        stage.run.report("submaps", (last + 1) / count, "frames")
        poses, posed = submap.value
        return poses, posed

    return solve_pieces(count, solve, np.asarray(recording.times)), solved


def _submap(
    stage: Chain, recording: Recording, reads: Sequence[StageResult[Any]], span: tuple[int, int]
) -> StageResult[Any]:
    """Poses of the frames of a span, first and last. reads: digests of the frames, and the tracks."""
    (first, last), digests, tracks = span, reads[0].value, reads[1].value
    return replace(stage, source=content_of(recording, digests, first, last))(
        SUBMAPS,
        [Content("tracks", tracks.content(first, last))],
        lambda: submap_poses(recording[first : last + 1], tracks.dense(first, last)),
        item=f"{first:06d}-{last:06d}",
    )

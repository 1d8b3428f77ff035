"""Today's chain for one window: movers, joints, parts, labels, refinement, with the cameras of the map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.dense.noise import DepthNoise
from recon.interaction.joints.type_selection import TypeHint
from recon.interaction.labels.label_frames import LABELS, label_frames
from recon.interaction.parts.find_parts import MOTION, FoundParts, find_parts
from recon.interaction.parts.moving_part import MovingPart
from recon.interaction.refine.refine_parts import POLISH, REFINE, polish_parts, refine_found
from recon.recording import Recording
from recon.recording.depth_cache import with_cached_depth
from recon.recording.said import Said
from recon.tracking.tracks import SparseTracks
from recon.windows.windows import Window
from twin.runs.chain import Chain
from twin.runs.stages import StageResult
from twin.scene import Trajectory


@dataclass(frozen=True, eq=False)
class Interaction:
    """What one window shows. Its frames count from 0, the window's first; its world is that of the cameras.

    found: movers, tracks on the hand, parts by tracks. parts: those of `found`, refined. labels: label images
    (H, W) of some frames.
    """

    window: Window
    found: FoundParts
    parts: tuple[MovingPart, ...]
    labels: Mapping[int, NDArray[np.uint8]]


@dataclass(frozen=True, eq=False)
class Observed:
    """What all windows share: the recording, its tracks, its cameras and the noise of its depth."""

    recording: Recording
    tracks: StageResult[SparseTracks]
    cameras: StageResult[Trajectory]
    noise: StageResult[DepthNoise]


def frames_of(recording: Recording, window: Window) -> Recording:
    """The recording of a window's frames; the same one where these are all."""
    if window.is_whole(recording):
        return recording
    return with_cached_depth(recording[window.frames])


def cameras_of(cameras: Trajectory, window: Window) -> Trajectory:
    """The cameras of a window's frames, which count from 0."""
    inside = (cameras.frames >= window.first) & (cameras.frames <= window.last)
    return Trajectory(
        cameras.frames[inside] - window.first, cameras.times[inside], cameras.T_world_cam[inside]
    )


def during(part: MovingPart, window: Window) -> MovingPart:
    """A part in the frames of a window, which count from 0."""
    motion, first = part.motion, window.first
    inside = (motion.frames >= first) & (motion.frames <= window.last)
    if not first and inside.all():
        return part
    spans = tuple((a - first, b - first) for a, b in motion.intervals if first <= a and b <= window.last)
    cut = replace(
        motion,
        frames=motion.frames[inside] - first,
        times=motion.times[inside],
        state=motion.state[inside],
        intervals=spans,
    )
    return replace(part, motion=cut, windows=())


def interact(
    stage: Chain, seen: Observed, window: Window, hints: Sequence[TypeHint], said: Said, *, only: bool
) -> tuple[Interaction, tuple[StageResult[Any], ...]]:
    """The parts of one window, and the stages' results that they come from: motion, refine, labels, polish.

    only: whether the recording has no other window.
    """
    c, loop, item = stage.config, stage.run.loop, "" if only else window.name
    recording, cameras = seen.recording, seen.cameras.value
    if not only:
        recording, cameras = frames_of(recording, window), cameras_of(cameras, window)
    sigma, of_parts = seen.noise.value, said.of_parts
    # Motion clustering, the joint of each part and its states (supplement 1.1 and 1.4).
    found = stage(
        MOTION,
        [seen.tracks, seen.cameras],
        lambda: find_parts(
            recording,
            seen.tracks.value.dense(window.first, window.last),
            cameras,
            c.motion,
            c.joints,
            hints,
            said,
        ),
        *([hints] if hints else []),
        *([of_parts] if of_parts is not None else []),
        item=item,
    )
    refined = stage(
        REFINE,
        [seen.cameras, found, seen.noise],
        lambda: refine_found(recording, cameras, found.value, c.labels, sigma, loop("refine")),
        item=item,
    )
    # Pixel-aligned part segmentation (supplement 1.3).
    labels = stage(
        LABELS,
        [seen.cameras, refined, seen.noise],
        lambda: label_frames(recording, cameras, refined.value, c.labels, sigma, progress=loop("labels")),
        item=item,
    )
    polished = stage(
        POLISH,
        [seen.cameras, found, refined, labels, seen.noise],
        lambda: polish_parts(recording, cameras, labels.value, found.value, refined.value, sigma),
        item=item,
    )
    whole = Interaction(window, found.value, polished.value, labels.value)
    return whole, (found, refined, labels, polished)

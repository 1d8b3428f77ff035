"""Today's chain for one window: movers, joints, parts, labels, refinement, with the cameras of the map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.dense.noise import DepthNoise, measure_noise
from recon.interaction.joints.type_selection import TypeHint
from recon.interaction.labels.label_frames import LABELS, label_frames
from recon.interaction.parts.find_parts import MOTION, FoundParts, PartTracks, find_parts
from recon.interaction.parts.moving_part import MovingPart
from recon.interaction.parts.words import SAID, hints_of, with_words
from recon.interaction.refine.refine_parts import POLISH, REFINE, polish_parts, refine_found
from recon.recording import Recording
from recon.recording.contents import content_of
from recon.recording.said import Said
from recon.tracking.tracks import SparseTracks, Tracks
from recon.windows.windows import Window
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.chain import Chain
from twin.runs.keys import Stage, digest
from twin.runs.manifest import AGAIN
from twin.runs.stages import StageResult
from twin.scene import Trajectory

OWN_NOISE = Stage("window_noise", 1, ())
FOUND_AGAIN = Stage("found_again", 2, ())


@dataclass(frozen=True, eq=False)
class Interaction:
    """What one window shows. Its frames count from 0, the window's first; its world is that of the cameras.

    found: movers, and parts by tracks. parts: those of `found`, refined. labels: label images (H, W) of some
    frames.
    """

    window: Window
    found: FoundParts
    parts: tuple[MovingPart, ...]
    labels: Mapping[int, NDArray[np.uint8]]

    def moved(self, T: Array) -> Interaction:
        """The same in a world into which T (4, 4) brings this one's points."""
        movers = replace(self.found.movers, points_world=geo.transform(T, self.found.movers.points_world))
        tracks = tuple(replace(t, part=t.part.moved(T)) for t in self.found.parts)
        found = replace(self.found, movers=movers, parts=tracks)
        return replace(self, found=found, parts=tuple(p.moved(T) for p in self.parts))


@dataclass(frozen=True, eq=False)
class Observed:
    """What all windows share: the recording, its tracks, its cameras by odometry, the noise of its depth, and
    digests of its frames; None of a clip, which is one window."""

    recording: Recording
    tracks: StageResult[SparseTracks]
    cameras: StageResult[Trajectory]
    noise: StageResult[DepthNoise]
    contents: StageResult[NDArray[np.uint8]] | None = None


@dataclass(frozen=True, eq=False)
class _Local:
    """One window: its stages, its frames, its cameras, the noise of its depth, and what its stages read."""

    stage: Chain
    recording: Recording
    cameras: Trajectory
    noise: StageResult[DepthNoise]
    reads: tuple[StageResult[Any], ...]
    tracks: tuple[StageResult[Any], ...]
    item: str


def frames_of(recording: Recording, window: Window) -> Recording:
    """The recording of a window's frames; the same one where these are all."""
    if window.is_whole(recording):
        return recording
    return recording[window.frames]


def cameras_of(cameras: Trajectory, window: Window) -> Trajectory:
    """The cameras of a window's frames, which count from 0."""
    inside = (cameras.frames >= window.first) & (cameras.frames <= window.last)
    return Trajectory(
        cameras.frames[inside] - window.first, cameras.times[inside], cameras.T_world_cam[inside]
    )


def frame_of(cameras: Trajectory, window: Window) -> Array:
    """Pose (4, 4) of a window's own frame: its first posed camera."""
    inside = np.flatnonzero((cameras.frames >= window.first) & (cameras.frames <= window.last))
    return cameras.T_world_cam[inside[0]] if len(inside) else np.eye(4)


def during(part: MovingPart, window: Window) -> MovingPart:
    """A part in the frames of a window, which count from 0."""
    motion, first = part.motion, window.first
    inside = (motion.frames >= first) & (motion.frames <= window.last)
    carrier = None if part.carrier is None else during(part.carrier, window)
    if not first and inside.all() and carrier is None:
        return part
    spans = tuple((a - first, b - first) for a, b in motion.intervals if first <= a and b <= window.last)
    cut = replace(
        motion,
        frames=motion.frames[inside] - first,
        times=motion.times[inside],
        state=motion.state[inside],
        intervals=spans,
    )
    return replace(part, motion=cut, windows=(), carrier=carrier)


def _local(stage: Chain, seen: Observed, window: Window, item: str) -> _Local:
    """A clip as it is; a window of minutes in its own frame, keyed by what it holds."""
    if seen.contents is None:
        shared = (seen.cameras, seen.noise)
        return _Local(
            stage, seen.recording, seen.cameras.value, seen.noise, shared, (seen.tracks, seen.cameras), ""
        )
    recording, cameras = frames_of(seen.recording, window), cameras_of(seen.cameras.value, window)
    cameras = cameras.transformed(geo.invert_pose(frame_of(seen.cameras.value, window)))
    source = digest(
        content_of(seen.recording, seen.contents.value, window.first, window.last),
        seen.tracks.value.content(window.first, window.last),
        cameras.frames,
        cameras.T_world_cam,
    )
    own = replace(stage, source=source)
    noise = own(OWN_NOISE, [], lambda: measure_noise(recording, cameras), item=item)
    return _Local(own, recording, cameras, noise, (noise,), (), item)


def interact(
    stage: Chain, seen: Observed, window: Window, hints: Sequence[TypeHint], said: Said
) -> tuple[Interaction, tuple[StageResult[Any], ...]]:
    """The parts of one window, and the stages' results that they come from: motion or said, refine, labels,
    polish.

    The window of a clip has the world of its cameras, one of minutes its own: that of its first camera.
    """
    c = stage.config
    of = _local(stage, seen, window, window.name)
    expected = hints_of(said.type, hints)

    def dense() -> Tracks:
        return seen.tracks.value.dense(window.first, window.last)

    # Motion clustering, the joint of each part and its states (supplement 1.1 and 1.4).
    found = of.stage(
        MOTION,
        of.tracks,
        lambda: find_parts(of.recording, dense(), of.cameras, c.motion, c.joints, expected),
        *([expected] if expected else []),
        item=of.item,
    )
    # Those that the user points at, which need not be found without.
    if said.parts:
        unsaid = found.value
        found = of.stage(
            SAID,
            [found, *of.tracks],
            lambda: with_words(of.recording, dense(), of.cameras, unsaid, c.joints, hints, said),
            replace(said, up=None),
            *([hints] if hints else []),
            item=of.item,
        )
    return _solved(of, window, found)


def interact_again(
    stage: Chain, seen: Observed, window: Window, found: FoundParts
) -> tuple[Interaction, tuple[StageResult[Any], ...]]:
    """The same with parts that other windows found beside its own ones, in the world of the window."""
    of = _local(stage, seen, window, f"{window.name}{AGAIN}")
    again = of.stage(FOUND_AGAIN, of.tracks, lambda: found, digest(*map(_digest, found.parts)), item=of.item)
    return _solved(of, window, again)


def _digest(tracks: PartTracks) -> str:
    joint, motion = tracks.part.joint, tracks.part.motion
    pose = joint.poses(np.array([0.0, 1.0]))
    return digest(joint.kind, pose, motion.frames, motion.state, tracks.members, tracks.type_source)


def _solved(
    of: _Local, window: Window, found: StageResult[FoundParts]
) -> tuple[Interaction, tuple[StageResult[Any], ...]]:
    """What follows from the parts found: labels, refined joints and states."""
    recording, cameras, item, reads, sigma = of.recording, of.cameras, of.item, of.reads, of.noise.value
    c, loop = of.stage.config, of.stage.run.loop
    refined = of.stage(
        REFINE,
        [found, *reads],
        lambda: refine_found(recording, cameras, found.value, c.labels, sigma, loop("refine")),
        item=item,
    )
    # Pixel-aligned part segmentation (supplement 1.3).
    labels = of.stage(
        LABELS,
        [refined, *reads],
        lambda: label_frames(recording, cameras, refined.value, c.labels, sigma, progress=loop("labels")),
        item=item,
    )
    polished = of.stage(
        POLISH,
        [found, refined, labels, *reads],
        lambda: polish_parts(recording, cameras, labels.value, found.value, refined.value, sigma),
        item=item,
    )
    whole = Interaction(window, found.value, polished.value, labels.value)
    return whole, (found, refined, labels, polished)

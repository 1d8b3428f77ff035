"""Our chain on one clip, step by step, and what a method answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.poses import Fitted
from recon.cameras.gravity import upright
from recon.cameras.poses import camera_poses
from recon.config import ReconConfig
from recon.contact.finish_parts import finish_parts
from recon.dense.noise import DepthNoise, measure_noise
from recon.fusion.fuse import fuse
from recon.interaction.interaction import Interaction
from recon.interaction.labels.label_frames import label_frames
from recon.interaction.parts.find_parts import find_parts
from recon.interaction.parts.found import FoundParts
from recon.interaction.parts.moving_part import MovingPart
from recon.interaction.refine.refine_parts import polish_parts, refine_found
from recon.recording import Recording
from recon.tracking.follow import track_points
from recon.tracking.tracks import Tracks
from recon.verdict.judge import judge
from recon.windows.windows import Window
from twin.geometry import Array
from twin.scene import Motion, Trajectory

Labels = Mapping[int, NDArray[np.uint8]]


@dataclass(frozen=True, eq=False)
class Seen:
    """What all methods share: the recording, our tracks, cameras and noise of its depth."""

    recording: Recording
    tracks: Tracks
    cameras: Trajectory
    noise: DepthNoise

    @classmethod
    def of(cls, recording: Recording) -> Seen:
        tracks = track_points(recording)
        cameras = upright(recording, camera_poses(recording, tracks))
        return cls(recording, tracks.dense(), cameras, measure_noise(recording, cameras))


@dataclass(frozen=True, eq=False)
class Answer:
    """Parts that a method found, their labels, and, where it has free poses in place of states, those of its
    one part: frames (n,) and T_world_part (n, 4, 4). cameras: those that it used."""

    parts: tuple[MovingPart, ...]
    labels: Labels | None
    cameras: Trajectory
    free: tuple[NDArray[np.int64], Array] | None = None


@lru_cache(maxsize=1)
def ours(seen: Seen) -> Answer:
    """Motion, refinement, labels, polish; a part is told whatever the verdict says."""
    return solved(seen, found_parts(seen))


@lru_cache(maxsize=1)
def found_parts(seen: Seen) -> FoundParts:
    """Parts by our motion stage as it is, which several methods share."""
    return find_parts(seen.recording, seen.tracks, seen.cameras)


def solved(seen: Seen, found: FoundParts) -> Answer:
    """What follows from the parts found."""
    recording, cameras, config = seen.recording, seen.cameras, ReconConfig()
    refined = refine_found(recording, cameras, found, config.labels, seen.noise)
    labels = label_frames(recording, cameras, refined, config.labels, seen.noise)
    parts = polish_parts(recording, cameras, labels, found, refined, seen.noise)
    return Answer(parts, labels, cameras)


def delivered(seen: Seen) -> Answer:
    """The same without the parts that the verdict refuses: what a user gets."""
    config, recording = ReconConfig(), seen.recording
    answer, found = ours(seen), found_parts(seen)
    labels = answer.labels or {}
    whole = Window(0, len(recording) - 1, None)
    interactions = (Interaction(whole, found, answer.parts, labels),)
    scene = fuse(recording, seen.cameras, labels, answer.parts, config.fusion, seen.noise)
    sources = {t.part.id: t.type_source for t in found.parts}
    finished = finish_parts(recording, seen.cameras, labels, sources, answer.parts, scene, config.contact)
    told = judge(recording, seen.cameras, labels, interactions, answer.parts, scene, finished)
    kept = tuple(p for p in answer.parts if told.parts[p.id].level != "refused")
    return replace(answer, parts=kept)


def part_of(
    fit: Fitted, frames: NDArray[np.int64], seen: Seen, spans: tuple[tuple[int, int], ...] = ()
) -> MovingPart:
    """A moving part of a joint and its states in some frames; between them, and beyond, the nearest ones'."""
    every = seen.cameras.frames
    state = np.interp(every, frames, fit.state)
    motion = Motion(every, seen.recording.times[every], state, spans, 0.0, 1.0)
    return MovingPart(2, fit.joint, motion)


def labelled(seen: Seen, parts: tuple[MovingPart, ...]) -> Answer:
    config = ReconConfig().labels
    labels = label_frames(seen.recording, seen.cameras, parts, config, seen.noise) if parts else {}
    return Answer(parts, labels, seen.cameras)

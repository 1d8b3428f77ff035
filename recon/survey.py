"""The stages from the recording to the surfaces, in a world whose z is up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from recon.cameras.gravity import GRAVITY, upright
from recon.cameras.poses import CAMERAS, camera_poses
from recon.contact.up.decide import UP, Upright, World, find_up, turned
from recon.dense.noise import NOISE, DepthNoise, measure_noise
from recon.fusion.fuse import FUSION, fuse
from recon.joints.type_selection import TypeHint
from recon.labels.label_frames import LABELS, label_frames
from recon.parts.find_parts import MOTION, FoundParts, find_parts
from recon.parts.moving_part import MovingPart
from recon.recording import Recording
from recon.refine.refine_parts import POLISH, REFINE, polish_parts, refine_found
from recon.tracking.tracks import TRACKS, track_points
from twin.runs.chain import Chain
from twin.runs.stages import StageResult
from twin.scene import Trajectory

T = TypeVar("T")

# Seconds of stages on two cores, for the time left (benchmarks/speed.md, texture a third). Only ratios count.


@dataclass(frozen=True, eq=False)
class Surveyed:
    """What the stages up to the surfaces leave: the world, turned upright, and what it was read from.

    reads: the results that the world comes from. doubts: texts about its up.
    """

    world: World
    upright: Upright
    noise: StageResult[DepthNoise]
    labels: StageResult[dict[int, NDArray[np.uint8]]]
    reads: tuple[StageResult[Any], ...]
    doubts: tuple[str, ...]


def survey(stage: Chain, recording: Recording, hints: Sequence[TypeHint] = ()) -> Surveyed:
    """The stages from the recording to the surfaces of static scene and parts, in a world whose z is up."""
    c, loop = stage.config, stage.run.loop
    # Sparse 3D tracks, without weights; the paper's tracker is learned.
    tracks = stage(TRACKS, [], lambda: track_points(recording, c.tracks, loop("tracks")))
    # Camera poses in spite of hands and moving parts (FunREC, supplement 1.2).
    cameras = stage(
        CAMERAS, [tracks], lambda: camera_poses(recording, tracks.value, c.cameras, loop("cameras"))
    )
    said, of_parts = c.said, c.said.of_parts  # they join the keys only where something is said
    guessed = stage(
        GRAVITY,
        [cameras],
        lambda: upright(recording, cameras.value, said.up),
        *([said.up] if said.up is not None else []),
    )
    # Motion clustering, the joint of each part and its states (supplement 1.1 and 1.4).
    found = stage(
        MOTION,
        [tracks, guessed],
        lambda: find_parts(recording, tracks.value, guessed.value, c.motion, c.joints, hints, said),
        *([hints] if hints else []),
        *([of_parts] if of_parts is not None else []),
    )
    # How far depth scatters in this recording: refinement, labels and fusion assume no sensor.
    noise = stage(NOISE, [cameras], lambda: measure_noise(recording, cameras.value))
    sigma = noise.value
    refined = stage(
        REFINE,
        [guessed, found, noise],
        lambda: refine_found(recording, guessed.value, found.value, c.labels, sigma, loop("refine")),
    )
    # Pixel-aligned part segmentation (supplement 1.3).
    labels = stage(
        LABELS,
        [guessed, refined, noise],
        lambda: label_frames(
            recording, guessed.value, refined.value, c.labels, sigma, progress=loop("labels")
        ),
    )
    polished = stage(
        POLISH,
        [guessed, found, refined, labels, noise],
        lambda: polish_parts(recording, guessed.value, labels.value, found.value, refined.value, sigma),
    )
    return _upright(stage, recording, guessed, found, noise, labels, polished)


def _upright(
    stage: Chain,
    recording: Recording,
    guessed: StageResult[Trajectory],
    found: StageResult[FoundParts],
    noise: StageResult[DepthNoise],
    labels: StageResult[dict[int, NDArray[np.uint8]]],
    polished: StageResult[tuple[MovingPart, ...]],
) -> Surveyed:
    """The surfaces, and up by all that is known of the world."""
    c, loop, cameras, images, parts = (
        stage.config,
        stage.run.loop,
        guessed.value,
        labels.value,
        polished.value,
    )
    # Truncated signed distances of the static scene and of each part.
    fused = stage(
        FUSION,
        [guessed, polished, labels, noise],
        lambda: fuse(recording, cameras, images, parts, c.fusion, noise.value, progress=loop("fusion")),
    )
    world = World(cameras, found.value, parts, fused.value)
    up = stage(
        UP,
        [guessed, found, labels, polished, fused],
        lambda: find_up(recording, world, images, c.said),
    )
    doubt = up.value.doubt
    doubts = guessed.warnings if doubt is None else (f"{doubt.text}; {doubt.help}",)
    reads = (guessed, found, polished, fused, up)
    return Surveyed(turned(world, up.value.up), up.value, noise, labels, reads, doubts)

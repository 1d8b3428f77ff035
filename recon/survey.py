"""The stages from the recording to the surfaces, in a world whose z is up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from recon.cameras.gravity import GRAVITY, upright
from recon.cameras.path import PATH, close_loops
from recon.cameras.poses import CAMERAS, camera_poses
from recon.contact.up.decide import UP, Upright, World, find_up, turned
from recon.dense.noise import NOISE, DepthNoise, measure_noise
from recon.fusion.fuse import FUSION, fuse
from recon.interaction.ahead import solve_ahead
from recon.interaction.interaction import Interaction, Observed, interact
from recon.interaction.joints.type_selection import TypeHint
from recon.merge.merge import MERGE, as_merged, merge
from recon.merge.relabel import all_labels
from recon.recording import Recording
from recon.tracking.tracks import TRACKS, track_points
from recon.windows.said_windows import said_windows
from recon.windows.windows import WINDOWS, apart, find_windows
from twin.runs.chain import Chain
from twin.runs.stages import StageResult

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Surveyed:
    """What the stages up to the surfaces leave: the world, turned upright, and what it was read from.

    reads: the results that the world comes from. doubts: texts about its up.
    """

    world: World
    upright: Upright
    noise: StageResult[DepthNoise]
    labels: Mapping[int, NDArray[np.uint8]]
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
    said = c.said  # it joins the keys only where something is said
    guessed = stage(
        GRAVITY,
        [cameras],
        lambda: upright(recording, cameras.value, said.up),
        *([said.up] if said.up is not None else []),
    )
    # How far depth scatters in this recording: windows, refinement, labels and fusion assume no sensor.
    noise = stage(NOISE, [cameras], lambda: measure_noise(recording, cameras.value))
    # Where something is handled: each time in a window of its own.
    found_windows = stage(
        WINDOWS,
        [guessed, noise],
        lambda: find_windows(recording, guessed.value, noise.value, loop("windows")),
    )
    windows = found_windows.value
    rigid = apart(windows)
    path = stage(PATH, [guessed, found_windows], lambda: close_loops(recording, guessed.value, rigid))
    seen, solved = Observed(recording, tracks, path, noise), []
    only = len(windows) == 1 and windows[0].is_whole(recording)
    times = np.asarray(recording.times)
    told = [(windows[0], said)] if only else said_windows(windows, said, times)
    solve_ahead(stage, seen, told, hints)
    for window, word in told:
        solved.append(interact(stage, seen, window, hints, word, only=only))
    results = [r for _, of_window in solved for r in of_window]
    return _upright(stage, seen, [i for i, _ in solved], results, guessed.warnings)


def _upright(
    stage: Chain,
    seen: Observed,
    interactions: Sequence[Interaction],
    results: Sequence[StageResult[Any]],
    doubts: Sequence[str],
) -> Surveyed:
    """One scene of all interactions, its surfaces, and up by all that is known of the world.

    results: of the stages that the interactions come from. doubts: about the first guess of up.
    """
    c, loop, recording, guessed, noise = (
        stage.config,
        stage.run.loop,
        seen.recording,
        seen.cameras,
        seen.noise,
    )
    cameras = guessed.value
    # One part of several interactions, its states over the whole recording.
    merged = stage(MERGE, [guessed, *results], lambda: merge(recording, cameras, interactions))
    parts = merged.value.parts
    of_parts = tuple(as_merged(i, k, merged.value) for k, i in enumerate(interactions))
    images = all_labels(recording, cameras, of_parts, merged.value)
    # Truncated signed distances of the static scene and of each part.
    fused = stage(
        FUSION,
        [guessed, *results, merged, noise],
        lambda: fuse(recording, cameras, images, parts, c.fusion, noise.value, progress=loop("fusion")),
    )
    world = World(cameras, of_parts, parts, fused.value)
    up = stage(
        UP,
        [guessed, *results, merged, fused],
        lambda: find_up(recording, world, images, c.said),
    )
    doubt = up.value.doubt
    told = tuple(doubts) if doubt is None else (f"{doubt.text}; {doubt.help}",)
    reads = (guessed, *results, merged, fused, up)
    return Surveyed(turned(world, up.value.up), up.value, noise, images, reads, told)

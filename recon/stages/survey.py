"""The stages from the recording to the surfaces, in a world whose z is up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from recon.cameras.gravity import GRAVITY, upright
from recon.cameras.path import LOOPS, PATH, close_loops, find_loops
from recon.contact.up.decide import UP, Upright, World, find_up, turned
from recon.dense.noise import NOISE, DepthNoise, measure_noise
from recon.fusion.fuse import FUSION, fuse
from recon.interaction.interaction import Interaction, Observed, frame_of, interact, interact_again
from recon.interaction.joints.type_selection import TypeHint
from recon.interaction.parts.found import FoundParts
from recon.merge.merge import MERGE, Merged, as_merged, merge
from recon.merge.recall import RECALL, found_again, recall
from recon.merge.relabel import all_labels
from recon.recording import Recording
from recon.recording.contents import FRAMES, frame_digests
from recon.recording.said import Said
from recon.stages.ahead import solve_ahead
from recon.stages.odometry import odometry
from recon.windows.said_windows import said_windows
from recon.windows.windows import WINDOWS, Window, apart, find_windows, is_long
from twin.runs.chain import Chain
from twin.runs.stages import StageResult
from twin.scene import Trajectory

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
    loop = stage.run.loop
    contents = None
    if is_long(recording):
        contents = stage(FRAMES, [], lambda: frame_digests(recording, loop("frames")))
    tracks, cameras = odometry(stage, recording, contents)
    said = stage.config.said  # it joins the keys only where something is said
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
    windows, times = found_windows.value, np.asarray(recording.times)
    told = [(w, said) for w in windows] if contents is None else said_windows(windows, said, times)
    rigid = apart(sorted({*windows, *(w for w, _ in told)}, key=lambda w: w.first))
    loops = stage(LOOPS, [guessed], lambda: find_loops(recording, guessed.value))
    path = stage(
        PATH,
        [guessed, found_windows, loops],
        lambda: close_loops(guessed.value, loops.value, rigid),
        *([rigid] if rigid != apart(windows) else []),
    )
    seen = Observed(recording, tracks, path if contents is None else cameras, noise, contents)
    if contents is not None:
        shared = (tracks, cameras, noise, contents)
        longest_first = sorted(told, key=lambda t: t[0].first - t[0].last)
        solve_ahead(stage, recording, shared, partial(_one_window, hints), longest_first, "interactions")
    local: list[Interaction] = []  # each in its own world
    results: list[tuple[StageResult[Any], ...]] = []
    for k, (window, word) in enumerate(told):
        interaction, of_window = interact(stage, seen, window, hints, word)
        local.append(interaction)
        results.append(of_window)
        if contents is not None:
            stage.run.report("interactions", (k + 1) / len(told), f"of {len(told)}")
    first = None
    if contents is not None:
        held = [k for k, (_, word) in enumerate(told) if word.parts]
        local, results, first = _again(stage, seen, path, local, results, held)
    solved = local if contents is None else _in_world(local, path.value)
    return _upright(stage, seen, path, solved, [r for rs in results for r in rs], guessed.warnings, first)


def _in_world(local: Sequence[Interaction], path: Trajectory) -> list[Interaction]:
    """Interactions of windows, each in its own world, in that of the path."""
    return [i.moved(frame_of(path, i.window)) for i in local]


def _again(
    stage: Chain,
    seen: Observed,
    path: StageResult[Trajectory],
    local: list[Interaction],
    results: list[tuple[StageResult[Any], ...]],
    held: Sequence[int],
) -> tuple[list[Interaction], list[tuple[StageResult[Any], ...]], Merged | None]:
    """The interactions, those solved again in which a part moves that only others found, and their results;
    all merged if none was solved again. held: those of which the user says what moves in them; it holds."""
    recalled = stage(
        RECALL,
        [path, *(r for rs in results for r in rs)],
        lambda: recall(seen.recording, path.value, _in_world(local, path.value)),
    ).value
    again = [r for r in recalled.again if r.interaction not in held]
    items = [(local[r.interaction].window, found_again(r, local[r.interaction])) for r in again]
    if not items:
        return local, results, recalled.merged
    assert seen.contents is not None
    shared = (seen.tracks, seen.cameras, seen.noise, seen.contents)
    solve_ahead(stage, seen.recording, shared, _one_again, items, "recall")
    local, results = list(local), list(results)
    for r, item in zip(again, items, strict=True):
        local[r.interaction], results[r.interaction] = interact_again(stage, seen, *item)
    return local, results, None


def _one_window(
    hints: Sequence[TypeHint],
    stage: Chain,
    recording: Recording,
    reads: Sequence[StageResult[Any]],
    told: tuple[Window, Said],
) -> None:
    """The stages of one window. reads: as `Observed` has them."""
    interact(stage, Observed(recording, *reads), told[0], hints, told[1])


def _one_again(
    stage: Chain,
    recording: Recording,
    reads: Sequence[StageResult[Any]],
    told: tuple[Window, FoundParts],
) -> None:
    """The stages of one window with parts of others. reads: as `Observed` has them."""
    interact_again(stage, Observed(recording, *reads), *told)


def _upright(
    stage: Chain,
    seen: Observed,
    guessed: StageResult[Trajectory],
    interactions: Sequence[Interaction],
    results: Sequence[StageResult[Any]],
    doubts: Sequence[str],
    first: Merged | None,
) -> Surveyed:
    """One scene of all interactions, its surfaces, and up by all that is known of the world.

    guessed: the cameras, upright by a first guess. results: of the stages that the interactions come from.
    doubts: about the guess. first: the interactions merged, if that was done before.
    """
    c, loop, recording, noise = stage.config, stage.run.loop, seen.recording, seen.noise
    cameras = guessed.value
    # One part of several interactions, its states over the whole recording.
    merged = stage(MERGE, [guessed, *results], lambda: first or merge(recording, cameras, interactions))
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

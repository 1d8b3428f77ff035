"""States of a part in frames in which nobody handles it: as these frames show it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.interaction.interaction import Interaction
from recon.merge.merge import merge
from recon.merge.same_part import surface_of
from recon.merge.standing import standing
from recon.recording import Recording
from tests.makers.recon.cabinets import Clip, make_clip
from tests.makers.recon.visits import Visit, visits_of
from twin.scene import Trajectory

# Within a step of the states that are tried.
NEAR = {"door": float(np.radians(2.1)), "drawer": 0.011}


def one_found(clip: Clip, number: int) -> tuple[Recording, Trajectory, tuple[Interaction, ...]]:
    """The part is opened, closed, and opened again; one of the three is found."""
    visits = [Visit(clip), Visit(clip, back=True), Visit(clip)]
    recording, cameras, found = visits_of(visits, gap=20)
    return recording, cameras, (found[number],)


@pytest.mark.parametrize("kind", ["door", "drawer"])
@pytest.mark.parametrize("number", [0, 1, 2])
def test_what_was_moved_in_a_time_that_could_not_be_solved_is_where_frames_show_it(
    kind: str, number: int
) -> None:
    clip = make_clip(kind)  # type: ignore[arg-type]
    recording, cameras, found = one_found(clip, number)
    (part,) = merge(recording, cameras, found).parts
    n, travel = len(clip.recording), clip.part.motion.state
    start = {0: 0.0, 1: travel[-1], 2: 0.0}[
        number
    ]  # its states count from the first frame of its interaction
    true = np.concatenate(
        [travel, np.full(20, travel[-1]), travel[::-1], np.zeros(20), travel, np.full(20, travel[-1])]
    )
    rests = [*range(n, n + 20), *range(2 * n + 20, 2 * n + 40), *range(3 * n + 40, 3 * n + 60)]
    told = {f: s for f in rests if (s := part.state(f)) is not None}
    assert len(told) > 0.5 * len(rests)
    for frame, state in told.items():
        assert state + start == pytest.approx(true[frame], abs=NEAR[kind]), frame


def test_no_state_is_told_between_two_frames_that_show_different_ones() -> None:
    clip = make_clip("drawer")
    recording, cameras, found = one_found(clip, 0)
    (part,) = merge(recording, cameras, found).parts
    n = len(clip.recording)
    closing = range(n + 20, 2 * n + 20)
    assert sum(part.state(f) is None for f in closing) > 0.3 * n


@pytest.mark.parametrize("kind", ["door", "drawer"])
def test_where_it_stands_between_visits_belongs_to_its_range(kind: str) -> None:
    """The interaction that is found begins when the part is ajar; frames before show it closed."""
    clip = make_clip(kind)  # type: ignore[arg-type]
    recording, cameras, (first, _) = visits_of([Visit(clip), Visit(clip, back=True)], gap=20)
    n, travel = len(clip.recording), clip.part.motion.state
    (part,) = merge(recording, cameras, (first,)).parts
    states = part.handled_states
    assert np.ptp(states) == pytest.approx(travel[-1], abs=NEAR[kind])
    ajar = replace(part, windows=((n // 2, n - 1),))
    assert np.ptp(ajar.motion.state[n // 2 : n]) < 0.8 * travel[-1]
    assert np.ptp(ajar.handled_states) == pytest.approx(travel[-1], abs=2 * NEAR[kind])


@pytest.mark.parametrize(("shown", "farthest"), [(True, 1.5), (False, 1.25)])
def test_states_beyond_the_range_count_where_frames_show_that_place_empty(
    shown: bool, farthest: float
) -> None:
    """Of a door that was opened by 1.2 rad; where frames have no depth beside it they tell nothing."""
    clip = make_clip("door")
    recording, cameras, (found,) = visits_of([Visit(clip)])
    part = found.parts[0]
    known = dict(zip(part.motion.frames.tolist(), part.motion.state.tolist(), strict=True))
    if not shown:
        depth = np.stack([recording.depth(f) for f in range(len(recording))])
        for f, image in enumerate(depth):
            around = [found.labels[k] != 1 for k in found.labels if abs(k - f) <= 1]
            image[~np.logical_or.reduce(around)] = 0.0
        color = np.stack([recording.color(f) for f in range(len(recording))])
        recording = Recording.from_arrays(color, depth, recording.intrinsics, fps=15)
    surface = surface_of(part, recording, cameras, found.labels)
    states = standing(part.joint, surface, known, recording, cameras).states
    assert (states.max() > farthest) == shown

"""A window that could not be solved, in which a part moves that other windows found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.interaction.interaction import Interaction
from recon.interaction.parts.found import FoundParts, PartTracks
from recon.interaction.parts.moving_part import MovingPart
from recon.merge.merge import merge
from recon.merge.recall import Recalled, found_again, recall
from recon.merge.same_part import Surface
from recon.merge.standing import standing
from recon.recording import Recording
from tests.makers.recon.cabinets import Clip, make_clip
from tests.makers.recon.visits import Visit, aside, visits_of
from twin import geometry as geo
from twin.scene import Motion, Prismatic, Trajectory

# Three steps of the states that are tried: between two frames that are asked a door goes as far.
NEAR = {"door": float(np.radians(6.1)), "drawer": 0.031}
KINDS = ["door", "drawer"]

World = tuple[Recording, Trajectory, tuple[Interaction, ...]]


def without_parts(interaction: Interaction) -> Interaction:
    """An interaction in which no part was found."""
    labels = {f: np.minimum(image, 1).astype(np.uint8) for f, image in interaction.labels.items()}
    found = FoundParts(interaction.found.movers, ())
    return replace(interaction, found=found, parts=(), labels=labels)


def mis_solved(interaction: Interaction) -> Interaction:
    """An interaction whose part is a slide along the part's height, which nothing follows."""
    (part,) = interaction.parts
    n = len(part.motion.frames)
    motion = Motion(part.motion.frames, part.motion.times, np.linspace(0.0, 0.2, n), part.motion.intervals)
    wrong = MovingPart(part.id, Prismatic(axis=np.array([0, 0, 1.0]), lower=0.0, upper=0.2), motion)
    tracks = PartTracks(wrong, np.zeros(0, bool), "motion")
    found = FoundParts(interaction.found.movers, (tracks,))
    return replace(interaction, found=found, parts=(wrong,))


def three(clip: Clip) -> World:
    """The part is opened, closed, and opened again."""
    return visits_of([Visit(clip), Visit(clip, back=True), Visit(clip)], gap=20)


def with_second(world: World, second: Interaction) -> World:
    recording, cameras, (first, _, third) = world
    return recording, cameras, (first, second, third)


def states_of(recalled: Recalled) -> np.ndarray:
    (part,) = recalled.parts
    return np.abs(part.motion.state)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("wrong", [without_parts, mis_solved])
def test_a_part_that_others_found_is_recalled_with_its_states(kind: str, wrong: object) -> None:
    clip = make_clip(kind)  # type: ignore[arg-type]
    world = three(clip)
    second = wrong(world[2][1])  # type: ignore[operator]
    (again,) = recall(*with_second(world, second)).again
    travel = clip.part.motion.state
    assert again.interaction == 1
    assert again.left_out == tuple(p.id for p in second.parts)
    assert states_of(again) == pytest.approx(np.abs(travel[::-1] - travel[-1]), abs=NEAR[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_the_recalled_part_is_the_known_one_when_all_are_merged(kind: str) -> None:
    clip = make_clip(kind)  # type: ignore[arg-type]
    world = three(clip)
    right = world[2][1]
    second = without_parts(right)
    (again,) = recall(*with_second(world, second)).again
    found = found_again(again, second)
    (tracks,) = found.parts
    at_frame_0 = geo.invert_pose(world[1].T_world_cam[second.window.first])
    solved = replace(right, found=found, parts=(tracks.part.moved(geo.invert_pose(at_frame_0)),))
    (part,) = merge(*with_second(world, solved)).parts
    assert len(part.windows) == 3
    assert np.ptp(part.handled_states) == pytest.approx(np.ptp(clip.part.motion.state), abs=NEAR[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_solved_right_is_left_alone(kind: str) -> None:
    assert recall(*three(make_clip(kind))).again == ()  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", KINDS)
def test_a_part_is_not_recalled_where_another_one_moves(kind: str) -> None:
    """The second visit is to a cabinet of the same kind four metres away, which no other window shows."""
    clip = make_clip(kind)  # type: ignore[arg-type]
    away = aside(np.array([4.0, 0.0, 0.0]))
    recording, cameras, (first, second) = visits_of([Visit(clip), Visit(clip, T=away)], gap=20)
    assert recall(recording, cameras, (first, without_parts(second))).again == ()


def test_a_part_that_stands_still_is_not_recalled() -> None:
    """In the second window the drawer that was opened before only stands open."""
    clip = make_clip("drawer")
    recording, cameras, (first,) = visits_of([Visit(clip)], gap=40)
    n = len(clip.recording)
    window = replace(first.window, first=n + 5, last=n + 35)
    second = replace(without_parts(first), window=window, labels={})
    assert recall(recording, cameras, (first, second)).again == ()


def test_a_part_that_is_moved_only_after_a_window_is_not_recalled_there() -> None:
    """Frames show the drawer closed after the second window, which ends when it begins to close."""
    clip = make_clip("drawer")
    recording, cameras, (first, closing) = visits_of([Visit(clip), Visit(clip, back=True)], gap=20)
    n = len(clip.recording)
    begins = closing.window.first + closing.parts[0].motion.intervals[0][0]
    second = replace(without_parts(first), window=replace(first.window, first=n + 2, last=begins), labels={})
    assert recall(recording, cameras, (first, second)).again == ()


def test_a_part_of_which_a_window_shows_a_strip_is_not_recalled() -> None:
    clip = make_clip("drawer")
    recording, cameras, (first, second, third) = three(clip)
    depth = np.stack([recording.depth(f) for f in range(len(recording))])
    depth[second.window.frames, :, : int(0.52 * depth.shape[2])] = 0.0
    color = np.stack([recording.color(f) for f in range(len(recording))])
    dark = Recording.from_arrays(color, depth, recording.intrinsics, fps=15)
    assert recall(dark, cameras, (first, without_parts(second), third)).again == ()


def test_a_part_that_explains_less_takes_nothing_from_one_that_was_solved_right() -> None:
    """The first window has the drawer slide 12 degrees aslant: its front lies on depth all the way, its
    outline does not."""
    clip = make_clip("drawer")
    recording, cameras, (first, second, third) = three(clip)
    (part,) = first.parts
    turn = geo.make_pose(geo.exp_so3(np.array([0, 0, np.radians(12.0)])))
    aslant = replace(part, joint=replace(part.joint, axis=geo.rotate(turn, part.joint.axis)))
    tracks = PartTracks(aslant, np.zeros(0, bool), "motion")
    wrong = replace(first, parts=(aslant,), found=replace(first.found, parts=(tracks,)))
    found = recall(recording, cameras, (wrong, second, third))
    assert len(found.merged.parts) == 2
    assert all(r.interaction == 0 for r in found.again)  # the first window, by the others


def test_a_door_does_not_stand_turned_into_the_wall_of_its_cabinet() -> None:
    clip = make_clip("door")
    recording, cameras, (first,) = visits_of([Visit(clip)])
    merged = merge(recording, cameras, (first, without_parts(replace(first, labels={}))))
    (part,), (cells,) = merged.parts, merged.surfaces
    widened = 1.5 * part.motion.state  # a range of 103 deg, and as much as 90 on either side
    known = dict(zip(part.motion.frames.tolist(), widened.tolist(), strict=True))
    states = standing(part.joint, Surface(cells), known, recording, cameras).states
    opened = float(np.sign(part.motion.state[-1]))
    assert np.abs(states + opened * np.radians(88.0)).min() > np.radians(3.0)
    assert np.abs(states + opened * np.radians(45.0)).min() < np.radians(2.0)

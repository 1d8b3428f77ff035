"""The user's word on parts: pointed at, intervals, joint types."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from benchmarks.scenes.tracks import minimum_jerk
from recon.interaction.parts.find_parts import FoundParts
from recon.recording import Intrinsics, Recording
from recon.recording.said import Said, Word
from recon.tracking.tracks import Tracks
from tests.makers.recon.said import parts_with
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.settings import from_dict
from twin.scene import Joint, Prismatic, Revolute, Trajectory

FRAMES = 60
CAMERA = Intrinsics(96, 72, 80.0, 80.0, 47.5, 35.5)
DOOR = Revolute(geo.unit(np.array([0.05, 1.0, 0.05])), 0.0, 0.8, pivot=np.array([0.35, 0.0, 1.5]))
BEHIND = Prismatic(geo.unit(np.array([1.0, 0.0, 0.2])), 0.0, 0.6)


def moving(joint: Joint, first: int, last: int, size: Array, centre: Array, count: int, seed: int) -> Array:
    """Points (FRAMES, count, 3) of a body whose joint goes through its range between two frames."""
    rng = np.random.default_rng(seed)
    rest = centre + size * rng.uniform(-1.0, 1.0, (count, 3))
    points = geo.transform(joint.poses(joint.upper * minimum_jerk(FRAMES, first, last)), rest)
    return np.asarray(points + rng.normal(0.0, 0.001, points.shape))


def seen(*bodies: Array) -> tuple[Recording, Tracks, Trajectory]:
    """A still camera that sees these bodies at depths that the points have, each everywhere in one colour."""
    points = np.concatenate(bodies, axis=1)
    depth = np.full((FRAMES, CAMERA.height, CAMERA.width), 3.0, np.float32)
    depth[:, :4] = 0.0
    for frame in range(FRAMES):
        x, y = np.rint(CAMERA.project(points[frame])).astype(int).T
        inside = (x >= 0) & (x < CAMERA.width) & (y >= 4) & (y < CAMERA.height)
        depth[frame, y[inside], x[inside]] = points[frame, inside, 2]
    color = np.full((*depth.shape, 3), 128, np.uint8)
    recording = Recording.from_arrays(color, depth, CAMERA, fps=15)
    shape = points.shape[:2]
    pixels = CAMERA.project(points)
    tracks = Tracks(points, pixels, np.ones(shape, bool))
    return (
        recording,
        tracks,
        Trajectory(np.arange(FRAMES), recording.times, np.tile(np.eye(4), (FRAMES, 1, 1))),
    )


def door(first: int = 32, last: int = 50) -> Array:
    """A small door, 24 tracks."""
    return moving(DOOR, first, last, np.array([0.2, 0.25, 0.01]), np.array([0.1, 0.0, 1.5]), 24, 1)


def curtain() -> Array:
    """What slides in the background early on, farther than the door and with thrice as many tracks."""
    return moving(BEHIND, 8, 24, np.array([0.3, 0.5, 0.02]), np.array([-0.7, 0.0, 2.4]), 72, 2)


def pixel(body: Array, frame: int) -> tuple[int, int, int]:
    """A pixel that shows a body's track nearest to its middle."""
    middle = int(np.argmin(np.linalg.norm(body[frame] - body[frame].mean(axis=0), axis=1)))
    x, y = np.rint(CAMERA.project(body[frame, middle])).astype(int)
    return int(x), int(y), frame


def joint_error(found: FoundParts, truth: Joint) -> float:
    """Degrees between the axis of the first part and the true one; 90 for another kind of joint."""
    joint = found.parts[0].part.joint
    return float(np.degrees(geo.line_angle(joint.axis, truth.axis))) if joint.kind == truth.kind else 90.0


def at(*points: tuple[int, int, int]) -> Said:
    return Said(parts=tuple(str(Word(point)) for point in points))


find = partial(parts_with, most=1)  # without a word


def test_a_point_tells_which_of_two_movers_is_the_part() -> None:
    body, other = door(), curtain()
    scene = seen(body, other)
    first = find(*scene).parts[0]
    assert not first.members[:24].any(), "without a word what is behind wins"
    for frame in (10, 41, 56):  # before, while and after it moves
        found = find(*scene, said=at(pixel(body, frame)))
        assert joint_error(found, DOOR) < 1.0
        assert found.parts[0].members[:24].all()
        assert not found.parts[0].members[24:].any()
    assert joint_error(find(*scene, said=at(pixel(other, 16))), BEHIND) < 1.0


def test_what_is_found_without_a_word_stays_unless_it_moves_meanwhile() -> None:
    body, other = door(), curtain()
    scene = seen(body, other)
    both = find(*scene, said=at(pixel(body, 41))).parts
    assert [(p.part.id, p.part.joint.kind) for p in both] == [(2, "revolute"), (3, "prismatic")]
    assert both[1].members[24:].all()
    (alone,) = find(*scene, said=at(pixel(other, 16))).parts  # the word's part is the one found
    assert alone.part.joint.kind == "prismatic"
    late = door(10, 28)  # one hand moves one part at a time, and the user says which
    (alone,) = find(*seen(late, other), said=at(pixel(late, 20))).parts
    assert alone.members[:24].all()
    assert not alone.members[24:].any()


def test_an_interval_leaves_only_what_moves_in_it() -> None:
    scene = seen(door(), curtain())
    for interval, truth in (((30, 52), DOOR), ((6, 26), BEHIND)):
        found = find(*scene, said=Said(parts=(str(Word(interval=interval)),)))
        assert joint_error(found, truth) < 1.0
        (span,) = found.parts[0].part.motion.intervals
        assert interval[0] <= span[0] < span[1] <= interval[1]
        state = found.parts[0].part.motion.state
        assert np.ptp(state[: interval[0] - 5]) == np.ptp(state[interval[1] + 6 :]) == 0.0, "it rests outside"


def test_a_hand_that_goes_along_is_no_part_of_what_is_pointed_at() -> None:
    """It holds the door's edge and turns against it, with more tracks than the door has."""
    body = door(20, 40)
    state = DOOR.upper * minimum_jerk(FRAMES, 20, 40)
    rng = np.random.default_rng(3)
    grip = body[0, np.argmin(body[0, :, 0])]
    held = geo.transform(DOOR.poses(state), grip[None])[:, 0]
    local = rng.uniform(-0.06, 0.06, (40, 3))
    turn = geo.exp_so3(-0.8 * state[:, None] * DOOR.axis)
    hand = held[:, None] + np.einsum(
        "tij,kj->tki", np.einsum("tij,tjk->tik", DOOR.poses(state)[:, :3, :3], turn), local
    )
    hand = hand + rng.normal(0.0, 0.001, hand.shape)
    scene = seen(body, hand)
    found = find(*scene, said=at(pixel(body, 30)))
    assert joint_error(found, DOOR) < 1.0
    assert found.parts[0].members[:24].mean() > 0.9
    assert found.parts[0].members[24:].mean() < 0.1


def test_parts_come_in_the_order_in_which_they_are_said() -> None:
    body, other = door(), curtain()
    points = (pixel(body, 41), pixel(other, 16))
    words = Word(points[0], (30, 52), "hinge"), Word(points[1], (6, 26), "slide")
    said = Said(parts=tuple(map(str, words)))
    found = find(*seen(body, other), said=said)
    assert [(p.part.id, p.part.joint.kind) for p in found.parts] == [(2, "revolute"), (3, "prismatic")]
    assert {p.type_source for p in found.parts} == {"said by the user"}


def test_an_interval_of_one_part_says_nothing_of_another() -> None:
    """The curtain, said without one, moves outside of the door's interval, where else a hand does: it is red,
    and what is red comes before what stands there."""
    body, other = door(), curtain()
    recording, tracks, cameras = seen(body, other)
    depth = np.stack([recording.depth(f) for f in range(FRAMES)])
    color = np.full((*depth.shape, 3), 128, np.uint8)
    for frame in range(FRAMES):
        x, y = np.rint(CAMERA.project(other[frame])).astype(int).T
        for dy, dx in np.ndindex(5, 5):
            at = frame, np.clip(y + dy - 2, 4, CAMERA.height - 1), np.clip(x + dx - 2, 0, CAMERA.width - 1)
            color[at], depth[at] = (200, 30, 30), other[frame, :, 2]
    painted = Recording.from_arrays(color, depth, CAMERA, fps=15)
    said = Said(parts=("--interval 30:52", str(Word(pixel(other, 16)))))
    found = find(painted, tracks, cameras, said=said)
    assert [p.part.joint.kind for p in found.parts] == ["revolute", "prismatic"]
    assert found.parts[1].members[24:].all()


def test_a_point_where_nothing_moves_gives_a_warning_and_no_part() -> None:
    """The curtain is found without a word, and stays."""
    scene = seen(door(), curtain())
    with pytest.warns(UserWarning, match="no part was found for --at 90,70@40: 0 of 0 tracks within 30 cm"):
        (part,) = find(*scene, said=at((90, 70, 40))).parts
    assert part.members[24:].all()
    lost = replace(
        scene[2],
        frames=np.arange(FRAMES - 5),
        times=scene[2].times[:-5],
        T_world_cam=scene[2].T_world_cam[:-5],
    )
    with pytest.warns(UserWarning, match="the camera of frame 58 is not known"):
        (part,) = find(*scene[:2], lost, said=at((47, 35, 58))).parts
    assert part.members[24:].all()


def test_a_type_that_is_said_overrules_motion() -> None:
    """A door that opens a crack looks like a slide; one that opens wide is no slide, and yet is taken as
    said."""
    crack = replace(DOOR, upper=float(np.radians(2.5)))
    body = moving(crack, 20, 40, np.array([0.25, 0.3, 0.02]), np.array([-0.3, 0.0, 1.5]), 60, 1)
    (without,) = find(*seen(body)).parts
    assert (without.part.joint.kind, without.type_source[:6]) == ("prismatic", "motion")
    for body_, word, kind in ((body, "hinge", "revolute"), (door(), "slide", "prismatic")):
        (part,) = find(*seen(body_), said=from_dict(Said, {"type": word})).parts
        assert (part.part.joint.kind, part.type_source) == (kind, "said by the user")

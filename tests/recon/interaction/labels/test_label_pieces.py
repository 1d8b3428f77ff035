"""What is no hand, what lies behind a drawer's front, and what is seen edge-on: laws of the labels on
closed-form pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from recon.dense.depth import F32
from recon.dense.noise import GOOD_SENSOR, DepthNoise
from recon.dense.voxels import in_hull_of
from recon.interaction.labels.enclosed import with_box
from recon.interaction.labels.evidence import Errors, Others, Pixels, compare, depth_range
from recon.interaction.labels.hand_pieces import Rests, drop_crumbs, too_wide
from recon.interaction.labels.pooling import VoxelPool
from recon.interaction.labels.reference_frames import View, as_references, gather
from recon.interaction.labels.spreading import follow_surroundings
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Motion, Prismatic, Revolute, Trajectory

CAMERA = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
SHAPE, FRAMES = (48, 64), 30
DOOR = Revolute(np.array([0.0, 0.0, 1.0]), upper=1.0, pivot=np.zeros(3))


def _cameras() -> Trajectory:
    return Trajectory(np.arange(FRAMES), np.arange(FRAMES) / 15.0, np.tile(np.eye(4), (FRAMES, 1, 1)))


def _part() -> MovingPart:
    state = np.clip((np.arange(FRAMES) - 16) / 4.0, 0.0, 1.0)
    return MovingPart(2, DOOR, Motion(np.arange(FRAMES), np.arange(FRAMES) / 15.0, state, ((16, 20),)))


def _views(spot: F32, frames: Sequence[int]) -> list[View]:
    """A wall 2 m away with something in front of it, in these frames only."""
    wall = np.full(SHAPE, 2.0, np.float32)
    grey = np.zeros((*SHAPE, 3), np.float32)
    return [View(f, spot if f in frames else wall, grey) for f in range(0, FRAMES, 2)]


def _belief(hand: np.ndarray) -> F32:
    """Static, part, hand: the part is second where the hand is first."""
    belief = np.zeros((3, *SHAPE), np.float32)
    belief[0], belief[1][hand], belief[2][hand] = 0.2, 0.3, 0.6
    return belief


def _hand_left(
    spot: tuple[slice, slice], there: Sequence[int], frame: int, holes: tuple[slice, slice] | None = None
) -> bool:
    """Whether a piece that is labelled hand in a frame and seen at its place in others stays one; else it is
    the part's."""
    depth = np.full(SHAPE, 2.0, np.float32)
    depth[spot] = 1.5
    if holes is not None:
        depth[holes] = 0.0
    hand = np.zeros(SHAPE, bool)
    hand[spot] = True
    belief = _belief(hand)
    views = _views(depth, there)
    rests = Rests.of(views, _cameras(), [_part()], CAMERA, 5.0, 0.003, GOOD_SENSOR)
    rests.drop_armless(belief, View(frame, depth, np.zeros((*SHAPE, 3), np.float32)))
    labels = belief.argmax(axis=0)[hand]
    assert len(np.unique(labels)) == 1
    assert labels[0] in (1, 2)
    return bool(labels[0] == 2)


MIDDLE, BORDER = (slice(20, 28), slice(20, 40)), (slice(20, 28), slice(0, 40))
BEFORE = range(0, 16, 2)


def test_what_stays_without_an_arm_while_all_rests_is_no_hand() -> None:
    assert not _hand_left(MIDDLE, BEFORE, 4)


@pytest.mark.parametrize(
    ("why", "arguments"),
    [
        ("an arm joins it to the border", (BORDER, BEFORE, 4)),
        ("the arm is too near for depth", (MIDDLE, BEFORE, 4, (slice(22, 26), slice(0, 20)))),
        ("it is there in one frame only", (MIDDLE, [4], 4)),
        ("a part moves, which may hide the arm", (MIDDLE, range(0, FRAMES, 2), 18)),
        ("the rest is too short to tell a hand that lingers", (MIDDLE, range(20, FRAMES, 2), 28)),
    ],
)
def test_a_hand_stays_one(why: str, arguments: tuple) -> None:  # type: ignore[type-arg]
    assert _hand_left(*arguments), why


def test_where_a_part_never_rests_no_hand_is_dropped() -> None:
    """Nothing tells the hand from what it moves there."""
    depth = np.full(SHAPE, 2.0, np.float32)
    depth[MIDDLE] = 1.5
    hand = np.zeros(SHAPE, bool)
    hand[MIDDLE] = True
    belief = _belief(hand)
    restless = replace(_part(), motion=replace(_part().motion, intervals=((0, FRAMES - 1),)))
    views = _views(depth, range(0, FRAMES, 2))
    rests = Rests.of(views, _cameras(), [restless], CAMERA, 5.0, 0.003, GOOD_SENSOR)
    rests.drop_armless(belief, views[2])
    assert (belief.argmax(axis=0)[hand] == 2).all()


def test_crumbs_are_no_hand() -> None:
    for size, kept in ((1, False), (3, True)):
        hand = np.zeros(SHAPE, bool)
        hand[5 : 5 + size, 5 : 5 + size] = True
        belief = _belief(hand)
        drop_crumbs(belief)
        assert bool((belief.argmax(axis=0) == 2).any()) == kept


def _drawer(axis: Array) -> MovingPart:
    motion = Motion(np.arange(2), np.arange(2) / 15.0, np.array([0.0, 0.1]))
    return MovingPart(2, Prismatic(axis, upper=0.1), motion)


def _front(thick: float = 0.02) -> F32:
    """A grid of points on a board 0.4 m wide and 0.2 m high that faces -y, and its rim."""
    x, y, z = np.meshgrid(np.linspace(-0.2, 0.2, 41), np.arange(0, thick, 0.01), np.linspace(0, 0.2, 21))
    return np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1).astype(np.float32)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("seed", range(3))
def test_what_a_front_drags_behind_it_is_inside_the_drawer(sign: float, seed: int) -> None:
    """Whichever way the axis points and however the scene lies; what is beside, under or before the front is
    not."""
    rng = np.random.default_rng(seed)
    T = geo.make_pose(geo.exp_so3(rng.normal(size=3)), rng.normal(size=3))
    eye, floor = geo.transform(T, [[0.1, -1.5, 0.8], [0.0, 0.3, 0.02]])
    part = _drawer(sign * T[:3, :3] @ [0.0, 1.0, 0.0])
    front = geo.transform(T, _front()).astype(np.float32)
    inside = in_hull_of(with_box(front, part, eye))
    assert inside(floor[None].astype(np.float32))[0]
    others = geo.transform(T, [[0.25, 0.3, 0.1], [0.0, 0.3, -0.05], [0.0, -0.1, 0.1], [0.0, 0.9, 0.1]])
    assert not inside(others.astype(np.float32)).any()


def test_a_panel_that_slides_along_itself_drags_nothing() -> None:
    front = _front()
    along = _drawer(np.array([1.0, 0.0, 0.0]))
    assert with_box(front, along, np.array([0.1, -1.5, 0.8])) is front
    hinge = replace(_part(), joint=DOOR)
    assert with_box(front, hinge, np.array([0.1, -1.5, 0.8])) is front


@pytest.mark.parametrize(("cosine", "weight"), [(0.05, 0.0), (0.25, 0.5), (0.6, 1.0), (None, 1.0)])
def test_what_is_seen_edge_on_is_hardly_seen_through(cosine: float | None, weight: float) -> None:
    """A point 1 m away, a wall read 0.2 m behind it; its own surface leans so far from the ray. None: its
    normal is not known."""
    shape = (9, 9)
    normals = np.zeros((*shape, 3), np.float32)
    if cosine is not None:
        normals[:] = [np.sqrt(1 - cosine**2), 0.0, -cosine]
    color, walls = np.zeros((*shape, 3), np.float32), np.full(shape, 1.2, np.float32)
    out = np.zeros((4, *shape), np.float32)
    compare(
        Pixels(
            np.ones(shape, np.float32), color, normals, np.ones(shape, bool), np.array([500, 500, 4, 4], np.float32)
        ),
        Others(
            np.eye(4, dtype=np.float32)[None, :3], walls[None], color[None], tuple(d[None] for d in depth_range(walls)),
            np.array([True]), np.array([1], np.int8),
        ),
        Errors(5.0, 0.003, GOOD_SENSOR.curve, 1.0), out,
    )  # fmt: skip
    assert out[1, 4, 4] == pytest.approx(weight, abs=0.01)


@pytest.mark.parametrize(("slow", "through"), [(0.0, True), (1.0, False)])
def test_errors_that_stay_alike_are_not_surer_in_many_references(slow: float, through: bool) -> None:
    """Six references read the wall two standard deviations behind a point: as fresh errors hardly all of them
    would, as one error it may be."""
    noise, camera = DepthNoise(0.006, 0.0, slow, 0.0), Intrinsics(9, 9, 500.0, 500.0, 4.0, 4.0)
    shape, moves = (9, 9), np.repeat(np.eye(4)[None, :3], 6, axis=0)
    off = 2.0 * np.hypot(np.sqrt(2.0) * 0.006, 0.003)
    walls = [
        View(k, np.full(shape, 1.0 + off, np.float32), np.zeros((*shape, 3), np.float32)) for k in range(6)
    ]
    seen = View(9, np.ones(shape, np.float32), np.zeros((*shape, 3), np.float32))
    references = as_references(walls, np.ones(6, bool), 2.0)
    violation = gather(seen, references, moves, camera, 0.003, noise)[1, 4, 4]
    assert (violation > 1.5) == through


def test_pixels_without_depth_follow_what_stands_around_in_their_colour() -> None:
    """A door whose middle a stereo camera has no depth on, and a gap in the wall beside it."""
    door, gap = np.zeros(SHAPE, bool), np.zeros(SHAPE, bool)
    door[8:40, 12:44], gap[5:43, 50:58] = True, True
    blind = gap.copy()
    blind[14:34, 18:38] = True
    color = np.zeros((*SHAPE, 3), np.float32)
    color[door, 0] = 40.0
    score = np.zeros((3, *SHAPE), np.float32)
    score[0], score[1], score[2] = np.where(door, -4.0, 2.0), np.where(door, 2.0, -4.0), -0.7
    score[:, blind] = np.array([0.0, -0.5, -0.7])[:, None]  # as without any evidence
    told = score[:, ~blind].copy()
    follow_surroundings(score, View(0, np.where(blind, 0, 2).astype(np.float32), color), 5.0)
    np.testing.assert_array_equal(score.argmax(axis=0), door)
    np.testing.assert_array_equal(score[:, ~blind], told)


@pytest.mark.parametrize("of_hand", [False, True], ids=["of any colour", "of the hand's colour"])
def test_what_has_no_depth_beside_a_hand_is_rather_none_unless_it_has_its_colour(of_hand: bool) -> None:
    """A camera sees no depth beside what is nearer; fingers without depth look like the others."""
    hand, blind = np.zeros(SHAPE, bool), np.zeros(SHAPE, bool)
    hand[:, :30], blind[:, 28:32] = True, True
    color = np.zeros((*SHAPE, 3), np.float32)
    color[hand | blind, 0] = 40.0 if of_hand else 0.0
    score = np.zeros((3, *SHAPE), np.float32)
    score[1], score[2] = -4.0, np.where(hand, 3.0, -3.0)
    depth = np.where(blind, 0, np.where(hand, 0.5, 2)).astype(np.float32)
    follow_surroundings(score, View(0, depth, color), 5.0)
    found = score.argmax(axis=0) == 2
    assert found[blind].mean() >= 0.5 if of_hand else found[blind].mean() <= 0.25
    assert (found == hand)[~blind].all()


@pytest.mark.parametrize("turns", [True, False], ids=["hinge", "slide"])
def test_what_lies_far_from_a_part_that_turns_is_none_of_it_but_where_it_moved(turns: bool) -> None:
    """A floor that turns within itself goes along as well as it stays. What slides is sure to move at its
    edges only."""
    depth = np.full(SHAPE, 1.0, np.float32)
    depth[:, 30:] = 2.0
    door, floor, gone = (np.zeros(SHAPE, bool) for _ in range(3))
    door[:, :30], floor[:, 34:50], gone[:, 54:] = True, True, True
    views = [View(f, depth, np.zeros((*SHAPE, 3), np.float32)) for f in (0, 2, 4)]
    part = _part() if turns else replace(_part(), joint=Prismatic(np.array([0.0, 0.0, 1.0]), upper=1.0))
    score = np.zeros((3, *SHAPE), np.float32)
    score[2] = -0.7
    score[0][door | gone], score[1][door], score[1][floor], score[1][gone] = -4.0, 3.0, 0.3, 0.3
    scores = [score.copy() for _ in views]
    VoxelPool(views, _cameras(), (part,), CAMERA, GOOD_SENSOR).add_to(scores, settled=True)
    for found in (s.argmax(axis=0) for s in scores):
        assert (found[door] == 1).all()
        assert (found[floor] == (0 if turns else 1)).all()
        assert (found[gone] != 0).all()


@pytest.mark.parametrize(("width_m", "stays"), [(0.2, True), (0.4, False)])
def test_what_no_arm_has_room_for_is_no_hand(width_m: float, stays: bool) -> None:
    """A strip from the picture's lower edge, 1.5 m away; a thin piece beside it stays a hand."""
    depth = np.full(SHAPE, 1.5, np.float32)
    hand = np.zeros(SHAPE, bool)
    px = round(width_m * 60.0 / 1.5)
    hand[8:, 30 : 30 + px] = True
    hand[20:, 2:6] = True
    wide = too_wide(hand, depth, 60.0)
    assert wide[:, 30 : 30 + px][8:].all() != stays
    assert not wide[:, :10].any()
    assert not too_wide(hand, np.zeros(SHAPE, np.float32), 60.0).any()

"""The judge of walks: exact is exact, order and world change nothing, each mistake costs what it should."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binomtest

from benchmarks.walk_rates import lines, pooled
from recon.evaluation.evaluate import evaluate, match_parts
from recon.evaluation.metrics import Span
from recon.evaluation.truth import Truth, TruthPart
from recon.evaluation.walk_rows import summary, walk_rows, walk_table
from recon.evaluation.walk_scores import IntervalCounts, LocalErrors, WalkScores
from recon.evaluation.walks import is_walk, state_counts, walk_scores
from tests.makers.recon.tiny import DRAWER, JOINTS, STATIC, cameras, in_world, smooth, twin_of
from tests.makers.twin.judged import DOUBT
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Joint, Mesh, Part, Trajectory, Twin
from twin.verdict import Verdict

FPS = 15
FRAMES = 90 * FPS
BESIDE = geo.make_pose(translation=[0.45, 0.0, 0.0])
FAR = geo.make_pose(translation=[0.0, 0.0, 1.0])


def course(travel: float, *moves: tuple[int, int, float]) -> Array:
    """States (n,) of moves (last frame at rest, first one after it, share of the travel by which it goes)."""
    return travel * sum((share * smooth(FRAMES, a, b) for a, b, share in moves), np.zeros(FRAMES))


def true_part(
    id: int, name: str, joint: Joint, mesh: Mesh, grip: Array, states: Array, spans: list[Span]
) -> TruthPart:
    return TruthPart(id, name, joint, states, joint.poses(states), mesh, tuple(spans), grip)


def truth_of(*parts: TruthPart) -> Truth:
    """A walk with these parts: each has a band of the label images."""
    image = np.ones((40, 30), dtype=np.uint8)
    for k, p in enumerate(parts):
        image[5 * k : 5 * k + 5, :20] = p.id
    frames = np.arange(FRAMES)
    path = Trajectory(frames, frames / FPS, cameras(FRAMES))
    labels = dict.fromkeys(range(0, FRAMES, 100), image)
    return Truth(Path("walk/truth"), FRAMES, path, parts, labels, STATIC)


@pytest.fixture(scope="module")
def truth() -> Truth:
    """A door that stays open for a minute, a drawer opened and shut twice, its like beside it, left open."""
    door, door_mesh, door_grip = JOINTS["door"]
    slide, _, grip = JOINTS["drawer"]
    again = course(0.3, (300, 345, 1), (360, 405, -1), (800, 845, 1), (860, 905, -1))
    return truth_of(
        true_part(
            2, "door", door, door_mesh, door_grip,
            course(1.2, (75, 135, 1), (1050, 1095, -1)), [(75, 135), (1050, 1095)],
        ),
        true_part(
            3, "drawer", slide, DRAWER, grip, again, [(300, 345), (360, 405), (800, 845), (860, 905)],
        ),
        true_part(
            4, "drawer_right", slide, DRAWER.transformed(BESIDE), geo.transform(BESIDE, grip[None])[0],
            course(0.3, (600, 660, 1)), [(600, 660)],
        ),
    )  # fmt: skip


@pytest.fixture(scope="module")
def exact(truth: Truth) -> Twin:
    return twin_of(truth)


def with_part(twin: Twin, name: str, change: Callable[[Part], Part]) -> Twin:
    return replace(twin, parts=tuple(change(p) if p.name == name else p for p in twin.parts))


def without(twin: Twin, name: str) -> Twin:
    return replace(twin, parts=tuple(p for p in twin.parts if p.name != name))


def and_part(twin: Twin, part: Part) -> Twin:
    return replace(twin, parts=(*twin.parts, part))


def only(part: Part, keep: NDArray[np.bool_]) -> Part:
    """A part whose state is known in some frames only (n,) bool."""
    m = part.motion
    return replace(part, motion=replace(m, frames=m.frames[keep], times=m.times[keep], state=m.state[keep]))


def score(walk: WalkScores, name: str) -> tuple[str | None, str | None]:
    part = next(p for p in walk.parts if p.name == name)
    return part.found, part.cause


def rows(walk: WalkScores) -> dict[str, tuple[float | None, float | None]]:
    return {r.metric: (r.value, r.matched) for r in walk_rows(walk)}


def test_a_perfect_twin_scores_perfectly(truth: Truth, exact: Twin) -> None:
    walk = walk_scores(exact, truth)
    assert [score(walk, p.name) for p in truth.parts] == [(p.name, None) for p in truth.parts]
    assert walk.room_right
    assert walk.intervals == walk.intervals_matched == IntervalCounts(7, 7, 7)
    zero = {
        "parts doubled", "parts mis-solved", "parts invented, trusted", "parts invented, not trusted", "ATE",
        "states unknown", "states unknown, part not closed", "frames in a named gap", "frames with neither",
        "local camera error, median", "local camera error, p90",
        "local camera rotation, median", "local camera rotation, p90",
    }  # fmt: skip
    for name, (value, matched) in rows(walk).items():
        assert value == (0.0 if name in zero else 1.0), name
        assert matched in (None, value), name


def test_order_and_ids_change_nothing(truth: Truth, exact: Twin) -> None:
    found = walk_scores(with_part(exact, "door", lambda p: only(p, p.motion.frames % 3 > 0)), truth)
    new = {2: 7, 3: 6, 4: 5}
    turned = with_part(exact, "door", lambda p: only(p, p.motion.frames % 3 > 0))
    parts = tuple(replace(p, id=new[p.id]) for p in turned.parts[::-1])
    labels = {f: np.where(image > 1, 9 - image, image).astype(np.uint8) for f, image in exact.labels.items()}
    again = walk_scores(
        replace(exact, parts=parts, labels=labels), replace(truth, parts=truth.parts[1:] + truth.parts[:1])
    )
    assert rows(again) == rows(found)
    assert set(again.parts) == set(found.parts)
    assert set(again.found) == set(found.found)


def test_a_rigid_move_of_the_twins_world_changes_no_number(truth: Truth, exact: Twin) -> None:
    T = geo.make_pose(geo.exp_so3([0.3, -0.2, 2.0]), [3.0, -1.0, 0.5])
    worse = with_part(exact, "drawer", lambda p: only(p, p.motion.frames % 2 > 0))
    before, after = walk_scores(worse, truth), walk_scores(in_world(worse, T), truth)
    for a, b in zip(walk_rows(before), walk_rows(after), strict=True):
        assert (a.metric, a.counted) == (b.metric, b.counted)
        assert b.value == pytest.approx(a.value, abs=1e-6)
    assert [replace(p, axis_deg=0, path_mm=0) for p in after.parts] == [
        replace(p, axis_deg=0, path_mm=0) for p in before.parts
    ]


def test_a_doubled_part_is_a_double_and_no_invention(truth: Truth, exact: Twin) -> None:
    drawer = exact.part("drawer")
    tilted = replace(drawer.joint, axis=geo.exp_so3([0.02, 0, 0]) @ drawer.joint.axis)
    late = replace(drawer.motion, intervals=drawer.motion.intervals[2:])
    double = replace(drawer, id=9, name="again", joint=tilted, motion=late)
    walk = walk_scores(and_part(exact, double), truth)
    assert (walk.count("double"), walk.count("invented"), walk.count("mis-solved")) == (1, 0, 0)
    assert (walk.found[-1].role, walk.found[-1].of) == ("double", "drawer")
    assert walk.right == 3
    assert not walk.room_right
    assert walk.intervals == IntervalCounts(7, 7, 9)
    assert walk.intervals_matched.precision == 1.0
    assert "again: double of drawer, trusted" in walk_table(walk)


def test_a_wrong_axis_on_the_right_surface_is_mis_solved(truth: Truth, exact: Twin) -> None:
    def tilt(deg: float) -> WalkScores:
        R = geo.exp_so3([np.radians(deg), 0, 0])
        turn = with_part(exact, "drawer", lambda p: replace(p, joint=replace(p.joint, axis=R @ p.joint.axis)))
        return walk_scores(turn, truth)

    assert score(tilt(14.0), "drawer") == ("drawer", "axis")
    walk = tilt(16.0)
    assert score(walk, "drawer") == (None, "mis-solved")
    assert (walk.count("mis-solved"), walk.count("double"), walk.count("invented")) == (1, 0, 0)
    assert (len(walk.matched), walk.right) == (2, 2)
    # next to a right one, it is a double of it
    bad = replace(exact.part("drawer").joint, axis=np.array([1.0, 0, 0]))
    both = and_part(exact, replace(exact.part("drawer"), id=9, name="bad", joint=bad))
    assert walk_scores(both, truth).count("double") == 1


def test_a_part_on_no_true_surface_is_invented_trusted_or_not(truth: Truth, exact: Twin) -> None:
    ghost = replace(exact.part("drawer"), id=9, name="ghost", mesh=DRAWER.transformed(FAR))
    doubtful = replace(ghost, id=10, name="doubted", verdict=Verdict((DOUBT,)))
    bare = replace(ghost, id=11, name="bare", mesh=Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32)))
    walk = walk_scores(replace(exact, parts=(*exact.parts, ghost, doubtful, bare)), truth)
    assert (walk.count("invented", True), walk.count("invented", False)) == (2, 1)
    assert (walk.right, walk.room_right) == (3, False)


def test_of_like_fronts_in_a_row_each_is_its_own(truth: Truth, exact: Twin) -> None:
    """Axes are the same, and all states too: the surface tells."""
    moved = with_part(
        without(exact, "drawer_right"), "drawer", lambda p: replace(p, mesh=p.mesh.transformed(BESIDE))
    )
    walk = walk_scores(moved, truth)
    assert score(walk, "drawer") == (None, "missed")
    assert score(walk, "drawer_right") == ("drawer", "path")


def test_an_interval_shifted_by_more_than_half_its_length_is_lost(truth: Truth, exact: Twin) -> None:
    def shifted(by: float) -> IntervalCounts:
        def shift(p: Part) -> Part:
            a, b = p.motion.intervals[0]
            n = round(by * (b - a + 1))
            return replace(p, motion=replace(p.motion, intervals=((a + n, b + n), *p.motion.intervals[1:])))

        return walk_scores(with_part(exact, "door", shift), truth).intervals

    assert shifted(0.3).hits == 7
    late = shifted(0.55)
    assert late == IntervalCounts(6, 7, 7)
    assert late.f1 == pytest.approx(6 / 7)


def test_an_interval_of_the_wrong_part_is_no_hit(truth: Truth, exact: Twin) -> None:
    spans = {p.name: p.motion.intervals for p in exact.parts}
    swap = {"drawer": spans["drawer_right"], "drawer_right": spans["drawer"], "door": spans["door"]}
    parts = tuple(replace(p, motion=replace(p.motion, intervals=swap[p.name])) for p in exact.parts)
    assert walk_scores(replace(exact, parts=parts), truth).intervals == IntervalCounts(2, 7, 7)


def test_a_missed_part_costs_recall_over_all_and_none_over_what_is_found(truth: Truth, exact: Twin) -> None:
    walk = walk_scores(without(exact, "drawer"), truth)
    found = rows(walk)
    assert score(walk, "drawer") == (None, "missed")
    assert walk.intervals == IntervalCounts(3, 7, 3)
    assert found["interaction recall"] == (pytest.approx(3 / 7), 1.0)
    assert found["interaction precision"] == (1.0, 1.0)
    assert found["states within 5 deg or 2 cm"] == (pytest.approx(2 / 3), 1.0)
    assert found["parts right"] == (pytest.approx(2 / 3), 1.0)
    assert not walk.room_right


def test_shut_throughout_is_right_most_of_the_time_and_never_while_open() -> None:
    """A part that is open for 5 s of 90."""
    joint, mesh, grip = JOINTS["drawer"]
    states = np.zeros(FRAMES)
    states[300:375] = 0.3
    one = truth_of(true_part(2, "drawer", joint, mesh, grip, states, [(299, 300), (374, 375)]))
    still = with_part(
        twin_of(one), "drawer", lambda p: replace(p, motion=replace(p.motion, state=np.zeros(FRAMES)))
    )
    found = rows(walk_scores(still, one))
    assert found["states within 5 deg or 2 cm"][0] == pytest.approx(1 - 5 / 90)
    assert found["states within 5 deg or 2 cm, part not closed"][0] == 0.0
    assert found["states unknown"][0] == 0.0


def test_unknown_frames_count_as_not_right_and_are_told(truth: Truth, exact: Twin) -> None:
    def seen(p: Part) -> Part:
        return only(p, (p.motion.frames < 500) | (p.motion.frames >= 800))

    walk = walk_scores(with_part(exact, "door", seen), truth)
    door = next(p for p in walk.parts if p.name == "door").states
    assert (door.frames, door.right, door.unknown) == (FRAMES, FRAMES - 300, 300)
    assert door.opened_unknown == 300
    assert door.opened_right == door.opened - 300
    # frames without a pose are no frames of the states
    lost = exact.cameras
    rest = Trajectory(lost.frames[500:], lost.times[500:], lost.T_world_cam[500:])
    assert walk_scores(replace(exact, cameras=rest), truth).states.frames == 3 * (FRAMES - 500)


def test_a_part_is_right_over_all_its_interactions(truth: Truth, exact: Twin) -> None:
    def early(p: Part) -> Part:
        return only(p, p.motion.frames < 1000)

    def stuck(p: Part) -> Part:
        return replace(
            p, motion=replace(p.motion, state=np.where(p.motion.frames < 700, p.motion.state, 0.0))
        )

    assert score(walk_scores(with_part(exact, "door", early), truth), "door") == ("door", "path")
    assert score(walk_scores(with_part(exact, "drawer", stuck), truth), "drawer") == ("drawer", "path")


def test_a_false_sign_is_seen(truth: Truth, exact: Twin) -> None:
    turned = with_part(
        exact, "drawer_right", lambda p: replace(p, joint=replace(p.joint, axis=-p.joint.axis))
    )
    walk = walk_scores(turned, truth)
    assert score(walk, "drawer_right") == ("drawer_right", "path")
    negative = with_part(
        exact, "drawer_right", lambda p: replace(p, motion=replace(p.motion, state=-p.motion.state))
    )
    walk = walk_scores(negative, truth)
    states = walk.parts[2].states
    assert score(walk, "drawer_right") == ("drawer_right", "path")
    assert states.opened_right < 0.1 * states.opened
    assert states.right < states.frames - 0.9 * states.opened


def test_states_have_the_tolerance_of_success(truth: Truth, exact: Twin) -> None:
    def off(part: int, by: float) -> float:
        found = exact.parts[part]
        moved = replace(found, motion=replace(found.motion, state=found.motion.state + by))
        counts = state_counts(moved, truth.parts[part], np.arange(FRAMES))
        return counts.right / counts.frames

    assert (off(1, 0.0199), off(1, 0.0201)) == (1.0, 0.0)
    assert (off(0, np.radians(-4.9)), off(0, np.radians(-5.1))) == (1.0, 0.0)
    assert state_counts(exact.parts[0], truth.parts[1], np.arange(FRAMES)).right == 0  # of another type


def test_wrong_masks_and_no_masks_are_not_right(truth: Truth, exact: Twin) -> None:
    walk = walk_scores(replace(exact, labels={}), truth)
    assert {p.cause for p in walk.parts} == {"labels"}
    assert len(walk.matched) == 3
    half = {
        f: np.where((image == 2) & (np.arange(30) < 7), 1, image).astype(np.uint8)
        for f, image in exact.labels.items()
    }
    assert score(walk_scores(replace(exact, labels=half), truth), "door") == ("door", "labels")


def bent(exact: Twin, frame: int, T: Array) -> Trajectory:
    """Cameras whose world is another from a frame on."""
    c = exact.cameras
    assert c is not None
    return replace(
        c, T_world_cam=np.where((c.frames >= frame)[:, None, None], T @ c.T_world_cam, c.T_world_cam)
    )


def test_a_bend_between_interactions_costs_the_loop_and_nothing_local(truth: Truth, exact: Twin) -> None:
    walk = walk_scores(
        replace(exact, cameras=bent(exact, 500, geo.make_pose(translation=[0.02, 0, 0]))), truth
    )
    assert max(walk.local.mm) < 1e-9
    assert walk.pieces[0].ate_mm == pytest.approx(20 * np.sqrt(500 * 850) / FRAMES, rel=1e-3)


def test_local_errors_are_those_of_pairs_inside_an_interaction(truth: Truth, exact: Twin) -> None:
    """Of the door's opening, the pairs with a jump of 3 mm between them."""
    walk = walk_scores(
        replace(exact, cameras=bent(exact, 100, geo.make_pose(translation=[0.003, 0, 0]))), truth
    )
    a, b = truth.parts[0].spans[0]
    assert b - a < 60
    off = np.array(walk.local.mm)
    assert np.sum(off > 1.0) == (100 - a) * (b - 100 + 1)
    np.testing.assert_allclose(off[off > 1.0], 3.0)
    assert (
        len(off)
        == walk.local.pairs
        == sum((n := d - c + 1) * (n - 1) // 2 for p in truth.parts for c, d in p.spans)
    )
    turned = walk_scores(
        replace(exact, cameras=bent(exact, 100, geo.make_pose(geo.exp_so3([0, 0, 0.01])))), truth
    )
    assert max(turned.local.deg) == pytest.approx(np.degrees(0.01))


def test_pairs_are_at_most_sixty_frames_apart() -> None:
    joint, mesh, grip = JOINTS["drawer"]
    long = truth_of(true_part(2, "drawer", joint, mesh, grip, course(0.3, (100, 300, 1)), [(100, 300)]))
    a, b = long.parts[0].spans[0]
    assert b - a > 100
    assert walk_scores(twin_of(long), long).local.pairs == sum(b - a + 1 - d for d in range(1, 61))


def test_pieces_that_were_not_joined_are_aligned_each_for_itself(truth: Truth, exact: Twin) -> None:
    """The second half of the walk, and the part that moves there, lie in a world of their own."""
    T = geo.make_pose(geo.exp_so3([0, 0, 1.0]), [2.0, 0, 0])
    moved = {p.name: p for p in in_world(exact, T).parts}
    torn = with_part(replace(exact, cameras=bent(exact, 610, T)), "drawer_right", lambda p: moved[p.name])
    assert walk_scores(torn, truth).pieces[0].ate_mm > 100.0
    pieces = [(610, FRAMES - 1), (0, 609)]
    walk = walk_scores(torn, truth, pieces)
    assert [(p.first, p.last, p.frames) for p in walk.pieces] == [
        (0, 609, 610),
        (610, FRAMES - 1, FRAMES - 610),
    ]
    assert max(p.ate_mm for p in walk.pieces) < 1e-6
    assert "ATE of the piece 0..609" in walk_table(walk)
    assert score(walk, "drawer_right") == ("drawer_right", None)
    a, b = truth.parts[2].spans[0]
    assert walk.local.pairs - len(walk.local.mm) == (610 - a) * (b - 610 + 1)
    assert max(walk.local.mm) < 1e-6


def test_frames_have_a_pose_a_named_gap_or_neither(truth: Truth, exact: Twin) -> None:
    c = exact.cameras
    assert c is not None
    keep = (c.frames < 500) | (c.frames >= 540)
    holed = replace(exact, cameras=Trajectory(c.frames[keep], c.times[keep], c.T_world_cam[keep]))
    poses = walk_scores(holed, truth, gaps=[(495, 519), (510, 529)]).poses
    assert (poses.frames, poses.posed, poses.named, poses.neither) == (FRAMES, FRAMES - 40, 30, 10)


def test_wrong_pieces_and_gaps_are_named(truth: Truth, exact: Twin) -> None:
    for pieces, said in (
        ([(0, 700), (700, FRAMES)], "two pieces .* frame 700"),
        ([(0, 700)], "frame 701 has a pose and lies in no piece"),
        ([(0, FRAMES), (FRAMES + 1, FRAMES + 9)], "no frame of the piece 1351"),
        ([], "frame 0 has a pose"),
    ):
        with pytest.raises(InputError, match=said):
            walk_scores(exact, truth, pieces)
    with pytest.raises(InputError, match=r"gap 9\.\.3 does not lie"):
        walk_scores(exact, truth, gaps=[(9, 3)])
    with pytest.raises(InputError, match="no cameras"):
        walk_scores(replace(exact, cameras=None), truth)
    with pytest.raises(InputError, match="doesn't tell meshes, labels"):
        walk_scores(exact, replace(truth, known=truth.known - {"meshes", "labels"}))


def test_of_a_part_moved_twice_what_lies_between_is_not_moving(truth: Truth) -> None:
    door = truth.parts[0]
    (a, b), (c, d) = door.spans
    np.testing.assert_array_equal(door.moving_frames, [*range(a, b + 1), *range(c, d + 1)])
    assert door.span == (a, d)
    # what moves between two motions of a part is no counterpart of it
    between = twin_of(truth).part("drawer").motion
    assert match_parts([(door.joint, between)], np.eye(4), replace(truth, parts=(door,))) == {}


def test_nothing_found_is_finite_and_all_charged(truth: Truth, exact: Twin) -> None:
    walk = walk_scores(replace(exact, parts=()), truth)
    found = rows(walk)
    assert found["parts found"] == (0.0, None)
    assert found["interaction F1"] == (0.0, None)
    assert found["states within 5 deg or 2 cm"] == (0.0, None)
    assert "nan" not in (walk_table(walk) + json.dumps(summary(walk))).lower()


def test_scores_are_read_back_as_written(truth: Truth, exact: Twin) -> None:
    walk = walk_scores(without(exact, "drawer"), truth)
    assert WalkScores.from_dict(json.loads(json.dumps(walk.as_dict()))) == walk
    assert (walk.local + walk.local).quantile(0.5) == walk.local.quantile(0.5)
    assert LocalErrors().quantile(0.5) is None


def test_evaluate_prints_the_walk_of_a_walk_alone(truth: Truth, exact: Twin) -> None:
    one = replace(truth, parts=truth.parts[2:])
    assert not is_walk(one)
    assert is_walk(replace(truth, parts=truth.parts[1:2]))
    less = truth.known - {"labels", "static", "hand"}
    clip = evaluate(without(without(exact, "door"), "drawer"), replace(one, known=less))
    assert clip.walk is None
    assert "walk" not in clip.as_dict()
    blind = evaluate(exact, replace(truth, known=less))
    assert blind.walk is None
    assert blind.remarks[0] == "no measures of a walk: the truth doesn't tell labels"


def test_rates_of_walks_are_those_of_their_sums(truth: Truth, exact: Twin) -> None:
    ghost = replace(exact.part("drawer"), id=9, name="ghost", mesh=DRAWER.transformed(FAR))
    bad = walk_scores(and_part(without(exact, "drawer"), ghost), truth)
    good = walk_scores(exact, truth)
    two = pooled([good, bad])
    assert (two.walks, two.parts, two.found, two.right, two.rooms_right) == (2, 6, 5, 5, 1)
    assert (two.trusted, two.trusted_right, two.invented_trusted, two.invented_untrusted) == (6, 5, 1, 0)
    assert two.intervals == IntervalCounts(10, 14, 14)
    assert two.intervals_matched == IntervalCounts(10, 10, 10)
    assert two.states.right == good.states.right + bad.states.right
    assert pooled([bad, good]) == two
    assert pooled([good, good]).local.quantile(0.9) == good.local.quantile(0.9)
    texts = dict(lines(two))
    low, high = binomtest(5, 6).proportion_ci(method="wilson")
    assert texts["parts found"] == f"5/6 = 83 % [{100 * low:.0f}-{100 * high:.0f}]"
    assert texts["rooms right"].startswith("1/2 = 50 %")
    assert texts["interaction F1, all"] == "0.714"
    nothing = dict(lines(pooled([])))
    assert {v for k, v in nothing.items() if "part" in k or "pose" in k or "local" in k} == {"-"}


def test_the_error_of_paths_is_over_all_their_frames(truth: Truth, exact: Twin) -> None:
    torn = walk_scores(exact, truth, [(0, 449), (450, FRAMES - 1)])
    pieces = (replace(torn.pieces[0], ate_mm=6.0), replace(torn.pieces[1], ate_mm=3.0))
    both = pooled([replace(torn, pieces=pieces)])
    assert (both.torn, both.ate_mm) == (1, pytest.approx(np.sqrt((36 + 2 * 9) / 3)))

"""The judge of walks: exact is exact, order and world change nothing, each mistake costs what it should."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.evaluation.evaluate import evaluate, match_parts
from recon.evaluation.truth import Truth
from recon.evaluation.walk_rows import summary, walk_rows, walk_table
from recon.evaluation.walk_scores import IntervalCounts, LocalErrors, WalkScores
from recon.evaluation.walks import is_walk, state_counts, walk_scores
from tests.makers.recon.tiny import DRAWER, JOINTS, in_world, twin_of
from tests.makers.recon.walked import BESIDE, FRAMES, score, true_part, truth_of, with_part
from tests.makers.twin.judged import DOUBT
from twin import geometry as geo
from twin.scene import Mesh, Part, Trajectory, Twin
from twin.verdict import Verdict

FAR = geo.make_pose(translation=[0.0, 0.0, 1.0])


def without(twin: Twin, name: str) -> Twin:
    return replace(twin, parts=tuple(p for p in twin.parts if p.name != name))


def and_part(twin: Twin, part: Part) -> Twin:
    return replace(twin, parts=(*twin.parts, part))


def only(part: Part, keep: NDArray[np.bool_]) -> Part:
    """A part whose state is known in some frames only (n,) bool."""
    m = part.motion
    return replace(part, motion=replace(m, frames=m.frames[keep], times=m.times[keep], state=m.state[keep]))


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

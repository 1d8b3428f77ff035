"""The judge: exact is exact, a moved world changes nothing, every mistake is seen, every failure is
charged."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.variants import KINDS, write_frames, write_variant
from recon.evaluation import surface_scores
from recon.evaluation.evaluate import Evaluation, camera_errors, evaluate, joint_errors, label_scores
from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from recon.evaluation.walks import walk_scores
from recon.readers import open_recording
from recon.verbs.twins import evaluate_step
from tests.makers.recon.tiny import JOINTS, TRAVEL, in_world, merged, twin_of, write_recording
from twin import geometry as geo
from twin.errors import InputError
from twin.scene import HAND_LABEL, Mesh, Part, Prismatic, Revolute, Trajectory, Twin
from twin.storage import load, save

ONES = {
    "frames with camera", "hand mIoU", "static mesh completeness", "type right",
    "opening direction right", "closed end right", "moving frames with state", "interval IoU", "interval precision",
    "interval recall", "ADD", "ADD-S", "ADD AUC to 10 cm", "part mIoU", "part mesh completeness", "success",
    "success, 5 deg and 2 cm",
}  # fmt: skip


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    return load_truth(write_recording(tmp_path_factory.mktemp("tiny") / "both", ("door", "drawer"), 40))


@pytest.fixture(scope="module")
def exact(truth: Truth) -> Twin:
    return twin_of(truth)


def assert_exact(evaluation: Evaluation, gap: float = 1.0) -> None:
    """Zero (mm, cm, deg) or one in every row."""
    assert evaluation.ok
    for r in evaluation.rows:
        expected = gap if r.metric == "longest gap of labels" else float(r.metric in ONES)
        assert r.value == pytest.approx(expected, abs=1e-3), r
        assert r.matched == r.value, r


def with_part(twin: Twin, name: str, change: Callable[[Part], Part]) -> Twin:
    return replace(twin, parts=tuple(change(p) if p.name == name else p for p in twin.parts))


def test_exact_twin_scores_zero_or_one_everywhere(truth: Truth, exact: Twin) -> None:
    evaluation = evaluate(exact, truth)
    assert_exact(evaluation)
    values = {r.metric: r.value for r in evaluation.rows}
    for metric in (
        "ATE",
        "RPE",
        "up",
        "axis",
        "pivot, point to line",
        "state",
        "range",
        "screw path",
        "handle path",
    ):
        assert values[metric] == 0.0, metric


def test_moved_world_scores_the_same(truth: Truth, exact: Twin) -> None:
    T = geo.make_pose(geo.exp_so3([0, 0, 2.0]), [3.0, -1.0, 0.5])
    assert_exact(evaluate(in_world(exact, T), truth))


def test_saved_and_loaded_twin_scores_the_same(truth: Truth, exact: Twin, tmp_path: Path) -> None:
    save(exact, tmp_path / "run" / "twin")
    assert_exact(evaluate(load(tmp_path / "run"), truth.folder))


def test_tilted_world_is_seen_in_up_alone(truth: Truth, exact: Twin) -> None:
    evaluation = evaluate(in_world(exact, geo.make_pose(geo.exp_so3([np.radians(3.0), 0, 0]))), truth)
    assert evaluation.row("up").value == pytest.approx(3.0, abs=1e-6)
    assert [r.metric for r in evaluation.rows if r.ok is False] == ["up"]


def test_played_backwards_and_cut_truths_are_exact_too(truth: Truth, tmp_path: Path) -> None:
    for kind in KINDS:
        cut = load_truth(write_variant(truth.folder.parent, tmp_path / kind, kind))
        assert_exact(evaluate(twin_of(cut), cut))


def test_a_recording_that_starts_ajar_is_judged_from_its_own_most_closed_state(
    truth: Truth, tmp_path: Path
) -> None:
    source = truth.folder.parent
    cut = load_truth(
        write_frames(source, tmp_path / "ajar", open_recording(source), truth, list(range(10, 40)))
    )
    assert cut.parts[0].closed > 0.3
    assert_exact(evaluate(twin_of(cut), cut))


def test_flipped_axis_is_seen(truth: Truth, exact: Twin) -> None:
    for name in ("door", "drawer"):
        flipped = with_part(exact, name, lambda p: replace(p, joint=replace(p.joint, axis=-p.joint.axis)))
        evaluation = evaluate(flipped, truth)
        assert evaluation.row("axis", name).value == 0.0
        assert evaluation.row("opening direction right", name).value == 0.0
        assert evaluation.row("screw path", name).value > 90.0
        assert evaluation.row("closed end right", name).value == 1.0
        assert evaluation.row("success", name).value == 0.0


def test_wrong_closed_end_is_seen(truth: Truth, exact: Twin) -> None:
    """A consistent twin whose state 0 is the open pose."""

    def swap(p: Part) -> Part:
        T = p.joint.pose(p.joint.upper)
        states = p.joint.upper - p.motion.state
        joint = replace(p.joint, axis=-p.joint.axis)
        return replace(p, joint=joint, motion=replace(p.motion, state=states), mesh=p.mesh.transformed(T))

    evaluation = evaluate(with_part(exact, "door", swap), truth)
    assert evaluation.row("closed end right", "door").value == 0.0
    assert evaluation.row("opening direction right", "door").value == 0.0
    assert evaluation.row("axis", "door").value == 0.0
    assert evaluation.row("state", "door").value == pytest.approx(0.0, abs=1e-9)
    assert evaluation.row("part mesh accuracy", "door").ok is False


def test_missing_part_is_charged_and_left_out_of_matched_only(truth: Truth, exact: Twin) -> None:
    evaluation = evaluate(replace(exact, parts=exact.parts[1:]), truth)
    charged = {
        "type right": 0.0, "axis": 90.0, "pivot, point to line": 1000.0, "state": np.degrees(TRAVEL["door"]),
        "interval IoU": 0.0, "part mIoU": 0.0, "part mesh completeness": 0.0, "contact": 1000.0, "ADD": 0.0,
        "success": 0.0, "success, 5 deg and 2 cm": 0.0, "screw path": 180.0,
    }  # fmt: skip
    for metric, value in charged.items():
        row = evaluation.row(metric, "door")
        assert row.value == pytest.approx(value), metric
        assert row.ok is not True
    assert evaluation.row("axis", "door").matched is None
    assert evaluation.row("axis", "all parts").value == 45.0
    assert evaluation.row("axis", "all parts").matched == 0.0
    assert evaluation.row("type right", "all parts").value == 0.5
    assert evaluation.row("axis", "drawer").value == 0.0
    assert evaluation.row("spurious parts").value == 0.0


def test_nothing_reconstructed_still_gives_a_finite_table(truth: Truth, exact: Twin) -> None:
    nothing = Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
    empty = replace(exact, parts=(), labels={}, static=replace(exact.static, mesh=nothing))
    evaluation = evaluate(empty, truth)
    assert all(np.isfinite(r.value) for r in evaluation.rows)
    for metric in (
        "hand mIoU",
        "part mIoU",
        "static mesh accuracy",
        "hand on hand-free frames",
        "longest gap of labels",
    ):
        assert evaluation.row(metric).ok is False, metric
    assert "nan" not in json.dumps(evaluation.as_dict()).lower()


def test_spurious_part_is_counted(truth: Truth, exact: Twin) -> None:
    ghost = replace(
        exact.parts[0], id=9, name="ghost", motion=replace(exact.parts[0].motion, intervals=((38, 39),))
    )
    evaluation = evaluate(replace(exact, parts=(*exact.parts, ghost)), truth)
    assert evaluation.row("spurious parts").value == 1.0
    assert evaluation.row("axis", "door").value == 0.0


def test_parts_match_by_what_they_do_not_by_their_ids(truth: Truth, exact: Twin) -> None:
    renamed = tuple(replace(p, id=12 - p.id) for p in exact.parts[::-1])
    relabel = {
        f: np.where(im == 2, 10, np.where(im == 3, 9, im)).astype(np.uint8) for f, im in exact.labels.items()
    }
    assert_exact(evaluate(replace(exact, parts=renamed, labels=relabel), truth))


def test_wrong_type_is_charged(truth: Truth, exact: Twin) -> None:
    slide = Prismatic(np.array([1.0, 0, 0]), 0.0, 0.5)
    evaluation = evaluate(with_part(exact, "door", lambda p: replace(p, joint=slide)), truth)
    assert evaluation.row("type right", "door").value == 0.0
    assert evaluation.row("axis", "door").value == 90.0
    assert evaluation.row("pivot, point to line", "door").value == 1000.0
    assert evaluation.row("state", "door").value == pytest.approx(np.degrees(TRAVEL["door"]))
    assert evaluation.row("axis", "door").matched is None
    assert evaluation.row("interval IoU", "door").value == 1.0


def test_known_errors_of_a_hinge_are_told_as_they_are(truth: Truth, exact: Twin) -> None:
    true = truth.part(2)
    assert isinstance(true.joint, Revolute)
    motion = exact.part("door").motion
    shifted = replace(true.joint, pivot=true.joint.pivot + [0.010, 0, 0])
    errors = joint_errors(shifted, motion, np.eye(4), truth, true)
    assert errors.pivot_line_mm == pytest.approx(10.0)
    assert errors.pivot_mm == pytest.approx(10.0)
    assert errors.axis_deg == 0.0
    tilt = np.radians(2.0)
    far = true.joint.pivot + [0, 0, 2.0]  # the lines meet 1.7 m above the door's middle
    tilted = replace(true.joint, axis=geo.exp_so3([tilt, 0, 0]) @ true.joint.axis, pivot=far)
    errors = joint_errors(tilted, motion, np.eye(4), truth, true)
    assert errors.axis_deg == pytest.approx(2.0)
    assert errors.pivot_line_mm == pytest.approx(0.0, abs=1e-6)
    centroid = true.closed_mesh.area_centroid
    assert errors.pivot_mm == pytest.approx(1e3 * (far[2] - centroid[2]) * np.tan(tilt), rel=0.02)


def test_state_scale_range_and_coverage(truth: Truth, exact: Twin) -> None:
    true, motion = truth.part(3), exact.part("drawer").motion
    short = replace(true.joint, upper=0.28)
    errors = joint_errors(short, replace(motion, state=motion.state + 0.05), np.eye(4), truth, true)
    assert errors.range == pytest.approx(20.0)
    assert errors.state == pytest.approx(0.0, abs=1e-9)
    keep = ~np.isin(motion.frames, true.moving_frames[:2])
    gappy = replace(motion, frames=motion.frames[keep], times=motion.times[keep], state=motion.state[keep])
    errors = joint_errors(true.joint, gappy, np.eye(4), truth, true)
    n = len(true.moving_frames)
    assert errors.state_share == pytest.approx((n - 2) / n)
    assert errors.add == pytest.approx((n - 2) / n)
    assert errors.handle_rmse_mm == pytest.approx(0.0, abs=1e-9)


def test_camera_noise_and_lost_frames(truth: Truth) -> None:
    true = truth.cameras
    jitter = true.T_world_cam.copy()
    jitter[:, :3, 3] += np.random.default_rng(1).normal(0, 0.003, (truth.frames, 3))
    errors = camera_errors(Trajectory(true.frames[2:], true.times[2:], jitter[2:]), truth)
    assert errors.share == pytest.approx(38 / 40)
    assert errors.ate_mm == pytest.approx(3.0 * np.sqrt(3), rel=0.2)
    assert errors.rpe_mm == pytest.approx(3.0 * np.sqrt(6), rel=0.25)
    assert errors.rpe_deg == pytest.approx(0.0, abs=1e-6)
    with pytest.raises(InputError, match="not in the truth"):
        camera_errors(Trajectory(true.frames + 500, true.times, jitter), truth)


def test_hand_labels_on_hand_free_frames_are_counted(truth: Truth) -> None:
    free = [f for f in truth.labels if not np.any(truth.labels[f] == HAND_LABEL)]
    labels = {f: np.array(truth.labels[f]) for f in truth.labels}
    for f in free:
        labels[f][:18] = HAND_LABEL  # a quarter of the rows
    scores = label_scores(labels, truth)
    assert scores[HAND_LABEL].false_share == pytest.approx(0.25)
    assert scores[HAND_LABEL].other_frames == len(free)
    assert scores[HAND_LABEL].miou == 1.0
    with pytest.raises(InputError, match="48x36"):
        label_scores({0: labels[0][::2, ::2]}, truth)


def test_gap_in_the_labels_is_seen(truth: Truth, exact: Twin) -> None:
    def gap(frames: list[int]) -> tuple[float, bool | None]:
        row = evaluate(replace(exact, labels={f: exact.labels[f] for f in frames}), truth).row(
            "longest gap of labels"
        )
        return row.value, row.ok

    assert gap(list(range(0, 40, 4))) == (4.0, True)
    assert gap(list(range(0, 40, 5))) == (5.0, False)
    assert gap(list(range(20))) == (21.0, False)


def test_contact_is_judged_against_the_reachable_surface(truth: Truth, exact: Twin) -> None:
    def move(p: Part) -> Part:
        assert p.contact is not None
        return replace(p, contact=replace(p.contact, point=JOINTS["door"][2] + [0, -0.1, 0]))

    row = evaluate(with_part(exact, "door", move), truth).row("contact", "door")
    assert row.value == pytest.approx(90.0, abs=0.01)  # the grip is 10 mm in front of the bar
    none = with_part(exact, "door", lambda p: replace(p, contact=None))
    row = evaluate(none, truth).row("contact", "door")
    assert (row.value, row.matched, row.ok) == (1000.0, None, False)


def test_surface_errors_see_an_offset_and_a_hole(truth: Truth, exact: Twin) -> None:
    lifted = with_part(
        exact,
        "drawer",
        lambda p: replace(p, mesh=p.mesh.transformed(geo.make_pose(translation=[0, -0.006, 0]))),
    )
    row = evaluate(lifted, truth).row("part mesh accuracy", "drawer")
    assert 1.5 < row.value < 6.0  # faces along the shift stay on the surface
    front = geo.make_pose(translation=[0, -0.05, 0])
    far = with_part(exact, "drawer", lambda p: replace(p, mesh=p.mesh.transformed(front)))
    assert evaluate(far, truth).row("part mesh completeness", "drawer").value < 0.5
    doubled = replace(
        exact.static,
        mesh=merged(truth.static, truth.static.transformed(geo.make_pose(translation=[0, 0, 0.3]))),
    )
    evaluation = evaluate(replace(exact, static=doubled), truth)
    assert evaluation.row("static mesh accuracy").ok is False
    assert evaluation.row("static mesh completeness").value == 1.0


def test_of_a_long_recording_some_frames_stand_for_all(
    truth: Truth, exact: Twin, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = open_recording(truth.folder.parent)
    every = surface_scores.seen_points(recording, truth)
    monkeypatch.setattr(surface_scores, "MOST_FRAMES", 20)
    some = surface_scores.seen_points(recording, truth)
    for key, points in every.items():
        assert len(some[key]) == pytest.approx(len(points) / 2, rel=0.05)
    assert_exact(evaluate(exact, truth))


def test_table_tells_goals_and_misses(truth: Truth, exact: Twin) -> None:
    text = evaluate(replace(exact, parts=exact.parts[1:]), truth).table()
    lines = text.splitlines()
    assert any(
        line.startswith("axis") and "door" in line and "90" in line and "MISSED" in line for line in lines
    )
    assert lines[-1] == "both: 20 of 33 goals met"


def test_a_clip_of_two_parts_has_the_table_of_a_walk_too(truth: Truth, exact: Twin, tmp_path: Path) -> None:
    evaluation = evaluate(exact, truth)
    assert evaluation.walk is not None
    assert evaluation.walk == walk_scores(exact, truth)  # which scores the masks itself
    assert evaluation.walk.room_right
    lines = evaluation.table().splitlines()
    assert [line.split() for line in lines if line.startswith("parts found")] == [
        ["parts", "found", "1", "-", "share", "2", "of", "2"]
    ]
    assert evaluation.as_dict()["walk"]["rows"][0]["metric"] == "parts found"
    save(replace(exact, parts=exact.parts[1:]), tmp_path / "run" / "twin")
    outcome = evaluate_step(lambda *_: None, tmp_path / "run", truth.folder).outcome
    assert [t.title for t in outcome.tables] == ["both", "both, the walk", "both, its parts"]
    assert list(outcome.tables[2].rows[0][:3]) == ["door", "-", "missed"]


def test_wrong_inputs_are_named(truth: Truth, exact: Twin, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no truth\.json"):
        evaluate(exact, tmp_path)
    with pytest.raises(InputError, match="no cameras"):
        evaluate(replace(exact, cameras=None), truth)
    short = load_truth(write_variant(truth.folder.parent, tmp_path / "half", "half"))
    whole = open_recording(truth.folder.parent)
    with pytest.raises(InputError, match=r"40 frames.* has 20"):
        evaluate(exact, short, whole)


@pytest.mark.parametrize("name", ["kitchen_hinge", "kitchen_microwave", "kitchen_slide"])
def test_truth_of_the_shared_recordings_is_exact(funtwin_data: Path, name: str) -> None:
    true = load_truth(funtwin_data / "recordings" / name)
    some = {f: true.labels[f] for f in range(0, true.frames, 4)}
    assert_exact(evaluate(replace(twin_of(true), labels=some), true), gap=4.0)

"""Truth of HOI4D: joints derived from annotated poses are the true ones, and what is wrong is told."""

from __future__ import annotations

import pickle
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import recon
from benchmarks.layouts import datasets as write
from recon.evaluation.evaluate import evaluate
from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from tests.makers.recon.annotated import (
    FRAMES,
    annotated,
    assert_exact,
    assert_joints,
    cameras_of,
    hoi4d,
)
from twin import geometry as geo
from twin.errors import InputError
from twin.scene import Recorded, Revolute, Twin


@pytest.mark.parametrize("beside", [False, True])
def test_hoi4d_joints_states_and_cameras(
    own: Truth, recording: recon.Recording, tmp_path: Path, beside: bool
) -> None:
    clip = hoi4d(own, recording, tmp_path, beside)
    found = load_truth(clip)
    assert_joints(found, own)
    assert found.cameras is not None
    np.testing.assert_allclose(found.cameras.T_world_cam, cameras_of(own), atol=1e-9)
    assert found.known == {"cameras", "intervals", "states", "centres", "all parts"}
    assert [p.spans for p in found.parts] == [p.spans for p in own.parts]
    assert found.notes == ()
    if beside:
        assert_joints(load_truth(tmp_path / "HOI4D_annotations" / write.CLIP), own)


def test_hoi4d_exact_twin_is_exact_in_what_is_known(
    own: Truth, exact: Twin, recording: recon.Recording, tmp_path: Path
) -> None:
    truth = load_truth(hoi4d(own, recording, tmp_path))
    evaluation = evaluate(exact, truth)
    assert_exact(evaluation, truth)
    assert evaluation.name == "ZY20210800001_H1_C4_N11_S1_s1_T1"
    for metric in (
        "handle path",
        "ADD",
        "part mIoU",
        "closed end right",
        "opening direction right",
        "up",
        "contact",
    ):
        assert metric in evaluation.unknown
    text = evaluation.table().splitlines()
    assert text[-2].startswith("not known from this truth: up, hand mIoU, ")
    assert "goals met" in text[-1]


def test_hoi4d_mistakes_are_seen(own: Truth, exact: Twin, recording: recon.Recording, tmp_path: Path) -> None:
    truth = load_truth(hoi4d(own, recording, tmp_path))
    door, drawer = exact.parts
    tilted = replace(drawer.joint, axis=geo.exp_so3(np.radians(3.0) * geo.orthogonal_basis(drawer.joint.axis)[:, 0]) @ drawer.joint.axis)  # fmt: skip
    assert isinstance(door.joint, Revolute)
    shifted = replace(door.joint, pivot=door.joint.pivot + 0.02 * geo.orthogonal_basis(door.joint.axis)[:, 0])
    short = replace(drawer.motion, state=0.5 * drawer.motion.state)
    twin = replace(exact, parts=(replace(door, joint=shifted), replace(drawer, joint=tilted, motion=short)))
    evaluation = evaluate(twin, truth)
    assert evaluation.row("axis", "drawer").value == pytest.approx(3.0, abs=0.01)
    assert evaluation.row("pivot, line to line", "door").value == pytest.approx(20.0, abs=0.1)
    assert evaluation.row("pivot, point to line", "door").value == pytest.approx(20.0, abs=0.1)
    assert evaluation.row("state", "drawer").value > 20.0
    assert not evaluation.ok
    missing = evaluate(replace(exact, parts=exact.parts[1:]), truth)
    assert missing.row("type right", "door").value == 0.0
    assert missing.row("state", "door").value == pytest.approx(np.degrees(1.2), abs=0.1)


def test_hoi4d_inverted_cameras_would_be_seen(own: Truth, recording: recon.Recording, tmp_path: Path) -> None:
    clip = write.write_hoi4d(recording, tmp_path)
    write.write_hoi4d_annotations(clip, cameras_of(own), annotated(own))
    inverted = write.write_hoi4d_annotations(tmp_path / "inverted", geo.invert_pose(cameras_of(own)), [])
    shutil.copy(inverted / "3Dseg" / "output.log", clip / "3Dseg" / "output.log")
    with pytest.raises(AssertionError):
        assert_joints(load_truth(clip), own)


def test_hoi4d_intervals_are_the_annotated_events(
    own: Truth, recording: recon.Recording, tmp_path: Path
) -> None:
    first, second = own.parts[0].segments[0], own.parts[1].segments[0]
    events = [
        ("rest", 0.0, 0.2),
        *((n, a / 15, (b + 1) / 15) for n, (a, b) in (("open", first), ("Pull", second))),
    ]
    found = load_truth(hoi4d(own, recording, tmp_path, events=events))
    assert [p.spans for p in found.parts] == [(first,), (second,)]
    found = load_truth(hoi4d(own, recording, tmp_path / "other", events=[("grasp", 0.0, 1.0)]))
    assert [p.spans for p in found.parts] == [p.spans for p in own.parts]


def test_hoi4d_frames_without_annotation_are_not_filled(
    own: Truth, exact: Twin, recording: recon.Recording, tmp_path: Path
) -> None:
    clip = hoi4d(own, recording, tmp_path)
    for k in (7, 8, 20):
        (clip / "objpose" / f"{k}.json").unlink()
    truth = load_truth(clip)
    assert_joints(truth, own)
    assert np.flatnonzero(np.isnan(truth.parts[0].states)).tolist() == [7, 8, 20]
    evaluation = evaluate(exact, truth)
    for metric in ("state", "range", "axis"):
        assert evaluation.row(metric, "door").value == pytest.approx(0.0, abs=1e-3)
    assert evaluation.row("moving frames with state", "door").value == 1.0


def test_hoi4d_what_is_carried_is_no_joint(
    own: Truth, exact: Twin, recording: recon.Recording, tmp_path: Path
) -> None:
    k = np.arange(FRAMES) / FRAMES
    loop = np.stack([0.4 * np.sin(6 * k), 0.3 * np.cos(9 * k), 0.3 * k], axis=1)
    cup = np.stack(
        [geo.make_pose(geo.exp_so3([2 * s, np.sin(4 * s), s]), t) for s, t in zip(k, loop, strict=True)]
    )
    parts = [*annotated(own), ("cup", cup, (0.1, 0.1, 0.1))]
    truth = load_truth(hoi4d(own, recording, tmp_path, parts=parts))
    assert_joints(truth, own)
    assert truth.notes[0].startswith("cup: its annotated poses are")
    evaluation = evaluate(exact, truth)
    assert "spurious parts" in evaluation.unknown  # the twin may rightly hold what is left out
    assert evaluation.notes == truth.notes


def test_hoi4d_same_labels_are_parts_by_their_order(
    own: Truth, recording: recon.Recording, tmp_path: Path
) -> None:
    parts = [("furniture", T, size) for _, T, size in annotated(own)]
    found = load_truth(hoi4d(own, recording, tmp_path, parts=parts))
    assert [p.name for p in found.parts] == ["furniture 2", "furniture 3"]


class _Boom:
    """Runs code when it is unpickled."""

    def __reduce__(self) -> Any:
        return (pytest.fail, ("a pickle was opened",))


def test_pickles_are_named_and_not_opened(own: Truth, recording: recon.Recording, tmp_path: Path) -> None:
    clip = hoi4d(own, recording, tmp_path)
    (clip / "handpose").mkdir()
    (clip / "handpose" / "0.pickle").write_bytes(pickle.dumps(_Boom()))
    assert load_truth(clip).notes == ("s1/T1/handpose holds pickles, which can run code: hands are not read",)
    view = write.write_itaco_rendered(recording, tmp_path / "sim")
    (view.parent / "actor_pose.pkl").write_bytes(pickle.dumps(_Boom()))
    with pytest.raises(InputError, match="pickled, which can run code: it is not read"):
        load_truth(view)


def test_hoi4d_refusals(own: Truth, recording: recon.Recording, tmp_path: Path) -> None:
    clip = write.write_hoi4d(recording, tmp_path)
    with pytest.raises(InputError, match="has no objpose/"):
        load_truth(clip)
    write.write_hoi4d_annotations(clip, cameras_of(own), annotated(own), events=[("open", 0, 1)])
    pose, action = clip / "objpose" / "3.json", clip / "action" / "color.json"
    text = pose.read_text()
    for bad in (
        '{"dataList": [{"label": "x"}]}',
        '{"dataList": 3}',
        "[]",
        "{",
        text.replace('"x": ', '"x": 1e999, "y": '),
        text.replace("0.4", "400"),
    ):
        pose.write_text(bad)
        with pytest.raises(InputError, match=r"3\.json") as caught:
            load_truth(clip)
        assert "\n" not in str(caught.value)
    pose.write_text(text)
    (clip / "objpose" / "90.json").write_text(text)
    with pytest.raises(InputError, match=r"of frame 90, 3Dseg/output\.log has 40"):
        load_truth(clip)
    (clip / "objpose" / "90.json").unlink()
    action.write_text('{"info": {"duration": 0}, "events": []}')
    with pytest.raises(InputError, match="lists no events"):
        load_truth(clip)
    action.unlink()
    (clip / "3Dseg" / "output.log").unlink()
    with pytest.raises(InputError, match=r"has no 3Dseg/output\.log"):
        load_truth(clip)


def test_truth_of_another_clip_is_refused(
    own: Truth, exact: Twin, recording: recon.Recording, tmp_path: Path
) -> None:
    truth = load_truth(hoi4d(own, recording, tmp_path))
    short = replace(exact, recorded=Recorded("other", 30, "0"))
    with pytest.raises(InputError, match=r"other has 30 frames, .* has 40"):
        evaluate(short, truth)
    with pytest.raises(InputError, match="no cameras to align"):
        evaluate(replace(exact, cameras=None), truth)

"""Truth that others annotated: only what is known is judged; Arti4D's axes and intervals, and our own layout
in part."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import recon
from benchmarks.layouts import datasets as write
from recon.evaluation.evaluate import evaluate, match_parts
from recon.evaluation.imported.nested_yaml import nested_mapping
from recon.evaluation.known import EVERYTHING, NEEDS, measurable
from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from tests.makers.recon.annotated import (
    SCENE_ONLY,
    arti4d,
    assert_exact,
    assert_joints,
    hoi4d,
)
from tests.makers.recon.tiny import twin_of
from twin.errors import InputError
from twin.scene import Twin
from twin.storage import save


def test_whole_truth_allows_every_measure(own: Truth, recording: recon.Recording) -> None:
    assert own.known == EVERYTHING
    evaluation = evaluate(twin_of(own), own)
    names = {r.metric for r in evaluation.rows}
    assert names | {"part on frames without it"} == set(NEEDS)  # both parts are in all frames
    assert (evaluation.unknown, evaluation.notes, evaluation.remarks) == ((), (), [])


# Arti4D


@pytest.mark.parametrize("slam", [False, True])
def test_arti4d_axes_types_intervals_and_cameras(
    own: Truth, exact: Twin, recording: recon.Recording, tmp_path: Path, slam: bool
) -> None:
    truth = load_truth(arti4d(own, recording, tmp_path, slam=slam))
    assert_joints(truth, own)
    assert truth.known == {"cameras", "intervals", "all parts"}
    assert [p.spans for p in truth.parts] == [p.spans for p in own.parts]
    evaluation = evaluate(exact, truth)
    assert_exact(evaluation, truth)
    assert evaluation.name == write.SCENE
    assert {"state", "range", "pivot, point to line", "moving frames with state"} <= set(evaluation.unknown)


def test_arti4d_cues_that_cannot_be_are_told(
    own: Truth, exact: Twin, recording: recon.Recording, tmp_path: Path
) -> None:
    cues = [("door", 4, 12, "VERIFIED"), ("door", 14, 12, "VERIFIED"), ("drawer", 25, 34, "verified "), ("door", 1, 2, "OPEN"), ("door", 30, 90, "VERIFIED")]  # fmt: skip
    truth = load_truth(arti4d(own, recording, tmp_path, cues=cues))
    assert [p.spans for p in truth.parts] == [((4, 12),), ((25, 34),)]
    assert truth.notes == (
        "matched_cues.csv row 3: door from 14 to 12 ends before it starts, and is left out",
        "matched_cues.csv row 6: door from 30 to 90 is outside the 40 frames, and is left out",
        "matched_cues.csv: 1 rows are not VERIFIED, and are left out",
    )
    assert "spurious parts" in evaluate(exact, truth).unknown


def test_arti4d_without_cameras_axes_are_not_compared(
    own: Truth, exact: Twin, recording: recon.Recording, tmp_path: Path
) -> None:
    scene = arti4d(own, recording, tmp_path)
    shutil.rmtree(tmp_path / "meta")
    truth = load_truth(scene)
    evaluation = evaluate(replace(exact, cameras=None), truth)
    assert_exact(evaluation, truth)
    assert {r.metric for r in evaluation.rows} - SCENE_ONLY == {
        "spurious parts", "type right", "interval IoU", "interval precision", "interval recall",
    }  # fmt: skip
    assert evaluation.remarks[-1] == f"{write.SCENE} tells no camera in its map, so axes can't be compared"


def test_arti4d_slam_without_registration_is_in_no_map(
    own: Truth, recording: recon.Recording, tmp_path: Path
) -> None:
    scene = arti4d(own, recording, tmp_path, slam=True)
    (scene / "registration_matrix.json").unlink()
    assert load_truth(scene).cameras is None


def test_parts_match_by_time_alone_where_worlds_cannot_be_aligned(
    own: Truth, exact: Twin, recording: recon.Recording, tmp_path: Path
) -> None:
    cues = [("door", 4, 20, "VERIFIED"), ("drawer", 12, 28, "VERIFIED")]
    truth = load_truth(arti4d(own, recording, tmp_path, cues=cues))
    door, drawer = truth.parts
    motion = exact.parts[0].motion
    # the axes of the other part, as if another world made them look so
    found = [(a.joint, replace(motion, intervals=b.spans)) for a, b in ((drawer, door), (door, drawer))]
    assert match_parts(found, np.eye(4), truth) == {0: 1, 1: 0}
    assert match_parts(found, np.eye(4), replace(truth, cameras=None)) == {0: 0, 1: 1}


def test_arti4d_refusals(own: Truth, recording: recon.Recording, tmp_path: Path) -> None:
    scene = arti4d(own, recording, tmp_path)
    axes, meta, cues = (
        scene / f"{write.SCENE}.json",
        tmp_path / "raw" / "metadata.yaml",
        scene / "matched_cues.csv",
    )
    for file, change, match in (
        (axes, lambda t: t.replace('"axis"', '"direction"'), "no axis and position of door"),
        (axes, lambda _: "[1", "is not JSON"),
        (meta, lambda t: t.replace("REVOLUTE", "SCREW"), "no joint type of door, but 'SCREW'"),
        (meta, lambda t: t.replace(write.SCENE, "scene_other"), "tells no joint_types of rh201/"),
        (meta, lambda t: t.replace("joint_types", "kinds"), "holds nothing under joint_types"),
        (cues, lambda t: t.replace("CUE_START", "START"), "lacks CUE_START"),
        (cues, lambda t: t.replace("door,", "door,x"), "row 2 is"),
        (cues, lambda _: "", "is empty"),
    ):
        text = file.read_text()
        file.write_text(change(text))
        with pytest.raises(InputError, match=match) as caught:
            load_truth(scene)
        assert "\n" not in str(caught.value)
        file.write_text(text)
    meta.unlink()
    with pytest.raises(InputError, match=r"no metadata\.yaml in the folders above"):
        load_truth(scene)


def test_plain_yaml_is_read_as_yaml_reads_it_and_other_forms_are_refused(tmp_path: Path) -> None:
    yaml = pytest.importorskip("yaml")
    text = """# all
other: [1, {a: b}]
joint_types:
  rh201:   # a room
      scene_2025-04-25-10-36-37:
          door-1: REVOLUTE
          'drawer 2': "PRISMATIC"

      scene_2:
          lid: REVOLUTE # note
  rr080:
      scene_3:
          x: y
difficulty:
- EASY
"""
    file = tmp_path / "metadata.yaml"
    file.write_text(text)
    assert nested_mapping(file, "joint_types") == yaml.safe_load(text)["joint_types"]
    dumped = yaml.safe_dump({"joint_types": {"a": {"b": {"c": "REVOLUTE", "d": "PRISMATIC"}}}, "z": 1})
    file.write_text(dumped)
    assert nested_mapping(file, "joint_types") == {"a": {"b": {"c": "REVOLUTE", "d": "PRISMATIC"}}}
    for bad in (
        "joint_types:\n  a: {b: c}\n",
        "joint_types:\n  - a\n",
        "joint_types:\n\ta: b\n",
        "joint_types:\n  a: &x b\n",
    ):
        file.write_text(bad)
        with pytest.raises(InputError, match="line 2 is"):
            nested_mapping(file, "joint_types")
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="no YAML text"):
        nested_mapping(file, "joint_types")


# Our own layout, in part


def test_own_truth_says_what_it_knows(own: Truth, exact: Twin, tmp_path: Path) -> None:
    folder = tmp_path / "truth"
    folder.mkdir()
    data = json.loads((own.folder / "truth.json").read_text())
    for p in data["parts"]:
        del p["states"]
    (folder / "truth.json").write_text(
        json.dumps(data | {"known": ["cameras", "intervals", "all parts"], "hand": None})
    )
    shutil.copy(own.folder / "trajectory.txt", folder)
    truth = load_truth(folder)
    assert_joints(truth, own)
    evaluation = evaluate(exact, truth)
    assert {"axis", "ATE", "interval IoU"} <= {r.metric for r in evaluation.rows} <= {m for m in NEEDS if measurable(m, truth.known)}  # fmt: skip
    assert evaluation.row("axis", "door").value == pytest.approx(0.0, abs=1e-4)
    (folder / "truth.json").write_text(json.dumps(data | {"known": ["camera"]}))
    with pytest.raises(InputError, match="did you mean 'cameras'"):
        load_truth(folder)
    (folder / "truth.json").write_text(json.dumps(data))
    with pytest.raises(InputError):  # what does not say that it is partial has to be whole
        load_truth(folder)


def test_command_takes_a_clip_as_truth(
    own: Truth, exact: Twin, recording: recon.Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from twin.cli.main import run

    save(exact, tmp_path / "run" / "twin")
    clip = hoi4d(own, recording, tmp_path / "data")
    before = sorted(p for p in (tmp_path / "data").rglob("*"))
    assert run(["evaluate", str(tmp_path / "run"), "--truth", str(clip), "--json"]) in (0, 2)
    told = json.loads(capsys.readouterr().out)
    assert told["recording"].startswith("ZY20210800001")
    assert "ADD" in told["unknown"]
    assert sorted(p for p in (tmp_path / "data").rglob("*")) == before

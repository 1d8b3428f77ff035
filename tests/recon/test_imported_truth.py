"""Truth that others annotated: joints derived from poses are the true ones, and only what is known is judged."""

from __future__ import annotations

import json
import pickle
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import recon
from benchmarks.layouts import datasets as write
from recon.evaluation.evaluate import Evaluation, evaluate, match_parts
from recon.evaluation.imported.joint_from_poses import box_surface, fit_joint
from recon.evaluation.imported.nested_yaml import nested_mapping
from recon.evaluation.known import EVERYTHING, NEEDS, measurable
from recon.evaluation.truth import Truth, load_truth
from tests.recon.tiny import twin_of, write_recording
from twin import geometry as geo
from twin.errors import InputError
from twin.scene import Prismatic, Recorded, Revolute, Twin
from twin.storage import save

FRAMES = 40
SIZES = {"door": (0.4, 0.06, 0.5), "drawer": (0.4, 0.24, 0.2), "cabinet": (1.2, 0.5, 0.8)}
ONES = {"frames with camera", "type right", "moving frames with state", "interval IoU", "interval precision", "interval recall"}  # fmt: skip
SCENE_ONLY = {"longest gap of labels"}


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    return load_truth(write_recording(tmp_path_factory.mktemp("tiny") / "both", ("door", "drawer"), FRAMES))


@pytest.fixture(scope="module")
def recording(own: Truth) -> recon.Recording:
    return recon.open_recording(own.folder.parent)


@pytest.fixture(scope="module")
def exact(own: Truth) -> Twin:
    """The twin that is exactly the truth, in another world."""
    T = geo.make_pose(geo.exp_so3([0.2, -0.1, 2.0]), [3.0, -1.0, 0.5])
    twin = twin_of(own)
    parts = tuple(
        replace(p, mesh=p.mesh.transformed(T), joint=p.joint.transformed(T), contact=None) for p in twin.parts
    )
    static = replace(twin.static, mesh=twin.static.mesh.transformed(T))
    assert twin.cameras is not None
    recorded = Recorded("both", FRAMES, "0")
    return replace(twin, static=static, parts=parts, cameras=twin.cameras.transformed(T), recorded=recorded)


def cameras_of(own: Truth) -> Any:
    assert own.cameras is not None
    return own.cameras.T_world_cam


def annotated(own: Truth) -> list[tuple[str, Any, Any]]:
    """The parts as boxes that are turned against the world, and the cabinet, which is at rest."""
    boxes = []
    for p in own.parts:
        middle = geo.make_pose(geo.exp_so3([0.3, -0.4, 0.2]), p.mesh.area_centroid)
        boxes.append((p.name, p.T_world_part @ middle, SIZES[p.name]))
    rest = np.tile(geo.make_pose(geo.exp_so3([0, 0, 0.1]), [0, 0.8, 1.0]), (FRAMES, 1, 1))
    return [("cabinet", rest, SIZES["cabinet"]), *boxes]


def hoi4d(own: Truth, recording: recon.Recording, out: Path, beside: bool = False, **options: Any) -> Path:
    clip = write.write_hoi4d(recording, out)
    folder = out / "HOI4D_annotations" / write.CLIP if beside else clip
    write.write_hoi4d_annotations(folder, cameras_of(own), options.pop("parts", annotated(own)), **options)
    return clip


def arti4d(own: Truth, recording: recon.Recording, out: Path, cues: Any = None, **options: Any) -> Path:
    axes = {
        p.name: (p.joint.kind.upper(), (2.0 * p.joint.axis).tolist(), (p.joint.pivot if isinstance(p.joint, Revolute) else np.ones(3)).tolist())
        for p in own.parts
    }  # fmt: skip
    if cues is None:
        cues = [(p.name, *p.spans[0], "VERIFIED") for p in own.parts]
    return write.write_arti4d(recording, out, cameras_of(own), axes=axes, cues=cues, **options)


def assert_joints(found: Truth, own: Truth) -> None:
    """Axes within 0.1 deg, hinges within 1 mm, states within 0.1 deg or 0.1 mm up to sign and zero, where they are known."""
    assert [p.name for p in found.parts] == [p.name for p in own.parts]
    for p, true in zip(found.parts, own.parts, strict=True):
        assert p.joint.kind == true.joint.kind
        assert np.degrees(geo.line_angle(p.joint.axis, true.joint.axis)) <= 0.1
        if isinstance(p.joint, Revolute) and isinstance(true.joint, Revolute):
            off = geo.line_distance(p.joint.pivot, p.joint.axis, true.joint.pivot, true.joint.axis)
            assert off <= 1e-3
        if found.knows("states"):
            told = np.isfinite(p.states)
            sign = np.sign(p.joint.axis @ true.joint.axis)
            np.testing.assert_allclose(sign * p.states[told], (true.states - true.states[np.argmax(told)])[told], atol=1e-4)  # fmt: skip


def assert_exact(evaluation: Evaluation, truth: Truth) -> None:
    """Zero or one in every row, and a row for every measure that the truth allows, for no other."""
    names = {r.metric for r in evaluation.rows}
    assert names | SCENE_ONLY == {m for m in NEEDS if measurable(m, truth.known)} | SCENE_ONLY
    assert set(evaluation.unknown) == set(NEEDS) - names
    for r in evaluation.rows:
        if r.metric not in SCENE_ONLY:
            assert r.value == pytest.approx(float(r.metric in ONES), abs=2e-3), r
            assert r.matched == r.value, r
    assert evaluation.ok


def test_whole_truth_allows_every_measure(own: Truth, recording: recon.Recording) -> None:
    assert own.known == EVERYTHING
    evaluation = evaluate(twin_of(own), own)
    names = {r.metric for r in evaluation.rows}
    assert names | {"part on frames without it"} == set(NEEDS)  # both parts are in all frames
    assert (evaluation.unknown, evaluation.notes, evaluation.remarks) == ((), (), [])


# HOI4D


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


# The derivation of joints


def hinge_poses(angles: Any, middle: Any, noise: float = 0.0) -> Any:
    joint = Revolute(geo.unit([0.1, 0.2, 1.0]), pivot=np.array([0.5, -0.3, 0.2]))
    T = joint.poses(angles) @ middle
    rng = np.random.default_rng(3)
    wobble = [
        geo.make_pose(geo.exp_so3(rng.normal(0, 2 * noise, 3)), rng.normal(0, noise, 3))
        for _ in np.atleast_1d(angles)
    ]
    return joint, T @ np.stack(wobble)


@pytest.mark.parametrize("degrees", [12.0, -25.0, 90.0, 175.0])
def test_a_hinge_is_found_from_short_and_long_arcs(degrees: float) -> None:
    middle = geo.make_pose(geo.exp_so3([0.4, 0.1, 0.3]), [0.9, 0.1, 0.4])
    angles = np.radians(degrees) * np.linspace(0, 1, 30) ** 2
    joint, T = hinge_poses(angles, middle)
    fitted = fit_joint(T, np.array([0.5, 0.4, 0.02]))
    assert fitted is not None
    assert fitted.kind == "revolute"
    assert geo.line_angle(fitted.axis, joint.axis) < 1e-6
    assert geo.line_distance(fitted.pivot, fitted.axis, joint.pivot, joint.axis) < 1e-6
    np.testing.assert_allclose(fitted.states, np.abs(angles), atol=1e-6)
    assert np.sign(fitted.axis @ joint.axis) == np.sign(degrees)
    assert fitted.residual < 1e-6


def test_noise_of_annotations_moves_a_hinge_little() -> None:
    middle = geo.make_pose(translation=[0.9, 0.1, 0.4])
    joint, T = hinge_poses(np.radians(70.0) * np.linspace(0, 1, 300), middle, noise=0.003)
    fitted = fit_joint(T, np.array([0.5, 0.4, 0.02]))
    assert fitted is not None
    assert np.degrees(geo.line_angle(fitted.axis, joint.axis)) < 0.5
    assert geo.line_distance(fitted.pivot, fitted.axis, joint.pivot, joint.axis) < 0.003
    assert 0.002 < fitted.residual < 0.006


def test_slides_and_parts_at_rest() -> None:
    rng = np.random.default_rng(0)
    states = np.array([0.0, -0.1, -0.25, -0.3, -0.2])
    T = Prismatic(geo.unit([1.0, 2.0, 0.5])).poses(states) @ geo.make_pose(translation=[0, 1, 2])
    fitted = fit_joint(T, np.array([0.4, 0.3, 0.2]))
    assert fitted is not None
    assert fitted.kind == "prismatic"
    np.testing.assert_allclose(fitted.axis, -geo.unit([1.0, 2.0, 0.5]), atol=1e-9)
    np.testing.assert_allclose(fitted.states, -states, atol=1e-9)
    still = np.stack(
        [geo.make_pose(geo.exp_so3(rng.normal(0, 0.01, 3)), rng.normal(0, 0.003, 3)) for _ in range(20)]
    )
    assert fit_joint(still, np.array([0.4, 0.3, 0.2])) is None


def test_points_lie_even_on_the_box() -> None:
    size = np.array([0.4, 0.2, 0.1])
    points = box_surface(size, 20_000, np.random.default_rng(1))
    on_face = np.isclose(np.abs(points), size / 2)
    assert np.all(on_face.any(axis=1))
    assert np.all(np.abs(points) <= size / 2 + 1e-12)
    areas = np.array([0.02, 0.04, 0.08])
    np.testing.assert_allclose(on_face.mean(axis=0), areas / areas.sum(), atol=0.01)
    np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=0.005)


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

"""The closed end: decided by the furniture around the part, whichever way the recording runs and the axis
points."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recon.contact import closed_end
from recon.contact.closed_end import (
    ClosedEnd,
    find_closed_end,
    rebase,
    rebase_mesh,
    travel_ends,
)
from recon.contact.faces import sample
from recon.contact.front import front_of
from recon.evaluation.read_truth import load_truth
from recon.interaction.parts.moving_part import MovingPart
from recon.readers import open_recording
from recon.verdict.of_parts import CLOSED
from tests.makers.recon.cabinets import TRAVEL, Clip, Kind, make_clip
from tests.makers.recon.tiny import box, merged
from twin import geometry as geo
from twin.scene import Joint, Mesh, Motion, Prismatic, Revolute, Trajectory

NOTHING = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))


def closed_of(clip: Clip) -> ClosedEnd:
    return find_closed_end(clip.part, clip.mesh, clip.static, clip.recording, clip.cameras, clip.labels)


@pytest.mark.parametrize("axis_sign", [1, -1])
@pytest.mark.parametrize("backwards", [False, True], ids=["opening", "closing"])
@pytest.mark.parametrize("kind", ["door", "drawer", "slide"])
def test_closed_end_is_found(kind: Kind, backwards: bool, axis_sign: int) -> None:
    clip = make_clip(kind, backwards=backwards, axis_sign=axis_sign)
    found = closed_of(clip)
    assert found.source.startswith("covers a cavity" if kind == "slide" else "flush")
    assert found.probability >= CLOSED or (kind == "slide" and backwards)
    part = rebase(clip.part, found)
    tolerance = 0.01 * TRAVEL[kind]
    np.testing.assert_allclose(part.motion.state, clip.opening, atol=tolerance)
    assert part.joint.lower == 0.0
    assert part.joint.upper == pytest.approx(TRAVEL[kind], abs=tolerance)
    np.testing.assert_allclose(part.joint.axis, clip.true_joint.axis, atol=1e-12)
    closed = rebase_mesh(clip.mesh, clip.part, found)
    true = make_clip(kind).mesh  # its first frame is closed
    np.testing.assert_allclose(closed.vertices, true.vertices, atol=0.01)


@pytest.mark.parametrize("axis_sign", [1, -1])
@pytest.mark.parametrize("backwards", [False, True], ids=["opening", "closing"])
def test_a_drawer_whose_front_is_not_flush_comes_out_towards_the_viewer(
    backwards: bool, axis_sign: int
) -> None:
    """Its front stands 4 cm before its neighbours', and nothing is seen behind it."""
    clip = make_clip("drawer", backwards=backwards, axis_sign=axis_sign)
    front = box((0.0, -0.05 - clip.opening[0], 1.4), (0.596, 0.018, 0.2))
    found = find_closed_end(clip.part, front, clip.static, clip.recording, clip.cameras, {})
    assert found.source.startswith("farther from the viewer")
    assert found.probability > 0.85
    np.testing.assert_allclose(rebase(clip.part, found).motion.state, clip.opening, atol=0.003)


def test_a_drawer_that_is_flush_only_where_it_is_out_is_unsure() -> None:
    """As where what was labelled static is the drawer's own front."""
    clip = make_clip("drawer")
    y = -TRAVEL["drawer"]
    beside = [box((x, y, 1.4), (0.3, 0.018, 0.2)) for x in (-0.45, 0.45)]
    static = merged(*beside, *(box((0.0, y, z), (1.2, 0.018, 0.2)) for z in (1.2, 1.6)))
    found = find_closed_end(clip.part, clip.mesh, static, clip.recording, clip.cameras, clip.labels)
    assert found.source == "farther from the viewer"
    assert found.probability < CLOSED


def ajar(clip: Clip, least: float) -> MovingPart:
    """The clip's part, seen only where it stands open by more than `least` rad."""
    keep, m = clip.opening > least, clip.part.motion
    return replace(clip.part, motion=Motion(m.frames[keep], m.times[keep], m.state[keep]))


@pytest.mark.parametrize("backwards", [False, True], ids=["opening", "closing"])
@pytest.mark.parametrize("axis_sign", [1, -1])
def test_a_door_that_never_shuts_closes_where_it_would_be_flush_if_it_went_on(
    axis_sign: int, backwards: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is seen behind it, and at its ends it is flush with nothing."""
    clip = make_clip("door", backwards=backwards, axis_sign=axis_sign)
    part = ajar(clip, 0.35)
    told = (part, clip.mesh, clip.static, clip.recording, clip.cameras, {})
    found = find_closed_end(*told)
    assert found.source.startswith("flush with its surroundings if it went on")
    assert 0.5 < found.probability < CLOSED
    assert found.opening_sign == axis_sign
    seen = clip.opening[clip.opening > 0.35]
    np.testing.assert_allclose(rebase(part, found).motion.state, seen - seen.min(), atol=0.02)
    monkeypatch.setattr(closed_end, "PAST_HINGE", 0.0)
    assert find_closed_end(*told).probability < CLOSED


def test_a_door_that_would_be_flush_past_both_ends_is_unsure() -> None:
    """Past its open end stands a wall as high as the door."""
    clip = make_clip("door")
    part = ajar(clip, 0.35)
    past = clip.mesh.transformed(part.joint.pose(float(part.motion.state.max()) + 0.3))
    walled = merged(clip.static, past)
    found = find_closed_end(part, clip.mesh, walled, clip.recording, clip.cameras, clip.labels)
    assert found.probability < CLOSED


def test_frames_in_which_the_part_is_half_way_tell_nothing_of_the_cavity() -> None:
    """There the part still covers most of it. A wall is put into their pictures, right behind the part's
    closed pose."""
    clip = make_clip("slide")
    share = clip.opening / clip.opening.max()
    between = (share > 0.05) & (share < 0.75)
    assert between.sum() > 3

    def walled(i: int) -> np.ndarray:
        depth = clip.recording.depth(i)
        return np.minimum(depth, 1.06).astype(np.float32) if between[i] else depth

    clean, told = closed_of(clip), replace(clip, recording=replace(clip.recording, read_depth=walled))
    assert clean.source.startswith("covers a cavity")
    assert clean.probability > 0.9
    assert closed_of(told) == clean


@pytest.mark.parametrize("axis_sign", [1, -1])
@pytest.mark.parametrize("backwards", [False, True], ids=["opening", "closing"])
@pytest.mark.parametrize("gap", [0.0, 0.4], ids=["walls at both ends", "room left at the open end"])
def test_a_sliding_door_before_an_open_shelf_closes_at_the_wall(
    gap: float, backwards: bool, axis_sign: int
) -> None:
    """It hides as much of the shelf wherever it stands: only the wall at which its edge stops tells the ends
    apart."""
    clip = make_clip("slide", backwards=backwards, axis_sign=axis_sign)
    at, joint = int(np.argmin(clip.opening)), clip.part.joint
    door = clip.mesh.transformed(joint.pose(float(clip.part.motion.state[at])))  # closed
    low, high = door.vertices.min(axis=0), door.vertices.max(axis=0)
    way = np.sign(clip.true_joint.axis[0])
    y, z = 0.5 * (low + high)[1:] + [0.03, 0.0]
    ends = (low[0], high[0]) if way > 0 else (high[0], low[0])
    walls = (ends[0] - 0.01 * way, ends[1] + way * (TRAVEL["slide"] + gap + 0.01))
    static = merged(*(box((x, y, z), (0.018, 0.03, high[2] - low[2])) for x in walls))
    found = find_closed_end(clip.part, clip.mesh, static, clip.recording, clip.cameras, {})
    if gap:
        assert found.source.startswith("nearer to a wall")
        assert found.probability > 0.6
        assert rebase(clip.part, found).joint.axis @ clip.true_joint.axis > 0
    else:
        assert found.probability < CLOSED


@pytest.mark.parametrize("side", [-3.0, 3.0])
def test_the_front_is_the_large_face_also_for_a_camera_far_aside(side: float) -> None:
    """A thick hinged part; its flanks face the camera, and lie farther from it along their normals."""
    joint = Revolute(np.array([0.0, 0.0, 1.0]), pivot=np.array([-0.35, 0.0, 1.0]))
    part = MovingPart(2, joint, Motion(np.arange(3), np.arange(3) / 15.0, np.zeros(3)))
    eyes = np.array([[side, -0.6, 1.2]])
    face = front_of(sample(box((0.0, 0.0, 1.0), (0.7, 0.3, 0.8))), part, eyes)
    np.testing.assert_allclose(face.normal, [0.0, -1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(face.rim[:, 1], -0.15, atol=2e-3)


def test_a_small_piece_before_the_large_face_is_no_front() -> None:
    """A strip beside the hinge that stands 24 deg off the door and nearer to the viewer: its rim is not the
    door's."""
    joint = Revolute(np.array([0.0, 0.0, 1.0]), pivot=np.array([-0.35, 0.0, 1.0]))
    part = MovingPart(2, joint, Motion(np.arange(3), np.arange(3) / 15.0, np.zeros(3)))
    tilt = geo.make_pose(geo.exp_so3(np.array([0.0, 0.0, np.radians(24.0)])), [-0.25, -0.07, 1.0])
    strip = box((0.0, 0.0, 0.0), (0.17, 0.01, 0.8)).transformed(tilt)
    door = merged(box((0.0, 0.0, 1.0), (0.7, 0.02, 0.8)), strip)
    face = front_of(sample(door), part, np.array([[1.5, -2.0, 1.2]]))
    np.testing.assert_allclose(face.rim[:, 1], -0.01, atol=2e-3)
    assert np.ptp(face.rim[:, 0]) == pytest.approx(0.7, abs=0.02)


@pytest.mark.parametrize("axis_sign", [1, -1])
def test_without_any_cue_the_first_rest_pose_is_closed(axis_sign: int) -> None:
    clip = make_clip("door", axis_sign=axis_sign)
    found = find_closed_end(clip.part, NOTHING, NOTHING, clip.recording, clip.cameras, clip.labels)
    assert found.source == "first rest pose"
    assert found.probability < CLOSED
    assert found.state == pytest.approx(0.0, abs=0.01)
    assert found.opening_sign == axis_sign


JOINTS: list[Joint] = [
    Prismatic(geo.unit([0.3, -0.8, 0.2]), covariance=np.array([[4e-6, 1e-6], [1e-6, 9e-6]])),
    Revolute(
        geo.unit([0.1, 0.2, -0.9]),
        covariance=np.diag([1e-6, 4e-6, 9e-6, 1.6e-5]) + 5e-7,
        pivot=np.array([0.4, -0.2, 1.0]),
    ),
]


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("joint", JOINTS, ids=["prismatic", "revolute"])
def test_counting_anew_moves_no_point(joint: Joint, sign: int) -> None:
    rng = np.random.default_rng(5)
    state = sign * np.concatenate([np.zeros(10), np.linspace(0, 0.5, 20), np.full(10, 0.5)]) + 0.07
    frames = np.arange(40)
    part = MovingPart(2, joint, Motion(frames, frames / 15.0, state))
    mesh = Mesh(rng.normal(size=(9, 3)), np.arange(9, dtype=np.int32).reshape(3, 3))
    closed = ClosedEnd(float(state[0]), 1 if sign > 0 else -1, "test")
    new, new_mesh = rebase(part, closed), rebase_mesh(mesh, part, closed)
    for frame in (0, 17, 39):
        before, after = part.pose(frame), new.pose(frame)
        assert before is not None
        assert after is not None
        np.testing.assert_allclose(
            geo.transform(after, new_mesh.vertices), geo.transform(before, mesh.vertices), atol=1e-12
        )
    assert new.motion.state[0] == pytest.approx(0.0, abs=1e-12)
    assert new.joint.upper == pytest.approx(0.5)


@pytest.mark.parametrize("joint", JOINTS, ids=["prismatic", "revolute"])
def test_turning_the_axis_keeps_its_uncertainty_in_the_world(joint: Joint) -> None:
    frames = np.arange(20)
    part = MovingPart(2, joint, Motion(frames, frames / 15.0, -np.linspace(0, 0.5, 20)))
    new = rebase(part, ClosedEnd(0.0, -1, "test")).joint
    np.testing.assert_allclose(new.axis, -joint.axis)

    def in_world(j: Joint) -> np.ndarray:
        assert j.covariance is not None
        spread = np.kron(np.eye(len(j.covariance) // 2), geo.orthogonal_basis(j.axis)[:, :2])
        return spread @ j.covariance @ spread.T

    np.testing.assert_allclose(in_world(new), in_world(joint), atol=1e-18)


def test_ends_of_travel_do_not_grow_with_noise_or_frames() -> None:
    rng = np.random.default_rng(0)
    for frames in (60, 600):
        true = np.concatenate([np.zeros(frames // 3), np.linspace(0, 1, frames // 3), np.ones(frames // 3)])
        noisy = true + rng.normal(0, 0.01, len(true))
        noisy[rng.choice(len(true), 2, replace=False)] = [-3.0, 4.0]  # single frames gone wrong
        low, high = travel_ends(noisy)
        assert low == pytest.approx(0.0, abs=0.015)
        assert high == pytest.approx(1.0, abs=0.015)


@pytest.mark.parametrize("backwards", [False, True], ids=["opening", "closing"])
@pytest.mark.parametrize("name", ["kitchen_hinge", "kitchen_microwave", "kitchen_slide"])
def test_closed_end_of_recordings_with_true_labels(funtwin_data: Path, name: str, backwards: bool) -> None:
    folder = funtwin_data / "recordings" / name
    recording, truth = open_recording(folder), load_truth(folder)
    true, n = truth.parts[0], len(recording)
    order = np.arange(n)[::-1] if backwards else np.arange(n)
    clip = replace(
        recording,
        read_color=lambda i: recording.color(int(order[i])),
        read_depth=lambda i: recording.depth(int(order[i])),
    )
    frames = np.arange(n)
    start = float(true.states[order[0]])
    part = MovingPart(2, true.joint, Motion(frames, clip.times, true.states[order] - start))
    cameras = Trajectory(frames, clip.times, truth.cameras.T_world_cam[order])
    labels = {int(f): truth.labels[int(order[f])] for f in frames[::8]}
    mesh = true.mesh.transformed(true.joint.pose(start))
    found = find_closed_end(part, mesh, truth.static, clip, cameras, labels)
    assert found.opening_sign == 1
    assert found.state + start == pytest.approx(true.closed, abs=0.01)
    assert rebase(part, found).joint.upper == pytest.approx(true.travel, abs=0.01)

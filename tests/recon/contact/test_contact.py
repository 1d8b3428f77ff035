"""Contact: the hand's place on the part, told by its visible surface and by what stands off the part."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recon.contact import hand_keypoints as hands
from recon.contact.faces import sample
from recon.contact.find_contact import ContactConfig, HandPoints, _close, find_contact
from recon.contact.handles import find_edge, find_handle
from recon.evaluation.read_truth import load_truth
from recon.interaction.parts.moving_part import MovingPart
from recon.readers import open_recording
from tests.makers.recon.cabinets import BAR, FRAMES, Clip, Grip, Kind, make_clip
from tests.makers.recon.tiny import box, merged
from twin import geometry as geo
from twin.errors import ConfigError
from twin.scene import HAND_LABEL, ContactPath, Mesh, Motion, Prismatic, Trajectory

DEFAULT = ContactConfig()
BAR_M = 0.03  # how far off a contact may be; most are within 1 cm


def contact_of(clip: Clip, config: ContactConfig = DEFAULT) -> ContactPath:
    found = find_contact(clip.recording, clip.cameras, clip.labels, clip.part, clip.mesh, config)
    assert found is not None
    return found


def error(clip: Clip, found: ContactPath) -> float:
    """Distance from the grip centre beyond that of the part's surface."""
    return max(0.0, float(np.linalg.norm(found.point - clip.grip)) - clip.grip_depth)


CASES: list[tuple[Kind, Grip]] = [
    ("door", "bar"), ("drawer", "bar"), ("slide", "bar"), ("door", "knob"), ("drawer", "knob"),
]  # fmt: skip


@pytest.mark.parametrize("backwards", [False, True], ids=["opening", "closing"])
@pytest.mark.parametrize(("kind", "grip"), CASES, ids=[f"{k}-{g}" for k, g in CASES])
def test_contact_lies_where_the_fist_is(kind: Kind, grip: Grip, backwards: bool) -> None:
    clip = make_clip(kind, grip, backwards=backwards)
    found = contact_of(clip)
    assert error(clip, found) < 0.02
    assert grip in found.source
    assert found.frames
    assert set(found.frames) <= set(range(5, 21))


@pytest.mark.parametrize(("kind", "along"), [("door", [0, 0, 1.0]), ("drawer", [1.0, 0, 0])])
def test_axes_say_how_to_close_on_a_bar(kind: Kind, along: list[float]) -> None:
    found = contact_of(make_clip(kind))
    assert geo.line_angle(found.rotation[:, 1], along) < np.radians(5)
    assert geo.angle_between(found.rotation[:, 2], [0, -1.0, 0]) < np.radians(5)  # towards the person
    assert found.width == pytest.approx(BAR, abs=0.004)


def test_contact_turns_with_the_world() -> None:
    clip = make_clip("door")
    T = geo.exp_se3([0.7, -1.3, 0.4, 0.5, -0.8, 1.9])
    part = replace(clip.part, joint=clip.part.joint.transformed(T))
    found = find_contact(
        clip.recording, clip.cameras.transformed(T), clip.labels, part, clip.mesh.transformed(T)
    )
    assert found is not None
    expected = contact_of(clip)
    np.testing.assert_allclose(found.point, geo.transform(T, expected.point[None])[0], atol=0.006)
    assert geo.angle_between(found.rotation[:, 2], geo.rotate(T, expected.rotation[:, 2])) < np.radians(2)


def test_a_door_without_handle_is_held_by_its_free_edge() -> None:
    clip = make_clip("door", "edge")
    found = contact_of(clip)
    assert "edge" in found.source
    assert error(clip, found) < BAR_M
    assert geo.angle_between(found.rotation[:, 2], [1.0, 0, 0]) < np.radians(
        10
    )  # over the edge, away from the hinge
    assert geo.line_angle(found.rotation[:, 0], [0, 1.0, 0]) < np.radians(10)  # through the panel
    assert found.width == pytest.approx(0.018, abs=0.006)


def test_without_a_hand_there_is_no_contact_and_a_warning() -> None:
    clip = make_clip("door", hand=False)
    with pytest.warns(UserWarning, match="no hand"):
        found = find_contact(clip.recording, clip.cameras, clip.labels, clip.part, clip.mesh)
    assert found is None


def test_a_hand_elsewhere_is_no_contact() -> None:
    clip = make_clip("door")
    away = clip.mesh.transformed(geo.make_pose(translation=[0, 1.0, 0]))
    with pytest.warns(UserWarning, match="no hand"):
        assert find_contact(clip.recording, clip.cameras, clip.labels, clip.part, away) is None


@pytest.mark.parametrize("kind", ["door", "drawer"])
def test_a_rim_that_is_labelled_as_hand_is_no_hand(kind: Kind) -> None:
    """The part's outermost pixels on the side away from the arm, in every frame."""
    clip = make_clip(kind)
    labels = {}
    for frame, label in clip.labels.items():
        of_part, rim = label == clip.part.id, label.copy()
        rows = np.nonzero(of_part.any(axis=1))[0]
        rim[rows[0] : rows[0] + 4][of_part[rows[0] : rows[0] + 4]] = HAND_LABEL
        labels[frame] = rim
    assert sum(int(np.sum(labels[f] != clip.labels[f])) for f in labels) > 500
    assert error(clip, contact_of(replace(clip, labels=labels))) < 0.02


def test_a_bar_whose_middle_was_never_seen_is_still_held_there() -> None:
    clip = make_clip("drawer")
    v, f = fine(clip.mesh)
    middle = np.linalg.norm(v[f].mean(axis=1) - clip.grip, axis=1) < 0.045
    assert middle.any()
    found = contact_of(replace(clip, mesh=Mesh(v, f[~middle])))
    assert "bar" in found.source
    assert error(clip, found) < BAR_M


@pytest.mark.parametrize("kind", ["door", "slide"])
def test_a_handle_that_the_mesh_lacks_is_in_the_fist(kind: Kind) -> None:
    clip = make_clip(kind)
    panel = clip.mesh.faces[:12]  # the first box
    found = contact_of(replace(clip, mesh=Mesh(clip.mesh.vertices, panel)))
    assert "unseen handle" in found.source
    assert error(clip, found) < 0.04
    assert geo.angle_between(found.rotation[:, 2], [0, -1.0, 0]) < np.radians(5)


def fine(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """The mesh with faces of some centimetres."""
    import trimesh

    v, f = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 0.02, max_iter=12)
    return v, f.astype(np.int32)


def test_the_handle_at_the_hand_is_taken() -> None:
    panel = box((0, 0, 1.0), (1.0, 0.02, 0.4))
    knobs = [box((x, -0.03, 1.0), (0.03, 0.04, 0.03)) for x in (-0.3, 0.0, 0.3)]
    surface = sample(merged(panel, *knobs))
    touch = np.array([0.3, -0.06, 1.0]) + np.random.default_rng(0).normal(0, 0.01, (50, 3))
    handle = find_handle(surface, touch, Prismatic(np.array([0, -1.0, 0])))
    assert handle is not None
    assert handle.kind == "knob"
    np.testing.assert_allclose(handle.centre[[0, 2]], [0.3, 1.0], atol=0.005)
    np.testing.assert_allclose(handle.surface_point, [0.3, -0.05, 1.0], atol=0.005)


def test_noise_and_moulding_are_no_handle() -> None:
    panel = box((0, 0, 1.0), (0.6, 0.02, 0.4))
    moulding = box((0.2, -0.012, 1.0), (0.02, 0.006, 0.3))
    surface = sample(merged(panel, moulding))
    noisy = replace(
        surface, points=surface.points + np.random.default_rng(0).normal(0, 0.002, surface.points.shape)
    )
    touch = np.array([0.28, -0.03, 1.0]) + np.random.default_rng(0).normal(0, 0.01, (50, 3))
    joint = Prismatic(np.array([1.0, 0, 0]))
    assert find_handle(noisy, touch, joint) is None
    edge = find_edge(noisy, touch, joint)
    assert edge.centre[0] == pytest.approx(0.29, abs=0.01)


def test_how_near_a_hand_is_counts_in_each_frame_by_itself() -> None:
    """Frame 3 touches with ten points, the other ten are the palm; frame 4 hovers 2 cm off; frame 5 is
    elsewhere."""
    distance = np.repeat([0.0, 0.04, 0.02, 0.2], 10)
    hand = HandPoints(np.zeros((40, 3)), np.repeat([3, 3, 4, 5], 10), distance)
    kept = _close(hand, distance)
    assert kept.frame.tolist() == [3] * 10 + [4] * 10
    assert kept.distance.tolist() == [0.0] * 10 + [0.02] * 10


def keypoints_at(clip: Clip, at: np.ndarray, frames: list[int]) -> hands.HandKeypoints:
    """One hand in each frame, its fingertips at a point of the part."""
    points = np.full((len(frames), hands.KEYPOINTS, 3), np.nan)
    for row, frame in zip(points, frames, strict=True):
        pose, camera = clip.part.pose(frame), clip.cameras.pose(frame)
        assert pose is not None
        assert camera is not None
        row[list(hands.FINGERTIPS)] = geo.transform(geo.invert_pose(camera) @ pose, at[None])[0]
    return hands.HandKeypoints(np.array(frames), points[..., :2] * 0, points, np.ones(len(frames)))


def test_fingertips_can_tell_the_contact(monkeypatch: pytest.MonkeyPatch) -> None:
    clip = make_clip("door")
    told = clip.grip + [0, -0.01, 0.05]  # 5 cm up the bar from where the labels say
    found_by = keypoints_at(clip, told, [8, 10, 12])
    monkeypatch.setattr(hands, "detect_hands", lambda *_: found_by)
    found = contact_of(clip, ContactConfig(source="keypoints"))
    assert found.source.startswith("keypoints")
    assert found.frames == tuple(range(8, 13))
    assert found.point[2] - clip.grip[2] == pytest.approx(0.05, abs=0.005)


def test_without_detections_keypoints_fall_back_to_geometry(monkeypatch: pytest.MonkeyPatch) -> None:
    clip = make_clip("door")
    none = hands.HandKeypoints(np.zeros(0, int), np.zeros((0, 21, 2)), np.zeros((0, 21, 3)), np.zeros(0))
    monkeypatch.setattr(hands, "detect_hands", lambda *_: none)
    with pytest.warns(UserWarning, match="no fingertip"):
        found = contact_of(clip, ContactConfig(source="keypoints"))
    np.testing.assert_array_equal(found.point, contact_of(clip).point)


def test_settings_are_checked() -> None:
    with pytest.raises(ConfigError, match="'magic' must be one of 'geometry', 'keypoints'"):
        ContactConfig(source="magic")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["kitchen_hinge", "kitchen_microwave", "kitchen_slide"])
def test_contact_on_recordings_with_true_labels(funtwin_data: Path, name: str) -> None:
    folder = funtwin_data / "recordings" / name
    recording, truth = open_recording(folder), load_truth(folder)
    true = truth.parts[0]
    frames = np.arange(len(recording))
    part = MovingPart(2, true.joint, Motion(frames, recording.times, true.states, true.spans))
    cameras = Trajectory(frames, recording.times, truth.cameras.T_world_cam)
    labels = {f: truth.labels[f] for f in range(0, FRAMES * 4, 4)}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = find_contact(recording, cameras, labels, part, true.mesh)
    assert found is not None
    grip = geo.transform(geo.invert_pose(true.T_world_closed), true.handle[None])[0]
    from recon.evaluation.metrics import DistanceField

    beyond = np.linalg.norm(found.point - grip) - DistanceField(true.mesh).distance(grip[None])[0]
    assert beyond < 0.02

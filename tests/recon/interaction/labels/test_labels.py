"""Labels against exact truth, and the laws of the evidence they rest on."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from recon.dense.depth import depth_sigma
from recon.dense.noise import GOOD_SENSOR
from recon.dense.voxels import distinct, in_hull_of, largest_piece, near_piece, solid_core
from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from recon.interaction.labels.crf import agree, geodesic, upsample_labels
from recon.interaction.labels.evidence import Errors, Others, Pixels, compare, depth_range, median_depth
from recon.interaction.labels.first_scores import _score
from recon.interaction.labels.label_frames import LabelConfig, _warn_of_ends, label_frames
from recon.interaction.labels.reference_frames import View, find_references
from recon.interaction.labels.spreading import spread_along_surfaces
from recon.interaction.parts.moving_part import MovingPart
from recon.readers import open_recording
from recon.recording import Recording
from tests.makers.recon.tiny import write_recording
from twin import geometry as geo
from twin.errors import ConfigError, ReconstructionError
from twin.geometry import Array
from twin.scene import HAND_LABEL, Motion, Trajectory
from twin.voxels import voxel_centres, voxel_keys

Scene = tuple[Recording, Truth, tuple[MovingPart, ...]]


def true_parts(truth: Truth, times: Array) -> tuple[MovingPart, ...]:
    """The parts as the motion stages would hand them over, without error and with state 0 at the first
    frame."""
    return tuple(
        MovingPart(p.id, p.joint, Motion(np.arange(truth.frames), times, p.states, p.spans))
        for p in truth.parts
    )


def scene(folder: Path, *parts: str) -> Scene:
    """A tiny recording (192x144) of these parts with its truth."""
    write_recording(folder, parts, frames=30 * len(parts), scale=2)
    recording, truth = open_recording(folder), load_truth(folder)
    return recording, truth, true_parts(truth, recording.times)


@pytest.fixture(scope="module", params=["door", "drawer"])
def single(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return scene(tmp_path_factory.mktemp("single") / "r", request.param)


def mean_iou(labels: dict[int, NDArray[np.uint8]], truth: Truth, label: int) -> float:
    values = []
    for frame, found in labels.items():
        true = truth.labels[frame] == label
        if true.mean() >= 0.004:
            values.append((true & (found == label)).sum() / (true | (found == label)).sum())
    return float(np.mean(values))


def backwards(recording: Recording, cameras: Trajectory, parts: tuple[MovingPart, ...]) -> Scene:
    n = len(recording)
    back = replace(
        recording,
        read_color=lambda i: recording.color(n - 1 - i),
        read_depth=lambda i: recording.depth(n - 1 - i),
    )
    turned = Trajectory(cameras.frames, cameras.times, cameras.T_world_cam[::-1])
    moved = []
    for p in parts:
        spans = tuple((n - 1 - b, n - 1 - a) for a, b in p.motion.intervals[::-1])
        moved.append(replace(p, motion=replace(p.motion, state=p.motion.state[::-1], intervals=spans)))
    return back, turned, tuple(moved)  # type: ignore[return-value]


def test_part_and_hand_are_found(single: Scene) -> None:
    recording, truth, parts = single
    labels = label_frames(recording, truth.cameras, parts, LabelConfig(every=3))
    assert sorted(labels) == list(range(0, 30, 3))
    assert mean_iou(labels, truth, 2) >= 0.85
    assert mean_iou(labels, truth, HAND_LABEL) >= 0.75
    for frame, found in labels.items():
        assert found.shape == truth.labels[frame].shape
        assert found.dtype == np.uint8
        if not (truth.labels[frame] == HAND_LABEL).any():
            assert (found == HAND_LABEL).mean() <= 0.01


def test_a_camera_without_depth_on_plain_surfaces_loses_no_part(single: Scene) -> None:
    """As a stereo camera: spots without depth, larger than what neighbours settle, on half of every
    picture."""
    recording, truth, parts = single
    rng = np.random.default_rng(3)
    rough = cv2.GaussianBlur(rng.normal(size=(144, 192)), (0, 0), 6.0)
    blind = rough > np.median(rough)

    def spotted(i: int) -> NDArray[np.float32]:
        return np.where(np.roll(blind, 7 * i, axis=1), 0, recording.depth(i)).astype(np.float32)

    labels = label_frames(replace(recording, read_depth=spotted), truth.cameras, parts, LabelConfig(every=3))
    assert mean_iou(labels, truth, 2) >= 0.75


def test_the_number_of_threads_changes_no_label(single: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    recording, truth, parts = single
    found = []
    for count in ("1", "3"):
        monkeypatch.setenv("OMP_NUM_THREADS", count)
        found.append(label_frames(recording, truth.cameras, parts, LabelConfig(every=6)))
    assert list(found[0]) == list(found[1])
    assert all(np.array_equal(found[0][f], found[1][f]) for f in found[0])


def test_closing_is_labelled_as_well_as_opening(single: Scene) -> None:
    recording, truth, parts = single
    back, cameras, moved = backwards(recording, truth.cameras, parts)
    labels = label_frames(back, cameras, moved, frames=range(0, 30, 3))  # type: ignore[arg-type]
    forward = {29 - f: image for f, image in labels.items()}
    assert mean_iou(forward, truth, 2) >= 0.85
    assert mean_iou(forward, truth, HAND_LABEL) >= 0.75


def test_two_parts_are_told_apart(tmp_path: Path) -> None:
    recording, truth, parts = scene(tmp_path / "r", "door", "drawer")
    labels = label_frames(recording, truth.cameras, parts, LabelConfig(every=5))
    assert mean_iou(labels, truth, 2) >= 0.85
    assert mean_iou(labels, truth, 3) >= 0.85


def test_frames_without_a_camera_are_left_out(single: Scene) -> None:
    recording, truth, parts = single
    keep = np.setdiff1d(np.arange(30), [3, 4])
    cameras = Trajectory(keep, truth.cameras.times[keep], truth.cameras.T_world_cam[keep])
    assert sorted(label_frames(recording, cameras, parts, frames=[2, 3, 4, 5])) == [2, 5]
    with pytest.raises(ReconstructionError, match="camera pose"):
        label_frames(recording, cameras, parts, frames=[3, 4])
    with pytest.raises(ConfigError, match="every = 0 must be at least 1 frame"):
        LabelConfig(every=0)


def test_a_hand_in_the_first_frames_warns_and_still_gives_labels(tmp_path: Path) -> None:
    recording, truth, parts = scene(tmp_path / "r", "door")
    start = next(f for f in range(30) if (truth.labels[f] == HAND_LABEL).any())
    cameras = Trajectory(
        truth.cameras.frames[start:], truth.cameras.times[start:], truth.cameras.T_world_cam[start:]
    )
    with pytest.warns(UserWarning, match="before the first motion is free of the hand"):
        labels = label_frames(recording, cameras, parts, frames=range(start, 30, 4))
    assert mean_iou(labels, truth, 2) >= 0.7


def test_references_at_rest_show_no_hand(single: Scene) -> None:
    recording, truth, parts = single
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refs = find_references(recording, truth.cameras, parts, factor=1, slack=0.003)
    assert refs.rest_without_hand == (True, True)
    trusted = [f for f, t in zip(refs.frames, refs.trusted, strict=True) if t]
    assert all(not (truth.labels[f] == HAND_LABEL).any() for f in trusted)


@pytest.mark.parametrize(
    ("wall", "support", "violation"), [(1.0, 1.0, 0.0), (1.2, 0.0, 1.0), (0.8, 0.0, 0.0)]
)
def test_a_wall_supports_shows_empty_space_or_hides(wall: float, support: float, violation: float) -> None:
    out = compared(wall, np.eye(4))
    assert out[:, 4, 4] == pytest.approx([support, violation, 0.0, support])


def test_what_lands_in_the_plane_of_a_camera_tells_nothing() -> None:
    assert not compared(1.0, geo.make_pose(np.eye(3), [0.0, 0.0, -1.0])).any()


def compared(wall: float, move: Array) -> NDArray[np.float32]:
    """Evidence of a wall 1 m away, by a reference that a move (4, 4) leads to and that sees one so far
    away."""
    shape = (9, 9)
    color = np.zeros((*shape, 3), np.float32)
    out = np.zeros((4, *shape), np.float32)
    walls = np.full(shape, wall, np.float32)
    near, far = depth_range(walls)
    compare(
        Pixels(
            np.full(shape, 1.0, np.float32),
            color,
            np.zeros((*shape, 3), np.float32),
            np.ones(shape, bool),
            np.array([10, 10, 4, 4], np.float32),
        ),
        Others(
            move.astype(np.float32)[None, :3],
            walls[None],
            color[None],
            (near[None], far[None]),
            np.array([True]),
            np.array([1], np.int8),
        ),
        Errors(5.0, 0.003, GOOD_SENSOR.curve, 1.0),
        out,
    )
    return out


def test_shrunk_depth_holds_readings_only() -> None:
    depth = np.array([[1.0, 2.0, 0, 0], [0, 2.1, 0, 0]], np.float32)
    assert median_depth(depth, 2).tolist() == [[2.0, 0.0]]
    assert depth_sigma([0.4, 1.4]) == pytest.approx([0.002, 0.005])


def test_pieces_of_voxels_are_joined_by_faces_edges_and_corners() -> None:
    points = np.array([[0, 0, 0], [1, 1, 1], [2, 2, 1], [5, 5, 5]], np.float32) * 0.01 + 0.005
    keys = np.sort(voxel_keys(points, 0.01))
    piece = largest_piece(keys, np.array([1, 1, 1, 2.5], np.float32))
    assert piece.tolist() == [True, True, True, False]
    assert near_piece(keys, keys[:2]).tolist() == [True, True, True, False]


def test_distinct_keys_are_those_of_numpy() -> None:
    keys = np.random.default_rng(0).integers(-(2**40), 2**40, 9000)[np.arange(27_000) // 2 % 9000]
    found, place = distinct(keys)
    expected, inverse = np.unique(keys, return_inverse=True)
    assert np.array_equal(found, expected)
    assert np.array_equal(place, inverse)


def test_a_core_is_what_several_views_agree_on() -> None:
    size = 0.01
    solid = np.array([[0, 0, 0], [1, 0, 0], [-1, 1, 0]], np.float32) * size + 0.004
    once, alone = np.array([[2, 0, 0]], np.float32) * size, np.array([[9, 9, 9]], np.float32) * size + 0.004
    views = [np.concatenate([solid, alone])] * 3 + [once.astype(np.float32)] * 2
    core = solid_core(views, size)
    assert core == pytest.approx(np.array([[-0.005, 0.015, 0.005], [0.005] * 3, [0.015, 0.005, 0.005]]))
    assert np.array_equal(
        voxel_keys(core, size), voxel_keys(voxel_centres(voxel_keys(core, size), size), size)
    )
    far = np.array([[200, 0, 0], [201, 0, 0]], np.float32) * size + 0.004  # noise that stays, 2 m off
    wall = np.stack(np.meshgrid(np.arange(10), np.arange(10), [0]), axis=-1).reshape(-1, 3) * size + 0.004
    near = solid_core([np.concatenate([wall, far]).astype(np.float32)] * 3, size)
    assert len(near) == 100
    assert near[:, 0].max() < 0.2
    assert solid_core([], size).shape == (0, 3)
    assert solid_core([solid, solid], size).shape == (0, 3)


def test_a_hull_holds_what_walls_enclose_and_a_flat_one_nothing() -> None:
    front = np.array([[x, 0, z] for x in (0, 4) for z in (0, 2)], np.float32)
    back = front + np.array([0, 4, 0], np.float32)
    inside = np.array([[2, 2, 1], [2, 2, 2.1], [2, 4.5, 1], [-1, 2, 1]], np.float32)
    assert in_hull_of(np.concatenate([front, back]))(inside).tolist() == [True, False, False, False]
    assert not in_hull_of(front)(front).any()
    assert not in_hull_of(front[:0])(front).any()


@pytest.mark.parametrize("enclosed", [True, False])
def test_what_slides_along_itself_is_static_unless_the_part_encloses_it(enclosed: bool) -> None:
    shape = (20, 30)
    score = np.zeros((3, *shape), np.float32)
    score[0], score[2] = (
        1.5,
        -0.7,
    )  # static is supported everywhere; the part, somewhat less, only to the left
    score[1, :, :15], score[1, :, 15:] = 0.2, -4.0
    sure = np.zeros((2, *shape), bool)
    held = np.zeros((2, 1, *shape), bool)
    held[1] = True
    held[0, 0, 5:15, :8] = enclosed
    depth = np.where(np.arange(30) < 15, 1.0, 2.0).astype(np.float32) * np.ones(shape, np.float32)
    spread_along_surfaces(score, sure, held, View(0, depth, np.zeros((*shape, 3), np.float32)), 5.0)
    part = score.argmax(axis=0) == 1
    assert part[:, :12].all() == enclosed
    assert part.any() == enclosed
    assert not part[:, 15:].any()


def test_a_way_along_surfaces_goes_round_a_depth_edge() -> None:
    depth = np.ones((5, 21), np.float32)
    depth[:4, 10] = 2.0  # a slot that leaves one row open
    seeds = np.zeros(depth.shape, bool)
    seeds[0, 9] = True
    color = np.zeros((*depth.shape, 3), np.float32)
    length = geodesic(seeds, color, depth, 5.0, 3)
    assert length[0, 8] == pytest.approx(1.0)
    assert 7.0 < length[0, 11] < 15.0
    depth[4, 10] = 2.0
    assert geodesic(seeds, color, depth, 5.0, 3)[0, 11] > 50.0


def test_neighbours_settle_an_open_pixel_but_not_across_a_colour_edge() -> None:
    scores = np.zeros((2, 12, 12), np.float32)
    scores[0, :, :6], scores[1, :, 6:] = 4.0, 4.0
    scores[:, 5, 4] = 0.0
    scores[:, 5, 7] = 0.0
    color = np.zeros((12, 12, 3), np.float32)
    color[:, 6:] = 50.0
    depth = np.ones((12, 12), np.float32)
    belief = agree(scores, color, depth, 5.0, 3, 4, 3.0)
    assert belief[0, 5, 4] > 0.9
    assert belief[1, 5, 7] > 0.9
    large = np.repeat(np.repeat(color, 2, axis=0), 2, axis=1)
    ids = np.array([1, 255], np.uint8)
    full = upsample_labels(belief, color, depth, large, np.ones((24, 24), np.float32), 2, 5.0, ids)
    assert np.array_equal(full, np.where(large[..., 0] > 0, 255, 1))


def test_what_is_seen_at_its_place_at_other_states_weighs_against_being_seen_through() -> None:
    evidence = np.zeros((4, 1, 5), np.float32)
    evidence[0, 0] = [0, 2, 0, 0, 2]  # support
    evidence[1, 0] = [0, 0, 2, 2, 2]  # violation
    evidence[2:, 0, 3] = 1.0  # at lower and at higher states
    nothing, supported, violated, but_seen, both = _score(evidence)[0]
    assert nothing == 0.0
    assert violated < but_seen < 0.0 < supported
    assert violated < both < supported


def test_colour_counts_in_units_of_its_scale() -> None:
    """Twice the contrast at twice the scale, equal labels; the same contrast at a tenth of the scale, other
    ones."""
    rng = np.random.default_rng(0)
    scores = rng.normal(size=(2, 12, 16)).astype(np.float32)
    color = rng.normal(0, 4.0, (12, 16, 3)).astype(np.float32)
    full = np.repeat(np.repeat(color, 2, axis=0), 2, axis=1)
    depth, large = np.ones((12, 16), np.float32), np.ones((24, 32), np.float32)
    seeds, ids = np.zeros(depth.shape, bool), np.array([1, 2], np.uint8)
    seeds[0, 0] = True

    def results(contrast: float, scale: float) -> list[np.ndarray]:
        belief = agree(scores, contrast * color, depth, scale, 3, 4, 3.0)
        of_full = upsample_labels(belief, contrast * color, depth, contrast * full, large, 2, scale, ids)
        return [belief, of_full, geodesic(seeds, contrast * color, depth, scale, 2)]

    plain, doubled, strict = results(1.0, 5.0), results(2.0, 10.0), results(1.0, 0.5)
    for a, b, c in zip(plain, doubled, strict, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-5)
        assert np.abs(a.astype(float) - c).max() > 0.1


def test_a_hand_at_either_end_is_named() -> None:
    without, with_hand = np.ones((40, 50), np.uint8), np.ones((40, 50), np.uint8)
    with_hand[:5, :4] = HAND_LABEL
    with pytest.warns(
        UserWarning, match=r"start with the hand in the picture \(1.0% of the first"
    ) as at_start:
        _warn_of_ends({0: with_hand, 4: with_hand, 8: without})
    with pytest.warns(UserWarning, match=r"end with the hand in the picture \(1.0% of the last") as at_end:
        _warn_of_ends({0: without, 4: without, 8: with_hand})
    assert len(at_start) == len(at_end) == 1  # of the other end nothing is said
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _warn_of_ends({0: without, 4: with_hand, 8: without})

"""What changed tells parts without a track: surfaces, joints and states on cabinets of closed form, and
nothing where nothing moves."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from recon.dense.looks import HIDDEN, SAME, THROUGH, UNKNOWN, look
from recon.interaction.motion.change.depths import Depths
from recon.interaction.motion.change.kernels import BARED, FRESH, OLD, best_path
from recon.interaction.motion.change.surfaces import _torn, changed_surfaces, informative_rows, novelty
from recon.interaction.parts.changed.carried import CarriedSurfaces
from recon.interaction.parts.changed.proposals import Proposed, proposed_joints
from recon.interaction.parts.changed.search import ChangedPart, _worth_telling, changed_parts
from recon.recording import Intrinsics
from tests.makers.recon.cabinets import Clip, Kind, make_clip
from twin import geometry as geo
from twin.scene import Joint, Prismatic, Revolute


@pytest.fixture(scope="module", params=["door", "drawer", "slide"])
def clip(request: pytest.FixtureRequest) -> Clip:
    kind: Kind = request.param
    return make_clip(kind)


@pytest.fixture(scope="module")
def parts(clip: Clip) -> list[ChangedPart]:
    return changed_parts(clip.recording, clip.cameras)


def apart(joint: Joint, true: Joint) -> tuple[float, float]:
    """Angle of the axes in degrees, and distance of the hinges in metres."""
    away = 0.0
    if isinstance(joint, Revolute) and isinstance(true, Revolute):
        away = geo.line_distance(joint.pivot, joint.axis, true.pivot, true.axis)
    return float(np.rad2deg(geo.line_angle(joint.axis, true.axis))), away


def test_depth_alone_tells_joint_and_states(clip: Clip, parts: list[ChangedPart]) -> None:
    (part,) = parts
    found, true = part.oriented(0.02), clip.part
    assert found.joint.kind == true.joint.kind
    angle, away = apart(found.joint, true.joint)
    assert angle < 3.0
    assert away < 0.03
    moved, truth = np.abs(found.state - found.state[0]), np.abs(true.motion.state)
    assert np.all(moved[:7] < 0.02)  # it rests
    if clip.recording.depth(0).any() and true.joint.kind == "revolute":
        assert np.abs(moved - truth).max() < 0.12
    assert float(np.ptp(found.state)) > 0.9 * float(np.ptp(true.motion.state))


def test_changed_surfaces_lie_on_the_part(clip: Clip) -> None:
    depths = Depths.of(clip.recording, clip.cameras)
    found = [s for rest in (0, len(depths.frames) - 1) for s in changed_surfaces(depths, rest)]
    assert found
    for surface in found:
        state = float(clip.part.motion.state[surface.rest])
        at_rest = clip.mesh.transformed(clip.part.joint.pose(state))
        low, high = at_rest.vertices.min(axis=0) - 0.02, at_rest.vertices.max(axis=0) + 0.02
        inside = ((surface.points > low) & (surface.points < high)).all(axis=1)
        assert inside.mean() > 0.97


def test_nothing_moves_in_a_room_at_rest(clip: Clip) -> None:
    depth = clip.recording.depth(0)

    def noisy(frame: int) -> np.ndarray:
        noise = np.random.default_rng(frame).normal(0, 0.004, depth.shape)
        return np.where(depth > 0, depth + noise, 0).astype(np.float32)

    cameras = replace(clip.cameras, T_world_cam=np.tile(clip.cameras.T_world_cam[0], (26, 1, 1)))
    assert changed_parts(replace(clip.recording, read_depth=noisy), cameras) == []


def test_noise_is_measured(clip: Clip) -> None:
    for sigma in (0.004, 0.012):

        def noisy(frame: int, sigma: float = sigma) -> np.ndarray:
            noise = np.random.default_rng(frame).normal(0, sigma, (150, 200))
            return (np.linspace(1.5, 2.5, 150)[:, None] + noise).astype(np.float32)

        cameras = replace(clip.cameras, T_world_cam=np.tile(np.eye(4), (26, 1, 1)))
        noise = Depths.of(replace(clip.recording, read_depth=noisy), cameras).noise
        between = noise.base + 4.0 * noise.slope  # of the difference of two
        assert between == pytest.approx(np.sqrt(2.0) * sigma, rel=0.1)


def test_the_world_frame_does_not_matter(clip: Clip, parts: list[ChangedPart]) -> None:
    T = geo.make_pose(geo.exp_so3(np.array([0.3, -1.0, 0.4])), [2.0, -1.0, 0.5])
    (moved,) = changed_parts(clip.recording, clip.cameras.transformed(T))
    here, there = (p.oriented(0.02).joint for p in (parts[0], moved))
    angle, away = apart(there, here.transformed(T))
    assert angle < 3.0  # rounding may take the search another way; both are as near to the truth
    assert away < 0.03


def _explaining(score: float, first: int, last: int) -> ChangedPart:
    """A part that moves from one of 100 frames to another and explains so much."""
    state = np.interp(np.arange(100), [first, last], [0.0, 0.3])
    none = cast(CarriedSurfaces, None)
    return ChangedPart(Proposed("prismatic", np.eye(3)[0], np.zeros(3)), np.arange(100), state, score, none)


def test_a_further_part_explains_enough_or_moves_in_turn() -> None:
    door = _explaining(100.0, 20, 40)
    for score, first, last, told in (
        (31.0, 20, 40, True),
        (29.0, 20, 40, False),
        (29.0, 60, 80, True),
        (11.0, 60, 80, True),
        (9.0, 60, 80, False),
        (29.0, 35, 55, True),
        (13.0, 35, 55, False),
        (29.0, 25, 45, False),
    ):
        other = _explaining(score, first, last)
        assert _worth_telling([door, other]) == ([door, other] if told else [door])


@pytest.mark.parametrize("smear", [0, 1, 2])
def test_a_jump_of_depth_is_torn_however_a_sensor_smears_it_and_a_slant_is_not(smear: int) -> None:
    """An arm at 0.7 m before a front at 0.9 m, and a floor seen at a grazing angle."""
    arm = np.where(np.arange(80) < 40, 0.7, 0.9)
    box = np.ones(smear + 1) / (smear + 1)
    blurred = np.convolve(np.pad(arm, 8, mode="edge"), np.convolve(box, box), mode="same")[8:-8]
    torn = _torn(np.tile(blurred, (60, 1)).astype(np.float32))
    assert torn[2:-2, 36:44].any(axis=1).all()
    assert not torn[:, :36].any()
    assert not torn[:, 44:].any()
    floor = 60.0 / np.linspace(20.0, 60.0, 60)  # m; up to 14 cm a pixel
    assert not _torn(np.tile(floor[:, None], (1, 80)).astype(np.float32))[2:-2].any()


def test_a_rectangle_proposes_its_edges_and_its_normal() -> None:
    u, v = np.meshgrid(np.linspace(-0.3, 0.3, 40), np.linspace(-0.2, 0.2, 30))
    flat = np.stack([u.ravel(), v.ravel(), np.zeros(u.size)], axis=1)
    T = geo.make_pose(geo.exp_so3(np.array([0.5, 0.2, -0.4])), [1.0, 2.0, 3.0])
    noise = np.random.default_rng(0).normal(0, 0.002, flat.shape)
    proposed = proposed_joints(geo.transform(T, flat + noise))
    slides = [p for p in proposed if p.kind == "prismatic"]
    hinges = [p for p in proposed if p.kind == "revolute"]
    assert min(geo.line_angle(p.axis, T[:3, 2]) for p in slides) < 0.02
    for k, half in ((0, 0.2), (1, 0.3)):  # hinges along x lie at the ends of y, and the other way round
        for sign in (-1.0, 1.0):
            edge = geo.transform(T, np.eye(3)[1 - k][None] * sign * half)[0]
            off = [geo.point_line_distance(edge, p.pivot, p.axis) for p in hinges]
            nearest = hinges[int(np.argmin(off))]
            assert min(off) < 0.02
            assert geo.line_angle(nearest.axis, T[:3, k]) < 0.03


@pytest.mark.parametrize("strip", [0.03, 0.06, 0.11])
def test_a_hinge_is_proposed_where_the_strip_beside_it_was_not_seen_to_leave(strip: float) -> None:
    u, v = np.meshgrid(np.linspace(-0.3 + strip, 0.3, 40), np.linspace(-0.2, 0.2, 30))
    flat = np.stack([u.ravel(), v.ravel(), np.zeros(u.size)], axis=1)
    hinge, up = np.array([-0.3, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    near = [p for p in proposed_joints(flat) if geo.line_angle(p.axis, up) < 0.03]
    assert min(geo.point_line_distance(hinge, p.pivot, p.axis) for p in near) < 0.03


@pytest.mark.parametrize(("wide", "pieces"), [(2, False), (8, True)])
def test_a_door_that_holes_cut_into_pieces_is_one(wide: int, pieces: bool) -> None:
    clip = make_clip("door")

    def striped(frame: int) -> np.ndarray:
        depth = clip.recording.depth(frame).copy()
        for k in range(wide):
            depth[10 + k :: 44], depth[:, k::52] = 0, 0
        return depth

    recording = replace(clip.recording, read_depth=striped)
    assert (len(changed_surfaces(Depths.of(recording, clip.cameras), 0)) > 2) == pieces
    found = changed_parts(recording, clip.cameras)[0].oriented(0.02)
    angle, away = apart(found.joint, clip.part.joint)
    assert angle < 5.0  # refinement takes it on
    assert away < 0.03


def test_a_surface_that_is_seen_in_spots_is_one_surface() -> None:
    """A dark front returns no depth in 45 % of its pixels, other ones in each frame."""
    clip = make_clip("door")

    def spotted(frame: int) -> np.ndarray:
        lost = np.random.default_rng(frame).random(clip.labels[0].shape) < 0.45
        near = min(clip.labels, key=lambda f: abs(f - frame))
        return np.where(lost & (clip.labels[near] == clip.part.id), 0, clip.recording.depth(frame))

    recording = replace(clip.recording, read_depth=spotted)
    whole = (changed_surfaces(Depths.of(r, clip.cameras), 0) for r in (clip.recording, recording))
    (clean,), (seen,) = whole
    assert len(seen.points) > 0.45 * len(clean.points)
    assert (recording.depth(0)[seen.mask] > 0).all()
    (part,) = changed_parts(recording, clip.cameras)
    angle, away = apart(part.oriented(0.02).joint, clip.part.joint)
    assert angle < 3.0
    assert away < 0.03


def _came(thing: np.ndarray) -> Depths:
    """A wall at 2 m for ten frames, and then things (h, w) of this depth before it, 0 where there are
    none."""
    wall = np.full(thing.shape, 2.0, np.float32)
    depth = np.stack([wall] * 10 + [np.where(thing > 0, thing, wall).astype(np.float32)] * 10)
    camera = Intrinsics(thing.shape[1], thing.shape[0], 130.0, 130.0, 79.5, 59.5)
    grey = np.full((*depth.shape, 3), 128, np.uint8)
    return Depths(camera, np.arange(20), depth, grey, np.tile(np.eye(4), (20, 1, 1)))


def test_an_arm_before_a_door_that_came_is_another_surface() -> None:
    door = np.zeros((120, 160))
    door[20:100, 40:120] = 1.2
    (alone,) = changed_surfaces(_came(door), 19)
    arm = door.copy()
    arm[70:, 60:80] = 1.0
    both = changed_surfaces(_came(arm), 19)
    assert len(both) == 2
    for surface in both:
        z = surface.points[:, 2]
        assert np.ptp(z) < 0.01
    assert len(both[0].points) > 0.7 * len(alone.points)


@pytest.mark.parametrize("slope", [20.0, 60.0, 80.0])
def test_a_slanted_board_is_one_surface(slope: float) -> None:
    board = np.zeros((120, 160))
    ray = (np.arange(40, 120) - 79.5) / 130.0
    board[20:100, 40:120] = 1.2 / np.maximum(1.0 + ray * np.tan(np.radians(slope)), 1e-3)
    board[board > 1.8] = 0.0
    (whole,) = changed_surfaces(_came(board), 19)
    assert len(whole.points) > 0.9 * np.count_nonzero(board) - 300


def test_poses_of_a_proposed_joint_are_those_of_a_twins() -> None:
    axis, pivot, states = (
        geo.unit(np.array([1.0, 2.0, 0.5])),
        np.array([0.3, -0.2, 1.0]),
        np.linspace(-1, 2, 7),
    )
    hinge, slide = Proposed("revolute", axis, pivot), Proposed("prismatic", axis, pivot)
    np.testing.assert_allclose(hinge.poses(states), Revolute(axis, pivot=pivot).poses(states), atol=1e-12)
    np.testing.assert_allclose(slide.poses(states), Prismatic(axis).poses(states), atol=1e-12)


def test_a_look_tells_nearer_from_farther() -> None:
    depth = np.full((9, 9), 2.0, np.float32)
    depth[:, :4] = 0.0
    points = np.array(
        [[0.0, 0.0, 2.01], [0.0, 0.0, 1.8], [0.0, 0.0, 2.2], [-0.9, 0.0, 2.0], [0.0, 0.0, -1.0]]
    )
    points[:3, 0] = 2 * 2.0 / 10.0
    told = look(points, np.eye(4), depth, 10.0, 10.0, 4.0, 4.0, 0.05, 0.0)
    assert told.tolist() == [SAME, THROUGH, HIDDEN, UNKNOWN, UNKNOWN]


def test_the_best_path_keeps_to_the_speed_limit() -> None:
    score = np.zeros((6, 9))
    score[:3, 1], score[3:, 7] = 1.0, 1.0
    free, total = best_path(score, np.full(6, 9), 0.0)
    assert free.tolist() == [1, 1, 1, 7, 7, 7]
    assert total == 6.0
    slow, less = best_path(score, np.full(6, 2), 0.0)
    assert np.abs(np.diff(slow)).max() <= 2
    assert less < total
    dear, _ = best_path(score, np.full(6, 9), 1.0)
    assert len(set(dear.tolist())) == 1  # six steps cost more than the three frames give


def test_what_could_not_be_seen_may_always_have_been_there() -> None:
    """A wall, from a camera that goes aside: what comes into the picture is not new, what comes before the
    wall is."""
    clip = make_clip("door")
    wall, nearer = np.full((150, 200), 2.0, np.float32), np.full((150, 200), 2.0, np.float32)
    nearer[60:90, 90:110], wall[:20, 100:] = 1.5, 0.0
    poses = np.tile(np.eye(4), (26, 1, 1))
    poses[20:, 0, 3] = 1.0
    recording = replace(clip.recording, read_depth=lambda f: wall if f < 10 else nearer)
    told = novelty(Depths.of(recording, replace(clip.cameras, T_world_cam=poses)), 0)
    assert (told[15, 62:88, 92:108] == FRESH).all()
    assert (told[15, :18, 102:] == BARED).all()  # without depth in the first frame
    assert (told[25, 30:50, 140:] == BARED).all()  # out of its picture
    assert (told[25, 30:50, :110] == OLD).all()


def test_rows_crowd_where_much_is_under_way(clip: Clip) -> None:
    depths = Depths.of(clip.recording, clip.cameras)
    first, last = (novelty(depths, rest) for rest in (0, len(depths.frames) - 1))
    rows = informative_rows(first, last, 10)
    assert rows[0] == 0
    assert rows[-1] == len(depths.frames) - 1
    under_way = ((rows >= 5) & (rows <= 20)).sum()
    assert under_way >= 6

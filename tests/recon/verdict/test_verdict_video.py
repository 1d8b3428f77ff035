"""Evidence that the fit did not use: the truth gives no reason, faults that are planted give theirs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics
from recon.verdict import of_video
from recon.verdict.evidence import PartEvidence
from recon.verdict.halves import Halves, Whole
from recon.verdict.in_motion import InMotion, frames_by_travel, moving_rows
from recon.verdict.posed import PosedTwin, wide
from tests.makers.recon.cabinets import FRAMES, Kind, make_clip
from tests.makers.recon.judged import perfect, with_depth
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Mesh, Motion, Revolute
from twin.verdict import Reason

VIDEO = (
    of_video.seen_through, of_video.motion_explained, of_video.motion_seen, of_video.same_in_halves,
)  # fmt: skip


@pytest.fixture(scope="module")
def door() -> PartEvidence:
    return perfect(make_clip("door"))


def asked(e: PartEvidence) -> set[str]:
    return {r.reason.type for r in (ask(e) for ask in VIDEO) if r is not None}


def with_part(e: PartEvidence, part: MovingPart, mesh: Mesh | None) -> PartEvidence:
    return replace(e, part=part, mesh=mesh, scene=replace(e.scene, parts=((part, mesh),)))


def with_state(e: PartEvidence, state: Array) -> PartEvidence:
    return with_part(e, replace(e.part, motion=replace(e.part.motion, state=state)), e.mesh)


@pytest.mark.parametrize("kind", ["door", "drawer", "slide"])
@pytest.mark.parametrize("backwards", [False, True])
def test_the_truth_gives_no_reason(kind: Kind, backwards: bool) -> None:
    e = perfect(make_clip(kind, backwards=backwards))
    assert asked(e) == set()
    assert e.in_motion is not None
    assert e.in_motion.through == 0
    assert e.in_motion.wrong < 0.1 * e.in_motion.right
    assert e.in_motion.right > 0.1 * e.in_motion.own
    assert e.halves is not None
    np.testing.assert_allclose(e.halves.axis, 0.0, atol=1e-4)


def late(e: PartEvidence, frames: int) -> PartEvidence:
    state = e.part.motion.state
    return with_state(e, np.concatenate([np.full(frames, state[0]), state[:-frames]]))


def test_wrong_states_and_wrong_axes_are_seen_through_and_do_not_explain_what_changes(
    door: PartEvidence,
) -> None:
    """A door that is nearer than what is seen, or away from where it is seen."""
    assert {"SeenThrough", "MotionUnexplained"} <= asked(late(door, 2))
    assert {"SeenThrough", "MotionUnexplained"} <= asked(with_state(door, -door.part.motion.state))
    assert "SeenThrough" in asked(with_state(door, 1.1 * door.part.motion.state))
    aside = geo.unit(np.cross(door.part.joint.axis, [0.3, 0.5, 0.81]))
    joint = door.part.joint
    tilted = replace(joint, axis=geo.unit(joint.axis + np.tan(np.radians(20)) * aside))
    assert "SeenThrough" in asked(with_part(door, replace(door.part, joint=tilted), door.mesh))


def test_a_part_that_stays_while_the_twin_has_it_gone_does_not_explain_the_motion() -> None:
    """Of a drawer that closes: farther in the twin than seen, as if a hand were before it, but where it was
    at rest."""
    e = perfect(make_clip("drawer", backwards=True))
    frames = np.arange(FRAMES)
    early = with_state(
        e, e.part.motion.state[np.where(frames > 8, np.minimum(frames + 4, FRAMES - 1), frames)]
    )
    assert "MotionUnexplained" in asked(early)
    assert early.in_motion is not None
    assert early.in_motion.wrong > 1.5 * early.in_motion.through


def test_a_hand_in_front_is_no_fault_whatever_it_hides(door: PartEvidence) -> None:
    def hidden(depth: Array) -> Array:
        depth = depth.copy()
        depth[40:110, 30:120] = 0.4
        return depth

    covered = with_depth(door, hidden)
    assert asked(covered) == set()
    assert covered.in_motion is not None
    assert (covered.in_motion.through, covered.in_motion.wrong) == (0, 0)


@pytest.mark.parametrize("z", [0.5, 1.0, 2.5])
def test_a_closed_gap_is_not_seen_through_and_a_strip_of_a_missed_part_is(z: float) -> None:
    """Whatever the camera's distance, as far as pixels show it: from one of three pixels width on."""
    camera = Intrinsics(160, 120, 140.0, 140.0, 79.5, 59.5)
    depth = np.full((120, 160), z, np.float32)

    def seen(width_m: float) -> bool:
        strip = np.zeros(depth.shape, bool)
        strip[:, 40 : 40 + max(1, round(width_m * camera.fx / z))] = True
        return bool(wide(strip, depth, camera).any())

    assert not seen(0.015)
    assert seen(0.06)
    assert not wide(np.zeros(depth.shape, bool), depth, camera).any()


@pytest.mark.parametrize("size", [3, 4, 5, 6])
def test_what_no_square_within_the_picture_fits_into_is_narrow(size: int) -> None:
    """Of even squares too, and at the picture's border, by a count of all squares."""
    mask = np.random.default_rng(size).random((30, 40)) < 0.85
    mask[:2] = mask[:, -2:] = True
    fits = np.zeros_like(mask)
    for y, x in np.ndindex(31 - size, 41 - size):
        if mask[y : y + size, x : x + size].all():
            fits[y : y + size, x : x + size] = True
    camera = Intrinsics(40, 30, (size - 0.6) / 0.025, (size - 0.6) / 0.025, 20.0, 15.0)
    np.testing.assert_array_equal(wide(mask, np.ones(mask.shape, np.float32), camera), fits)


def test_a_part_that_is_seen_in_spots_is_seen_to_move(door: PartEvidence) -> None:
    """As by a stereo camera, which has no depth on plain surfaces: two of three rows and columns of pixels
    are lost."""

    def spotted(depth: Array) -> Array:
        step = PosedTwin(door.scene.recording, door.scene.cameras, door.scene.static, ()).step
        y, x = np.indices(depth.shape) // step
        return np.where((y % 3 == 0) & (x % 3 == 0), depth, 0.0)

    whole, spots = door.in_motion, with_depth(door, spotted).in_motion
    assert whole is not None
    assert spots is not None
    assert spots.right / spots.own == pytest.approx(whole.right / whole.own, rel=0.2)
    assert spots.wrong < 0.2 * spots.right


def test_what_stands_behind_the_part_is_not_seen_through_unless_it_is_farther(door: PartEvidence) -> None:
    """A ghost of the closed door in the static scene, as where its labels were wrong."""
    static = door.scene.static
    ghost = Mesh(
        np.concatenate([static.vertices, door.mesh.vertices]),  # type: ignore[union-attr]
        np.concatenate([static.faces, door.mesh.faces + len(static.vertices)]),  # type: ignore[union-attr]
    )
    assert "SeenThrough" in asked(replace(door, scene=replace(door.scene, static=ghost)))


def test_what_does_not_change_the_depth_is_not_seen_to_move(door: PartEvidence) -> None:
    trembling = with_state(door, 0.01 * door.part.motion.state)
    assert "MotionUnseen" in asked(trembling)
    away = Mesh(door.mesh.vertices + [0, 0, 50.0], door.mesh.faces)  # type: ignore[union-attr]
    assert "MotionUnseen" in asked(with_part(door, door.part, away))


def test_without_motion_or_surface_the_video_tells_nothing(door: PartEvidence) -> None:
    still = replace(door.part, motion=replace(door.part.motion, intervals=()))
    nothing = Motion(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    for e in (
        with_part(door, door.part, None),
        with_part(door, still, door.mesh),
        with_part(door, replace(door.part, motion=nothing), None),
    ):
        assert e.in_motion is None
        assert asked(e) <= {"HalvesDisagree"}
    assert with_part(door, still, door.mesh).halves is None


def test_frames_are_spread_by_travel_not_by_time(door: PartEvidence) -> None:
    rows = moving_rows(door.part)
    state = door.part.motion.state[[r for r in rows if r in frames_by_travel(door.part, 4)]]
    share = (state - door.part.motion.state[rows[0]]) / np.ptp(door.part.motion.state[rows])
    np.testing.assert_allclose(share, [0.2, 0.4, 0.6, 0.8], atol=0.07)
    assert set(frames_by_travel(door.part, 100)) <= set(rows.tolist())


def bent(e: PartEvidence, tilt: float, shift: float, noise: float = 0.0) -> PartEvidence:
    """Tracks whose second half of motion goes about an axis that is tilted by `tilt` deg and `shift` m
    aside."""
    joint, state = e.part.joint, e.part.motion.state
    aside = geo.unit(np.cross(joint.axis, [0.3, 0.5, 0.81]))
    axis = geo.unit(joint.axis + np.tan(np.radians(tilt)) * aside)
    moved: Any = replace(joint, axis=axis)
    if shift:
        moved = replace(moved, pivot=joint.pivot + shift * aside)  # type: ignore[union-attr]
    movers = e.scene.found.movers
    points = movers.points_world.copy()
    second = np.flatnonzero(state > 0.5 * state.max())
    at_rest = points[0][e.tracks.members]
    for f in second:
        points[f, e.tracks.members] = geo.transform(moved.pose(float(state[f])), at_rest)
    points += np.random.default_rng(0).normal(0.0, noise, points.shape)
    found = replace(e.scene.found, movers=replace(movers, points_world=points))
    return replace(e, scene=replace(e.scene, found=found))


@pytest.mark.parametrize("kind", ["door", "drawer"])
def test_halves_with_different_axes_disagree(kind: Kind) -> None:
    e = perfect(make_clip(kind))
    told = of_video.same_in_halves(bent(e, 12.0, 0.0, 0.001))
    assert told.reason.type == "HalvesDisagree"
    np.testing.assert_allclose(told.reason.numbers["axis_deg"], 12.0, atol=0.5)
    assert of_video.same_in_halves(bent(e, 8.0, 0.0, 0.001)) is None


def test_halves_with_different_hinges_disagree(door: PartEvidence) -> None:
    told = of_video.same_in_halves(bent(door, 0.0, 0.06, 0.001))
    assert told.reason.type == "HalvesDisagree"
    np.testing.assert_allclose(told.reason.numbers["pivot_m"], 0.06, atol=0.005)
    assert of_video.same_in_halves(bent(door, 0.0, 0.04, 0.001)) is None


def test_tracks_scatter_farther_about_a_joint_that_is_not_theirs(door: PartEvidence) -> None:
    """1 mm of noise: as far as about the halves' own joints where the joint holds for both, some times
    farther where it does not."""
    same, apart = (bent(door, deg, 0.0, 0.001).halves for deg in (0.0, 12.0))
    assert same is not None
    assert apart is not None
    assert 0.9 < same.worse < 1.1
    assert apart.worse > 3.0


def test_halves_that_are_too_short_tell_nothing(door: PartEvidence) -> None:
    """By their own sigma, or because nothing is left to fit."""
    noisy = bent(door, 12.0, 0.06, 0.1)
    assert noisy.halves is not None
    assert noisy.halves.axis_sigma > np.radians(10.0) / 3
    assert of_video.same_in_halves(noisy) is None
    brief = replace(door.part, motion=replace(door.part.motion, intervals=((11, 13),)))
    assert with_part(bent(door, 12.0, 0.0), brief, door.mesh).halves is None


def test_tracks_that_tell_another_axis_in_both_halves_are_heard() -> None:
    e = perfect(make_clip("drawer"))
    assert of_video.as_its_tracks(e) is None
    aside = geo.orthogonal_basis(e.part.joint.axis)[:, 0]
    for deg, told in ((3.0, False), (6.0, True)):
        joint = replace(e.part.joint, axis=geo.exp_so3(np.radians(deg) * aside) @ e.part.joint.axis)
        reason = of_video.as_its_tracks(replace(e, part=replace(e.part, joint=joint)))
        assert (reason is not None) == told
        if reason is not None:
            assert reason.reason.type == "TracksDisagree"
            np.testing.assert_allclose(reason.reason.numbers["axis_deg"], deg, atol=0.2)


def test_all_tracks_together_are_heard() -> None:
    """They know the axis better than either half, and less is allowed."""
    e = bent(perfect(make_clip("drawer")), 0.0, 0.0, 0.002)
    assert e.halves is not None
    assert e.whole is not None
    assert e.whole.sigma < 0.5 * e.halves.axis_sigma
    assert e.whole.off < 3 * e.whole.sigma
    assert of_video.as_its_tracks(e) is None
    aside = geo.orthogonal_basis(e.part.joint.axis)[:, 0]
    for deg, told in ((3.2, False), (3.8, True)):
        joint = replace(e.part.joint, axis=geo.exp_so3(np.radians(deg) * aside) @ e.part.joint.axis)
        reason = of_video.as_its_tracks(replace(e, part=replace(e.part, joint=joint)))
        assert (reason is not None) == told
        if reason is not None:
            assert reason.reason.type == "TracksDisagree"
            np.testing.assert_allclose(
                [reason.reason.numbers["axis_deg"], reason.reason.numbers["limit_deg"]], [deg, 3.5], atol=0.2
            )


def test_tracks_that_tell_another_hinge_in_both_halves_are_heard(door: PartEvidence) -> None:
    e = bent(door, 0.0, 0.0, 0.0005)
    joint = e.part.joint
    assert isinstance(joint, Revolute)
    aside = geo.orthogonal_basis(joint.axis)[:, 0]
    for m, told in ((0.01, False), (0.05, True)):
        moved = replace(e.part, joint=replace(joint, pivot=joint.pivot + m * aside, covariance=None))
        reason = of_video.as_its_tracks(with_part(e, moved, door.mesh))
        assert (reason is not None) == told
        if reason is not None:
            assert reason.reason.type == "TracksDisagree"
            np.testing.assert_allclose(reason.reason.numbers["pivot_m"], m, atol=0.005)
            assert (
                "50 mm" in reason.reason.text
                or "49 mm" in reason.reason.text
                or "51 mm" in reason.reason.text
            )


def with_seen(e: PartEvidence, seen: Any) -> PartEvidence:
    """Evidence with these figures of the video."""
    out = replace(e)
    vars(out)[{Halves: "halves", Whole: "whole", InMotion: "in_motion"}[type(seen)]] = seen
    return out


D, P = np.radians, 0.001
BOTH_SIDES: dict[str, tuple[Callable[[PartEvidence], Reason | None], Any, Any]] = {
    # evidence: no reason, a reason. As numbers, not as multiples of the limits, so that a limit that was
    # changed is noticed.
    "through": (of_video.seen_through, InMotion(1000, 4, 500, 0, 7), InMotion(1000, 6, 500, 0, 7)),
    "through, in view": (of_video.seen_through, InMotion(0, 500, 0, 0, 7), InMotion(1000, 500, 0, 0, 7)),
    "explained": (of_video.motion_explained, InMotion(9000, 0, 810, 190, 7), InMotion(9000, 0, 790, 210, 7)),
    "enough": (of_video.motion_explained, InMotion(9000, 0, 0, 95, 7), InMotion(9000, 0, 0, 105, 7)),
    "witnessed": (of_video.motion_seen, InMotion(1000, 0, 55, 0, 7), InMotion(1000, 0, 45, 0, 7)),
    "axes": (of_video.same_in_halves, Halves(D(9), D(0.1), None, None), Halves(D(11), D(0.1), None, None)),
    "axes, sure": (of_video.same_in_halves, Halves(D(45), D(3.6), None, None), Halves(D(45), D(3.1), None, None)),
    "axes, as well": (of_video.same_in_halves, Halves(D(45), D(1), None, None, 0, 1.14), Halves(D(45), D(1), None, None, 0, 1.16)),
    "own axis": (of_video.as_its_tracks, Halves(D(2.9), D(0.1), None, None, D(3.9)), Halves(D(2.9), D(0.1), None, None, D(4.1))),
    "own axis, agreed": (of_video.as_its_tracks, Halves(D(3.1), D(0.1), None, None, D(9)), Halves(D(2.9), D(0.1), None, None, D(9))),
    "own axis, sure": (of_video.as_its_tracks, Halves(D(1), D(3.6), None, None, D(9)), Halves(D(1), D(3.1), None, None, D(9))),
    "own hinge": (of_video.as_its_tracks, Halves(0, D(0.1), P, P, 0, 2, 24 * P), Halves(0, D(0.1), P, P, 0, 2, 26 * P)),
    "own hinge, agreed": (of_video.as_its_tracks, Halves(0, D(0.1), 21 * P, P, 0, 2, 0.1), Halves(0, D(0.1), 19 * P, P, 0, 2, 0.1)),
    "own hinge, sure": (of_video.as_its_tracks, Halves(0, D(0.1), P, 7 * P, 0, 2, 0.1), Halves(0, D(0.1), P, 6 * P, 0, 2, 0.1)),
    "own hinge, as well": (of_video.as_its_tracks, Halves(0, D(0.1), P, P, 0, 1.1, 0.1), Halves(0, D(0.1), P, P, 0, 1.2, 0.1)),
    "all tracks": (of_video.as_its_tracks, Whole(D(3.4), D(0.1), 2), Whole(D(3.6), D(0.1), 2)),
    "all tracks, sure": (of_video.as_its_tracks, Whole(D(9), D(1.1), 2), Whole(D(9), D(0.9), 2)),
    "all tracks, as well": (of_video.as_its_tracks, Whole(D(9), D(0.1), 1.1), Whole(D(9), D(0.1), 1.2)),
    "hinges": (of_video.same_in_halves, Halves(0, D(0.1), 45 * P, P), Halves(0, D(0.1), 55 * P, P)),
    "hinges, sure": (of_video.same_in_halves, Halves(0, D(0.1), 90 * P, 7.5 * P), Halves(0, D(0.1), 90 * P, 6 * P)),
}  # fmt: skip


@pytest.mark.parametrize("name", BOTH_SIDES)
def test_each_limit_stands_where_it_is_said_to(name: str, door: PartEvidence) -> None:
    ask, within, beyond = BOTH_SIDES[name]
    assert ask(with_seen(door, within)) is None
    told = ask(with_seen(door, beyond))
    assert told is not None
    assert told.reason.level == "doubtful"

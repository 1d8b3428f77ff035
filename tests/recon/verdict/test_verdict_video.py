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
from recon.verdict.in_motion import InMotion, frames_by_travel, moving_rows
from recon.verdict.posed import PosedTwin, wide
from tests.makers.recon.cabinets import FRAMES, Kind, make_clip
from tests.makers.recon.judged import perfect, with_depth
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Mesh, Motion
from twin.verdict import Reason

VIDEO = (
    of_video.seen_through, of_video.motion_explained, of_video.motion_seen,
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
        assert not asked(e)


def test_frames_are_spread_by_travel_not_by_time(door: PartEvidence) -> None:
    rows = moving_rows(door.part)
    state = door.part.motion.state[[r for r in rows if r in frames_by_travel(door.part, 4)]]
    share = (state - door.part.motion.state[rows[0]]) / np.ptp(door.part.motion.state[rows])
    np.testing.assert_allclose(share, [0.2, 0.4, 0.6, 0.8], atol=0.07)
    assert set(frames_by_travel(door.part, 100)) <= set(rows.tolist())


def with_seen(e: PartEvidence, seen: Any) -> PartEvidence:
    """Evidence with these figures of the video."""
    out = replace(e)
    vars(out)["in_motion"] = seen
    return out


BOTH_SIDES: dict[str, tuple[Callable[[PartEvidence], Reason | None], Any, Any]] = {
    # evidence: no reason, a reason. As numbers, not as multiples of the limits, so that a limit that was
    # changed is noticed.
    "through": (of_video.seen_through, InMotion(1000, 4, 500, 0, 7), InMotion(1000, 6, 500, 0, 7)),
    "through, in view": (of_video.seen_through, InMotion(0, 500, 0, 0, 7), InMotion(1000, 500, 0, 0, 7)),
    "explained": (of_video.motion_explained, InMotion(9000, 0, 810, 190, 7), InMotion(9000, 0, 790, 210, 7)),
    "enough": (of_video.motion_explained, InMotion(9000, 0, 0, 95, 7), InMotion(9000, 0, 0, 105, 7)),
    "witnessed": (of_video.motion_seen, InMotion(1000, 0, 55, 0, 7), InMotion(1000, 0, 45, 0, 7)),
}  # fmt: skip


@pytest.mark.parametrize("name", BOTH_SIDES)
def test_each_limit_stands_where_it_is_said_to(name: str, door: PartEvidence) -> None:
    ask, within, beyond = BOTH_SIDES[name]
    assert ask(with_seen(door, within)) is None
    told = ask(with_seen(door, beyond))
    assert told is not None
    assert told.reason.level == "doubtful"

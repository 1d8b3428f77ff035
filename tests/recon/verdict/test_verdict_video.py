"""Evidence that the fit did not use: the truth gives no reason, faults that are planted give theirs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics
from recon.verdict import of_parts
from recon.verdict.evidence import PartEvidence
from recon.verdict.in_motion import frames_by_travel
from recon.verdict.posed import wide
from tests.makers.recon.cabinets import Kind, make_clip
from tests.makers.recon.judged import perfect, with_depth
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Mesh, Motion


@pytest.fixture(scope="module")
def door() -> PartEvidence:
    return perfect(make_clip("door"))


def through(e: PartEvidence) -> float:
    """Pixels of the motion that are seen through, over the part's own."""
    assert e.seen_through is not None
    return e.seen_through[1]


def with_part(e: PartEvidence, part: MovingPart, mesh: Mesh | None) -> PartEvidence:
    return replace(e, part=part, mesh=mesh, scene=replace(e.scene, parts=((part, mesh),)))


def with_state(e: PartEvidence, state: Array) -> PartEvidence:
    return with_part(e, replace(e.part, motion=replace(e.part.motion, state=state)), e.mesh)


@pytest.mark.parametrize("kind", ["door", "drawer", "slide"])
@pytest.mark.parametrize("backwards", [False, True])
def test_the_truth_is_not_seen_through(kind: Kind, backwards: bool) -> None:
    e = perfect(make_clip(kind, backwards=backwards))
    assert through(e) == 0.0
    assert of_parts.seen_through(e) is None


def late(e: PartEvidence, frames: int) -> PartEvidence:
    state = e.part.motion.state
    return with_state(e, np.concatenate([np.full(frames, state[0]), state[:-frames]]))


def test_wrong_states_and_wrong_axes_are_seen_through(door: PartEvidence) -> None:
    """A door that is nearer than what is seen, or away from where it is seen."""
    aside = geo.unit(np.cross(door.part.joint.axis, [0.3, 0.5, 0.81]))
    joint = door.part.joint
    tilted = replace(joint, axis=geo.unit(joint.axis + np.tan(np.radians(20)) * aside))
    for wrong in (
        late(door, 2),
        with_state(door, -door.part.motion.state),
        with_state(door, 1.1 * door.part.motion.state),
        with_part(door, replace(door.part, joint=tilted), door.mesh),
    ):
        assert of_parts.seen_through(wrong).reason.type == "SeenThrough"  # type: ignore[union-attr]


def test_a_hand_in_front_is_no_fault_whatever_it_hides(door: PartEvidence) -> None:
    def hidden(depth: Array) -> Array:
        depth = depth.copy()
        depth[40:110, 30:120] = 0.4
        return depth

    assert through(with_depth(door, hidden)) == 0.0


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


def test_what_stands_behind_the_part_is_not_seen_through_unless_it_is_farther(door: PartEvidence) -> None:
    """A ghost of the closed door in the static scene, as where its labels were wrong."""
    static = door.scene.static
    ghost = Mesh(
        np.concatenate([static.vertices, door.mesh.vertices]),  # type: ignore[union-attr]
        np.concatenate([static.faces, door.mesh.faces + len(static.vertices)]),  # type: ignore[union-attr]
    )
    assert of_parts.seen_through(replace(door, scene=replace(door.scene, static=ghost))) is not None


def test_without_motion_or_surface_the_video_tells_nothing(door: PartEvidence) -> None:
    still = replace(door.part, motion=replace(door.part.motion, intervals=()))
    nothing = Motion(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    for e in (
        with_part(door, door.part, None),
        with_part(door, still, door.mesh),
        with_part(door, replace(door.part, motion=nothing), None),
    ):
        assert e.seen_through is None
        assert of_parts.seen_through(e) is None


def test_frames_are_spread_by_travel_not_by_time(door: PartEvidence) -> None:
    motion = door.part.motion
    ((first, last),) = motion.intervals
    rows = np.flatnonzero((motion.frames >= first) & (motion.frames <= last))
    state = motion.state[[r for r in rows if r in frames_by_travel(door.part, 4)]]
    share = (state - motion.state[rows[0]]) / np.ptp(motion.state[rows])
    np.testing.assert_allclose(share, [0.2, 0.4, 0.6, 0.8], atol=0.07)
    assert set(frames_by_travel(door.part, 100)) <= set(rows.tolist())


@pytest.mark.parametrize(("share", "told"), [(0.004, False), (0.006, True)])
def test_the_limit_stands_where_it_is_said_to(share: float, told: bool, door: PartEvidence) -> None:
    """As a number, so that a limit that was changed is noticed."""
    seen = replace(door)
    vars(seen)["seen_through"] = (7, share)
    assert (of_parts.seen_through(seen) is not None) == told

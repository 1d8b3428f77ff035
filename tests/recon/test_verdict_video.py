"""Evidence that the fit did not use: the truth gives no reason, faults that are planted give theirs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from recon.parts.moving_part import MovingPart
from recon.recording import Recording
from recon.verdict import of_video
from recon.verdict.evidence import PartEvidence
from recon.verdict.halves import Halves
from recon.verdict.in_motion import InMotion, frames_by_travel, moving_rows
from tests.recon.cabinets import FRAMES, Clip, Kind, make_clip
from tests.recon.judged import perfect
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import HAND_LABEL, Mesh, Motion
from twin.verdict import (
    HalvesDisagree,
    HandWhereNobodyIs,
    MotionUnexplained,
    MotionUnseen,
    Reason,
    SeenThrough,
)

VIDEO = (
    of_video.seen_through, of_video.motion_explained, of_video.motion_seen, of_video.same_in_halves,
    of_video.hand_at_ends,
)  # fmt: skip


@pytest.fixture(scope="module")
def door() -> PartEvidence:
    return perfect(make_clip("door"))


def asked(e: PartEvidence) -> set[type[Reason]]:
    return {type(r) for r in (ask(e) for ask in VIDEO) if r is not None}


def with_part(e: PartEvidence, part: MovingPart, mesh: Mesh | None) -> PartEvidence:
    return replace(e, part=part, mesh=mesh, scene=replace(e.scene, parts=((part, mesh),)))


def with_state(e: PartEvidence, state: Array) -> PartEvidence:
    return with_part(e, replace(e.part, motion=replace(e.part.motion, state=state)), e.mesh)


def with_depth(e: PartEvidence, change: Callable[[Array], Array]) -> PartEvidence:
    """The recording with its depth (H, W) m changed in every frame."""
    read = e.scene.recording.read_depth
    recording: Recording = replace(e.scene.recording, read_depth=lambda f: change(read(f)).astype(np.float32))
    return replace(e, scene=replace(e.scene, recording=recording))


def with_labels(e: PartEvidence, labels: dict[int, Any], mesh: Mesh | None) -> PartEvidence:
    scene = replace(e.scene, labels=labels, parts=((e.part, mesh),))
    return replace(e, scene=scene, mesh=mesh)


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
    assert {SeenThrough, MotionUnexplained} <= asked(late(door, 2))
    assert {SeenThrough, MotionUnexplained} <= asked(with_state(door, -door.part.motion.state))
    assert SeenThrough in asked(with_state(door, 1.1 * door.part.motion.state))
    aside = geo.unit(np.cross(door.part.joint.axis, [0.3, 0.5, 0.81]))
    joint = door.part.joint
    tilted = replace(joint, axis=geo.unit(joint.axis + np.tan(np.radians(20)) * aside))
    assert SeenThrough in asked(with_part(door, replace(door.part, joint=tilted), door.mesh))


def test_a_part_that_stays_while_the_twin_has_it_gone_does_not_explain_the_motion() -> None:
    """Of a drawer that closes: farther in the twin than seen, as if a hand were before it, but where it was at rest."""
    e = perfect(make_clip("drawer", backwards=True))
    frames = np.arange(FRAMES)
    early = with_state(
        e, e.part.motion.state[np.where(frames > 8, np.minimum(frames + 4, FRAMES - 1), frames)]
    )
    assert MotionUnexplained in asked(early)
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


def test_what_stands_behind_the_part_is_not_seen_through_unless_it_is_farther(door: PartEvidence) -> None:
    """A ghost of the closed door in the static scene, as where its labels were wrong."""
    static = door.scene.static
    ghost = Mesh(
        np.concatenate([static.vertices, door.mesh.vertices]),  # type: ignore[union-attr]
        np.concatenate([static.faces, door.mesh.faces + len(static.vertices)]),  # type: ignore[union-attr]
    )
    assert SeenThrough in asked(replace(door, scene=replace(door.scene, static=ghost)))


def test_what_does_not_change_the_depth_is_not_seen_to_move(door: PartEvidence) -> None:
    trembling = with_state(door, 0.01 * door.part.motion.state)
    assert MotionUnseen in asked(trembling)
    away = Mesh(door.mesh.vertices + [0, 0, 50.0], door.mesh.faces)  # type: ignore[union-attr]
    assert MotionUnseen in asked(with_part(door, door.part, away))


def test_without_motion_or_surface_the_video_tells_nothing(door: PartEvidence) -> None:
    still = replace(door.part, motion=replace(door.part.motion, intervals=()))
    nothing = Motion(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    for e in (
        with_part(door, door.part, None),
        with_part(door, still, door.mesh),
        with_part(door, replace(door.part, motion=nothing), None),
    ):
        assert e.in_motion is None
        assert asked(e) <= {HalvesDisagree}
    assert with_part(door, still, door.mesh).halves is None


def test_frames_are_spread_by_travel_not_by_time(door: PartEvidence) -> None:
    rows = moving_rows(door.part)
    state = door.part.motion.state[[r for r in rows if r in frames_by_travel(door.part, 4)]]
    share = (state - door.part.motion.state[rows[0]]) / np.ptp(door.part.motion.state[rows])
    np.testing.assert_allclose(share, [0.2, 0.4, 0.6, 0.8], atol=0.07)
    assert set(frames_by_travel(door.part, 100)) <= set(rows.tolist())


def bent(e: PartEvidence, tilt: float, shift: float, noise: float = 0.0) -> PartEvidence:
    """Tracks whose second half of motion goes about an axis that is tilted by `tilt` deg and `shift` m aside."""
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
    assert isinstance(told, HalvesDisagree)
    np.testing.assert_allclose(told.axis_deg, 12.0, atol=0.5)
    assert of_video.same_in_halves(bent(e, 8.0, 0.0, 0.001)) is None


def test_halves_with_different_hinges_disagree(door: PartEvidence) -> None:
    told = of_video.same_in_halves(bent(door, 0.0, 0.06, 0.001))
    assert isinstance(told, HalvesDisagree)
    np.testing.assert_allclose(told.pivot_m, 0.06, atol=0.005)
    assert of_video.same_in_halves(bent(door, 0.0, 0.04, 0.001)) is None


def test_halves_that_are_too_short_tell_nothing(door: PartEvidence) -> None:
    """By their own sigma, or because nothing is left to fit."""
    noisy = bent(door, 12.0, 0.06, 0.1)
    assert noisy.halves is not None
    assert noisy.halves.axis_sigma > np.radians(10.0) / 3
    assert of_video.same_in_halves(noisy) is None
    brief = replace(door.part, motion=replace(door.part.motion, intervals=((11, 13),)))
    assert with_part(bent(door, 12.0, 0.0), brief, door.mesh).halves is None


def with_seen(e: PartEvidence, seen: Any) -> PartEvidence:
    """Evidence with these figures of the video."""
    out = replace(e)
    vars(out)["halves" if isinstance(seen, Halves) else "in_motion"] = seen
    return out


D, P = np.radians, 0.001
BOTH_SIDES: dict[str, tuple[Callable[[PartEvidence], Reason | None], Any, Any]] = {
    # evidence: no reason, a reason. As numbers, not as multiples of the limits, so that a limit that was changed is noticed.
    "through": (of_video.seen_through, InMotion(1000, 4, 500, 0, 7), InMotion(1000, 6, 500, 0, 7)),
    "explained": (of_video.motion_explained, InMotion(9000, 0, 810, 190, 7), InMotion(9000, 0, 790, 210, 7)),
    "enough": (of_video.motion_explained, InMotion(9000, 0, 0, 95, 7), InMotion(9000, 0, 0, 105, 7)),
    "witnessed": (of_video.motion_seen, InMotion(1000, 0, 55, 0, 7), InMotion(1000, 0, 45, 0, 7)),
    "axes": (of_video.same_in_halves, Halves(D(9), D(0.1), None, None), Halves(D(11), D(0.1), None, None)),
    "axes, sure": (of_video.same_in_halves, Halves(D(45), D(3.6), None, None), Halves(D(45), D(3.1), None, None)),
    "hinges": (of_video.same_in_halves, Halves(0, D(0.1), 45 * P, P), Halves(0, D(0.1), 55 * P, P)),
    "hinges, sure": (of_video.same_in_halves, Halves(0, D(0.1), 90 * P, 7.5 * P), Halves(0, D(0.1), 90 * P, 6 * P)),
}  # fmt: skip


@pytest.mark.parametrize("name", BOTH_SIDES)
def test_each_limit_stands_where_it_is_said_to(name: str, door: PartEvidence) -> None:
    ask, within, beyond = BOTH_SIDES[name]
    assert ask(with_seen(door, within)) is None
    told = ask(with_seen(door, beyond))
    assert told is not None
    assert told.level == "doubtful"


def hand_labels(clip: Clip, last: int) -> dict[int, Any]:
    return {f: image for f, image in clip.labels.items() if f <= last}


@pytest.mark.parametrize("kind", ["door", "slide"])
def test_a_true_hand_at_an_end_is_no_reason(kind: Kind) -> None:
    """The recording ends while the hand moves the part, with half an arm in view that does not reach the border."""
    clip = make_clip(kind)
    for last in (10, 12, 14, 16):
        labels = hand_labels(clip, last)
        assert (labels[last] == HAND_LABEL).mean() > of_video.HAND_AT_END
        assert of_video.hand_at_ends(perfect(clip, labels)) is None


def painted(clip: Clip, frame: int, what: Any) -> dict[int, Any]:
    """The true labels, with hand in a frame where `what` (H, W) says so."""
    return clip.labels | {frame: np.where(what, np.uint8(HAND_LABEL), clip.labels[frame])}


def block(clip: Clip, share: float) -> Any:
    """A block (H, W) in the middle of the picture that covers a share of it, rounded to whole pixels of the thinned one."""
    image = np.zeros(next(iter(clip.labels.values())).shape, bool)
    high, wide = (round(n * np.sqrt(share)) for n in image.shape)
    image[70 : 70 + high, 110 : 110 + wide] = True
    return image


@pytest.mark.parametrize("frame", [0, FRAMES - 2])
def test_hand_that_has_the_depth_of_the_twin_is_none(frame: int) -> None:
    clip = make_clip("door")
    told = of_video.hand_at_ends(perfect(clip, painted(clip, frame, block(clip, 0.009))))
    assert isinstance(told, HandWhereNobodyIs)
    assert told.frame == frame
    np.testing.assert_allclose(told.share, 0.009, rtol=0.15)
    assert of_video.hand_at_ends(perfect(clip, painted(clip, frame, block(clip, 0.004)))) is None


@pytest.mark.parametrize("frame", [0, FRAMES - 2])
def test_a_missed_part_that_was_labelled_hand_is_none(frame: int) -> None:
    """It stands before all that the twin shows, and keeps its place."""
    clip = make_clip("drawer")
    missed = painted(clip, frame, clip.labels[frame] == 2)
    e = with_labels(perfect(clip), missed, None)
    told = of_video.hand_at_ends(e)
    assert isinstance(told, HandWhereNobodyIs)
    assert told.frame == frame


def changing(e: PartEvidence, since: int, depth: Array) -> PartEvidence:
    """The recording stands still at its first frame and has this depth (H, W) from frame `since` on."""
    read = e.scene.recording.read_depth
    first = np.asarray(read(0))
    cameras = replace(e.scene.cameras, T_world_cam=np.repeat(e.scene.cameras.T_world_cam[:1], FRAMES, axis=0))
    recording = replace(
        e.scene.recording, read_depth=lambda f: (depth if f >= since else first).astype(np.float32)
    )
    return replace(e, scene=replace(e.scene, recording=recording, cameras=cameras))


@pytest.mark.parametrize("since", [1, 6])
def test_what_leaves_may_be_a_hand(since: int) -> None:
    """Even if most of the frames still see it."""
    clip = make_clip("drawer")
    thing = clip.labels[0] == 2
    e = with_labels(perfect(clip), {0: painted(clip, 0, thing)[0]}, None)
    depth = clip.recording.depth(0)
    assert isinstance(of_video.hand_at_ends(changing(e, since, depth)), HandWhereNobodyIs)
    assert of_video.hand_at_ends(changing(e, since, np.where(thing, depth + 0.2, depth))) is None


def test_fingers_may_rest_while_the_arm_moves() -> None:
    clip = make_clip("drawer")
    thing = clip.labels[0] == 2
    column = np.quantile(np.nonzero(thing)[1], [0.3, 0.5])
    e = with_labels(perfect(clip), {0: painted(clip, 0, thing)[0]}, None)
    depth = clip.recording.depth(0)
    fingers, half = (np.where(thing & (np.arange(thing.shape[1]) > x), depth + 0.2, depth) for x in column)
    assert of_video.hand_at_ends(changing(e, 1, fingers)) is None
    assert isinstance(of_video.hand_at_ends(changing(e, 1, half)), HandWhereNobodyIs)


@pytest.mark.parametrize(("kind", "told"), [("drawer", False), ("door", True)])
def test_what_reaches_the_border_may_be_an_arm_unless_it_is_too_large(kind: Kind, told: bool) -> None:
    """The front of the drawer shows 0.12 m^2, the door 0.4 m^2."""
    clip = make_clip(kind)
    arm = (np.arange(clip.labels[0].shape[1]) == 100)[None] & (clip.labels[0] != 2)
    near = with_depth(perfect(clip), lambda depth: np.where(arm, 0.5, depth))
    labels = {0: painted(clip, 0, arm | (clip.labels[0] == 2))[0]}
    e = changing(with_labels(near, labels, None), FRAMES, np.zeros(0))
    assert (of_video.hand_at_ends(e) is not None) == told
    assert of_video.hand_at_ends(with_labels(e, {}, None)) is None

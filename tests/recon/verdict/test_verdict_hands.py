"""Hands: what is labelled hand and rests needs an explanation, and a visit of one moves something."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from recon.verdict import hand_visits, of_parts
from recon.verdict.evidence import PartEvidence
from tests.makers.recon.cabinets import FRAMES, Clip, Kind, make_clip
from tests.makers.recon.judged import perfect, with_depth
from twin.geometry import Array
from twin.scene import HAND_LABEL, Mesh, Motion


def with_labels(e: PartEvidence, labels: dict[int, Any], mesh: Mesh | None) -> PartEvidence:
    scene = replace(e.scene, labels=labels, parts=((e.part, mesh),))
    return replace(e, scene=scene, mesh=mesh)


def hand_labels(clip: Clip, last: int) -> dict[int, Any]:
    return {f: image for f, image in clip.labels.items() if f <= last}


def painted(clip: Clip, frame: int, what: Any) -> dict[int, Any]:
    """The true labels, with hand in a frame where `what` (H, W) says so."""
    return clip.labels | {frame: np.where(what, np.uint8(HAND_LABEL), clip.labels[frame])}


def changing(e: PartEvidence, since: int, depth: Array) -> PartEvidence:
    """The recording stands still at its first frame and has this depth (H, W) from frame `since` on."""
    read = e.scene.recording.read_depth
    first = np.asarray(read(0))
    cameras = replace(e.scene.cameras, T_world_cam=np.repeat(e.scene.cameras.T_world_cam[:1], FRAMES, axis=0))
    recording = replace(
        e.scene.recording, read_depth=lambda f: (depth if f >= since else first).astype(np.float32)
    )
    return replace(e, scene=replace(e.scene, recording=recording, cameras=cameras))


def ending(e: PartEvidence, last: int) -> PartEvidence:
    """The recording up to and with a frame."""
    cameras = e.scene.cameras
    kept = slice(None, last + 1)
    cut = replace(
        cameras, frames=cameras.frames[kept], times=cameras.times[kept], T_world_cam=cameras.T_world_cam[kept]
    )
    return replace(e, scene=replace(e.scene, cameras=cut))


@pytest.mark.parametrize("kind", ["door", "slide"])
def test_a_hand_that_moves_at_an_end_needs_no_explanation(kind: Kind) -> None:
    """While it moves; without its label, or as a thing that rests, it is a depth that the twin does not
    have."""
    clip = make_clip(kind)
    e = ending(perfect(clip, hand_labels(clip, 14)), 14)
    assert of_parts.explained(e) is None
    unlabelled = {f: np.where(image == HAND_LABEL, np.uint8(1), image) for f, image in e.scene.labels.items()}
    assert (
        of_parts.explained(replace(e, scene=replace(e.scene, labels=unlabelled))).reason.type == "Unexplained"
    )


@pytest.mark.parametrize(("lost", "explained"), [(2, True), (9, False)])
def test_the_smeared_rim_of_a_hand_needs_no_explanation(lost: int, explained: bool) -> None:
    """Labels that miss so many pixels of the moving hand's outline."""
    clip = make_clip("door")
    kernel = np.ones((2 * lost + 1,) * 2, np.uint8)

    def thinner(image: Any) -> Any:
        hand = (image == HAND_LABEL).astype(np.uint8)
        return np.where((hand > 0) & (cv2.erode(hand, kernel) == 0), np.uint8(1), image)

    labels = {f: thinner(image) for f, image in hand_labels(clip, 14).items()}
    assert (of_parts.explained(ending(perfect(clip, labels), 14)) is None) == explained


def test_a_missed_part_that_was_labelled_hand_needs_an_explanation() -> None:
    clip = make_clip("drawer")
    missed = {f: np.where(image == 2, np.uint8(HAND_LABEL), image) for f, image in clip.labels.items()}
    assert of_parts.explained(with_labels(perfect(clip), missed, None)).reason.type == "Unexplained"


@pytest.mark.parametrize(("border_m", "explained"), [(0.4, True), (0.0, True), (1.0, False)])
def test_an_arm_that_rests_reaches_in_and_a_board_at_the_border_does_not(
    border_m: float, explained: bool
) -> None:
    """It lies still in all frames, from the lower border to 1 m; 0 m: too near for the sensor there."""
    clip = make_clip("drawer")
    rows, columns = np.indices(clip.labels[0].shape)
    arm = (rows >= 80) & (np.abs(columns - 30) < 6)
    depth = np.where(rows > 140, border_m, 1.0 + (border_m - 1.0) * (rows - 80) / 70) if border_m else np.where(
        rows > 140, 0.0, 1.0
    )  # fmt: skip
    e = with_depth(perfect(clip), lambda seen: np.where(arm & (seen > 1.1), depth, seen))
    assert (clip.recording.depth(0)[arm] > 1.1).mean() > 0.9
    labels = {f: painted(clip, f, arm)[f] for f in clip.labels}
    shut = replace(e.part, motion=replace(e.part.motion, state=np.zeros(FRAMES)))
    still = changing(with_labels(replace(e, part=shut), labels, e.mesh), FRAMES, np.zeros(0))
    assert (of_parts.explained(still) is None) == explained


@pytest.mark.parametrize("kind", ["door", "slide"])
def test_each_visit_of_the_hand_moves_a_part(kind: Kind) -> None:
    """The true hand's does; were the part to rest or only to shake meanwhile, something would be missing. A
    short look in is no visit."""
    clip = make_clip(kind)
    e = perfect(clip)
    assert e.scene.idle_visit is None
    (part, mesh), *_ = e.scene.parts
    motion = part.motion
    hands = [f for f in clip.labels if (clip.labels[f] == HAND_LABEL).mean() > 0.004]
    shake = np.where(motion.frames == motion.frames[1], 1.0, 0.1 * motion.state / np.ptp(motion.state))
    for other in (
        replace(motion, intervals=()),
        replace(motion, state=shake * np.ptp(motion.state)),
    ):
        scene = replace(e.scene, parts=((replace(part, motion=other), mesh),))
        assert scene.idle_visit == (min(hands), max(hands))
    brief = {
        f: np.where(image == HAND_LABEL, 1, image) if f != hands[1] else image
        for f, image in clip.labels.items()
    }
    scene = replace(
        e.scene, labels=brief, parts=((replace(part, motion=replace(motion, intervals=())), mesh),)
    )
    assert scene.idle_visit is None


@pytest.mark.parametrize(("seconds", "idle"), [(2.5, False), (3.5, True)])
@pytest.mark.parametrize("before", [True, False])
def test_a_hand_that_stays_beside_a_motion_may_have_moved_something_else(
    seconds: float, idle: bool, before: bool
) -> None:
    """Ten frames a second; the part moves while the hand has been in view for so long, or is still in view
    for so long."""
    clip = make_clip("door")
    e = perfect(clip)
    (part, _), *_ = e.scene.parts
    rate, count = 10.0, 90
    motion = (40, 46)
    visit = (motion[0] - round(seconds * rate), 50) if before else (38, motion[1] + round(seconds * rate))
    frames = np.arange(count)
    state = np.interp(frames, motion, (0.0, 1.0))
    moved = replace(part, motion=Motion(frames, frames / rate, state, (motion,)))
    image = np.full(clip.labels[0].shape, HAND_LABEL, np.uint8)
    labels = {f: image if visit[0] <= f <= visit[1] else np.ones_like(image) for f in range(count)}
    recording = replace(e.scene.recording, times=frames / rate)
    told = hand_visits.idle_visit(recording, labels, [moved])
    assert told == (((visit[0], motion[0]) if before else (motion[1], visit[1])) if idle else None)


@pytest.mark.parametrize(("seconds", "idle"), [(5.5, None), (6.5, (16, 81))])
def test_between_two_motions_a_hand_leaves_one_part_and_reaches_for_the_next(
    seconds: float, idle: tuple[int, int] | None
) -> None:
    """In view throughout, ten frames a second: 3 s for each of both."""
    clip = make_clip("door")
    e = perfect(clip)
    (part, _), *_ = e.scene.parts
    frames = np.arange(100)
    again = 16 + round(seconds * 10)
    state = np.interp(frames, (10, 16, again, again + 6), (0.0, 1.0, 1.0, 0.0))
    moved = replace(part, motion=Motion(frames, frames / 10, state, ((10, 16), (again, again + 6))))
    labels = {int(f): np.full(clip.labels[0].shape, HAND_LABEL, np.uint8) for f in frames}
    recording = replace(e.scene.recording, times=frames / 10)
    assert hand_visits.idle_visit(recording, labels, [moved]) == idle

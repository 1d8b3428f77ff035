"""A part about which nothing is doubtful, as the stages before the verdict would hand it on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from recon.contact.closed_end import ClosedEnd
from recon.interaction.interaction import Interaction
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.find_parts import FoundParts, PartTracks
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from recon.verdict.evidence import PartEvidence, SceneEvidence
from recon.windows.windows import Window
from tests.makers.recon.cabinets import Clip
from twin.geometry import Array
from twin.scene import JointSigma

SPAN = 1.2  # rad, of the door
SHUT = ClosedEnd(0.0, 1, "rest", 1.0, 1.0)  # a closed end that is known well


def part_of(clip: Clip) -> MovingPart:
    """The clip's part with its range, known well."""
    sigma = JointSigma(0.002, 0.001, 0.002)
    return replace(clip.part, joint=replace(clip.part.joint, sigma=sigma, covariance=None, upper=SPAN))


def movers_of(clip: Clip, background: float = 0.0) -> tuple[Movers, Any]:
    """A track on each triangle of the part, exact, and as many in the room that shift by `background` m at
    half time."""
    rng = np.random.default_rng(0)
    on_part = clip.mesh.vertices[clip.mesh.faces].mean(axis=1)
    count = len(on_part)
    poses = clip.part.joint.poses(clip.part.motion.state)
    moving = np.einsum("tij,kj->tki", poses[:, :3, :3], on_part) + poses[:, None, :3, 3]
    room = np.tile(rng.uniform(-1, 1, (count, 3)), (len(poses), 1, 1))
    room[len(poses) // 2 :, :, 0] += background
    points = np.concatenate([moving, room], axis=1)
    mask = np.arange(2 * count) < count
    return Movers(points, np.ones(points.shape[:2], bool), mask, mask), mask


def as_one(recording: Recording, found: FoundParts, labels: Any = None) -> tuple[Interaction, ...]:
    """What was found as the only interaction of a recording."""
    window = Window(0, len(recording) - 1)
    return (Interaction(window, found, tuple(t.part for t in found.parts), labels or {}),)


def perfect(clip: Clip, labels: Any = None) -> PartEvidence:
    """The truth of the clip as evidence. labels: label images; the true ones where none are given."""
    return _true(clip) if labels is None else _with(clip, labels)


@cache  # what tests ask of the scene is computed once
def _true(clip: Clip) -> PartEvidence:
    return _with(clip, clip.labels)


def _with(clip: Clip, labels: Any) -> PartEvidence:
    part = part_of(clip)
    scene = SceneEvidence(clip.recording, clip.cameras, labels, clip.static, ((part, clip.mesh),))
    return PartEvidence(scene, part, clip.mesh)


def found_in(clip: Clip) -> FoundParts:
    """The clip's part as it was found: with a track on each of its triangles."""
    movers, mask = movers_of(clip)
    return FoundParts(movers, (PartTracks(part_of(clip), mask, "motion"),))


def with_depth(e: PartEvidence, change: Callable[[Array], Array]) -> PartEvidence:
    """The recording with its depth (H, W) m changed in every frame."""
    read = e.scene.recording.read_depth
    recording: Recording = replace(e.scene.recording, read_depth=lambda f: change(read(f)).astype(np.float32))
    return replace(e, scene=replace(e.scene, recording=recording))

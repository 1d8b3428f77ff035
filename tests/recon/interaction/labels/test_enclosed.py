"""What lies within a part is its own, but what surely stays while the part turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.dense.noise import GOOD_SENSOR
from recon.interaction.labels.enclosed import enclosed_by_parts
from recon.interaction.labels.label_frames import _part_box
from recon.interaction.labels.reference_frames import References, view
from tests.makers.recon.cabinets import Kind, make_clip
from twin.mesh import sample_surface
from twin.scene import STATIC_LABEL


def held(kind: Kind, stays: bool) -> list[NDArray[np.bool_]]:
    """Pixels (h, w) of static scene within a part whose every pixel is sure to have moved; stays: all of the
    static scene is seen at its place at both ends."""
    clip = make_clip(kind)
    frames = sorted(clip.labels)
    views = [view(clip.recording, f, 1) for f in frames]
    scores, sure = [], []
    for f in frames:
        part, static = clip.labels[f] == 2, clip.labels[f] == STATIC_LABEL
        scores.append(np.stack([np.zeros(part.shape), 3.0 * part, np.zeros(part.shape)]).astype(np.float32))
        sure.append(np.stack([part, static & stays]))
    found = enclosed_by_parts(
        views, scores, sure, clip.cameras, (clip.part,), clip.recording.intrinsics, GOOD_SENSOR
    )
    return [e[0, 0] & (clip.labels[f] == STATIC_LABEL) for e, f in zip(found, frames, strict=True)]


def test_what_stays_beside_a_hinge_is_none_of_the_door() -> None:
    loose, sure = (sum(int(h.sum()) for h in held("door", stays)) for stays in (False, True))
    assert loose > 50
    assert sure == 0


@pytest.mark.parametrize("kind", ["drawer"])
def test_what_slides_looks_as_if_it_stayed_and_is_held_all_the_same(kind: Kind) -> None:
    loose, sure = (sum(int(h.sum()) for h in held(kind, stays)) for stays in (False, True))
    assert sure == loose > 0


@pytest.mark.parametrize(("kind", "whole"), [("slide", True), ("door", False)])
def test_the_board_of_what_slides_in_its_own_plane_is_its_own_to_the_edges(kind: Kind, whole: bool) -> None:
    """Sure is only the strip that it leaves free, a fifth of it. A door's neighbours are told otherwise."""
    clip = make_clip(kind)
    frames = sorted(clip.labels)[:2]
    views = [view(clip.recording, f, 1) for f in frames]
    part = replace(clip.part, board=sample_surface(clip.mesh, 2000, np.random.default_rng(0))[0])
    scores, sure = [], []
    for f in frames:
        mine = clip.labels[f] == 2
        columns = np.flatnonzero(mine.any(axis=0))
        strip = mine & (np.arange(mine.shape[1]) < columns[len(columns) // 5])
        scores.append(np.stack([np.zeros(mine.shape), 3.0 * strip, np.zeros(mine.shape)]).astype(np.float32))
        sure.append(np.stack([strip, np.zeros_like(strip)]))
    found = enclosed_by_parts(
        views, scores, sure, clip.cameras, (part,), clip.recording.intrinsics, GOOD_SENSOR
    )
    shares = [e[0, 0][clip.labels[f] == 2].mean() for e, f in zip(found, frames, strict=True)]
    assert (min(shares) > 0.8) == whole
    assert (max(shares) < 0.4) != whole


@pytest.mark.parametrize(("kind", "behind"), [("door", 0.0), ("drawer", 0.6)])
def test_a_part_lies_about_its_board_and_a_drawer_behind_it(kind: Kind, behind: float) -> None:
    """Whatever noise is seen elsewhere: the references are not asked where the board is known."""
    clip = make_clip(kind)
    board = sample_surface(clip.mesh, 2000, np.random.default_rng(0))[0]
    part, none = replace(clip.part, board=board), np.zeros((0, 4, 4), np.float32)
    nowhere = References((), none, none, (none, none), np.zeros(0, bool), (), 1.0)
    box = _part_box(nowhere, clip.cameras, part, clip.recording.intrinsics, 0.003, GOOD_SENSOR)
    assert box is not None
    low, high = box
    size = float(np.ptp(board, axis=0).max())
    assert np.all(low < board.min(axis=0) - 0.3 * size)
    assert np.all(high > board.max(axis=0) + 0.3 * size)
    reach = np.abs(np.stack([low - board.min(axis=0), high - board.max(axis=0)]))
    along = np.abs(part.joint.axis) > 0.9
    assert np.allclose(reach[:, along].max(), 0.1 + 0.5 * size + behind, atol=0.05)

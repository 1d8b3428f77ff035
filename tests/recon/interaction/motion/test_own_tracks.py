"""Tracks on the hand are no witnesses of a part's joint."""

from __future__ import annotations

import numpy as np

from recon.interaction.motion.movers import Movers
from recon.interaction.parts.found import PartTracks
from recon.recording import Intrinsics
from recon.verdict.own_tracks import without_hand
from tests.laws import random_pose
from tests.makers.recon.cabinets import make_clip
from twin import geometry as geo
from twin.scene import HAND_LABEL, STATIC_LABEL, Trajectory

CAMERA = Intrinsics(100, 80, 90.0, 90.0, 49.5, 39.5)


def test_tracks_labelled_hand_more_often_than_part_are_left_out() -> None:
    """Left a quarter of the picture is hand, then part, and static at the right; in the last labelled frame
    hand and part are exchanged."""
    part = make_clip("door").part
    image = np.full((80, 100), STATIC_LABEL, np.uint8)
    image[:, :25], image[:, 25:50] = HAND_LABEL, part.id
    other = image.copy()
    other[:, :25], other[:, 25:50] = part.id, HAND_LABEL
    T = random_pose(np.random.default_rng(0))
    x = np.array([10.0, 40.0, 70.0, 10.0, 40.0, 400.0, 10.0])
    seen = np.ones((9, len(x)), bool)
    seen[:8, 3] = False  # this one is seen where it is labelled part only, the next one where it is hand
    seen[:8, 4] = False
    here = CAMERA.backproject(np.stack([x, np.full(len(x), 30.0)], axis=1), np.full(len(x), 1.2))
    points = np.tile(geo.transform(T, here), (9, 1, 1))
    points[~seen] = np.nan
    movers = Movers(points, seen, np.ones(len(x), bool), np.ones(len(x), bool))
    members = np.arange(len(x)) < 6
    frames = np.arange(9)
    cameras = Trajectory(frames, frames / 15.0, np.tile(T, (9, 1, 1)))
    labels = {0: image, 4: image, 8: other}
    own = without_hand(PartTracks(part, members, "depth"), movers, CAMERA, cameras, labels)
    assert own.members.tolist() == [False, True, True, True, False, True, False]
    once = without_hand(
        PartTracks(part, members, "depth"), movers, CAMERA, cameras, {0: image, 8: other, 20: image}
    )
    assert once.members.tolist()[:2] == [
        True,
        True,
    ]  # as often the one as the other; frames without a camera tell nothing

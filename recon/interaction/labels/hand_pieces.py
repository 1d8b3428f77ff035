"""Which unexplained pieces are no hand: crumbs, what is too wide, and pieces at rest without an arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32
from recon.dense.noise import DepthNoise
from recon.interaction.labels.reference_frames import View, as_references, gather, relative_moves, rest_phases
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics
from twin.scene import Trajectory

Bits = NDArray[np.bool_]

# All chosen by us. Least share of the picture that a hand has.
_MIN_HAND = 0.001
# m; radius of a disc within an arm: true hands with sleeves have .06 at most (40 open recordings), coarse
# sensors smear them.
_WIDEST_M = 0.1
# px of the working grid within which a piece reaches the picture's border.
_BORDER_PX = 3
# Share of a resting piece's pixels that stay where they are.
_STAYS = 0.5
# Share of the other labelled frames of the same rest in which such a pixel stays.
_OFTEN = 0.6
# Fewest such frames, as a hand may linger.
_FEWEST = 5


def drop_crumbs(belief: F32) -> None:
    """Take the hand, last of the beliefs (n, h, w), from pieces below `_MIN_HAND`: noise and thin handles."""
    hand = belief.argmax(axis=0) == len(belief) - 1
    _, pieces, stats, _ = cv2.connectedComponentsWithStats(hand.astype(np.uint8), connectivity=8)
    small = stats[:, cv2.CC_STAT_AREA] < _MIN_HAND * hand.size
    belief[-1][small[pieces] & hand] = 0.0


def too_wide(hand: Bits, depth: F32, fx: float) -> Bits:
    """Pixels (H, W) of pieces of the hand into which a disc fits that no arm has room for: people, curtains.
    depth (H, W): m, 0 unknown. fx: px."""
    _, pieces = cv2.connectedComponents(hand.astype(np.uint8), connectivity=8)
    room = cv2.distanceTransform(np.pad(hand.astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1] * depth / fx
    return np.asarray(np.isin(pieces, pieces[room > _WIDEST_M]) & hand)


@dataclass(frozen=True, eq=False)
class Rests:
    """The labelled frames by the rests in which no part moves."""

    views: Sequence[View]
    cameras: Trajectory
    phases: Sequence[NDArray[np.int64]]
    camera: Intrinsics
    color_sigma: float
    slack: float
    noise: DepthNoise

    @classmethod
    def of(
        cls,
        views: Sequence[View],
        cameras: Trajectory,
        parts: Sequence[MovingPart],
        camera: Intrinsics,
        color_sigma: float,
        slack: float,
        noise: DepthNoise,
    ) -> Rests:
        """Split the views; frames in which a part moves are in no rest."""
        phases = rest_phases(parts, np.array([v.frame for v in views])) if parts else []
        moving = [i for p in parts for i in p.motion.intervals]
        phases = [p for p in phases if not any(a <= p[0] <= b for a, b in moving)]
        return cls(views, cameras, phases, camera, color_sigma, slack, noise)

    def drop_armless(self, belief: F32, seen: View) -> None:
        """Take the hand from pieces that stay while no part moves and that no arm joins to the border.

        Such a piece is a part's rim that a joint puts aside a little, or surface that another state hides. An
        arm may be too near for depth and run across unknown pixels. A part may hide the arm of fingers.
        """
        others = [v for phase in self.phases if seen.frame in phase for v in self.views if v.frame in phase]
        others = [v for v in others if v.frame != seen.frame]
        hand = belief.argmax(axis=0) == len(belief) - 1
        armless = hand & ~_with_arm(hand, seen.depth)
        if len(others) < _FEWEST or not armless.any():
            return
        refs = as_references(others, np.zeros(len(others), bool), self.color_sigma)
        moves = relative_moves(self.cameras, (), seen.frame, refs.frames)[0]
        above = np.ones(len(others), np.int8)
        there = gather(seen, refs, moves, self.camera, self.slack, self.noise, armless, above)[3]
        _, pieces = cv2.connectedComponents(armless.astype(np.uint8), connectivity=8)
        size = np.bincount(pieces.ravel())
        stay = np.bincount(pieces[there > _OFTEN * len(others)], minlength=len(size)) > _STAYS * size
        belief[-1][armless & stay[pieces]] = 0.0


def _with_arm(hand: Bits, depth: F32) -> Bits:
    """Pixels (h, w) of the hand or of unknown depth in pieces that reach the picture's border."""
    _, pieces = cv2.connectedComponents((hand | (depth <= 0)).astype(np.uint8), connectivity=8)
    inner = pieces[_BORDER_PX:-_BORDER_PX, _BORDER_PX:-_BORDER_PX]
    reaches = np.bincount(pieces.ravel()) > np.bincount(inner.ravel(), minlength=int(pieces.max()) + 1)
    return np.asarray(reaches[pieces] & (pieces > 0))

"""Evidence against a part that its fit did not use: depth in its motion, labels, false hands.

The limits are what right parts keep to, chosen by us on recordings that we looked at, as the figures below;
what a number beyond one is worth is calibrated (`recon.verdict.posterior`).
"""

from __future__ import annotations

import numpy as np

from recon.verdict.doubt import Doubt, above, below
from recon.verdict.evidence import PartEvidence
from twin.verdict import reason

# Greatest ratio of pixels seen through to the part's own. Right: 0 in all, .0009 with stereo depth. Wrong:
# .006, .013 and .20 in three, less in the others, whose part hardly shows.
THROUGH = 0.005
# Greatest share of pixels against the twin's state, of all pixels that decide. Right: 0, and .047 in one that
# is closed, by a hand where the part was. Wrong: 1 in two.
WRONG = 0.2
# Fewest pixels that decide: a blob of ten by ten. Chosen by us.
FEWEST = 100
# Least ratio of pixels that leave the depth of rest for the twin's to the part's own pixels. Right: .11 to
# .80, .03 and more with a stereo camera; one right door has 0. Wrong: below in 23 of 36 with a surface.
WITNESSED = 0.05
# Least share of the part's area that was seen to move. Right: .47 to .96 in 30. Wrong: 0 to .28 in 21.
MOVED = 0.3
# Least share of the area that goes far enough to be judged.
TOLD = 0.3
# Greatest share of the area that is seen to be absent, or to stay. Right: 0 to .03 in 30. Wrong: .11 to .23
# in four, less in parts that are hidden behind their mislabelled surroundings.
CONTRADICTED = 0.1
# Least intersection over union of the part's labels and the twin's pixels, in half of the frames at an end of
# the travel. Right and trusted: .79 to .99 in 47. Wrong: 0 to .48 in 14.
LABELLED = 0.8
# Greatest share of the border at rest without an edge. Right: .18 and less in 107 of 109 trusted ones; plain
# fronts reach .63 on a walk. Wrong labels: .21 to .6 in ten.
BARE = 0.2
# Greatest share of the first or last labelled frame that is a false hand. Right: 0 to .009, most with time of
# flight. Wrong: .008 to .59, from .02 in 25 of 31 with as much labelled hand there.
HAND_AT_END = 0.012
# Greatest share of any labelled frame that is labelled hand and rests half a second before and after: fingers
# stay on a handle, and a hand may wait. Right: 0 to .014 in 51. With a missed part or path: .049 to .19 in
# four, less in nine.
HAND_AT_REST = 0.03


def labelled_at_ends(e: PartEvidence) -> Doubt | None:
    """The labels against the twin: a surface on another joint is labelled where it really is."""
    if e.least_labelled is None:
        return None
    frame, share = e.least_labelled
    return below("LabelledElsewhere", share, LABELLED, frame, share)


def seen_through(e: PartEvidence) -> Doubt | None:
    """Where the moving twin is nearer than the reading; no hand adds depth. Unseen parts: `motion_seen`."""
    m = e.in_motion
    if m is None or m.own == 0:
        return None
    return above("SeenThrough", m.through / m.own, THROUGH, m.worst, m.through / m.own)


def motion_explained(e: PartEvidence) -> Doubt | None:
    """Whether changed pixels have the depth of the moving twin."""
    m = e.in_motion
    if m is None or m.right + m.wrong < FEWEST:
        return None
    return above("MotionUnexplained", m.wrong / (m.right + m.wrong), WRONG)


def motion_seen(e: PartEvidence) -> Doubt | None:
    """How much of the part is seen to move by another depth. Without any, nothing shows that it moves."""
    m = e.in_motion
    return None if m is None else below("MotionUnseen", m.right / max(m.own, 1), WITNESSED)


def seen_to_move(e: PartEvidence) -> Doubt | None:
    """How much surface is seen at two places, one of them empty in between; None if it hardly moves."""
    p = e.places
    if p is None or p.far < TOLD:
        return None
    return below("SurfaceUnseen", p.witnessed, MOVED, p.witnessed, 1.0 - p.witnessed - p.contradicted)


def contradicted(e: PartEvidence) -> Doubt | None:
    """How much of its surface is seen not to move with it: wall, table or neighbour labelled part."""
    return None if e.places is None else above("SurfaceContradicted", e.places.contradicted, CONTRADICTED)


def ends_at_edges(e: PartEvidence) -> Doubt | None:
    """Whether the picture shows an edge where the part's labels end."""
    if e.bare_border is None:
        return None
    frame, share = e.bare_border
    return above("BareBorder", share, BARE, frame, share)


def hand_is_one(e: PartEvidence) -> Doubt | None:
    """False hands, in the first and last labelled frame or at rest in any: missed or mislabelled parts."""
    if not e.scene.labels:
        return None
    for (frame, share), limit in ((e.scene.false_hand, HAND_AT_END), (e.scene.resting_hand, HAND_AT_REST)):
        if share > limit:
            return above("HandWhereNobodyIs", share, limit, frame, share)
    return None


def hand_moves_something(e: PartEvidence) -> Doubt | None:
    """Whether a part moves at each visit of a hand: against each part; a missed one may be a piece of it."""
    visit = e.scene.idle_visit
    return None if visit is None else Doubt(reason("HandMovesNothing", "doubtful", *visit), np.e)

"""Evidence against a part that its fit did not use: depth in its motion, its two halves, false hands.

The limits are what right parts keep to, chosen by us on recordings that we looked at, as the figures below;
what a number beyond one is worth is calibrated (`recon.verdict.posterior`).
"""

from __future__ import annotations

import numpy as np

from recon.verdict.doubt import Doubt, above, below
from recon.verdict.evidence import PartEvidence
from recon.verdict.halves import Halves, Whole
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
# rad and m by which axes and hinges of the halves may differ. Right: up to 4 deg where they answer, 37 mm.
HALVES_AXIS, HALVES_PIVOT = np.radians(10.0), 0.05
# rad and m. The halves answer if `_SIGMAS` standard deviations of their difference are within these. The
# second is narrower, as the sigma leaves out the drift of tracks: right runs differ by up to nine sigmas.
SURE_AXIS, SURE_PIVOT = np.radians(10.0), 0.02
_SIGMAS = 3.0
# Least ratio of the tracks' scatter about the part's joint to that about a half's own joint. Below, the
# halves differ where drifting tracks are blind: 1.02 and 1.09 in two right parts, 1.25 and more if wrong.
AS_WELL = 1.15
# rad within which the axes of the halves agree.
AGREED = np.radians(3.0)
# rad and m by which halves that agree may differ from the part's joint. Right: up to 2.3 deg in twelve, 18 mm
# in six. Wrong: 8.2 deg in a drawer whose plain front slipped sideways, 55 mm in one cut outline.
TRACKS_AXIS, TRACKS_PIVOT = np.radians(4.0), 0.025
# rad. Greatest sigma of the axis by the tracks of the whole motion.
WHOLE_SURE = np.radians(1.0)
# rad by which that axis may differ from the part's, if the scatter's ratio is above `AS_WELL`. Right: up to
# 2.8 deg in 160. Wrong: 3.8 in a plain front that slipped sideways, and 9.9.
WHOLE_AXIS = np.radians(3.5)
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


def _telling(halves: Halves | None) -> Halves | None:
    """The halves where their axes are known and the part's joint is worse for their tracks than theirs."""
    if halves is None or _SIGMAS * halves.axis_sigma > SURE_AXIS or halves.worse <= AS_WELL:
        return None
    return halves


def _sure_pivot(halves: Halves) -> float | None:
    """Distance (m) of the halves' hinges; None if unsure."""
    sigma = halves.pivot_sigma
    return None if sigma is None or _SIGMAS * sigma > SURE_PIVOT else halves.pivot


def same_in_halves(e: PartEvidence) -> Doubt | None:
    """Whether both halves of the motion show the same joint; None if one is too short."""
    h = _telling(e.halves)
    if h is None:
        return None
    pivot = _sure_pivot(h) or 0.0
    return _joints_differ("HalvesDisagree", h.axis, HALVES_AXIS, pivot, HALVES_PIVOT)


def _joints_differ(type: str, axis: float, most: float, pivot: float, farthest: float) -> Doubt | None:
    """The doubt about two joints by the angle of their axes, rad, and the distance of their hinges, m."""
    times = max(axis / most, pivot / farthest)
    told = float(np.rad2deg(axis)), float(np.rad2deg(most)), pivot, farthest
    return Doubt(reason(type, "doubtful", *told), times) if times > 1.0 else None


def _another(whole: Whole | None) -> float:
    """By how much, rad, the axis by the tracks of the whole motion differs, if they tell another one."""
    if whole is None or whole.sigma > WHOLE_SURE or whole.worse <= AS_WELL:
        return 0.0
    return whole.off


def as_its_tracks(e: PartEvidence) -> Doubt | None:
    """Whether the part's tracks agree with its axis and its hinge: all of them, or both halves."""
    off = _another(e.whole)
    if off > WHOLE_AXIS:
        return _joints_differ("TracksDisagree", off, WHOLE_AXIS, 0.0, TRACKS_PIVOT)
    h = _telling(e.halves)
    if h is None:
        return None
    distance = _sure_pivot(h)
    pivot = h.off_pivot if distance is not None and distance <= SURE_PIVOT else 0.0
    axis = h.off if h.axis <= AGREED else 0.0
    return _joints_differ("TracksDisagree", axis, TRACKS_AXIS, pivot, TRACKS_PIVOT)


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

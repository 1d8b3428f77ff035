"""Evidence against a part that its fit did not use: depth in its motion, its two halves, hands that are none.

The limits are floors, chosen by us on recordings that were looked at while this was built: 24 right runs, 5
of one recording with a fault of the sensor each, and 37 on random scenes, 5 of them right. Each limit is at
least twice what right runs have.
"""

from __future__ import annotations

import numpy as np

from recon.verdict.evidence import PartEvidence
from recon.verdict.halves import Halves, Whole
from twin.verdict import Level, Reason, reason

# Pixels that are seen through, over the part's own. Right: 0 in all, .0009 with stereo depth; wrong: .006,
# .013 and .20 in three, less in the others, whose part hardly shows.
THROUGH = 0.005
# Share of what tells that the part is not where the twin has it, of all that tells. Right: 0, .047 in one
# that is closed, by a hand that is where the part was; wrong: 1 in two. Where less than `FEWEST` pixels
# (chosen by us, a blob of ten by ten) tell, it means nothing.
WRONG, FEWEST = 0.2, 100
# What is seen with another depth than at rest and with the twin's, over the part's own pixels. Right: .11 to
# .80; wrong: below in 23 of 36 with a surface, most others with a right joint and the wrong closed end or
# labels. Refused where there is none of it, by us: 0 in four of five open negatives that were looked at for
# it; right ones with a stereo camera .03 and more, one right door 0, whose surface moved.
WITNESSED, WITNESSED_REFUSED = 0.05, 0.005
# Share of the part's area that was seen to move, and that goes far enough to be told. Right: .47 to .96 in
# 30; wrong: 0 to .28 in 21, and more in six whose surface is right and whose joint, path or closed end is
# not. Where hardly any was, and most was not even seen at two places, what is called a part is none.
MOVED, MOVED_REFUSED, FOLLOWED, TOLD = 0.3, 0.02, 0.5, 0.3
# Share of the area that is seen not to be there, or to stay. Right: 0 to .03 in 30; wrong: .11 to .23 in
# four, less in those that are hidden behind what they were labelled with. Above half of it, by us.
CONTRADICTED, CONTRADICTED_REFUSED = 0.1, 0.5
# rad and m by which the joints of the halves differ: twice and two and a half times what counts as success.
# Right: up to 3 deg and 25 mm where they answer, 4 deg and 37 mm with a lidar. They do where three sigmas of
# the difference are within the limits `SURE`; that of the hinge is narrower, as its sigma leaves out how
# tracks drift: right runs differ by up to nine of them.
HALVES_AXIS, HALVES_PIVOT = np.radians(10.0), 0.05
SURE_AXIS, SURE_PIVOT, _SIGMAS = np.radians(10.0), 0.02, 3.0
# Where tracks scatter about the part's joint hardly farther than about a half's own, the halves differ along
# what tracks that drift don't tell: 1.02 and 1.09 times in two right ones whose halves are 16 and 27 deg
# apart, 1.25 and more in four that are none.
AS_WELL = 1.15
# rad. By how much halves that agree with each other may differ from the part's axis. Right: up to 2.3 deg in
# twelve that agree; one of a drawer whose plain front slipped sideways in depth, 8.2.
AGREED, TRACKS_AXIS = np.radians(3.0), np.radians(4.0)
# rad. The same of the tracks of the whole motion, where one sigma of their axis is within the first. Right
# ones whose tracks scatter as much farther about the part's joint: up to 2.8 deg in 160, looked at; wrong 3.8
# in a plain front that slipped sideways, and 9.9.
WHOLE_SURE, WHOLE_AXIS = np.radians(1.0), np.radians(3.5)
# m. By how much the hinge of halves that agree within `SURE_PIVOT` may lie from the part's. Right: up to 18
# mm in six of 48 hinges where halves are so sure; one whose refinement left the tracks' place for a cut
# outline's, 55. All of them looked at.
TRACKS_PIVOT = 0.025
# Intersection over union of what is labelled as it and what should show it, in half of the frames at an end
# of its travel; success needs .7 of its labels. Trusted ones that were right: .81 to .99 in 45 and .79 in
# two, one of which has .71 of its labels; wrong: 0 to .48 in 14, .2 in one that nothing else spoke against,
# .65 and more in six that other reasons tell. All of them looked at.
LABELLED = 0.8
# Share of the border at rest that is no edge. Right: .18 and less in 107 of 109 open random ones that were
# trusted, looked at, .24 in one, .38 in one whose upper third was labelled room (its path 16 mm off); wrong
# labels: .21 to .6 in ten, less in as many that end at others' edges.
BARE = 0.2
# Most of the outline is none: what moves is another surface. By us; more than any right one (.38).
BARE_REFUSED = 0.5
# Share of the first or last labelled frame. Right: 0 to .009, with time of flight most, .0014 at most in 24
# recordings that are cut at some 700 frames with a true hand in view; wrong: .008 to .59, from .02 in 25 of
# 31 that have as much labelled hand there.
HAND_AT_END = 0.012
# Share of any labelled frame that is labelled hand and rests half a second before and after: fingers stay on
# a handle, and a hand may wait. Right: 0 to .014 in 51; where a part or the path was missed .049 to .19 in
# four, less in nine. All of them looked at
HAND_AT_REST = 0.03


def labelled_at_ends(e: PartEvidence) -> Reason | None:
    """The labels against the twin: a surface that moves by another joint is labelled where it really is."""
    if e.least_labelled is None or e.least_labelled[1] >= LABELLED:
        return None
    return reason("LabelledElsewhere", "doubtful", *e.least_labelled, LABELLED)


def seen_through(e: PartEvidence) -> Reason | None:
    """Where the moving twin is nearer than the reading; no hand adds depth. Unseen parts: `motion_seen`."""
    m = e.in_motion
    if m is None or m.own == 0 or m.through <= THROUGH * m.own:
        return None
    return reason("SeenThrough", "doubtful", m.worst, m.through / m.own, THROUGH)


def motion_explained(e: PartEvidence) -> Reason | None:
    """Whether what changed has the depth of the moving twin."""
    m = e.in_motion
    if m is None or m.right + m.wrong < FEWEST:
        return None
    share = m.wrong / (m.right + m.wrong)
    return None if share <= WRONG else reason("MotionUnexplained", "doubtful", share, WRONG)


def motion_seen(e: PartEvidence) -> Reason | None:
    """How much of the part is seen to move by another depth. Without any, nothing shows that it moves."""
    m, p = e.in_motion, e.places
    if m is None or m.right >= WITNESSED * max(m.own, 1):
        return None
    share = m.right / max(m.own, 1)
    nothing = share < WITNESSED_REFUSED and p is not None and p.witnessed < MOVED_REFUSED
    return reason("MotionUnseen", "refused" if nothing else "doubtful", share, WITNESSED)


def seen_to_move(e: PartEvidence) -> Reason | None:
    """How much surface is seen at two places, one of them empty in between; None if it hardly moves."""
    p = e.places
    if p is None or p.far < TOLD or p.witnessed >= MOVED:
        return None
    none = p.witnessed < MOVED_REFUSED and p.followed < FOLLOWED
    untold = 1.0 - p.witnessed - p.contradicted
    return reason("SurfaceUnseen", "refused" if none else "doubtful", p.witnessed, untold, MOVED)


def surely_moved(e: PartEvidence) -> bool:
    """Whether depth shows by itself that this surface moves as the part does: then its joint may be unsure,
    and it is a part all the same."""
    m, p = e.in_motion, e.places
    if m is None or p is None or m.right < WITNESSED * max(m.own, 1):
        return False
    return p.far >= TOLD and p.witnessed >= MOVED and p.contradicted <= CONTRADICTED


def contradicted(e: PartEvidence) -> Reason | None:
    """How much of its surface is seen not to move with it: wall, table or neighbour labelled part."""
    p = e.places
    if p is None or p.contradicted <= CONTRADICTED:
        return None
    level: Level = "refused" if p.contradicted > CONTRADICTED_REFUSED else "doubtful"
    return reason("SurfaceContradicted", level, p.contradicted, CONTRADICTED)


def _telling(halves: Halves | None) -> Halves | None:
    """The halves where their axes are known and the part's joint is worse for their tracks than theirs."""
    if halves is None or _SIGMAS * halves.axis_sigma > SURE_AXIS or halves.worse <= AS_WELL:
        return None
    return halves


def _sure_pivot(halves: Halves) -> float | None:
    """How far the halves' hinges are apart (m), None where that is not told."""
    sigma = halves.pivot_sigma
    return None if sigma is None or _SIGMAS * sigma > SURE_PIVOT else halves.pivot


def same_in_halves(e: PartEvidence) -> Reason | None:
    """Whether both halves of the motion show the same joint; None where one is too short to tell."""
    h = _telling(e.halves)
    if h is None:
        return None
    pivot = _sure_pivot(h) or 0.0
    if h.axis <= HALVES_AXIS and pivot <= HALVES_PIVOT:
        return None
    return reason(
        "HalvesDisagree",
        "doubtful",
        float(np.rad2deg(h.axis)),
        float(np.rad2deg(HALVES_AXIS)),
        pivot,
        HALVES_PIVOT,
    )


def _another(whole: Whole | None) -> Whole | None:
    """The tracks of the whole motion where they tell another axis."""
    if whole is None or whole.sigma > WHOLE_SURE or whole.worse <= AS_WELL:
        return None
    return whole if whole.off > WHOLE_AXIS else None


def as_its_tracks(e: PartEvidence) -> Reason | None:
    """Whether the part's tracks tell its axis and its hinge: all of them, or both halves."""
    another = _another(e.whole)
    if another is not None:
        off, limit = float(np.rad2deg(another.off)), float(np.rad2deg(WHOLE_AXIS))
        return reason("TracksDisagree", "doubtful", off, limit, 0.0, TRACKS_PIVOT)
    h = _telling(e.halves)
    if h is None:
        return None
    apart = _sure_pivot(h)
    pivot = h.off_pivot if apart is not None and apart <= SURE_PIVOT else 0.0
    axis = h.off if h.axis <= AGREED else 0.0
    if axis <= TRACKS_AXIS and pivot <= TRACKS_PIVOT:
        return None
    return reason(
        "TracksDisagree",
        "doubtful",
        float(np.rad2deg(axis)),
        float(np.rad2deg(TRACKS_AXIS)),
        pivot,
        TRACKS_PIVOT,
    )


def ends_at_edges(e: PartEvidence) -> Reason | None:
    """Whether the picture shows an edge where the labels have the part end."""
    if e.bare_border is None or e.bare_border[1] <= BARE:
        return None
    level: Level = "refused" if e.bare_border[1] > BARE_REFUSED else "doubtful"
    return reason("BareBorder", level, *e.bare_border, BARE)


def hand_is_one(e: PartEvidence) -> Reason | None:
    """What is labelled hand and is none, in the first and the last labelled frame or at rest in any: a part
    that was missed, or one labelled wrong."""
    if not e.scene.labels:
        return None
    for (frame, share), limit in ((e.scene.false_hand, HAND_AT_END), (e.scene.resting_hand, HAND_AT_REST)):
        if share > limit:
            return reason("HandWhereNobodyIs", "doubtful", frame, share, limit)
    return None


def hand_moves_something(e: PartEvidence) -> Reason | None:
    """Whether a part moves at each visit of a hand: against each part; a missed one may be a piece of it."""
    visit = e.scene.idle_visit
    return None if visit is None else reason("HandMovesNothing", "doubtful", *visit)

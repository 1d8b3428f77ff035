"""Evidence against a part that its fit did not use: depth in its motion, its two halves, false hands.

The limits are floors, chosen by us on the dev set: 24 right runs, 5 runs of one recording with a sensor fault
each, and 37 on random scenes, 5 of them right. Each limit is at least twice what right runs have. The figures
below are of recordings that we looked at.
"""

from __future__ import annotations

import numpy as np

from recon.verdict.evidence import PartEvidence
from recon.verdict.halves import Halves, Whole
from twin.verdict import Level, Reason, reason

# Greatest ratio of pixels seen through to the part's own. Right: 0 in all, .0009 with stereo depth. Wrong:
# .006, .013 and .20 in three, less in the others, whose part hardly shows.
THROUGH = 0.005
# Greatest share of pixels against the twin's state, of all pixels that decide. Right: 0, and .047 in one that
# is closed, by a hand where the part was. Wrong: 1 in two.
WRONG = 0.2
# Fewest pixels that decide: a blob of ten by ten. Chosen by us.
FEWEST = 100
# Least ratio of pixels that leave the depth of rest for the twin's to the part's own pixels. Right: .11 to
# .80. Wrong: below in 23 of 36 with a surface; most others have a right joint and the wrong closed end or
# labels.
WITNESSED = 0.05
# Below this ratio the part is refused. Chosen by us: 0 in four of five open negatives. Right parts have .03
# and more with a stereo camera; one right door has 0, and its surface moved.
WITNESSED_REFUSED = 0.005
# Least share of the part's area that was seen to move. Right: .47 to .96 in 30. Wrong: 0 to .28 in 21, and
# more in six with a right surface and a wrong joint, path or closed end.
MOVED = 0.3
# Below this share the part is refused, if less than `FOLLOWED` of it was seen at two places.
MOVED_REFUSED = 0.02
FOLLOWED = 0.5
# Least share of the area that goes far enough to be judged.
TOLD = 0.3
# Greatest share of the area that is seen to be absent, or to stay. Right: 0 to .03 in 30. Wrong: .11 to .23
# in four, less in parts that are hidden behind their mislabelled surroundings.
CONTRADICTED = 0.1
# Above this share the part is refused. Chosen by us.
CONTRADICTED_REFUSED = 0.5
# rad by which the axes of the halves may differ, twice the limit of success. Right: up to 3 deg where they
# answer, 4 deg with a lidar.
HALVES_AXIS = np.radians(10.0)
# m by which their hinges may differ, two and a half times that limit. Right: up to 25 mm, 37 mm with a lidar.
HALVES_PIVOT = 0.05
# rad. The halves answer if `_SIGMAS` standard deviations of the axes' difference are within this limit,
SURE_AXIS = np.radians(10.0)
# m, and those of the hinges within this one. It is narrower, as the sigma leaves out the drift of tracks:
# right runs differ by up to nine sigmas.
SURE_PIVOT = 0.02
_SIGMAS = 3.0
# Least ratio of the tracks' scatter about the part's joint to that about a half's own joint. Below, the
# halves differ where drifting tracks are blind: 1.02 and 1.09 in two right parts with halves 16 and 27 deg
# apart, 1.25 and more in four wrong ones.
AS_WELL = 1.15
# rad within which the axes of the halves agree.
AGREED = np.radians(3.0)
# rad by which halves that agree may differ from the part's axis. Right: up to 2.3 deg in twelve. Wrong: 8.2
# in a drawer whose plain front slipped sideways in depth.
TRACKS_AXIS = np.radians(4.0)
# rad. Greatest sigma of the axis by the tracks of the whole motion.
WHOLE_SURE = np.radians(1.0)
# rad by which that axis may differ from the part's, if the scatter's ratio is above `AS_WELL`. Right: up to
# 2.8 deg in 160. Wrong: 3.8 in a plain front that slipped sideways, and 9.9.
WHOLE_AXIS = np.radians(3.5)
# m by which the hinge of halves that agree within `SURE_PIVOT` may lie from the part's. Right: up to 18 mm in
# six of 48 hinges with such halves. Wrong: 55 in one whose refinement followed a cut outline.
TRACKS_PIVOT = 0.025
# Least intersection over union of the part's labels and the twin's pixels, in half of the frames at an end of
# the travel; success needs .7 of the labels. Right and trusted: .81 to .99 in 45 and .79 in two, one of which
# has .71 of its labels. Wrong: 0 to .48 in 14, .2 in one without another reason, .65 and more in six with
# one.
LABELLED = 0.8
# Greatest share of the border at rest without an edge. Right: .18 and less in 107 of 109 trusted open random
# ones, .24 in one, .38 in one whose upper third was labelled room (its path 16 mm off). Wrong labels: .21 to
# .6 in ten, less in as many that end at others' edges. Right ones of plain fronts reach .63 on a walk: no
# share refuses.
BARE = 0.2
# Greatest share of the first or last labelled frame that is a false hand. Right: 0 to .009, most with time of
# flight, and .0014 at most in 24 recordings cut at some 700 frames with a true hand in view. Wrong: .008 to
# .59, from .02 in 25 of 31 with as much labelled hand there.
HAND_AT_END = 0.012
# Greatest share of any labelled frame that is labelled hand and rests half a second before and after: fingers
# stay on a handle, and a hand may wait. Right: 0 to .014 in 51. With a missed part or path: .049 to .19 in
# four, less in nine.
HAND_AT_REST = 0.03


def labelled_at_ends(e: PartEvidence) -> Reason | None:
    """The labels against the twin: a surface on another joint is labelled where it really is."""
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
    """Whether changed pixels have the depth of the moving twin."""
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
    """Whether depth alone shows the surface moving as the part does: a part even if its joint is unsure."""
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
    """Distance (m) of the halves' hinges; None if unsure."""
    sigma = halves.pivot_sigma
    return None if sigma is None or _SIGMAS * sigma > SURE_PIVOT else halves.pivot


def same_in_halves(e: PartEvidence) -> Reason | None:
    """Whether both halves of the motion show the same joint; None if one is too short."""
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
    """The tracks of the whole motion, if their axis is another one."""
    if whole is None or whole.sigma > WHOLE_SURE or whole.worse <= AS_WELL:
        return None
    return whole if whole.off > WHOLE_AXIS else None


def as_its_tracks(e: PartEvidence) -> Reason | None:
    """Whether the part's tracks agree with its axis and its hinge: all of them, or both halves."""
    another = _another(e.whole)
    if another is not None:
        off, limit = float(np.rad2deg(another.off)), float(np.rad2deg(WHOLE_AXIS))
        return reason("TracksDisagree", "doubtful", off, limit, 0.0, TRACKS_PIVOT)
    h = _telling(e.halves)
    if h is None:
        return None
    distance = _sure_pivot(h)
    pivot = h.off_pivot if distance is not None and distance <= SURE_PIVOT else 0.0
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
    """Whether the picture shows an edge where the part's labels end."""
    if e.bare_border is None or e.bare_border[1] <= BARE:
        return None
    return reason("BareBorder", "doubtful", *e.bare_border, BARE)


def hand_is_one(e: PartEvidence) -> Reason | None:
    """False hands, in the first and last labelled frame or at rest in any: missed or mislabelled parts."""
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

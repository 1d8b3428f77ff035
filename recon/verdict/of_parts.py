"""Evidence against a part: each function looks at one number and returns a reason, or None.

The limits are floors, chosen by us on 27 held-out runs: 6 right, 12 with the part missed, 9 with a right
joint and wrong labels, a wrong closed end, or one of several parts. Residual and share of inliers don't
separate (1.2 to 2.7 mm and .41 to .83 if right, 1.9 to 8.2 mm and .37 to .68 if missed). The figures below
are of recordings that we looked at.
"""

from __future__ import annotations

import numpy as np

from recon.verdict.evidence import PartEvidence
from recon.verdict.fronts import square_to_front
from recon.verdict.in_motion import moving_rows
from recon.verdict.of_video import (
    as_its_tracks,
    contradicted,
    ends_at_edges,
    hand_is_one,
    hand_moves_something,
    labelled_at_ends,
    motion_explained,
    motion_seen,
    same_in_halves,
    seen_through,
    seen_to_move,
    surely_moved,
)
from recon.verdict.track_drift import track_drift
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Motion
from twin.verdict import Level, Reason, reason

# deg. Above this sigma of the axis a short range refuses. Right joints of 90 open random recordings have .04
# to 1.64; wrong or missing ones .67 to 1300, and below 3 only with another refusal.
AXIS_HALF_SURE = 0.9
# deg. Doubtful at a quarter of the limit of success, as the sigma leaves out the drift of tracks.
AXIS_DOUBTFUL = 1.25
# deg. Refused where two sigmas exceed the limit of success.
AXIS_REFUSED = 3.0
# m by which borders are off. A slide without texture shows its way by borders alone: 4 to 14 mm in five runs.
BORDERS_M = 0.008
# deg. Doubtful at half of the limit of success.
SIDEWAYS_DOUBTFUL = 2.5
# Least ratio of the range to the sigma of a state. In 60 open random recordings right joints have 41 to 2100
# in 45, and 25 in one whose states ran on unseen; wrong or missing ones 0 to 41 in 10, and 48 to 330 in 8
# with other reasons. Below, an axis above `AXIS_HALF_SURE` refuses.
RANGE_DOUBTFUL = 40.0
# Below this ratio the part may be at rest.
RANGE_REFUSED = 10.0
# rad of range, whatever its error. Rattling and drifting corners go as far, a cupboard farther. Chosen by us.
TURN_DOUBTFUL = np.radians(6.0)
TURN_REFUSED = np.radians(3.0)
# m of range, likewise.
SLIDE_DOUBTFUL = 0.02
SLIDE_REFUSED = 0.01
# Shares by which the ends of the travel differ. Right: .35 and more in 24; wrong: 0 in one.
CLOSED_END = 0.25
# m by which frames disagree on the room. Right (ATE up to 6 mm): 2 to 12; wrong (27 to 134): 58 to 587.
CAMERAS_DOUBTFUL = 0.02
CAMERAS_REFUSED = 0.05
# m that the path may be aside by one sigma, half of the limit of success. Labels that cut an outline put the
# path of open hinges off by up to four sigmas. One of 56 right and trusted parts has more.
PIVOT_DOUBTFUL = 0.01
# m. A hinge with this sigma is no hinge of this part.
PIVOT_REFUSED = 0.1
# Least ratio of the part's travel to the apparent motion of resting tracks between the rests around.
DRIFT_DOUBTFUL = 5.0
DRIFT_REFUSED = 2.0
# Greatest share of the frames in which the part moves: a recording needs rest before and after.
RESTLESS = 0.9
# rad by which the state may change at rest. Right: up to 1 deg in 30; wrong: 5 deg. Chosen by us.
CREEP_TURN = np.radians(2.5)
# m, likewise. Right: up to 4 mm; wrong: 29 mm in one whose states ran on unseen.
CREEP_SLIDE = 0.01
# m^2. Less than the palm that opens a part.
SMALL = 0.005
# Greatest share of the picture at rest with another depth than the twin's. Right: 0 in eleven, .0003 with
# time of flight; 0 in four with a right joint and a sensor fault; .007 and .010 at the ends of one with a
# missed part.
UNEXPLAINED = 0.002
UNEXPLAINED_REFUSED = 0.05
# Least share of the area that moves across itself. Sliding panels have .02 to .1, doors and drawers above .6.
# Chosen by us, as the two below.
ACROSS = 0.25
# Least sine of the way to the surface for motion across.
ACROSS_SINE = 0.25
# Share of the range on either side of its middle for that way.
AJAR = 0.05
# Greatest share of a frame's picture. Right: 0 in 27, .0005 in one; .0036 if a missed part leaves the view.
STATIC_THROUGH = 0.001
# Label images. Each of two may show the moment at which another part moved.
FEWEST_LABELS = 3


def _graded(bad: bool, worse: bool) -> Level | None:
    return "refused" if worse else "doubtful" if bad else None


def uncertainty(e: PartEvidence) -> Reason | None:
    """Whether the joint says how well it is known."""
    return reason("NoUncertainty", "refused") if e.part.joint.sigma is None else None


def axis(e: PartEvidence) -> Reason | None:
    """The axis against its own sigma."""
    if e.part.joint.sigma is None:
        return None
    sigma = float(np.rad2deg(e.part.joint.sigma.axis))
    both = sigma > AXIS_HALF_SURE and _short(e) and not surely_moved(e)
    level = _graded(sigma > AXIS_DOUBTFUL, sigma > AXIS_REFUSED or both)
    if level is not None:
        return reason("AxisUnsure", level, sigma, AXIS_HALF_SURE if both else AXIS_DOUBTFUL)
    sideways = _sideways(e)
    return (
        reason("AxisUnsure", "doubtful", sideways, SIDEWAYS_DOUBTFUL)
        if sideways > SIDEWAYS_DOUBTFUL
        else None
    )


def _sideways(e: PartEvidence) -> float:
    """Degrees by which a slide that only borders in depth show may lean aside; 0 for all others."""
    joint = e.part.joint
    if joint.kind == "revolute" or e.tracks.type_source != "depth" or square_to_front(joint, e.mesh):
        return 0.0
    return float(np.rad2deg(np.arctan2(BORDERS_M, joint.upper - joint.lower)))


def pivot(e: PartEvidence) -> Reason | None:
    """How far the sigma of the pivot takes the part's path aside: by the chord of its range."""
    joint = e.part.joint
    sigma = None if joint.sigma is None else joint.sigma.pivot
    if sigma is None:
        return None
    aside = min(2.0 * float(np.sin(0.5 * min(joint.upper - joint.lower, np.pi))), 1.0)
    level = _graded(aside * sigma > PIVOT_DOUBTFUL, sigma > PIVOT_REFUSED)
    return (
        None
        if level is None
        else reason("PivotUnsure", level, float(sigma), PIVOT_DOUBTFUL / max(aside, 0.1))
    )


def travelled(e: PartEvidence) -> Reason | None:
    """The range against the sigma of a state."""
    joint = e.part.joint
    if joint.sigma is None:
        return None
    span, sigma = joint.upper - joint.lower, joint.sigma.state
    level = _graded(_short(e), span < RANGE_REFUSED * sigma and not surely_moved(e))
    if level is None:
        return None
    scale, unit = (float(np.rad2deg(1.0)), "°") if joint.kind == "revolute" else (1000.0, "mm")
    return reason("RangeUnsure", level, scale * span, scale * sigma, unit, RANGE_DOUBTFUL)


def far_enough(e: PartEvidence) -> Reason | None:
    """The range for itself."""
    joint = e.part.joint
    span = joint.upper - joint.lower
    if joint.kind == "revolute":
        level = _graded(span < TURN_DOUBTFUL, span < TURN_REFUSED)
        numbers = float(np.rad2deg(span)), "°", float(np.rad2deg(TURN_DOUBTFUL))
    else:
        level = _graded(span < SLIDE_DOUBTFUL, span < SLIDE_REFUSED)
        numbers = 1000 * span, "mm", 1000 * SLIDE_DOUBTFUL
    return None if level is None else reason("TooShort", level, *numbers)


def closed_end(e: PartEvidence) -> Reason | None:
    """Whether the surroundings decide which end of the travel is the closed one."""
    if e.closed_margin is None or e.closed_margin >= CLOSED_END:
        return None
    return reason("ClosedEndUnsure", "doubtful", e.closed_margin, CLOSED_END)


def cameras(e: PartEvidence) -> Reason | None:
    """The cameras' path: a reason against each part."""
    frame, other, off = e.scene.camera_drift
    level = _graded(off > CAMERAS_DOUBTFUL, off > CAMERAS_REFUSED)
    return None if level is None else reason("CamerasDrift", level, frame, other, off, CAMERAS_DOUBTFUL)


def _short(e: PartEvidence) -> bool:
    """Whether the range is not many times its sigma."""
    joint = e.part.joint
    return joint.sigma is not None and joint.upper - joint.lower < RANGE_DOUBTFUL * joint.sigma.state


def rests(e: PartEvidence) -> Reason | None:
    """How much of the time the part moves: a part that never rests drifts."""
    share = len(moving_rows(e.part)) / max(len(e.part.motion.frames), 1)
    return None if share <= RESTLESS else reason("NeverRests", "doubtful", share, RESTLESS)


def rests_still(e: PartEvidence) -> Reason | None:
    """By how much the state changes in the frames in which the part rests."""
    joint, motion = e.part.joint, e.part.motion
    creep = max((float(np.ptp(np.quantile(s, [0.05, 0.95]))) for s in _at_rest(motion)), default=0.0)
    if creep <= (CREEP_TURN if joint.kind == "revolute" else CREEP_SLIDE):
        return None
    if joint.kind == "revolute":
        return reason(
            "CreepsAtRest", "doubtful", float(np.rad2deg(creep)), "°", float(np.rad2deg(CREEP_TURN))
        )
    return reason("CreepsAtRest", "doubtful", 1000 * creep, "mm", 1000 * CREEP_SLIDE)


def _at_rest(motion: Motion) -> list[Array]:
    """States of each stretch of frames between the intervals of motion, without two frames beside these."""
    moving = np.zeros(len(motion.frames), dtype=bool)
    for first, last in motion.intervals:
        moving |= (motion.frames >= first - 2) & (motion.frames <= last + 2)
    stretch = np.cumsum(np.diff(moving, prepend=moving[:1]))
    out = [motion.state[~moving & (stretch == k)] for k in np.unique(stretch[~moving])]
    return [s for s in out if len(s) >= 3]


def drift(e: PartEvidence) -> Reason | None:
    """The part's travel against the drift of the static scene; None if too few tracks see both rests."""
    drifted = track_drift(e.part.motion, e.scene.found.movers)
    if drifted is None or e.mesh is None or not len(e.mesh.vertices):
        return None
    joint = e.part.joint
    ends = (geo.transform(joint.pose(s), e.mesh.vertices) for s in (joint.lower, joint.upper))
    travel = float(np.median(np.linalg.norm(np.subtract(*ends), axis=1)))
    level = _graded(travel < DRIFT_DOUBTFUL * drifted, travel < DRIFT_REFUSED * drifted)
    return None if level is None else reason("WithinDrift", level, travel, drifted, DRIFT_DOUBTFUL)


def surface(e: PartEvidence) -> Reason | None:
    """The part's mesh."""
    if e.mesh is None or not len(e.mesh.faces):
        return reason("NoSurface", "refused")
    return reason("SmallSurface", "doubtful", e.mesh.area, SMALL) if e.mesh.area < SMALL else None


def across_itself(e: PartEvidence) -> Reason | None:
    """How much of the surface moves across itself; None if the joint is by tracks."""
    if e.tracks.type_source != "depth" or e.mesh is None or not len(e.mesh.faces):
        return None
    joint = e.part.joint
    closed, ajar = (
        geo.transform(joint.pose(joint.lower + share * (joint.upper - joint.lower)), e.mesh.vertices)
        for share in (0.5 - AJAR, 0.5 + AJAR)
    )
    normals, area = geo.triangle_normals(closed[e.mesh.faces])
    way = (ajar - closed)[e.mesh.faces].mean(axis=1)
    sine = np.abs(np.sum(normals * way, axis=1)) / np.maximum(np.linalg.norm(way, axis=1), 1e-12)
    share = float(area[sine > ACROSS_SINE].sum() / max(float(area.sum()), 1e-12))
    return None if share >= ACROSS else reason("AlongItself", "doubtful", share, ACROSS)


def labelled(e: PartEvidence) -> Reason | None:
    """How many label images show the part."""
    frames = sum(bool((image == e.part.id).any()) for image in e.scene.labels.values())
    if frames >= FEWEST_LABELS:
        return None
    return reason(
        "FewLabels", "doubtful" if frames else "refused", frames, len(e.scene.labels), FEWEST_LABELS
    )


def explained(e: PartEvidence) -> Reason | None:
    """The twin against the frames at rest: any of the parts may be the wrong one."""
    frame, share = e.scene.unexplained
    level = _graded(share > UNEXPLAINED, share > UNEXPLAINED_REFUSED)
    return None if level is None else reason("Unexplained", level, frame, share, UNEXPLAINED)


def static_stays(e: PartEvidence) -> Reason | None:
    """The static scene against all frames: surface that left may belong to any part or to another one."""
    frame, share = e.scene.static_seen_through
    return (
        None
        if share <= STATIC_THROUGH
        else reason("StaticSeenThrough", "doubtful", frame, share, STATIC_THROUGH)
    )


OF_PARTS = (
    uncertainty, axis, pivot, travelled, far_enough, closed_end, cameras, drift, rests, rests_still, surface, across_itself, seen_to_move, contradicted, labelled, labelled_at_ends, ends_at_edges, hand_is_one, hand_moves_something, explained, static_stays,
    seen_through, motion_explained, motion_seen, same_in_halves, as_its_tracks,
)  # fmt: skip

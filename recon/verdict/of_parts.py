"""Evidence against a part: each function looks at one number and returns a doubt, or None.

The limits are what right parts keep to, chosen by us on open recordings that we looked at; what a number
beyond one is worth is calibrated (`recon.verdict.posterior`).
"""

from __future__ import annotations

import numpy as np

from recon.verdict.doubt import SURELY, Doubt, above, below
from recon.verdict.evidence import PartEvidence
from recon.verdict.in_motion import moving_rows
from recon.verdict.of_video import (
    contradicted,
    ends_at_edges,
    hand_is_one,
    hand_moves_something,
    labelled_at_ends,
    motion_explained,
    motion_seen,
    seen_through,
    seen_to_move,
)
from twin.geometry import Array
from twin.scene import Motion
from twin.verdict import reason

# deg, a quarter of the limit of success, as the sigma leaves out the drift of tracks.
AXIS = 1.25
# Least ratio of the range to the sigma of a state. Right joints of 60 recordings have 41 to 2100 in 45.
RANGE = 40.0
# rad and m of range, whatever its error. Rattling and drifting corners go as far, a cupboard farther.
TURN, SLIDE = np.radians(6.0), 0.02
# Probability of the closed end by all its cues. Of 36 parts of new open recordings (looked at) 31 of 33 with
# the right end have more, and three with the wrong one .42, .53 and .91.
CLOSED = 0.95
# m by which frames disagree on the room. Right (ATE up to 6 mm): 2 to 12; wrong (27 to 134): 58 to 587.
CAMERAS, CAMERAS_LOST = 0.02, 0.05
# m that the path may be aside by one sigma, half of the limit of success.
PIVOT = 0.01
# Greatest share of the frames in which the part moves: a recording needs rest before and after.
RESTLESS = 0.9
# rad and m by which the state may change at rest. Right: up to 1 deg in 30, 4 mm; wrong: 5 deg, 29 mm.
CREEP_TURN, CREEP_SLIDE = np.radians(2.5), 0.01
# m^2. Less than the palm that opens a part.
SMALL = 0.005
# Greatest share of the picture at rest with another depth than the twin's. Right: 0 in eleven.
UNEXPLAINED = 0.002
# Greatest share of a frame's picture. Right: 0 in 27, .0005 in one; .0036 if a missed part leaves the view.
STATIC_THROUGH = 0.001
# Label images. Each of two may show the moment at which another part moved.
FEWEST_LABELS = 3


def uncertainty(e: PartEvidence) -> Doubt | None:
    """Whether the joint says how well it is known."""
    return Doubt(reason("NoUncertainty", "refused"), SURELY) if e.part.joint.sigma is None else None


def axis(e: PartEvidence) -> Doubt | None:
    """The sigma of the axis."""
    if e.part.joint.sigma is None:
        return None
    return above("AxisUnsure", float(np.rad2deg(e.part.joint.sigma.axis)), AXIS)


def pivot(e: PartEvidence) -> Doubt | None:
    """How far the sigma of the pivot takes the part's path aside: by the chord of its range."""
    joint = e.part.joint
    sigma = None if joint.sigma is None else joint.sigma.pivot
    if sigma is None:
        return None
    aside = max(min(2.0 * float(np.sin(0.5 * min(joint.upper - joint.lower, np.pi))), 1.0), 0.1)
    return above("PivotUnsure", float(sigma), PIVOT / aside)


def travelled(e: PartEvidence) -> Doubt | None:
    """The range against the sigma of a state."""
    joint = e.part.joint
    if joint.sigma is None:
        return None
    span, sigma = joint.upper - joint.lower, joint.sigma.state
    scale, unit = (float(np.rad2deg(1.0)), "°") if joint.kind == "revolute" else (1000.0, "mm")
    return below("RangeUnsure", span / max(sigma, 1e-12), RANGE, scale * span, scale * sigma, unit)


def far_enough(e: PartEvidence) -> Doubt | None:
    """The range for itself."""
    joint = e.part.joint
    span = joint.upper - joint.lower
    if joint.kind == "revolute":
        return below(
            "TooShort", float(np.rad2deg(span)), float(np.rad2deg(TURN)), float(np.rad2deg(span)), "°"
        )
    return below("TooShort", 1000 * span, 1000 * SLIDE, 1000 * span, "mm")


def closed_end(e: PartEvidence) -> Doubt | None:
    """How sure all cues together are of which end of the travel is the closed one; None without a surface."""
    if e.closed_probability is None or e.closed_probability >= CLOSED:
        return None
    times = (1.0 - e.closed_probability) / (1.0 - CLOSED)
    return Doubt(reason("ClosedEndUnsure", "doubtful", e.closed_probability, CLOSED), times)


def cameras(e: PartEvidence) -> Doubt | None:
    """The cameras' path: a doubt about each part."""
    frame, other, off = e.scene.camera_drift
    if off > CAMERAS_LOST:
        return Doubt(reason("CamerasDrift", "refused", frame, other, off, CAMERAS), SURELY)
    return above("CamerasDrift", off, CAMERAS, frame, other, off)


def rests(e: PartEvidence) -> Doubt | None:
    """How much of the time the part moves: a part that never rests drifts."""
    return above("NeverRests", len(moving_rows(e.part)) / max(len(e.part.motion.frames), 1), RESTLESS)


def rests_still(e: PartEvidence) -> Doubt | None:
    """By how much the state changes in the frames in which the part rests."""
    turns = e.part.joint.kind == "revolute"
    creep = max((float(np.ptp(np.quantile(s, [0.05, 0.95]))) for s in _at_rest(e.part.motion)), default=0.0)
    scale, unit, limit = (float(np.rad2deg(1.0)), "°", CREEP_TURN) if turns else (1000.0, "mm", CREEP_SLIDE)
    return above("CreepsAtRest", scale * creep, float(scale * limit), scale * creep, unit)


def _at_rest(motion: Motion) -> list[Array]:
    """States of each stretch of frames between the intervals of motion, without two frames beside these."""
    moving = np.zeros(len(motion.frames), dtype=bool)
    for first, last in motion.intervals:
        moving |= (motion.frames >= first - 2) & (motion.frames <= last + 2)
    stretch = np.cumsum(np.diff(moving, prepend=moving[:1]))
    out = [motion.state[~moving & (stretch == k)] for k in np.unique(stretch[~moving])]
    return [s for s in out if len(s) >= 3]


def surface(e: PartEvidence) -> Doubt | None:
    """The part's mesh."""
    if e.mesh is None or not len(e.mesh.faces):
        return Doubt(reason("NoSurface", "refused"), SURELY)
    return below("SmallSurface", e.mesh.area, SMALL)


def labelled(e: PartEvidence) -> Doubt | None:
    """How many label images show the part."""
    frames = sum(bool((image == e.part.id).any()) for image in e.scene.labels.values())
    told = frames, len(e.scene.labels), FEWEST_LABELS
    if not frames:
        return Doubt(reason("FewLabels", "refused", *told), SURELY)
    return (
        Doubt(reason("FewLabels", "doubtful", *told), FEWEST_LABELS / frames)
        if frames < FEWEST_LABELS
        else None
    )


def explained(e: PartEvidence) -> Doubt | None:
    """The twin against the frames at rest: any of the parts may be the wrong one."""
    frame, share = e.scene.unexplained
    return above("Unexplained", share, UNEXPLAINED, frame, share)


def static_stays(e: PartEvidence) -> Doubt | None:
    """The static scene against all frames: surface that left may belong to any part or to another one."""
    frame, share = e.scene.static_seen_through
    return above("StaticSeenThrough", share, STATIC_THROUGH, frame, share)


OF_PARTS = (
    uncertainty, axis, pivot, travelled, far_enough, closed_end, cameras, rests, rests_still, surface, seen_to_move, contradicted, labelled, labelled_at_ends, ends_at_edges, hand_is_one, hand_moves_something, explained, static_stays,
    seen_through, motion_explained, motion_seen,
)  # fmt: skip

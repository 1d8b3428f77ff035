"""Evidence against a part: each function looks at one number and returns a doubt, or None.

The limits are what right parts keep to, chosen by us on open recordings that we looked at; what a number
beyond one is worth is calibrated (`recon.verdict.posterior`).
"""

from __future__ import annotations

import numpy as np

from recon.verdict.doubt import SURELY, Doubt, above, below
from recon.verdict.evidence import PartEvidence
from twin.verdict import reason

# deg, a quarter of the limit of success, as the sigma leaves out the drift of tracks.
AXIS = 1.25
# m that the path may be aside by one sigma of the hinge: the limit of success.
PIVOT = 0.02
# Least ratio of the range to the sigma of a state. Right parts of open recordings (looked at) have 30 to 2100
# in 129 of 130; wrong ones less in twelve.
RANGE = 30.0
# rad and m: no state is known better. Rattling and drifting corners go 30 times as far, a cupboard farther.
LEAST_TURN, LEAST_SLIDE = np.radians(0.2), 0.02 / RANGE
# Probability of the closed end by all its cues. Of 36 parts of new open recordings (looked at) 31 of 33 with
# the right end have more, and three with the wrong one .42, .53 and .91.
CLOSED = 0.95
# Least share of the rim beside which static surface stands at one end. Right parts of open recordings (looked
# at) have .26 and more in 33 of 33; people who walk into the picture 0, 0 and .19.
ADJOINED = 0.25
# m by which frames disagree on the room. Right (ATE up to 6 mm): 2 to 12 mm; wrong (27 to 134): 58 to 587.
CAMERAS, CAMERAS_LOST = 0.02, 0.05
# Greatest share of the picture at rest with another depth than the twin's. Right: 0 in eleven.
UNEXPLAINED = 0.002
# Greatest share of a frame's picture. Right: 0 in 27, .0005 in one; .0036 if a missed part leaves the view.
STATIC_THROUGH = 0.001
# Greatest ratio of pixels seen through to the part's own. Right: 0 in all, .0009 with stereo depth. Wrong:
# .006, .013 and .20 in three, less in the others, whose part hardly shows.
THROUGH = 0.005
# Least share of the part's area that was seen to move. Right: .47 to .96 in 30. Wrong: 0 to .28 in 21.
MOVED = 0.3
# Least share of the area that goes far enough to be judged.
TOLD = 0.3
# m^2. Less than the palm that opens a part.
SMALL = 0.005
# Greatest share of the border without an edge, at the rest that shows more of them. Right: .17 and less in 80
# of 82 on open recordings (looked at), .21 and .23 else. Wrong: .20 to .61 in seven.
BARE = 0.2


def uncertainty(e: PartEvidence) -> Doubt | None:
    """Whether the joint says how well it is known."""
    return Doubt(reason("NoUncertainty", "refused"), SURELY) if e.part.joint.sigma is None else None


def surface(e: PartEvidence) -> Doubt | None:
    """Whether the part has a mesh, and labels that show it."""
    return None if e.has_surface else Doubt(reason("NoSurface", "refused"), SURELY)


def cameras(e: PartEvidence) -> Doubt | None:
    """The cameras' path."""
    frame, other, off = e.scene.camera_drift
    if off > CAMERAS_LOST:
        return Doubt(reason("CamerasDrift", "refused", frame, other, off, CAMERAS), SURELY)
    return above("CamerasDrift", off, CAMERAS, frame, other, off)


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
    turns = joint.kind == "revolute"
    scale, unit = (float(np.rad2deg(1.0)), "°") if turns else (1000.0, "mm")
    span, sigma = joint.upper - joint.lower, max(joint.sigma.state, LEAST_TURN if turns else LEAST_SLIDE)
    return below("RangeUnsure", span / sigma, RANGE, scale * span, scale * sigma, unit)


def closed_end(e: PartEvidence) -> Doubt | None:
    """How sure all cues together are of which end of the travel is the closed one; None without a surface."""
    if e.closed is None or e.closed.probability >= CLOSED:
        return None
    times = (1.0 - e.closed.probability) / (1.0 - CLOSED)
    return Doubt(reason("ClosedEndUnsure", "doubtful", e.closed.probability, CLOSED), times)


def adjoined(e: PartEvidence) -> Doubt | None:
    """Whether furniture stands beside it where it is closed; None without a surface."""
    return None if e.closed is None else below("StandsFree", e.closed.adjoined, ADJOINED)


def seen_to_move(e: PartEvidence) -> Doubt | None:
    """How much surface is seen at two places, one of them empty in between; None if it hardly moves."""
    p = e.places
    return None if p is None or p.far < TOLD else below("SurfaceUnseen", p.witnessed, MOVED)


def large_enough(e: PartEvidence) -> Doubt | None:
    """How much surface there is; None without any."""
    return below("SmallSurface", e.mesh.area, SMALL) if e.mesh is not None and e.has_surface else None


def explained(e: PartEvidence) -> Doubt | None:
    """The twin against the frames at rest: any of the parts may be the wrong one."""
    frame, share = e.scene.unexplained
    return above("Unexplained", share, UNEXPLAINED, frame, share)


def static_stays(e: PartEvidence) -> Doubt | None:
    """The static scene against all frames: surface that left may belong to any part or to another one."""
    frame, share = e.scene.static_seen_through
    return above("StaticSeenThrough", share, STATIC_THROUGH, frame, share)


def seen_through(e: PartEvidence) -> Doubt | None:
    """Where the moving twin is nearer than the reading; no hand adds depth."""
    if e.seen_through is None:
        return None
    frame, share = e.seen_through
    return above("SeenThrough", share, THROUGH, frame, share)


def ends_at_edges(e: PartEvidence) -> Doubt | None:
    """Whether the picture shows an edge where the part's labels end."""
    if e.bare_border is None:
        return None
    frame, share = e.bare_border
    return above("BareBorder", share, BARE, frame, share)


OF_PARTS = (
    uncertainty, surface, cameras, axis, pivot, travelled, closed_end, adjoined, seen_to_move, large_enough, explained,
    static_stays, seen_through, ends_at_edges,
)  # fmt: skip

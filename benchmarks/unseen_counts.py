"""Counters of one reconstruction against its truth: what became of each part, how exact it is, whether its
sigmas hold.

Rates and medians of many recordings follow from sums of these: a median is below a limit where half of the
parts are.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from recon.evaluation.outcome import Outcome, outcome
from recon.evaluation.scores import camera_errors, contact_mm, joint_errors, label_scores, match_parts
from recon.evaluation.truth import Truth, TruthPart
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import HAND_LABEL, Part, Revolute, Twin

# Limits under which errors of parts are counted: deg, mm, and for states deg or mm
AXIS_DEG, PIVOT_MM, STATE_DEG, STATE_MM = (0.3, 0.7), (3.0, 6.0), (0.3, 0.5), (2.0, 3.0)
CONTACT_MM = 20.0, 60.0  # of right parts that a hand held
HAND_MOST = 0.03  # share of a hand-free frame, mean of a recording
PPM = 1e-6
_WORDS = "fine", "good"


def counts(twin: Twin, truth: Truth) -> Counter[str]:
    """All counters but those of the exit code."""
    found = outcome(twin, truth)
    out = _of_outcome(found)
    hand = label_scores(twin.labels, truth, {}).get(HAND_LABEL)
    if hand is not None and hand.other_frames:
        out["hand-free"] = 1
        out["hand, ppm"] = round(hand.false_share / PPM)
        out["hand above 3 %"] = int(hand.false_share > HAND_MOST)
    if twin.cameras is None:
        return out
    T = camera_errors(twin.cameras, truth).T_truth_recon
    pairs = match_parts([(p.joint, p.motion) for p in twin.parts], T, truth)
    for i, true in enumerate(truth.parts):
        out["hinges"] += true.joint.kind == "revolute"
        if i in pairs:
            out += _exactness(twin.parts[pairs[i]], true, truth, T)
            if found.parts[i].cause is None:
                out += coverage(twin.parts[pairs[i]], true, T)
                out += _contact(twin.parts[pairs[i]], true, T)
    return out


def _of_outcome(found: Outcome) -> Counter[str]:
    out = Counter[str]()
    for part in found.parts:
        out["success" if part.cause is None else f"cause {part.cause}"] += 1
        out["trusted"] += part.trusted
        out["trusted success"] += part.trusted and part.cause is None
        if part.trusted and part.cause is not None:
            of = "" if part.aside is None else f" of {part.aside}"
            out[f"wrong but trusted {part.cause}{of}"] += 1
        if part.aside is not None:
            out[f"aside {part.aside}"] += 1
        if part.cause is None:
            out.update(f"doubt {name}" for name in part.doubts)
    if any(part.cause == "missed" for part in found.parts):
        out["missed where a part was refused"] = int(bool(found.refused))
        out.update(f"refused {name}" for name in found.refused)
    out["invented"] = len(found.invented)
    out["invented trusted"] = sum(found.invented)
    out["trusted"] += sum(found.invented)
    out["doubtful"] = found.doubtful
    out["up wrong"] = int(not found.up_right)
    out["up wrong, told"] = int(not found.up_right and found.up_doubted)
    out["failed clips"] = int(bool(found.invented) or any(p.cause is not None for p in found.parts))
    return out


def _exactness(part: Part, true: TruthPart, truth: Truth, T: Array) -> Counter[str]:
    """Whether each error is within its limits; one that has no value is not."""
    errors = joint_errors(part.joint, part.motion, T, truth, true)
    state = STATE_DEG if true.joint.kind == "revolute" else STATE_MM
    out = Counter[str]()
    for name, value, limits in (
        ("axis", errors.axis_deg, AXIS_DEG),
        ("pivot", errors.pivot_line_mm, PIVOT_MM),
        ("state", errors.state, state),
    ):
        for limit, word in zip(limits, _WORDS, strict=True):
            out[f"{name} {word}"] += value is not None and value <= limit
    return out


def _contact(part: Part, true: TruthPart, T: Array) -> Counter[str]:
    """Whether the contact of a part that a hand held is within each limit; a missing one is not."""
    if true.grip is None:
        return Counter()
    off = contact_mm(part, true, T)
    within = {word: off is not None and off <= limit for limit, word in zip(CONTACT_MM, _WORDS, strict=True)}
    return Counter({"contacts": 1, **{f"contact {word}": int(held) for word, held in within.items()}})


def coverage(part: Part, true: TruthPart, T: Array) -> Counter[str]:
    """Components of the axis' tilt and of the hinge's shift within one and two stated sigmas, and of how
    many; states as one mean share of frames, in ppm."""
    joint, sigma = part.joint.transformed(T), part.joint.sigma
    if sigma is None:
        return Counter()
    right = true.joint.axis if joint.axis @ true.joint.axis > 0 else -true.joint.axis
    across = geo.orthogonal_basis(right)[:, :2].T
    off = {"axis": (across @ joint.axis, sigma.axis)}
    if isinstance(joint, Revolute) and isinstance(true.joint, Revolute) and sigma.pivot is not None:
        near = geo.nearest_point_on_line(joint.pivot, true.joint.pivot, right)
        off["pivot"] = (across @ (joint.pivot - near), sigma.pivot)
    out = Counter[str]()
    for name, (error, scale) in off.items():
        out[f"{name} components"] = len(error)
        for k in (1, 2):
            out[f"{name} within {k} sigma"] = int(np.sum(np.abs(error) <= k * scale))
    found, states = part.motion.state, true.states[part.motion.frames]
    sign = 1.0 if np.dot(states - states.mean(), found - found.mean()) >= 0 else -1.0
    error = found - sign * states
    error = error - np.median(error)  # each is counted from its own zero
    out["states"] = 1
    for k in (1, 2):
        out[f"states within {k} sigma, ppm"] = round(float(np.mean(np.abs(error) <= k * sigma.state)) / PPM)
    return out

"""What the numbers of single frames say: clock, copies, cuts, blur, exposure, missing depth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from recon.inspection.cuts import Shown, cuts, largest_change, thumbnail
from recon.inspection.finding import Unknown
from recon.inspection.findings import finding
from recon.inspection.glance import Stretch
from recon.inspection.pictures import DIRECTIONS
from recon.recording import Recording
from twin.cause import Cause
from twin.geometry import Array
from twin.robust import mad_sigma

Found = list[Cause | Unknown]

# standard deviations of a clock's own jitter that a step exceeds or falls below by chance in no recording
_JITTER = 5.0
_LONG = 1.5  # usual steps: more than half a frame over, so that one is missing
# 1/s; a door that takes a second turns 9 degrees from frame to frame, and is then lost edge-on
_LEAST_FPS = 10.0
_LEAST_SIDE = 240  # px of the shorter side; below it a handle a metre away is a few pixels wide
# px of 640: an even smear over 3.5 px. Sharp pictures, of six real cameras too, measure 0.2 to 0.8
_BLUR = 1.0
_BLURRED = 0.1  # share of frames; tracks bridge single ones
_MOTION = 1.5  # blur along the motion over blur across it; a lens blurs alike in all directions
_WHITE = 0.1  # share of the picture: what is white has no corners, and a tenth is the size of a part
_BLACK = 0.4  # share of the picture; a dark corner or fronts may be black, but not near half of all
# shares of the whole picture (registered depth leaves borders bare) and of its centre, where the part is
_NO_DEPTH = 0.35, 0.25
# m: nothing within it, and so nothing within an arm's length (0.8 m) of a head or chest that wears the camera
_REACH = 2.0
_NEAR = 0.3  # m: where depth cameras begin


def clock(times: Array) -> Found:
    """times (N,) s, strictly increasing."""
    step = np.diff(times)
    usual = float(np.median(step))
    jitter = mad_sigma(step - usual)
    found: Found = []
    long = np.flatnonzero(step > _LONG * usual + _JITTER * jitter)
    if len(long):
        k = int(long[np.argmax(step[long])])
        found.append(finding("ClockGap", k, float(step[k]), usual, len(long)))
    short = np.flatnonzero(step < 0.5 * usual - _JITTER * jitter)
    if len(short):
        k = int(short[0])
        found.append(finding("ClockDoubled", k, float(step[k]), usual, len(short)))
    if 1.0 / usual < _LEAST_FPS:
        found.append(finding("TooSlow", 1.0 / usual))
    return found


def size(recording: Recording) -> Found:
    """The pictures' size."""
    k = recording.intrinsics
    return [finding("Small", k.width, k.height)] if min(k.width, k.height) < _LEAST_SIDE else []


def copies(stretches: list[Stretch]) -> Found:
    """Frames that repeat the one before them."""
    same = [
        int(s.frames[k])
        for s in stretches
        for k in range(1, len(s.facts))
        if s.facts[k].mark == s.facts[k - 1].mark
    ]
    return [finding("Stuck", len(same), same[0], sum(len(s.frames) for s in stretches))] if same else []


def cut(shown: Sequence[Shown], recording: Recording) -> Found:
    """Frames between which the video is cut, where the clock does not tell that some are missing."""
    found = [place for s in shown for place in _cuts(s, recording)]
    return [finding("Cut", found[0], len(found))] if found else []


def _cuts(shown: Shown, recording: Recording) -> list[int]:
    """Frames of the recording that are the last ones before a cut."""
    step = np.diff(recording.times[shown.frames])
    out = []
    for k in cuts(shown.thumbnails).tolist():
        if step[k] < _LONG * np.median(step):
            between = range(int(shown.frames[k]), int(shown.frames[k + 1]) + 1)
            out.append(between[largest_change([thumbnail(recording.frame(i)) for i in between])])
    return out


def blur(stretches: list[Stretch]) -> Found:
    """Blur of the frames, by the edges they show."""
    frames = np.concatenate([s.frames for s in stretches])
    sigma = np.array([f.blur for s in stretches for f in s.facts])
    told = np.isfinite(sigma).sum(axis=1) >= 2
    if told.mean() < 0.5:
        return [Unknown("blur", "most frames show too few edges")]
    frames, sigma = frames[told], sigma[told]
    most = np.nanmax(sigma, axis=1)
    share = float((most > _BLUR).mean())
    if share <= _BLURRED:
        return []
    k = int(np.argmax(most))
    least = int(np.nanargmin(sigma[k]))
    # a motion leaves edges along it sharp; those across it may be too few to be measured
    across = (least + 2) % 4
    moved = most[k] > _MOTION * sigma[k, least]
    return [finding("Blurred", share, int(frames[k]), float(most[k]), DIRECTIONS[across] if moved else "")]


def exposure(stretches: list[Stretch]) -> Found:
    """Shares of white and of black pixels."""
    white, black = (
        np.array([getattr(f, name) for s in stretches for f in s.facts]) for name in ("saturated", "black")
    )
    found: Found = []
    if np.median(white) > _WHITE:
        found.append(finding("OverExposed", float(np.median(white)), float(white.max())))
    if np.median(black) > _BLACK:
        found.append(finding("UnderExposed", float(np.median(black)), float(black.max())))
    return found


def depth(stretches: list[Stretch]) -> Found:
    """Where depth is, and how far it reaches."""
    facts = [f for s in stretches for f in s.facts]
    known, centre, near, far = (
        float(np.nanmedian([getattr(f, name) for f in facts]))
        for name in ("known", "known_centre", "near", "far")
    )
    found: Found = []
    if 1 - known > _NO_DEPTH[0] or 1 - centre > _NO_DEPTH[1]:
        found.append(finding("MissingDepth", 1 - known, 1 - centre, far))
    if near > _REACH:
        found.append(finding("OutOfReach", near))
    if far < _NEAR:
        found.append(finding("TooNear", far))
    return found

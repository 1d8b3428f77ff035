"""The words of every fault of a recording. Numbers are in s, m, px of the recording and shares."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from twin.cause import Cause, Numbers, Words
from twin.verdict import Reason, reason


def finding(type: str, *values: Any) -> Cause:
    """The fault of a type in `FINDINGS` by its numbers. Raises as `Cause.told`."""
    return Cause.told(FINDINGS, type, *values)


def doubts(found: Cause) -> bool:
    """Whether a twin that is made of such a recording may be wrong while all else speaks for it."""
    return found.type in ("Cut", "Misregistered", "NoCommonEdges") or bool(late_frames(found))


def late_frames(found: Cause) -> int:
    """By how many whole frames the fault is that depth lags."""
    return found.numbers["frames"] if found.type == "DepthDelayed" else 0


def value(found: Cause) -> str:
    """By how much, with its numbers: the text without the kind."""
    return found.text.removeprefix(f"{found.kind}: ")


def only_after(found: Cause) -> int | None:
    """The frame after which alone a fault lies; None: it lies elsewhere, too."""
    return found.numbers["frame"] if found.type == "Cut" and found.numbers["count"] == 1 else None


def as_reason(found: Cause) -> Reason:
    """The same as a reason against a twin that is made of the recording."""
    return reason("OfRecording", "doubtful", found.type, found.text, found.kind, found.help)


def _gap(n: Numbers) -> str:
    more = "; {count} gaps in all" if n["count"] > 1 else ""
    missing = round(n["step"] / n["usual"]) - 1
    return f"{{kind}}: {{step:.3f}} s after frame {{frame}}, as if {missing} frames were missing{more}"


def _cut(n: Numbers) -> str:
    more = n["count"] - 1
    also = f", and at {more} more place{'s' * (more != 1)}" if more > 0 else ""
    return f"{{kind}}: between frames {{frame}} and {n['frame'] + 1}{also}"


def _blur(n: Numbers) -> str:
    how = "motion {direction}" if n["direction"] else "out of focus"
    return f"{{kind}}: {{share:.0%}} of the frames, most of all frame {{frame}} by {{sigma:.1f}} px ({how})"


def _beside(n: Numbers) -> str:
    said = [
        f"{abs(n[name]):.1f} px too {more if n[name] > 0 else less}{where}"
        for name, more, less, where in (
            ("x", "far right", "far left", ""),
            ("y", "far down", "far up", ""),
            ("border", "wide", "narrow", " at either border"),
        )
        if n[name] is not None
    ]
    return f"{{kind}}: {', '.join(said)}"


def _lag(n: Numbers) -> str:
    frames, ms = abs(n["frames"]), f"{1000 * abs(n['lag']):.0f} ± {1000 * n['sigma']:.0f} ms"
    told = f"{frames} frame{'s' * (frames != 1)} ({ms})" if frames else f"{ms}, less than half a frame,"
    return "{kind}: depth " + (f"lags {told} behind colour" if n["lag"] > 0 else f"is {told} ahead of colour")


def _lag_help(n: Numbers) -> str:
    if n["frames"]:
        return "open it with --depth-delay {frames}, or pair pictures by the times they were taken"
    return "pair pictures by the times they were taken, or let the device synchronise them"


def _focal(n: Numbers) -> str:
    off = n["stated"] / n["fitted"] - 1
    told = f"{abs(off):.1%} too {'long' if off > 0 else 'short'}"
    return f"{{kind}}: {{stated:.0f}} px is {told}: points move rigidly at {{fitted:.0f}} px"


def _which(n: Numbers, first: str, last: str, between: str) -> str:
    """What is said of the beginning, of the end, or of both."""
    return f" {between} ".join(word for word, here in ((first, n["before"]), (last, n["after"])) if here)


FINDINGS: Mapping[str, Words] = {
    "ClockGap": Words(  # the longest of `count`
        "frame step usual count",
        "clock jumps",
        _gap,
        "record without dropped frames (faster storage, a lower resolution), or cut the recording there",
    ),
    "ClockDoubled": Words(  # the first of `count`
        "frame step usual count",
        "clock repeats itself",
        "{kind}: {count} frames, first {step:.1f ms} after frame {frame}, usually {usual:.0f ms}",
        "write the time at which each picture was taken, not saved, and leave out doubled frames",
    ),
    "TooSlow": Words(
        "fps",
        "few frames per second",
        "{kind}: {fps:.1f} per second",
        "record 15 frames per second or more, or move more slowly; give times in seconds",
    ),
    "Stuck": Words(
        "count frame of",
        "pictures stand still",
        "{kind}: {count} of {of} are copies of the one before, first frame {frame}",
        "leave out repeated frames and keep the others' times",
    ),
    "Cut": Words(  # the first of `count`
        "frame count",
        "the video is cut",
        _cut,
        "take the piece that shows the motion, with --start and --end, or record in one go",
    ),
    "Blurred": Words(  # sigma: px of a picture 640 wide; direction: "" for a lens out of focus
        "share frame sigma direction",
        "blurred",
        _blur,
        lambda n: (
            "more light or a shorter exposure (1/100 s or less), slower head and hand"
            if n["direction"]
            else "fix the focus at the distance of the part, clean the lens"
        ),
    ),
    "OverExposed": Words(  # share: of the picture, in the median frame
        "share worst",
        "over-exposed",
        "{kind}: {share:.0%} of the picture is white, {worst:.0%} in the worst frame",
        "shorten the exposure and fix it; keep lamps and windows out of view",
    ),
    "UnderExposed": Words(
        "share worst",
        "under-exposed",
        "{kind}: {share:.0%} of the picture is black, {worst:.0%} in the worst frame",
        "more light; fix the exposure on the part",
    ),
    "MissingDepth": Words(  # in the median frame; far: what 5 % of the known pixels exceed
        "whole centre far",
        "depth is missing",
        "{kind}: {whole:.0%} of the picture, {centre:.0%} of its centre; the rest reaches to {far:.1f} m",
        "come as near as the sensor allows, avoid glass, gloss and sunlight, look at surfaces less aslant",
    ),
    "OutOfReach": Words(  # near: what 5 % of the pixels are nearer
        "near",
        "too far away",
        "{kind}: nothing is nearer than {near:.1f} m",
        "check depth's unit (depth_scale in intrinsic.json; 1000 for millimetres); else come nearer",
    ),
    "TooNear": Words(  # far: what 5 % of the pixels are farther
        "far",
        "too near",
        "{kind}: nothing is farther than {far:.2f} m",
        "check depth's unit (depth_scale in intrinsic.json; 1000 for millimetres); else step back",
    ),
    "Small": Words("width height", "small pictures", "{kind}: {width}x{height}", "record 640x480 or more"),
    "Misregistered": Words(  # x, y: to the right and below are positive; border: by a wrong scale; None: not known
        "x y border",
        "depth does not lie on colour",
        _beside,
        "register depth to colour with the device's own calibration, and check depth_intrinsic.json",
    ),
    "NoCommonEdges": Words(
        "edges reach",
        "depth does not lie on colour",
        "{kind}: edges of depth ({edges} pixels) meet edges of colour nowhere within {reach:.0f} px",
        "register depth to colour; check that it is not mirrored, turned, or from another moment",
    ),
    "DepthDelayed": Words(  # ahead of colour: negative; frames: the nearest whole number of the recording's
        "frames lag sigma", "depth and colour of different times", _lag, _lag_help
    ),
    "WrongFocal": Words(  # sigma: of their ratio
        "stated fitted sigma",
        "wrong focal length",
        _focal,
        "give the intrinsics of this resolution and of colour; calibrate, and undistort the pictures",
    ),
    "NoRest": Words(  # share: the greater
        "before after seconds share",
        lambda n: f"no rest {_which(n, 'before', 'after', 'or')} the motion",
        lambda n: (
            "{kind}: {share:.1%} of the picture moves in the "
            f"{_which(n, 'first', 'last', 'and')} {{seconds:.2f}} s"
        ),
        "start recording a second before you reach out, and go on for a second after the hand has left",
    ),
    "NothingMoves": Words(
        "share",
        "nothing moves",
        "{kind}: at most {share:.2%} of the picture changes in 0.3 s",
        "open the part by hand, in view, by a few degrees or centimetres at least",
    ),
    "HandAlwaysThere": Words(  # share: of the frames
        "before after share",
        lambda n: "hand in every frame" if n["before"] and n["after"] else "hand in view",
        lambda n: f"{{kind}}: in the {_which(n, 'first', 'last', 'and')} frames, and in {{share:.0%}} of all",
        "keep the hand out of view for a few frames before and after: they show the part bare",
    ),
}

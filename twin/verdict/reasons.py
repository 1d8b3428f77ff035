"""The words of every reason, by the names under which twin.json has them: a name that was given stays.

To add one: its words here, and the function that tells it by its evidence in `recon/verdict/`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from twin.cause import Numbers, Words
from twin.verdict.reason import Level, Reason

# Of the user's words, those that help most reasons.
POINT_AT_IT = "point at the part with --at X,Y@FRAME"
CUT = "cut the recording to the opening with --interval A:B"


def reason(type: str, level: Level, *values: Any) -> Reason:
    """The reason of a type in `REASONS` by its numbers. Raises as `Cause.told`, and SceneError for another
    level."""
    return Reason.told(REASONS, type, *values, level=level)


def _labels(n: Numbers) -> str:
    if not n["frames"]:
        return "none of {labelled} labelled frames shows it"
    return "{frames} of {labelled} labelled frames show it (at least {limit})"


def _free(n: Numbers) -> str:
    things = f"{{free}} thing{'s' * (n['free'] != 1)} moved freely" if n["free"] else "nothing moved"
    return f"{{kind}}; {things}"


def _up(n: Numbers) -> str:
    if not n["other"]:
        return "{kind}: too little is seen of floors and walls, and it is taken from how the camera is held"
    return "{kind}: {taken} has odds of {odds:.1f} against {other} (at least {limit:g})"


def _up_help(n: Numbers) -> str:
    says = "--up {taken} or --up {other}" if n["other"] else "--up X,Y,Z"
    return f"say which way is up in the first picture with {says} (x right, y down, z forward)"


REASONS: Mapping[str, Words] = {
    "AxisUnsure": Words(
        "sigma_deg limit_deg",
        "its axis is unsure",
        "its axis is known to ± {sigma_deg:.2f}° only (at most {limit_deg:g}°)",
        f"open it farther and slower, with all of it in view, or {POINT_AT_IT}, or its type with --type hinge|slide",
    ),
    "PivotUnsure": Words(
        "sigma_m limit_m",
        "the place of its hinge is unsure",
        "its hinge is known to ± {sigma_m:.1f mm} only (at most {limit_m:g mm})",
        f"open it farther, with all of it in view, or say --type slide if it is none, or {POINT_AT_IT}",
    ),
    "RangeUnsure": Words(
        "range sigma unit limit",
        "its range is hardly more than its error",
        "its range of {range:.1f} {unit} is known to ± {sigma:.2f} {unit} (at least {limit:g} times that)",
        f"open it farther, or {CUT}, or {POINT_AT_IT}",
    ),
    "TooShort": Words(  # rattling and drift go as far
        "range unit limit",
        "it hardly moves",
        "it moves by {range:.1f} {unit} only (at least {limit:g} {unit})",
        f"open it farther, or {POINT_AT_IT}",
    ),
    "NoUncertainty": Words(
        "",
        "nothing says how well its joint is known",
        "{kind}",
        f"open it farther, with all of it in view, or {POINT_AT_IT}",
    ),
    "NeverRests": Words(
        "share limit",
        "it never rests",
        "it moves in {share:.0f %} of the frames (at most {limit:g %})",
        f"record a second of rest before and after the opening, or {POINT_AT_IT}",
    ),
    "ClosedEndUnsure": Words(
        "probability limit",
        "which end of its travel is the closed one is a guess",
        "its closed end has a probability of {probability:.0f %} (at least {limit:g %})",
        f"close it in the recording, with what surrounds it in view, or {CUT}",
    ),
    "CreepsAtRest": Words(
        "creep unit limit",
        "its state changes while it rests",
        "its state changes by {creep:.1f} {unit} while it rests (at most {limit:g} {unit})",
        f"keep all of it in view from rest to rest, or {CUT}",
    ),
    "CamerasDrift": Words(
        "frame other off_m limit_m",
        "the path of the camera is wrong, or something that fills the view moved unnoticed",
        "frames {frame} and {other} see the room {off_m:.0f mm} apart (at most {limit_m:g mm})",
        f"move the camera slower, from farther away, with more of the room in view, or {CUT}",
    ),
    "HandWhereNobodyIs": Words(
        "frame share limit",
        "what stands still is taken for a hand",
        "{share:.1f %} of frame {frame} is labelled hand, but stands still or lies on the twin "
        "(at most {limit:g %})",
        f"record a second of rest without the hand before and after, or {POINT_AT_IT}",
    ),
    "HandMovesNothing": Words(
        "first last",
        "a hand is in view and nothing in the twin moves",
        "a hand is in view from frame {first} to {last}, and nothing in the twin moves: what it moved may be missing",
        f"{CUT}, or {POINT_AT_IT}",
    ),
    "NoSurface": Words(
        "",
        "it has no surface",
        "{kind}",
        f"keep more of the part in view while it moves, or {POINT_AT_IT}",
    ),
    "SmallSurface": Words(
        "area_m2 limit_m2",
        "its surface is tiny",
        "its surface has {area_m2:.1f cm²} only (at least {limit_m2:g cm²})",
        f"keep more of the part in view while it moves, or {POINT_AT_IT}",
    ),
    "SurfaceUnseen": Words(
        "share untold limit",
        "hardly any of its surface was seen to move",
        "{share:.0f %} of its surface was seen to move with it, {untold:.0f %} not told (at least {limit:g %})",
        f"keep the whole part in view before, while and after it moves, or {POINT_AT_IT}",
    ),
    "SurfaceContradicted": Words(
        "share limit",
        "some of its surface is not the part's",
        "{share:.0f %} of its surface is seen not to move with it (at most {limit:g %})",
        f"{POINT_AT_IT}, or {CUT}",
    ),
    "BareBorder": Words(
        "frame share limit",
        "its border is no edge: a piece of it, or of what is beside it, is labelled wrong",
        "{share:.0f %} of its border in frame {frame} is no edge, in colour or depth (at most {limit:g %})",
        f"light it so that its gaps show, open it farther, or {POINT_AT_IT}",
    ),
    "LabelledElsewhere": Words(  # share: of the pixels that are labelled as it or should show it, those that are both
        "frame share limit",
        "it is labelled elsewhere than the twin has it",
        "in frame {frame} its labels and its place in the twin share only {share:.0f %} of their pixels "
        "(at least {limit:g %})",
        f"keep all of it in view where it is open and where it is closed, or {POINT_AT_IT}",
    ),
    "StaticSeenThrough": Words(
        "frame share limit",
        "what should never move is seen through",
        "{share:.1f %} of frame {frame} is farther than what never moves in the twin (at most {limit:g %})",
        f"open one part at a time, from rest to rest, with all of it in view, or {POINT_AT_IT}",
    ),
    "Unexplained": Words(
        "frame share limit",
        "the twin does not explain what changed",
        "{share:.1f %} of frame {frame} has another depth than the twin in its state there (at most {limit:g %})",
        f"{POINT_AT_IT}; what stands elsewhere afterwards must be a part, or stay where it was",
    ),
    "SeenThrough": Words(
        "frame share limit",
        "as it moves, it is seen through",
        "as it moves, {share:.1f %} of its pixels are seen through, most in frame {frame} (at most {limit:g %})",
        f"open it slower, with all of it in view, or {POINT_AT_IT}",
    ),
    "MotionUnexplained": Words(
        "share limit",
        "what changes as it moves does not look like the twin",
        "{share:.0f %} of what changes as it moves does not look like the twin in its state (at most {limit:g %})",
        f"open one part at a time, slowly, or {POINT_AT_IT}",
    ),
    "MotionUnseen": Words(
        "share limit",
        "its surface is hardly seen to move",
        "as it moves, {share:.1f %} of its pixels are seen to come nearer or to go farther (at least {limit:g %})",
        f"open it farther, seen from where it comes towards the camera or goes away from it, or {POINT_AT_IT}",
    ),
    "FewLabels": Words(
        "frames labelled limit",
        "hardly any labelled frame shows it",
        _labels,
        f"keep the part in view, before and after it moves too, or {POINT_AT_IT}",
    ),
    "MovesWithDoubted": Words(  # share: of the frames in which either moves
        "share limit",
        "something that is not trusted moves when it does",
        "what is not trusted moves in {share:.0f %} of the frames in which either does (at most {limit:g %})",
        f"open one part at a time, all of it in view, or {POINT_AT_IT}",
    ),
    "NothingArticulated": Words(  # free: how many things moved by no joint, a hand among them
        "free",
        "nothing articulated was found",
        _free,
        f"record a part being opened, from rest to rest, or {POINT_AT_IT}, or {CUT}",
    ),
    "UpUnsure": Words(  # taken, other: directions in the first camera's axes, as --up takes them
        "odds limit taken other", "up is unsure", _up, _up_help
    ),
    "OfPart": Words(  # of, said, sort, cure: type, text, kind and help of a reason against a part, told of its twin
        "part written of said sort cure",
        lambda n: "a part: {sort}" if n["written"] else "a refused part: {sort}",
        lambda n: "{part}: {said}" if n["written"] else "{part}, refused and not written: {said}",
        "{cure}",
    ),
    "OfRecording": Words(  # the same of a finding of the recording's inspection
        "finding said sort cure", "{sort}", "{said}", f"{{cure}}, or {CUT}"
    ),
}

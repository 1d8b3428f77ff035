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
    "NoUncertainty": Words(
        "",
        "nothing says how well its joint is known",
        "{kind}",
        f"open it farther, with all of it in view, or {POINT_AT_IT}",
    ),
    "ClosedEndUnsure": Words(
        "probability limit",
        "which end of its travel is the closed one is a guess",
        "its closed end has a probability of {probability:.0f %} (at least {limit:g %})",
        f"close it in the recording, with what surrounds it in view, or {CUT}",
    ),
    "StandsFree": Words(
        "share limit",
        "nothing stands beside it where it is closed: it may be no part of furniture",
        "beside {share:.0f %} of its border stands furniture where it is closed (at least {limit:g %})",
        f"record it closed, with what surrounds it in view, or {POINT_AT_IT}",
    ),
    "CamerasDrift": Words(
        "frame other off_m limit_m",
        "the path of the camera is wrong, or something that fills the view moved unnoticed",
        "frames {frame} and {other} see the room {off_m:.0f mm} apart (at most {limit_m:g mm})",
        f"move the camera slower, from farther away, with more of the room in view, or {CUT}",
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
        "share limit",
        "hardly any of its surface was seen to move",
        "{share:.0f %} of its surface was seen to move with it (at least {limit:g %})",
        f"keep the whole part in view before, while and after it moves, or {POINT_AT_IT}",
    ),
    "BareBorder": Words(
        "frame share limit",
        "its border is no edge: a piece of it, or of what is beside it, is labelled wrong",
        "{share:.0f %} of its border in frame {frame} is no edge, in colour or depth (at most {limit:g %})",
        f"light it so that its gaps show, open it farther, or {POINT_AT_IT}",
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

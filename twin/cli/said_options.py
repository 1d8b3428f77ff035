"""Options by which the user says what is seen in a recording; see docs/verdicts.md."""

from __future__ import annotations

import math
import re
from argparse import ArgumentParser, ArgumentTypeError
from functools import partial

# A frame's number, or its time in s
_MOMENT = r"\d+(?:\.\d+)?s|\d+"


def add_options(parser: ArgumentParser) -> None:
    """Those of `twin reconstruct` that tell the user's word on a recording."""
    add = partial(parser.add_argument, action="append", default=[])
    add(
        "--at",
        type=_pixel,
        metavar="X,Y@FRAME",
        help="a pixel that shows a moving part, in a frame or at 21.4s",
    )
    add(
        "--interval",
        dest="intervals",
        type=_frames,
        metavar="A:B",
        help="frames in which a part moves, or seconds as 21s:23.5s",
    )
    add("--type", dest="types", choices=("hinge", "slide"), help="type of its joint, or of all parts' joints")
    parser.add_argument(
        "--up",
        type=_up,
        metavar="AXIS|X,Y,Z",
        help="which way is up, in the first camera's axes: -y for one held level",
    )


def point(text: str) -> tuple[float, ...]:
    """Three numbers of an option; raises ArgumentTypeError for what is none."""
    try:
        point = tuple(float(word) for word in text.split(","))
    except ValueError:
        point = ()
    if len(point) != 3 or not all(map(math.isfinite, point)):
        raise ArgumentTypeError(f"{text!r} is no point: write three numbers in m, such as 0.4,-0.1,0.9")
    return point


def _pixel(text: str) -> tuple[int, int, int | float]:
    found = re.fullmatch(rf"(\d+),(\d+)@({_MOMENT})", text, re.ASCII)
    if found is None:
        raise ArgumentTypeError(
            f"{text!r} is no pixel of a frame: write X,Y@FRAME, whole numbers from 0, such as 320,240@45, or a time "
            "for the frame, such as 320,240@21.4s"
        )
    return int(found[1]), int(found[2]), _moment(found[3])


def _frames(text: str) -> tuple[int | float, int | float]:
    found = re.fullmatch(rf"({_MOMENT}):({_MOMENT})", text, re.ASCII)
    ends = None if found is None else (_moment(found[1]), _moment(found[2]))
    if ends is None or type(ends[0]) is not type(ends[1]) or ends[0] >= ends[1]:
        raise ArgumentTypeError(
            f"{text!r} is no interval: write its first and last frame, such as 30:75, or their times, such as "
            "21s:23.5s, the first before the last"
        )
    return ends


def _moment(text: str) -> int | float:
    """A frame, or a float of seconds from the first one."""
    return float(text[:-1]) if text.endswith("s") else int(text)


def _up(text: str) -> str | tuple[float, ...]:
    if re.fullmatch("[+-][xyz]", text):
        return text
    try:
        direction = point(text)
    except ArgumentTypeError:
        direction = (0.0,)
    if not any(direction):
        raise ArgumentTypeError(
            f"{text!r} is no direction: write +x, -x, +y, -y, +z, -z or three numbers, such as 0,-1,0.2"
        )
    return direction

"""Options by which the user says what is seen in a recording; see docs/verdicts.md."""

from __future__ import annotations

import math
import re
from argparse import ArgumentParser, ArgumentTypeError
from functools import partial


def add_options(parser: ArgumentParser) -> None:
    """Those of `twin reconstruct` that tell the user's word on a recording."""
    add = partial(parser.add_argument, action="append", default=[])
    add("--at", type=_pixel, metavar="X,Y@FRAME", help="a pixel that shows a moving part")
    add("--interval", dest="intervals", type=_frames, metavar="A:B", help="frames in which a part moves")
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


def _pixel(text: str) -> tuple[int, ...]:
    found = re.fullmatch(r"(\d+),(\d+)@(\d+)", text, re.ASCII)
    if found is None:
        raise ArgumentTypeError(
            f"{text!r} is no pixel of a frame: write X,Y@FRAME, whole numbers from 0, such as 320,240@45"
        )
    return tuple(map(int, found.groups()))


def _frames(text: str) -> tuple[int, ...]:
    found = re.fullmatch(r"(\d+):(\d+)", text, re.ASCII)
    if found is None or int(found[1]) >= int(found[2]):
        raise ArgumentTypeError(
            f"{text!r} is no interval: write its first and last frame, such as 30:75, the first before the last"
        )
    return tuple(map(int, found.groups()))


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

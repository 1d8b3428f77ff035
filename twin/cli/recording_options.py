"""Options by which a recording is opened; see docs/recordings.md."""

from __future__ import annotations

import math
import re
from argparse import ArgumentParser, ArgumentTypeError
from pathlib import Path


def add_options(parser: ArgumentParser) -> None:
    """Those of every verb that opens a recording, by the names that `recon.open_recording` has for them."""
    add = parser.add_argument
    add("--layout", metavar="NAME", help="layout of the recording [recognised from its files]")
    add(
        "--calibration",
        metavar="FILE",
        type=Path,
        help="cameras of the recording, from `twin calibrate` [its own]",
    )
    add("--color-topic", metavar="TOPIC", help="colour topic of a ROS bag [the only one]")
    add("--depth-topic", metavar="TOPIC", help="depth topic of a ROS bag [the only one]")
    add(
        "--depth-delay",
        type=_delay,
        metavar="N|MSms",
        help="frames by which depth lags, or a time such as 66ms [0]",
    )
    add("--start", type=_seconds, metavar="S", help="leave out what is before, s from the first frame")
    add("--end", type=_seconds, metavar="S", help="leave out what is after, s from the first frame")


def _delay(text: str) -> int | str:
    if re.fullmatch(r"[+-]?\d+", text, re.ASCII):
        return int(text)
    if re.fullmatch(r"[+-]?\d+(\.\d+)?ms", text, re.ASCII):
        return text
    raise ArgumentTypeError(
        f"{text!r} is no delay: write whole frames, such as 2, or a time, such as 66ms; negative where depth is ahead"
    )


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= 0):
        raise ArgumentTypeError(f"{text!r} is no time: write seconds from the first frame on, such as 2.5")
    return value


def annotate(parser: ArgumentParser) -> None:
    """`twin annotate`."""
    add = parser.add_argument
    add("recording", metavar="RECORDING", type=Path, help="folder or file of a recording")
    add(
        "-o", "--out", metavar="RUN", type=Path, required=True, help="run folder; the truth goes to RUN/truth"
    )
    add("--port", metavar="N", type=int, default=0, help="of the server on this machine [a free one]")
    add_options(parser)


def convert(parser: ArgumentParser) -> None:
    """`twin convert`."""
    add = parser.add_argument
    add("recording", metavar="RECORDING", type=Path, help="folder or file of a recording")
    add("-o", "--out", metavar="FOLDER", type=Path, required=True, help="new folder to write")
    add("--format", dest="into", choices=("native", "tum"), default="native", help="layout to write [native]")
    add_options(parser)


def calibrate(parser: ArgumentParser) -> None:
    """`twin calibrate`."""
    add = parser.add_argument
    add("pictures", metavar="PICTURE", type=Path, nargs="+", help="the colour camera's, of a board")
    add("--infrared", metavar="PICTURE", type=Path, nargs="+", default=[], help="the depth camera's own")
    add("--depth", metavar="PNG", type=Path, nargs="+", default=[], help="its depth, 16 bits, mm")
    add("--board", metavar="charuco|checkerboard|FILE", required=True, help="kind, or a JSON file of it")
    add("--columns", type=int, metavar="N", help="squares along a row of the board")
    add("--rows", type=int, metavar="N", help="squares along a column")
    add("--square", type=float, metavar="M", help="side of a square, m")
    add("--marker", type=float, metavar="M", help="side of a marker, m")
    add("--dictionary", metavar="NAME", help="of the markers, such as 5X5_250")
    add("--known", metavar="FILE", type=Path, help="calibration whose lenses are kept")
    add("--coefficients", type=int, choices=(5, 8), help="of the lens [what pictures left out bear]")
    add("-o", "--out", metavar="FOLDER", type=Path, required=True, help="folder for calibration.json")

"""Options of the command line's verbs; imports nothing heavy, so that it answers at once."""

from __future__ import annotations

import math
from argparse import ArgumentParser, ArgumentTypeError
from collections.abc import Callable, Sequence
from pathlib import Path

from twin.cli import batch_options, edit_options, export_options, recording_options, said_options
from twin.cli.export_options import settings
from twin.cli.said_options import point

_MAY_BEGIN_WITH_MINUS = ("--contact", "--up", "--at", "--interval", "--goal", "--from-state", "--depth-delay")


def points_joined(words: Sequence[str]) -> list[str]:
    """`--contact -0.1,0,0.6` as one word: argparse takes a value that begins with a minus for an option."""
    joined: list[str] = []
    for word in words:
        value = word[:1] == "-" and word[1:2] in set("0123456789.xyz")
        if joined and joined[-1] in _MAY_BEGIN_WITH_MINUS and value:
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def _height(text: str) -> float:
    try:
        height = float(text)
    except ValueError:
        height = math.nan
    if not math.isfinite(height):
        raise ArgumentTypeError(f"{text!r} is no height: write a number in m, such as -0.02")
    return height


def _demo(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("--recording", type=Path, help="another recording than the shipped one")
    add("-o", "--out", metavar="RUN", type=Path, default=Path("out/demo"), help="run folder [out/demo]")
    recording_options.add_options(parser)
    settings(parser)
    _robot(parser)


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise ArgumentTypeError(f"{text!r} is no seed: give a whole number from 0 on")
    return int(text)


def _lag(text: str) -> int | str:
    try:
        return text if text == "drawn" else int(text)
    except ValueError:
        raise ArgumentTypeError(f"{text!r} is no lag: give whole frames, such as 2, or drawn") from None


def _simulate(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("scene", metavar="SCENE.xml", type=Path, nargs="?", help="MJCF file with a hinge or slide joint")
    add("--joint", help="name of the joint that the hand moves")
    add("--random", metavar="SEED", type=_seed, help="no scene: all of it is drawn from a seed")
    add("--walk", metavar="SEED", type=_seed, help="a walk through a furnished room, drawn from a seed")
    add("--seconds", metavar="S", type=float, help="length of the walk, 10 to 600 [drawn, 45 to 180]")
    add(
        "--depth-lag",
        metavar="N|drawn",
        type=_lag,
        default=0,
        help="frames that depth lags behind colour [0]",
    )
    add("-o", "--out", metavar="RECORDING", type=Path, required=True, help="folder to write")
    settings(parser)


def _inspect(parser: ArgumentParser) -> None:
    _recording(parser)


def _reconstruct(parser: ArgumentParser) -> None:
    add = parser.add_argument
    _recording(parser)
    add(
        "-o",
        "--out",
        metavar="RUN",
        type=Path,
        required=True,
        help="run folder; an earlier run is resumed",
    )
    add(
        "--type-hint",
        metavar="vlm|FILE",
        help="expected joint types, which clear motion overrules: vlm sends frames to FUNTWIN_VLM_URL",
    )
    said_options.add_options(parser)
    settings(parser)


def _import(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("scene", metavar="SCENE.urdf|.xml", type=Path, help="URDF or MJCF file")
    add("-o", "--out", metavar="RUN", type=Path, required=True, help="run folder without a twin")
    add(
        "--closed",
        metavar="JOINT=lower|upper|NUMBER",
        action="append",
        default=[],
        help="where a joint is closed, m or rad [the end of the range near the rest pose, else the rest pose]",
    )
    add(
        "--limit",
        dest="limits",
        metavar="JOINT=LOW,HIGH",
        action="append",
        default=[],
        help="range of a joint, m or rad [the file's]",
    )
    add(
        "--exclude",
        metavar="BODY",
        action="append",
        default=[],
        help="body or link to leave out with all that hangs on it; * and ? allowed",
    )
    add(
        "--visual-group",
        dest="visual_groups",
        metavar="N",
        type=int,
        action="append",
        default=[],
        help="group of MJCF geoms that is seen, 0 to 5 [by the model's own groups]",
    )


def _check(parser: ArgumentParser) -> None:
    export_options.run(parser)
    export_options.formats(parser)
    parser.add_argument(
        "--engines",
        metavar="NAME",
        nargs="+",
        help="engines to ask, validators (of USD), or all [the engines that need no `twin engines`]",
    )
    settings(parser)


def _lint(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("paths", metavar="FILE|RUN", type=Path, nargs="*", help="files, or run folders with their exports")
    add("--ignore", metavar="RULE", nargs="+", default=[], help="rules to leave out")
    add("--rules", dest="show_rules", action="store_true", help="list the rules")


def _replay(parser: ArgumentParser) -> None:
    add = parser.add_argument
    export_options.run(parser)
    _robot(parser)
    add("--part", dest="parts", metavar="NAME", action="append", default=[], help="part to move [all]")
    _way(parser, "where to bring it", "where it is before")
    add("--recording", metavar="FOLDER", type=Path, help="shown beside the robot [where RUN has it from]")
    add("--contact", type=point, metavar="X,Y,Z", help="hold it there: m, twin's world, part at state 0")
    add("--floor", type=_height, metavar="Z", help="its height: m, twin's world [seen, else assumed]")
    add("--control", metavar="position|impedance", help="stiff joints or a compliant hand [impedance]")
    add("--stiffness", type=float, metavar="SHARE", help="share of the stiffness of either [1]")
    add("--trials", type=int, metavar="N", help="then N replays on parts that differ from the twin")
    add("--grid", action="store_true", help="trials also of each kind of error alone")
    add("--seed", type=int, default=0, metavar="S", help="of the trials [0]")
    settings(parser)


def _way(parser: ArgumentParser, goal: str, before: str) -> None:
    """The states between which a robot moves a part, as `robots.task.task_of` reads them."""
    add = parser.add_argument
    states = "open|close|SHARE|STATE"
    add(
        "--goal", metavar=states, default="open", help=f"{goal}: 0.5 or 50%% of its range, 15deg, 0.2m [open]"
    )
    add("--from-state", metavar=states, help=f"{before}, the same [the other end]")


def _trajectory(parser: ArgumentParser) -> None:
    add = parser.add_argument
    export_options.run(parser)
    _robot(parser)
    add("--part", metavar="NAME", help="part that it moves [all, each in a folder of its name]")
    _way(parser, "where the replay brought it", "where it was before")
    add(
        "--format",
        dest="formats",
        metavar="FORMAT",
        nargs="+",
        required=True,
        help="json npz csv ros2 moveit spot lerobot",
    )
    add("-o", "--out", metavar="FOLDER", type=Path, required=True, help="folder to write")
    add("--overwrite", action="store_true", help="also replace files there that no earlier call wrote")
    add("--accept-doubtful", action="store_true", help="also of a part that is not trusted")


def _evaluate(parser: ArgumentParser) -> None:
    export_options.run(parser)
    parser.add_argument(
        "--truth",
        metavar="FOLDER",
        type=Path,
        required=True,
        help="truth/ of a simulated or annotated recording, or an annotated HOI4D or Arti4D clip",
    )


def _config(parser: ArgumentParser) -> None:
    from twin.cli.table import SETTINGS

    add = parser.add_argument
    add("run", metavar="RUN", type=Path, nargs="?", help="show what this run was made with")
    add(
        "--of",
        dest="what",
        choices=tuple(SETTINGS),
        default="reconstruct",
        help="whose settings [reconstruct]",
    )
    settings(parser)
    add("--changed", action="store_true", help="only settings that differ from their defaults")
    add("--toml", action="store_true", help="as a file for --config, meanings as comments")


def _physics(parser: ArgumentParser) -> None:
    from twin.cli.physics_options import add_options

    add_options(parser)


def _robots(parser: ArgumentParser) -> None:
    parser.add_argument("action", choices=("list", "show", "fetch"), help="what to do")
    parser.add_argument("name", metavar="NAME", nargs="?", help="name of a robot, or a robot file")


def _engines(parser: ArgumentParser) -> None:
    parser.add_argument(
        "--install", metavar="NAME", nargs="+", default=[], help="environments to make, or all"
    )


def _completion(parser: ArgumentParser) -> None:
    parser.add_argument(
        "shell",
        choices=("bash", "zsh"),
        help="bash: source the script; zsh: save it as _twin in a folder of $fpath",
    )


def _recording(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("recording", metavar="RECORDING", type=Path, help="folder or file of a recording")
    recording_options.add_options(parser)


def _robot(parser: ArgumentParser) -> None:
    parser.add_argument("--robot", default="franka", help="name of a robot [franka]")


# verb -> adds its options, beside --json, which every verb has
OPTIONS: dict[str, Callable[[ArgumentParser], None]] = {
    "demo": _demo,
    "simulate": _simulate,
    "inspect": _inspect,
    "convert": recording_options.convert,
    "calibrate": recording_options.calibrate,
    "reconstruct": _reconstruct,
    "import": _import,
    "export": export_options.export,
    "check": _check,
    "lint": _lint,
    "replay": _replay,
    "trajectory": _trajectory,
    "evaluate": _evaluate,
    "annotate": recording_options.annotate,
    "batch": batch_options.batch,
    "config": _config,
    "view": edit_options.view,
    "edit": edit_options.add_options,
    "physics": _physics,
    "robots": _robots,
    "engines": _engines,
    "completion": _completion,
}

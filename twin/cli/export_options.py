"""Options of what is exported; imports nothing heavy."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path

FORMATS = ("urdf", "mjcf", "usd")
SHOWN = ("glb", "rrd")  # only looked at: nothing simulates them


def export(parser: ArgumentParser) -> None:
    add = parser.add_argument
    run(parser)
    formats(parser, SHOWN)
    add("--package", metavar="NAME", default="", help="make the URDF's folder the ROS package NAME")
    add(
        "--asset",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="what the files state: author, license, category, qcode (of Wikidata) or date",
    )
    add("--overwrite", action="store_true", help="also replace exported files that were changed since")
    _view(parser)
    settings(parser)


def settings(parser: ArgumentParser) -> None:
    """Settings of a verb, which `twin config --of VERB` lists."""
    add = parser.add_argument
    add("--config", metavar="FILE.toml", type=Path, help="settings; what it leaves out keeps its default")
    add("--set", metavar="KEY=VALUE", action="append", default=[], help="one setting")


def _view(parser: ArgumentParser) -> None:
    """What is shown of the twin; left out, `twin.completion.asset.usual_view` chooses."""
    add = parser.add_argument
    add(
        "--geometry",
        choices=("seen", "bounded", "complete"),
        help="what was seen; with what is inferred; with what is assumed [complete]",
    )
    add("--room", choices=("keep", "drop"), help="what is no furniture of the parts [drop]")
    add(
        "--origin",
        choices=("furniture", "camera"),
        help="on the floor under the part's front, or the twin's own world [furniture]",
    )


def run(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", type=Path, help="run folder, or a folder that holds only twin/")


def formats(parser: ArgumentParser, more: tuple[str, ...] = ()) -> None:
    """more: formats that have to be asked for."""
    told = f"; {', '.join(more)} where it is named" if more else ""
    parser.add_argument(
        "--format",
        dest="formats",
        help=f"urdf mjcf usd [all{told}]",
        nargs="+",
        choices=(*FORMATS, *more),
        default=list(FORMATS),
        metavar="FORMAT",
    )

"""Options of the verb `physics`; imports nothing heavy, so that the command line answers at once."""

from __future__ import annotations

import argparse
from pathlib import Path

from twin.units import UNITS


def add_options(parser: argparse.ArgumentParser) -> None:
    """The actions of the verb and their options."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    texts = {
        "show": "print every quantity with its interval and source",
        "set": "give weighed or known numbers",
        "catch": "give a closed part a magnet, roller or seal, from a force, a log of forces, or as other furniture has it",
        "estimate": "ask a vision-language model; sends a picture of each part to FUNTWIN_VLM_URL",
    }
    for name, text in texts.items():
        sub = actions.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        sub.add_argument(
            "run", metavar="RUN", type=Path, help="run folder, or a folder that holds only twin/"
        )
        sub.add_argument("--part", metavar="NAME", help="the part; may be left out when there is only one")
        sub.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS)
        if name == "set":
            _set_options(sub)
        if name == "catch":
            _catch_options(sub)
        if name == "estimate":
            _estimate_options(sub)


def _set_options(sub: argparse.ArgumentParser) -> None:
    for name, unit in UNITS.items():
        sub.add_argument(f"--{name}", metavar="X", type=float, help=unit)
        sub.add_argument(
            f"--{name}-interval", metavar=("LOW", "HIGH"), nargs=2, type=float, help="where it lies"
        )
    sub.add_argument("--material", metavar="NAME", help="a material of assets/materials.toml")
    _source_options(sub)


def _catch_options(sub: argparse.ArgumentParser) -> None:
    one = sub.add_mutually_exclusive_group(required=True)
    one.add_argument(
        "--hold",
        metavar="FORCE",
        help="what it holds beside friction: 24N at the handle, 7.2Nm about the hinge; without a unit N m for a hinge, N for a slide",
    )
    one.add_argument(
        "--log", metavar="FILE", type=Path, help="csv or npz with states and forces of an opening"
    )
    one.add_argument(
        "--typical", action="store_true", help="as measured on other furniture, assets/materials.toml"
    )
    one.add_argument("--none", action="store_true", help="take it away")
    sub.add_argument("--hold-interval", metavar=("LOW", "HIGH"), nargs=2, help="where the force lies")
    sub.add_argument(
        "--width",
        metavar="W",
        help="how far from closed it acts, e.g. 3deg or 8mm of the handle's way [10mm]",
    )
    sub.add_argument(
        "--lever",
        metavar="M",
        type=float,
        help="from the hinge to where the log's force was taken [the handle's]",
    )
    _source_options(sub)


def _source_options(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "--measured", action="store_true", help="the numbers were weighed or measured on this part"
    )
    sub.add_argument(
        "--note", metavar="TEXT", default="", help="kept with the numbers, e.g. how they were measured"
    )


def _estimate_options(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--model", metavar="NAME", help="the model to ask [FUNTWIN_VLM_MODEL]")
    sub.add_argument(
        "--recording",
        metavar="RECORDING",
        type=Path,
        help="choose among all its frames [key frames of the run]",
    )
    sub.add_argument(
        "--description", metavar="TEXT", default="", help="what the part is, e.g. oven door with glass"
    )
    sub.add_argument("--dry-run", action="store_true", help="print what would be sent and send nothing")
    sub.add_argument("--refresh", action="store_true", help="ask again even where an answer is kept")

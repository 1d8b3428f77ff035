"""Options of the verbs `edit` and `view`; imports nothing heavy, so that the command line answers at once."""

from __future__ import annotations

from argparse import ArgumentParser

from twin.cli import export_options

# what `twin edit` takes, as twin.edits.KINDS has it, whose imports take seconds
EDITS = (
    "upper", "lower", "closed", "axis", "pivot", "name", "removed", "merged", "split", "verdict", "mass", "friction",
    "damping", "frictionloss", "material",
)  # fmt: skip


def add_options(parser: ArgumentParser) -> None:
    add = parser.add_argument
    export_options.run(parser)
    add(
        "assignments",
        metavar="WHAT=VALUE",
        nargs="*",
        help=f"edits to make, of {', '.join(EDITS)}; without any the edits are listed",
    )
    add("--part", metavar="NAME", help="the part; may be left out when there is only one")
    add(
        "--why",
        metavar="TEXT",
        default="",
        help="the reason, which verdict=trusted needs; kept with the edit",
    )
    add("--undo", metavar="N", type=int, nargs="?", const=1, help="take the last N edits back [1]")


def view(parser: ArgumentParser) -> None:
    export_options.run(parser)
    parser.add_argument(
        "--port", metavar="N", type=int, default=0, help="of the server on this machine [a free one]"
    )

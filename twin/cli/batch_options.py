"""Options of the verb `batch`; imports nothing heavy, so that the command line answers at once."""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError
from pathlib import Path

# what `--do` takes, as twin.batch.work.VERBS has it
VERBS = ("reconstruct", "evaluate", "export", "check", "replay")


def batch(parser: ArgumentParser) -> None:
    """`twin batch`."""
    add = parser.add_argument
    add(
        "recordings", metavar="RECORDING", nargs="*",
        help="paths, FOLDER/*, @FILE with a recording a line, random:0-99 or walk:0-9",
    )  # fmt: skip
    add("-o", "--out", metavar="DIR", type=Path, required=True, help="folder of the batch; it goes on there")
    add(
        "--do", metavar="VERBS", type=_verbs, default=VERBS[:2],
        help=f"of {', '.join(VERBS)} [reconstruct,evaluate]; evaluate where there is a truth",
    )  # fmt: skip
    add("--workers", metavar="N", type=_count, default=0, help="recordings at a time [half of the cores]")
    add(
        "--backend",
        choices=("processes", "ray"),
        default="processes",
        help="what carries them out [processes]",
    )
    add("--address", metavar="ADDR", default="", help="of a Ray cluster that sees DIR [one on this machine]")
    add("--shard", metavar="I/N", default="0/1", help="only every N-th recording, from the I-th on [0/1]")
    add(
        "--retry", choices=("failed", "doubtful", "all"), default="",
        help="do again what ended so [nothing that is done]",
    )  # fmt: skip
    add("--timeout", metavar="S", type=_seconds, default=3600.0, help="s for one recording [3600]")
    add(
        "--memory", metavar="GB", type=_seconds, default=0.0, help="for one recording [what there is, shared]"
    )
    add(
        "--keep", choices=("all", "exports", "twin"), default="all",
        help="of a run: all, no intermediate stages, or the twin alone [all]",
    )  # fmt: skip
    add("--config", metavar="FILE", type=Path, help="TOML file with settings of reconstruct [none]")
    add(
        "--set", metavar="KEY=VALUE", action="append", default=[], help="a setting of reconstruct; repeatable"
    )
    add("--dry-run", action="store_true", help="list what would be done, and do nothing")
    add(
        "--page",
        action="store_true",
        help="write page and table of all that is done in DIR, and do nothing else",
    )


def _verbs(text: str) -> tuple[str, ...]:
    wanted = tuple(v for v in text.split(",") if v)
    wrong = [v for v in wanted if v not in VERBS]
    if wrong or "reconstruct" not in wanted:
        problem = f"{wrong[0]!r} is none of them" if wrong else "reconstruct must be among them"
        raise ArgumentTypeError(f"{problem}: {','.join(VERBS)}")
    return tuple(v for v in VERBS if v in wanted)


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 1024:
        raise ArgumentTypeError(f"{text!r} is no number of workers: give one from 1 to 1024")
    return int(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise ArgumentTypeError(f"{text!r} is no number above 0")
    return value

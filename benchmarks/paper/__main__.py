"""The paper's tables on recordings of ours: `paper.md`.

    python -m benchmarks.paper run [--subset] [--rooms 0-11] [--work DIR]   # goes on where it stopped
    python -m benchmarks.paper page

A unit is one method on one clip; its line in results/ROOM.jsonl has no time and no place, so that equal code
gives equal bytes. A clip is rendered, measured by all methods that have no line yet, and deleted. Rooms are
independent: two processes may share the work by --rooms.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.paper.ablations import METHODS
from benchmarks.paper.baselines import BASELINES
from benchmarks.paper.cameras import CAMERAS
from benchmarks.paper.chain import Answer, Seen
from benchmarks.paper.page import write_page
from benchmarks.paper.rooms import ROOMS, Clip, Room, clips, subset
from benchmarks.paper.scores import scored
from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from recon.readers import open_recording
from twin.errors import FuntwinError, ReconstructionError

HERE = Path(__file__).parent
PAGE = HERE.parent / "paper.md"
NAMES = (*METHODS, *BASELINES, *CAMERAS)


def run(wanted: Sequence[Clip], results: Path, work: Path) -> None:
    """Measure what has no line yet."""
    rooms: dict[int, Room] = {}
    for clip in wanted:
        path = results / f"room_{clip.room:02d}.jsonl"
        rows = _lines(path)
        left = [n for n in NAMES if (clip.name, n) not in rows]
        if not left:
            continue
        room = rooms.setdefault(clip.room, Room(clip.room))
        folder = room.render(clip.number, work / clip.name)
        rows |= {(clip.name, name): row for name, row in measured(folder, left).items()}
        _write(path, rows)
        shutil.rmtree(folder)
        print(clip.name, *left, sep="; ", flush=True)


def measured(folder: Path, names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Each method's scores on a rendered clip."""
    recording, truth = open_recording(folder, "native"), moved_part(load_truth(folder / "truth"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what a method doubts is counted, not told
        seen = Seen.of(recording)
        return {name: scored(_answer(name, seen, truth), truth) for name in names}


def moved_part(truth: Truth) -> Truth:
    """The truth of the one part that a clip shows in motion."""
    moved = [p for p in truth.parts if p.segments]
    if len(moved) != 1:
        raise ValueError(f"{truth.folder} shows {len(moved)} parts in motion, not one")
    return replace(truth, parts=tuple(moved))


def _answer(name: str, seen: Seen, truth: Truth) -> Answer:
    method: Callable[..., Answer] = {**METHODS, **BASELINES, **CAMERAS}[name]
    try:
        return method(seen, truth) if name in BASELINES else method(seen)
    except ReconstructionError:
        return Answer((), {} if name in METHODS else None, seen.cameras)


def _lines(path: Path) -> dict[tuple[str, str], dict[str, Any]]:
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    rows = [json.loads(line) for line in text.splitlines()]
    return {
        (r["clip"], r["method"]): {k: v for k, v in r.items() if k not in ("clip", "method")} for r in rows
    }


def _write(path: Path, rows: dict[tuple[str, str], dict[str, Any]]) -> None:
    order = sorted(rows, key=lambda k: (k[0], NAMES.index(k[1])))
    lines = [json.dumps({"clip": c, "method": m} | rows[c, m]) + "\n" for c, m in order]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(lines), encoding="utf-8")


def main(argv: Sequence[str] | None = None) -> int:
    """Parse the command line; 0 when done."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.paper", description=(__doc__ or "").splitlines()[0])  # fmt: skip
    parser.add_argument("verb", choices=("run", "page"))
    parser.add_argument("--subset", action="store_true", help="the first interaction of each room")
    parser.add_argument("--rooms", default=f"0-{ROOMS - 1}", help="first and last")
    parser.add_argument("--results", type=Path, default=HERE / "results")
    parser.add_argument("--work", type=Path, help="where clips are rendered [a temporary folder]")
    args = parser.parse_args(argv)
    first, last = (int(k) for k in args.rooms.split("-"))
    try:
        if args.verb == "run":
            wanted = [c for c in (subset() if args.subset else clips()) if first <= c.room <= last]
            with tempfile.TemporaryDirectory(prefix="paper", dir=args.work) as work:
                run(wanted, args.results, Path(work))
        write_page(args.results, PAGE)
    except FuntwinError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

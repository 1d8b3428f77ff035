"""Rates on random walks through furnished rooms: `walks.md`.

    python -m benchmarks.walks open FIRST LAST OUT [--seconds S]   # open seeds, kept, a table for each
    python -m benchmarks.walks sealed                              # 16 walks of this commit; sums are kept

A sealed walk's seed follows from the commit, so nobody can have seen it. Its recording, run and logs are
deleted with it; as many are measured at a time as there are cores. A stopped run goes on with the next walk;
every finished run is a section of the page.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks import sealing
from benchmarks.sealing import ROOT
from benchmarks.walk_rates import lines, pooled
from recon.evaluation.evaluate import evaluate
from recon.evaluation.read_truth import load_truth
from recon.evaluation.walk_cameras import loop_counts
from recon.evaluation.walk_scores import (
    IntervalCounts,
    LocalErrors,
    LoopCounts,
    PoseCounts,
    StateCounts,
    TruePartScore,
    WalkScores,
)
from recon.pipeline import read_stage
from recon.simulate.random.strata import WalkStratum, sealed_walks
from recon.simulate.walk.scene import simulate_walk
from twin.errors import FuntwinError, InputError
from twin.files.text import read_json, write_json
from twin.runs.threads import each
from twin.storage import load

STATE = ROOT / "out" / "walks"
PAGE = ROOT / "benchmarks" / "walks.md"
# s of measuring that a second of a walk may take while another one is measured: rendering is two thirds of it
LIMIT = 60.0
HEAD = """# Walks

Random walks of 45 to 120 s through furnished rooms (`twin simulate --walk`), VGA, 15 frames a second, that nobody has
looked at: seeds follow from the commit, recordings are deleted, sums are kept. Definitions: [metrics](../docs/metrics.md#walks).
Made by `python -m benchmarks.walks sealed`; a walk that ends with an error or beyond its time counts with all its parts missed.
"""


def walk(seed: int, stratum: WalkStratum | None, place: Path, seconds: float | None = None) -> dict[str, Any]:
    """Render, reconstruct, score; "scores" and "loops" as plain data, and whether there is a twin."""
    recording, run = place / "recording", place / "run"
    simulate_walk(seed, recording, stratum, seconds)
    sealing.twin_verb(ROOT, place, "reconstruct", str(recording), "-o", str(run))
    truth = load_truth(recording / "truth")
    if not (run / "twin" / "twin.json").is_file():
        return _failed(len(truth.parts), sum(len(p.spans) for p in truth.parts), truth.frames)
    scores = evaluate(load(run), recording / "truth").walk
    assert scores is not None
    loops = loop_counts(read_stage(run, "loops"), truth)
    return {"failed": False, "scores": scores.nameless().as_dict(), "loops": asdict(loops)}


def _failed(parts: int, interactions: int, frames: int) -> dict[str, Any]:
    """Of a walk without a twin: all parts and interactions missed, no state known, no frame posed."""
    per_part = [interactions // parts + (k < interactions % parts) for k in range(parts)]
    states = StateCounts(frames=frames, unknown=frames)
    missed = [
        TruePartScore("", None, "missed", False, None, None, None, IntervalCounts(true=n), states)
        for n in per_part
    ]
    scores = WalkScores("", tuple(missed), (), (), LocalErrors(), PoseCounts(frames=frames))
    return {"failed": True, "scores": scores.as_dict(), "loops": asdict(LoopCounts())}


def open_walks(first: int, last: int, out: Path, seconds: float | None) -> int:
    """Seeds first to last, whose recordings and runs stay in `out`; the rates of each, then of all."""
    if not 0 <= first <= last < sealing.OPEN_SEEDS:
        raise InputError(
            f"seeds {first} to {last} are not open", f"take some from 0 to {sealing.OPEN_SEEDS - 1}"
        )
    found = []
    for seed in range(first, last + 1):
        place = out / str(seed)
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        found.append(walk(seed, None, place, seconds))
        print(f"seed {seed}", *_told(found[-1:]), sep="\n", flush=True)
    print("all", *_told(found), sep="\n")
    return 0


def sealed() -> int:
    """Measure all walks of this commit that are not counted yet, and add the section when all are."""
    commit, strata = sealing.commit(), sealed_walks()
    path = STATE / f"{commit}.json"
    state = read_json(path) or {"done": [], "walks": []}
    left = [i for i in range(len(strata)) if i not in state["done"]]

    def alone(i: int) -> dict[str, Any]:
        return _alone(sealing.sealed_seed(commit, i), i, strata[i])

    for i, found in zip(left, each(alone, left), strict=True):
        state["walks"].append(found)
        state["done"].append(i)
        write_json(path, state)
        print(f"{len(state['done'])} of {len(strata)}", flush=True)
    text = PAGE.read_text(encoding="utf-8") if PAGE.is_file() else HEAD
    rows = [f"## {commit}", "", "| rate | |", "|---|---|", *_told(state["walks"])]
    of_sensor = [strata[i].sensor for i in state["done"]]
    for sensor in dict.fromkeys(of_sensor):
        some = [w for w, s in zip(state["walks"], of_sensor, strict=True) if s == sensor]
        told = dict(_rates(some))
        rows.append(f"| {sensor}: found; right | {told['parts found']}; {told['parts right']} |")
    PAGE.write_text(text.rstrip() + "\n\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return 0


def _told(found: Sequence[dict[str, Any]]) -> list[str]:
    """Rows of a table: the rates, loops, and walks without a twin."""
    loops = sum((LoopCounts(**f["loops"]) for f in found), LoopCounts())
    return [
        *(f"| {name} | {text} |" for name, text in _rates(found)),
        f"| false loops | {loops.false} of {loops.accepted} |",
        f"| walks without a twin | {sum(f['failed'] for f in found)} |",
    ]


def _rates(found: Sequence[dict[str, Any]]) -> list[tuple[str, str]]:
    """Names and texts of the rates."""
    return lines(pooled([WalkScores.from_dict(f["scores"]) for f in found]))


def _alone(seed: int, index: int, stratum: WalkStratum) -> dict[str, Any]:
    """The scores of one walk, made in a process of its own, of which nothing else is left."""
    with tempfile.TemporaryDirectory(prefix="walk") as place:
        command = [sys.executable, "-m", "benchmarks.walks", "one", str(seed), str(index), place]
        try:
            done = subprocess.run(
                command,
                cwd=ROOT,
                capture_output=True,
                timeout=LIMIT * stratum.seconds,
                env=sealing.environment(ROOT),
            )
            found: dict[str, Any] = json.loads(done.stdout.decode().strip().splitlines()[-1])
        except (subprocess.TimeoutExpired, ValueError, IndexError):
            return _failed(stratum.parts, stratum.interactions, round(stratum.seconds * stratum.fps))
    return found


def main() -> int:
    """Parse the command line; 0 when done."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("sealed")
    some = verbs.add_parser("open")
    some.add_argument("first", type=int)
    some.add_argument("last", type=int)
    some.add_argument("out", type=Path)
    some.add_argument("--seconds", type=float)
    one = verbs.add_parser("one")
    one.add_argument("seed", type=int)
    one.add_argument("index", type=int)
    one.add_argument("place", type=Path)
    args = parser.parse_args()
    try:
        if args.verb == "one":
            print(json.dumps(walk(args.seed, sealed_walks()[args.index], args.place)))
            return 0
        if args.verb == "sealed":
            return sealed()
        return open_walks(args.first, args.last, args.out, args.seconds)
    except FuntwinError as error:
        print(error, file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())

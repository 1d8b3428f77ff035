"""Rates on recordings that nobody has looked at: `unseen.md`.

    python -m benchmarks.unseen sealed                  # 160 clips of this commit; only counters are kept
    python -m benchmarks.unseen sealed --baseline REV   # and an earlier commit's code on every fourth clip
    python -m benchmarks.unseen open FIRST LAST OUT     # clips of the open seeds 0 to 9999, kept and told

A sealed clip's seed follows from the commit, so nobody can have seen it; its recording, run and logs are
deleted before the next one, and what is kept says only how many of which kind succeeded. As many clips as
there are cores are measured at a time, which changes no result. A stopped run goes on with the next clip.
Every finished run is a row of the page; none is taken off.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from benchmarks import sealing
from benchmarks.sealing import ROOT
from benchmarks.unseen_counts import counts
from benchmarks.unseen_page import write_row
from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from recon.simulate.random.scene import simulate_random
from recon.simulate.random.strata import sealed_set
from twin.errors import FuntwinError, InputError
from twin.files.text import read_json
from twin.storage import load

STATE = ROOT / "out" / "unseen"
PAGE = ROOT / "benchmarks" / "unseen.md"
BASELINE = 40  # clips that an earlier commit is measured on: every fourth


def sealed(baseline: str | None) -> int:
    """Measure all clips of this commit that are not counted yet, and add the rows when all are. Raises
    InputError on a dirty tree."""
    commit = sealing.commit()
    path, strata = STATE / f"{commit}.json", sealed_set()
    state = read_json(path) or {"done": [], "counts": {}, "baseline": {}, "of": baseline}
    if state["of"] != baseline:
        raise InputError(
            f"the run of {commit} was begun with --baseline {state['of']}", "go on with that one"
        )
    every = len(strata) // BASELINE
    with _code(baseline) as code:

        def measured(i: int) -> list[dict[str, int]]:
            codes = [ROOT, code] if baseline is not None and i % every == 0 else [ROOT]
            return _clip_alone(sealing.sealed_seed(commit, i), i, codes)

        sealing.go_on(path, state, dict(enumerate(strata)), ("counts", "baseline"), measured)
    write_row(PAGE, commit, None, len(strata), state["counts"])
    if baseline is not None:
        write_row(PAGE, commit, baseline, BASELINE, state["baseline"])
    return 0


def _clip_alone(seed: int, index: int, codes: Sequence[Path]) -> sealing.Rows:
    return sealing.clip_alone("benchmarks.unseen", (seed, index), codes)


def clip(seed: int, index: int, place: Path, codes: Sequence[Path]) -> list[dict[str, int]]:
    """Render, reconstruct with each of the codes, judge."""
    recording = place / "recording"
    simulate_random(seed, recording, sealed_set()[index])
    repeated = len(read_json(recording / "truth" / "random.json")["repeated"])
    truth = load_truth(recording / "truth")
    made = {"clips": 1, "repeated draws": repeated, "parts": len(truth.parts)}
    runs = [place / "run", *(place / f"run{k}" for k in range(1, len(codes)))]
    return [made | _measured(recording, run, truth, code) for run, code in zip(runs, codes, strict=True)]


def _measured(recording: Path, run: Path, truth: Truth, code: Path) -> dict[str, int]:
    """Counters of what the code in a folder makes of a recording."""
    said_so = sealing.twin_verb(code, run.parent, "reconstruct", str(recording), "-o", str(run)) in (1, 2)
    if not (run / "twin" / "twin.json").is_file():
        return {
            "no twin": 1, "cause missed": len(truth.parts), "exit not 0 where failed": int(said_so), "failed clips": 1
        }  # fmt: skip
    found = counts(load(run), truth)
    found["exit not 0 where failed"] = int(bool(found["failed clips"]) and said_so)
    return dict(found)


def open_clips(first: int, last: int, out: Path) -> int:
    """Seeds first to last, whose recordings and runs stay in `out`; a line for each."""
    if not 0 <= first <= last < sealing.OPEN_SEEDS:
        raise InputError(
            f"seeds {first} to {last} are not open", f"take some from 0 to {sealing.OPEN_SEEDS - 1}"
        )
    strata = sealed_set()
    for seed in range(first, last + 1):
        place = out / str(seed)
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        index = seed % len(strata)
        print(seed, json.dumps(asdict(strata[index])), clip(seed, index, place, [ROOT])[0], flush=True)
    return 0


@contextmanager
def _code(revision: str | None) -> Iterator[Path]:
    """A checkout of an earlier commit, for as long as it takes; this tree for None."""
    if revision is None:
        yield ROOT
        return
    with tempfile.TemporaryDirectory(prefix="unseen_code") as folder:
        place = Path(folder) / "code"
        sealing.git("worktree", "add", "--detach", str(place), revision)
        try:
            yield place
        finally:
            sealing.git("worktree", "remove", "--force", str(place))


def main() -> int:
    """Parse the command line; 0 when done."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    one = verbs.add_parser("sealed")
    one.add_argument("--baseline", metavar="REV")
    some = verbs.add_parser("open")
    some.add_argument("first", type=int)
    some.add_argument("last", type=int)
    some.add_argument("out", type=Path)
    single = verbs.add_parser("clip")
    single.add_argument("seed", type=int)
    single.add_argument("index", type=int)
    single.add_argument("place", type=Path)
    single.add_argument("codes", type=Path, nargs="+")
    args = parser.parse_args()
    if args.verb == "clip":  # its error's name is counted
        for row in clip(args.seed, args.index, args.place, args.codes):
            print(json.dumps(row))
        return 0
    try:
        if args.verb == "sealed":
            return sealed(args.baseline)
        return open_clips(args.first, args.last, args.out)
    except FuntwinError as error:
        print(error, file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())

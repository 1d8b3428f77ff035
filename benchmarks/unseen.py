"""Rates on recordings that nobody has looked at: `unseen.md`.

    python -m benchmarks.unseen sealed                  # 160 clips of this commit; only counters are kept
    python -m benchmarks.unseen sealed --baseline REV   # and an earlier commit's code on every fourth of them, its row beside
    python -m benchmarks.unseen open FIRST LAST OUT     # clips of the open seeds 0 to 9999, kept and told one by one

A sealed clip's seed follows from the commit, so nobody can have seen it; its recording, run and logs are deleted before the next one,
and what is kept says only how many of which kind succeeded. As many clips as there are cores are measured at a time, which changes no
result. A stopped run goes on with the next clip. Every finished run is a row of
the page; none is taken off.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.unseen_counts import counts
from benchmarks.unseen_page import write_row
from recon.evaluation.truth import Truth, load_truth
from recon.simulate.random.scene import simulate_random
from recon.simulate.random.strata import Stratum, sealed_set
from twin.errors import FuntwinError, InputError
from twin.files.text import read_json, write_json
from twin.runs.threads import each
from twin.storage import load

ROOT = Path(__file__).parents[1]
STATE = ROOT / "out" / "unseen"
PAGE = ROOT / "benchmarks" / "unseen.md"
OPEN_SEEDS = 10_000
BASELINE = 40  # clips that an earlier commit is measured on: every fourth
# The command of any commit: `main` was a function in twin/cli.py before it was a module
_TWIN = "from twin.cli import main; getattr(main, 'main', main)()"
MINUTES = 20  # after which a clip counts as failed


def sealed_seed(commit: str, index: int) -> int:
    """The seed of clip `index`: nobody can know it before the commit is made, and it is none of the open ones."""
    digest = hashlib.sha256(f"{commit}:{index}".encode()).digest()
    return OPEN_SEEDS + int.from_bytes(digest[:6], "big")


def sealed(baseline: str | None) -> int:
    """Measure all clips of this commit that are not counted yet, and add the rows when all are. Raises InputError on a dirty tree."""
    commit = _commit()
    path, strata = STATE / f"{commit}.json", sealed_set()
    state = read_json(path) or {"done": [], "counts": {}, "baseline": {}, "of": baseline}
    if state["of"] != baseline:
        raise InputError(
            f"the run of {commit} was begun with --baseline {state['of']}", "go on with that one"
        )
    every = len(strata) // BASELINE
    left = [i for i in range(len(strata)) if i not in state["done"]]
    with _code(baseline) as code:

        def measured(i: int) -> list[dict[str, int]]:
            codes = [ROOT, code] if baseline is not None and i % every == 0 else [ROOT]
            return _clip_alone(sealed_seed(commit, i), i, codes)

        for i, rows in zip(left, each(measured, left), strict=True):
            for name, found in zip(("counts", "baseline"), rows, strict=False):
                state[name] = dict(sorted((Counter(state[name]) + counted(found, strata[i])).items()))
            state["done"] = sorted([*state["done"], i])
            write_json(path, state)
            print(f"{len(state['done'])} of {len(strata)}", flush=True)
    write_row(PAGE, commit, None, len(strata), state["counts"])
    if baseline is not None:
        write_row(PAGE, commit, baseline, BASELINE, state["baseline"])
    return 0


def counted(found: dict[str, Any], stratum: Stratum) -> Counter[str]:
    """What is kept of a clip: how many parts of its group, and of each of its factors, did what."""
    group = stratum.group
    names = [group, f"{group} sensor {stratum.sensor}"]
    if group != "negative":
        names += [f"{group} view {stratum.view}", f"{group} short {'yes' if stratum.short else 'no'}"]
        names.append(f"{group} picture {'hard' if stratum.hard_picture else 'clean'}")
    else:
        names.append(f"negative {stratum.negative}")
    out: Counter[str] = Counter()
    for name in names:
        for key, value in found.items():
            out[f"{name}: {key}"] += value
    return out


def _clip_alone(seed: int, index: int, codes: Sequence[Path]) -> list[dict[str, int]]:
    """Counters of one clip by each code, made and measured in a process of its own, of which nothing else is left."""
    with tempfile.TemporaryDirectory(prefix="unseen") as place:
        command = [
            sys.executable,
            "-m",
            "benchmarks.unseen",
            "clip",
            str(seed),
            str(index),
            place,
            *map(str, codes),
        ]
        try:
            done = subprocess.run(
                command,
                cwd=ROOT,
                capture_output=True,
                timeout=60 * MINUTES * len(codes),
                env=_environment(ROOT),
            )
            told = [json.loads(line) for line in done.stdout.decode().strip().splitlines()[-len(codes) :]]
            broken = _error_kind(done.stderr.decode(errors="replace"), done.returncode)
        except subprocess.TimeoutExpired:
            told, broken = [], "time"
        except ValueError:
            told, broken = [], "output"
    if len(told) != len(codes):
        return [{"clips": 1, "broken": 1, f"broken {broken}": 1} for _ in codes]
    return [{k: int(v) for k, v in row.items()} for row in told]


def _error_kind(stderr: str, code: int) -> str:
    """The name of the error that ended a clip's process, which tells nothing of the clip; its exit code where it names none."""
    last = stderr.strip().splitlines()[-1:]
    named = re.match(r"([A-Za-z_.]+(?:Error|Exception|Interrupt))\b", last[0]) if last else None
    return named.group(1).rpartition(".")[2] if named else f"exit {code}"


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
    command = [sys.executable, "-c", _TWIN, "reconstruct", str(recording), "-o", str(run)]
    done = subprocess.run(command, cwd=run.parent, capture_output=True, env=_environment(code))
    said_so = done.returncode in (1, 2)
    if not (run / "twin" / "twin.json").is_file():
        return {
            "no twin": 1, "cause missed": len(truth.parts), "exit not 0 where failed": int(said_so), "failed clips": 1
        }  # fmt: skip
    found = counts(load(run), truth)
    found["exit not 0 where failed"] = int(bool(found["failed clips"]) and said_so)
    return dict(found)


def open_clips(first: int, last: int, out: Path) -> int:
    """Seeds first to last, whose recordings and runs stay in `out`; a line for each."""
    if not 0 <= first <= last < OPEN_SEEDS:
        raise InputError(f"seeds {first} to {last} are not open", f"take some from 0 to {OPEN_SEEDS - 1}")
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
        _git("worktree", "add", "--detach", str(place), revision)
        try:
            yield place
        finally:
            _git("worktree", "remove", "--force", str(place))


def _environment(code: Path) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(code)}


def _git(*words: str) -> str:
    return subprocess.run(
        ["git", *words], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.strip()


def _commit() -> str:
    if _git("status", "--porcelain"):
        raise InputError(
            "the tree has changes that are in no commit", "commit them: a sealed run is of a commit"
        )
    return _git("rev-parse", "--short=10", "HEAD")


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

"""Plant faults and see which of them the default tests notice.

    python -m benchmarks.mutants draw            add faults to faults.toml, replace those whose line is gone
    python -m benchmarks.mutants run [--only X]  judge what has no valid result, then write mutants.md
    python -m benchmarks.mutants page            only write the page
    python -m benchmarks.mutants rate [--seed N] [--count K]   how many faults beside the list are noticed

A run may be stopped and goes on where it was; results are in results.jsonl beside the list. A fault is judged
again when its module or the test that noticed it changes, a survivor when any test does.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.mutants.draw import draw, sample
from benchmarks.mutants.faults import LIST, RESULTS, ROOT, read_faults, write_faults
from benchmarks.mutants.page import page
from benchmarks.mutants.run import NOTICED, Runner, read_results


def main(argv: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.mutants",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("verb", choices=("draw", "run", "page", "rate"))
    parser.add_argument("--only", default="", help="judge only faults whose file or key holds this text")
    parser.add_argument("--tests", nargs="*", help="only the tests of these files judge (default: all)")
    parser.add_argument("--workers", type=int, default=2, help="faults judged at a time (default: 2)")
    parser.add_argument("--fresh", action="store_true", help="judge again what was judged before")
    parser.add_argument(
        "--out", type=Path, default=ROOT / "out", help="folder of what tests run which lines (default: out)"
    )
    parser.add_argument(
        "--seed", type=int, default=1, help="of a rate's faults; take one that nobody has used"
    )
    parser.add_argument("--count", type=int, default=40, help="faults of a rate (default: 40)")
    args = parser.parse_args(argv)
    faults = read_faults()
    if args.verb == "draw":
        stand, gone = draw(faults)
        for f in gone:
            print(f"gone: {f.file}: {f.line}" + ("  (NAMED: find its place by hand)" if f.name else ""))
        write_faults(stand, LIST)
        print(f"{len(stand)} faults, {len(set(stand) - set(faults))} of them new, {len(gone)} gone")
        return 1 if any(f.name for f in gone) else 0
    if args.verb == "rate":
        faults = sample(faults, args.count, args.seed)
    results = RESULTS if args.verb != "rate" else args.out / f"mutants_of_seed_{args.seed}.jsonl"
    if args.verb in ("run", "rate"):
        if args.fresh:
            results.unlink(missing_ok=True)
        runner = Runner(ROOT, args.out, args.workers, _tell if args.verb == "run" else _silent, results)
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            runner.run([f for f in faults if args.only in f"{f.file} {f.key}"], args.tests)
        except KeyboardInterrupt:
            print("stopped; the same command goes on from here")
            return 130
    if args.verb == "rate":
        found = read_results(results).values()
        print(
            f"{sum(r.outcome == NOTICED for r in found)} of {len(found)} faults of seed {args.seed} are noticed"
        )
        return 0
    (ROOT / "benchmarks/mutants.md").write_text(page(faults, read_results(results), ROOT), encoding="utf-8")
    print(f"{ROOT / 'benchmarks/mutants.md'} is written")
    return 0


def _tell(said: str) -> None:
    print(said, flush=True)


def _silent(said: str) -> None:
    """A rate is told without the faults that it rests on, or the tests would be written for them."""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Judge completed assets by the simulator's truth: `complete.md`.

    python -m benchmarks.complete RUN RECORDING/truth [RUN RECORDING/truth ...]   # a table of their exports
    python -m benchmarks.complete RUN RECORDING/truth ... --page TITLE            # and a section of the page
    python -m benchmarks.complete sealed                     # 40 clips of this commit; only counters are kept

A sealed clip's seed follows from the commit, as benchmarks/unseen.py has it; its recording, run, export and
logs are deleted before the next one. A stopped run goes on with the next clip.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks import sealing
from benchmarks.completed.counts import counts
from benchmarks.completed.judge import judge, missed
from benchmarks.completed.page import rates, table, write_section
from benchmarks.sealing import ROOT
from recon.simulate.random.scene import simulate_random
from recon.simulate.random.strata import sealed_set
from twin.errors import FuntwinError
from twin.files.text import read_json

PAGE = ROOT / "benchmarks" / "complete.md"
STATE = ROOT / "out" / "complete"
# One of every three that have parts, each time another: 20 ordinary and 20 hard ones, of all sensors, views
# and lengths
CLIPS = tuple(3 * k + k % 3 for k in range(40))


def sealed() -> int:
    """Measure all clips of this commit that are not counted yet, and add a section when all are. Raises
    InputError on a dirty tree."""
    commit = sealing.commit()
    path, strata = STATE / f"{commit}.json", sealed_set()
    state = read_json(path) or {"done": [], "counts": {}}

    def measured(i: int) -> sealing.Rows:
        return _clip_alone(sealing.sealed_seed(commit, i), i)

    sealing.go_on(path, state, {i: strata[i] for i in CLIPS}, ("counts",), measured)
    write_section(PAGE, commit, f"{len(CLIPS)} clips.\n\n{rates(state['counts'])}")
    return 0


def _clip_alone(seed: int, index: int) -> sealing.Rows:
    return sealing.clip_alone("benchmarks.complete", (seed, index), (ROOT,))


def clip(seed: int, index: int, place: Path, code: Path) -> dict[str, int]:
    """Counters of one clip: render, reconstruct, export, judge."""
    recording, run = place / "recording", place / "run"
    simulate_random(seed, recording, sealed_set()[index])
    sealing.twin_verb(code, place, "reconstruct", str(recording), "-o", str(run))
    out = {"clips": 1}
    if not (run / "twin" / "twin.json").is_file():
        return out | counts(missed(recording / "truth"))
    out["with twin"] = 1
    if sealing.twin_verb(code, place, "export", str(run)) != 0:
        return out | {"broken": 1, "broken export": 1} | counts(missed(recording / "truth"))
    return out | counts(judge(run, recording / "truth"))


def told(folders: Sequence[Path], title: str | None) -> int:
    """Print a table of runs, each followed by its truth; with a title, as a section of the page as well."""
    text = table([judge(run, truth) for run, truth in zip(folders[::2], folders[1::2], strict=True)])
    print(text, flush=True)
    if title is not None:
        write_section(PAGE, title, text)
    return 0


def main(argv: Sequence[str]) -> int:
    """Run the command line; 0 when done."""
    try:
        if argv[:1] == ["clip"]:
            seed, index, place, code = argv[1:]
            print(json.dumps(clip(int(seed), int(index), Path(place), Path(code))))
            return 0
        if list(argv) == ["sealed"]:
            return sealed()
        parser = argparse.ArgumentParser(
            description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        parser.add_argument("folders", type=Path, nargs="+", metavar="RUN TRUTH")
        parser.add_argument("--page", metavar="TITLE", help="also write a section of complete.md")
        options = parser.parse_args(argv)
        if len(options.folders) % 2:
            parser.error("give a run and its truth, or several such pairs")
        return told(options.folders, options.page)
    except FuntwinError as error:
        if argv[:1] == ["clip"]:  # its error's name is counted
            raise
        print(error, file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

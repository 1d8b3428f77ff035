"""Which way is up, on open random recordings that look steeply down or up: `up.md`.

    python -m benchmarks.up run [--most 5]      # 60 recordings, or the next five; only counters are kept
    python -m benchmarks.up clip SEED INDEX PLACE

The recordings are those of the stratum "steep", rendered as they are drawn. Each is taken to its surfaces and
to what is said of up, and deleted with all that was computed before the next one. A stopped run goes on with
the next clip; the last one writes the page.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from benchmarks import sealing
from benchmarks.sealing import ROOT
from recon.config import ReconConfig
from recon.evaluation.outcome import LOST_MM, UP_DEG
from recon.evaluation.read_truth import load_truth
from recon.evaluation.scores import camera_errors
from recon.readers import open_recording
from recon.recording.decoded import decoded_once
from recon.simulate.random.scene import simulate_random
from recon.simulate.random.strata import Stratum, sealed_set
from recon.stages.survey import survey
from twin.files.text import read_json, write_json, write_text
from twin.runs.chain import Chain
from twin.runs.stages import Run
from twin.scene import Trajectory

STATE, PAGE = ROOT / "out" / "up.json", ROOT / "benchmarks" / "up.md"
CLIPS, FIRST_SEED = 60, 8200  # the seeds of no other page
STEEP_DEG = 40.0  # of the pitch below which wall and floor are nearly as far from the picture's top
GROUPS = ("all", "pitched 40 degrees down or more", "pitched less", "cameras lost")

HEAD = f"""# Which way is up, seen steeply

`python -m benchmarks.up run` measures the commit on {CLIPS} open random recordings (`twin simulate --random`, seeds from {FIRST_SEED}) of the
stratum "steep": pitched 35 to 60 degrees down, or 20 to 30 up. Up is right within {UP_DEG:g} degrees. "By posture" is the first guess,
by walls, floors and how the camera is held, with which the stages before work. Doubted: the twin's verdict names up.
"""


def strata() -> dict[int, Stratum]:
    """The stratum of each clip by its index: those of `sealed_set` that look steeply, in turn."""
    steep = [s for s in sealed_set() if s.view == "steep"]
    return {k: steep[k % len(steep)] for k in range(CLIPS)}


def clip(seed: int, index: int, place: Path) -> dict[str, int]:
    """Counters of one recording, made and measured in `place`."""
    folder = simulate_random(seed, place / "recording", strata()[index])
    truth = load_truth(folder / "truth")
    with decoded_once(open_recording(folder), None) as recording, Run(None, recording.fingerprint) as run:
        surveyed = survey(Chain(run, ReconConfig()), recording)
    guessed: Trajectory = surveyed.reads[0].value
    before, after = camera_errors(guessed, truth), camera_errors(surveyed.world.cameras, truth)
    assert truth.cameras is not None
    pitch = float(np.degrees(np.arcsin(truth.cameras.T_world_cam[:, 2, 2].mean())))
    lost = after.ate_mm > LOST_MM
    group = "cameras lost" if lost else GROUPS[1] if pitch <= -STEEP_DEG else "pitched less"
    right, doubted = after.up_deg <= UP_DEG, surveyed.upright.doubt is not None
    found = {
        "clips": 1,
        "right": int(right),
        "right and doubted": int(right and doubted),
        "wrong and doubted": int(doubted and not right),
        "wrong and not doubted": int(not (right or doubted)),
        "right by posture": int(before.up_deg <= UP_DEG),
    }
    return {f"{name}: {key}": n for name in ("all", group) for key, n in found.items()}


def run(most: int) -> int:
    """Measure the next `most` clips that are not counted yet; after the last one the page is written."""
    state = read_json(STATE) or {"done": [], "counts": {}}
    left = {k: s for k, s in strata().items() if k not in state["done"]}
    for k in islice(left, most):
        (row,) = sealing.clip_alone("benchmarks.up", (FIRST_SEED + k, k), [ROOT])
        for key, n in row.items():
            state["counts"][key] = state["counts"].get(key, 0) + n
        state["done"] = sorted([*state["done"], k])
        write_json(STATE, state)
        print(f"{len(state['done'])} of {CLIPS}", flush=True)
    if len(state["done"]) == CLIPS:
        write_text(PAGE, page(state["counts"]))
    return 0


def page(counts: Mapping[str, int]) -> str:
    """The page of these counters."""
    columns = (
        "clips",
        "right",
        "right and doubted",
        "wrong and doubted",
        "wrong and not doubted",
        "right by posture",
    )
    rows = [[group, *(str(counts.get(f"{group}: {c}", 0)) for c in columns)] for group in GROUPS]
    rows += [["broken", str(counts.get("broken", 0)), *[""] * (len(columns) - 1)]]
    return "\n".join([HEAD, *_table(("recordings", *columns), rows), ""])


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]


def main() -> int:
    """Parse the command line; 0 when done."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    several = verbs.add_parser("run")
    several.add_argument("--most", type=int, default=CLIPS)
    single = verbs.add_parser("clip")
    single.add_argument("seed", type=int)
    single.add_argument("index", type=int)
    single.add_argument("place", type=Path)
    single.add_argument("codes", type=Path, nargs="*")
    args = parser.parse_args()
    if args.verb == "run":
        return run(args.most)
    print(json.dumps(clip(args.seed, args.index, args.place)))
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Failures mended by the user's word, on open random recordings that nobody has looked at: `words.md`.

    python -m benchmarks.words run [--most 5]     # until ten failures were tried, or the next five recordings

Recordings of the ordinary and hard strata, seeds from 9200, are reconstructed one after the other. Where a
part fails (docs/metrics.md, "success, 5 deg and 2 cm"), the user points at it: `--at` the pixel in the middle
of its true mask in the middle of its motion, and `--type`. Nothing else is said, and nothing is tried twice.
A recording is deleted before the next one; a line of words.jsonl stays, so that a stopped run goes on.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Mapping, Sequence
from itertools import count, islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks import sealing
from benchmarks.sealing import ROOT
from recon.evaluation.outcome import Outcome, outcome
from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth, TruthPart
from recon.recording.said import Word
from recon.simulate.random.scene import simulate_random
from recon.simulate.random.strata import sealed_set
from twin.files.text import write_text
from twin.storage import load

ROWS, PAGE = (ROOT / "benchmarks" / f"words.{kind}" for kind in ("jsonl", "md"))
# the seeds of no other page; failures that are tried
FIRST_SEED, WANTED = 9200, 10
HEAD = """# Failures mended by a click

`python -m benchmarks.words run`: open random recordings (`twin simulate --random`, seeds from {first}, ordinary and hard strata, none looked at
before its line was written). Where a part fails, the middle of its mask in the middle of its motion is pointed at and its type said:
what `twin view` makes of a click. Mended: the part then has the right type, its axis within 5°, its handle's path within 2 cm, and its masks
an IoU of .7. {done} recordings, {failed} failures, {mended} mended.

| seed | part | failed by | said | after it |
|---|---|---|---|---|
"""


def tried(seed: int, place: Path) -> list[dict[str, Any]]:
    """A row for each part that fails, or one row without "part" where none does."""
    strata = [s for s in sealed_set() if s.negative is None]
    folder, run = simulate_random(seed, place / "recording", strata[seed % len(strata)]), place / "run"
    truth = load_truth(folder / "truth")
    before = _causes(folder, run, truth, ())
    failed = [k for k, cause in enumerate(before) if cause is not None]
    rows: list[dict[str, Any]] = []
    for k in failed:
        word = pointed(truth, truth.parts[k])
        after = _causes(folder, place / f"run{k}", truth, str(word).split()) if word is not None else before
        row = {"part": truth.parts[k].name, "before": before[k], "said": str(word or ""), "after": after[k]}
        rows.append({"seed": seed} | row)
    return rows or [{"seed": seed}]


def pointed(truth: Truth, part: TruthPart) -> Word | None:
    """The pixel farthest from the rim of a part's mask in the middle of its motion; None of an unseen one."""
    if part.span is None:
        return None
    middle = sum(part.span) // 2
    for frame in sorted(truth.labels, key=lambda f: abs(f - middle)):
        inside = cv2.distanceTransform((truth.labels[frame] == part.id).astype(np.uint8), cv2.DIST_L2, 5)
        if inside.max() > 1.0:
            y, x = np.unravel_index(int(inside.argmax()), inside.shape)
            kind = "hinge" if part.joint.kind == "revolute" else "slide"
            return Word((int(x), int(y), frame), None, kind)
    return None


def _causes(folder: Path, run: Path, truth: Truth, words: Sequence[str]) -> list[str | None]:
    """Why each true part fails, None for those that don't."""
    sealing.twin_verb(ROOT, run.parent, "reconstruct", str(folder), "-o", str(run), *words)
    if not (run / "twin" / "twin.json").is_file():
        return ["missed"] * len(truth.parts)
    found: Outcome = outcome(load(run), truth)
    return [p.cause for p in found.parts]


def run(most: int | None) -> None:
    """Try the next recordings until ten failures were, and write the page."""
    rows = [json.loads(line) for line in ROWS.read_text().splitlines()] if ROWS.is_file() else []
    done = {r["seed"] for r in rows}
    for seed in islice((s for s in count(FIRST_SEED) if s not in done), most):
        if sum("part" in r for r in rows) >= WANTED:
            break
        with tempfile.TemporaryDirectory(prefix="words") as place:
            rows += tried(seed, Path(place))
        write_text(ROWS, "".join(json.dumps(r) + "\n" for r in rows))
        write_text(PAGE, page(rows))
        print(*(json.dumps(r) for r in rows if r["seed"] == seed), sep="\n", flush=True)


def page(rows: Sequence[Mapping[str, Any]]) -> str:
    """The page of these rows."""
    failed = [r for r in rows if "part" in r]
    mended = sum(r["after"] is None for r in failed)
    head = HEAD.format(
        first=FIRST_SEED, done=len({r["seed"] for r in rows}), failed=len(failed), mended=mended
    )
    lines = [
        f"| {r['seed']} | {r['part']} | {r['before']} | `{r['said']}` | {r['after'] or 'right'} |"
        for r in failed
    ]
    return head + "\n".join([*lines, ""])


def main(argv: Sequence[str] | None = None) -> int:
    """Parse the command line; 0 when done."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("verb", choices=("run",))
    parser.add_argument("--most", type=int, help="recordings [until ten failures were tried]")
    run(parser.parse_args(argv).most)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

"""What each doubt of a verdict is worth, and how reliable verdicts are: `verdicts.md`.

    python -m benchmarks.calibrate judge SEED...   # open seeds 0 to 9999, of the stratum seed % 160; goes on
    python -m benchmarks.calibrate fit             # the weights of recon/verdict/posterior.py, and the page

A part's row holds the amounts of its doubts and whether it is right (type, 5 degrees, 2 cm, labels); parts
that were refused count too, and what is none is wrong. The fit is a logistic regression, maximum a
posteriori: weights are at least 0 and stay near `_EXPECTED` where few rows tell. The page judges each row by
weights that are fitted to the other nine tenths of the recordings.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from benchmarks.sealing import OPEN_SEEDS, ROOT
from recon.contact.finish_parts import FinishedPart
from recon.evaluation.outcome import LOST_MM, PART_MIOU, joint_cause
from recon.evaluation.read_truth import load_truth
from recon.evaluation.scores import camera_errors, joint_errors, label_scores, match_parts
from recon.pipeline import read_stage, reconstruct
from recon.simulate.random.scene import simulate_random
from recon.simulate.random.strata import sealed_set
from recon.verdict.posterior import QUESTIONS, REFUSED, TRUSTED
from twin.errors import FuntwinError, InputError, ReconstructionError
from twin.files.text import read_json, write_json
from twin.geometry import Array
from twin.scene import Twin

RECORDS, PAGE = ROOT / "benchmarks" / "verdicts.json", ROOT / "benchmarks" / "verdicts.md"
# What we expect of a doubt's weight and of the log odds of a part without one, and how sure we are of that
_EXPECTED, _SPREAD = 1.2, 0.3
_SOUND, _SOUND_SPREAD = 4.5, 0.7
_FOLDS = 10
# Probabilities between which the page counts parts
_BINS = (0.0, 0.3, 0.6, 0.8, 0.9, 0.95, 0.98, 1.0)


def judge(seeds: list[int]) -> int:
    """Render, reconstruct and judge the recordings of open seeds that have no rows yet."""
    records = read_json(RECORDS) or {"rows": [], "seeds": []}
    for seed in seeds:
        if not 0 <= seed < OPEN_SEEDS:
            raise InputError(f"seed {seed} is not open", f"take some from 0 to {OPEN_SEEDS - 1}")
        if seed in records["seeds"]:
            continue
        with tempfile.TemporaryDirectory(prefix="calibrate") as place:
            rows = _judged(seed, Path(place))
        records["rows"] += rows
        records["seeds"].append(seed)
        write_json(RECORDS, records)
        print(seed, *rows, sep="\n  ", flush=True)
    return 0


def _judged(seed: int, place: Path) -> list[dict[str, Any]]:
    """A row for each part that was found, refused ones too."""
    stratum = sealed_set()[seed % len(sealed_set())]
    recording = simulate_random(seed, place / "recording", stratum)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            twin = reconstruct(recording, out=place / "run", progress=False)
        except ReconstructionError:
            return []
    finished = {p.moving.id: p for p in read_stage(place / "run", "contact")}
    of = {"seed": seed, "sensor": stratum.sensor, "group": stratum.group}
    causes = _causes(recording, place / "run", twin, finished)
    amounts = read_stage(place / "run", "verdict").amounts
    return [of | {"wrong": causes[k], "amounts": dict(told)} for k, told in amounts.items() if k in causes]


def _causes(
    recording: Path, run: Path, twin: Twin, finished: dict[int, FinishedPart]
) -> dict[int, str | None]:
    """Why each part with a surface is wrong, None if it is right."""
    truth = load_truth(recording / "truth")
    assert twin.cameras is not None
    errors = camera_errors(twin.cameras, truth)
    ids, labels = list(finished), read_stage(run, "labels")
    found = [(finished[k].moving.joint, finished[k].moving.motion) for k in ids]
    of_true = {j: i for i, j in match_parts(found, errors.T_truth_recon, truth).items()}
    out: dict[int, str | None] = {}
    for j, k in enumerate(ids):
        if j not in of_true:
            out[k] = "none"
            continue
        true = truth.parts[of_true[j]]
        wrong = joint_cause(joint_errors(*found[j], errors.T_truth_recon, truth, true))
        miou = label_scores(labels, truth, {true.id: k})[true.id].miou or 0.0
        lost = errors.ate_mm > LOST_MM
        out[k] = "cameras" if lost else wrong or ("labels" if miou < PART_MIOU else None)
    return out


def fitted(amounts: Array, right: Array) -> tuple[float, Array]:
    """Log odds of a part without a doubt, and weights (d,), by amounts (n, d) and which of n are right."""

    def cost(x: Array) -> float:
        odds = x[0] - amounts @ x[1:]
        misfit = np.logaddexp(0.0, np.where(right, -odds, odds)).sum()
        prior = ((x[0] - _SOUND) / _SOUND_SPREAD) ** 2 + (((x[1:] - _EXPECTED) / _SPREAD) ** 2).sum()
        return float(misfit + 0.5 * prior)

    start = np.array([_SOUND, *[_EXPECTED] * amounts.shape[1]])
    best = minimize(cost, start, bounds=[(0.0, None)] * len(start)).x
    return float(best[0]), np.asarray(best[1:])


def fit() -> int:
    """Print the weights by all rows, and write the page by weights fitted to other recordings."""
    rows = read_json(RECORDS)["rows"]
    amounts = np.array(
        [[max(r["amounts"].get(t, 0.0) for t in types) for types in QUESTIONS.values()] for r in rows]
    )
    right = np.array([r["wrong"] is None for r in rows])
    sound, weights = fitted(amounts, right)
    print(
        f"SOUND = {sound:.2f}",
        *(f'    "{q}": {w:.2f},' for q, w in zip(QUESTIONS, weights, strict=True)),
        sep="\n",
    )
    seeds = np.array([r["seed"] for r in rows])
    fold = np.unique(seeds, return_inverse=True)[1] % _FOLDS
    told = np.zeros(len(rows))
    for k in range(_FOLDS):
        base, its = fitted(amounts[fold != k], right[fold != k])
        told[fold == k] = 1.0 / (1.0 + np.exp(amounts[fold == k] @ its - base))
    PAGE.write_text(_page(rows, right, told, weights), encoding="utf-8")
    return 0


def _page(rows: list[dict[str, Any]], right: Array, told: Array, weights: Array) -> str:
    """The page of the records, with each row's probability by weights of other recordings."""
    causes = Counter(r["wrong"] for r in rows if r["wrong"] is not None)
    trusted, refused = told >= TRUSTED, told < REFUSED
    lines = [
        "# Verdicts",
        "",
        "How probabilities of verdicts are calibrated: `python -m benchmarks.calibrate`, definitions in its head.",
        f"{len(rows)} parts of {len({r['seed'] for r in rows})} open random recordings, {int(right.sum())} right; the others: "
        + ", ".join(f"{c} {n}" for c, n in causes.most_common())
        + ". Each part is judged by weights fitted to other recordings, by the method that was built while some of these were looked at.",
        "",
        "| probability | parts | mean | right |",
        "|---|---|---|---|",
    ]
    for low, high in pairwise(_BINS):
        inside = (told >= low) & (told < high if high < 1 else told <= 1)
        share = f"{right[inside].mean():.2f}" if inside.any() else "-"
        mean = f"{told[inside].mean():.2f}" if inside.any() else "-"
        lines.append(f"| {low:g} to {high:g} | {int(inside.sum())} | {mean} | {share} |")
    trust = (
        f"Trusted (from {TRUSTED:g} on): {int((trusted & right).sum())} of {int(trusted.sum())} right, which are "
        f"{int((trusted & right).sum())} of {int(right.sum())} right ones. Refused (below {REFUSED:g}): "
        f"{int((refused & ~right).sum())} of {int(refused.sum())} wrong."
    )
    lines += [
        "",
        trust,
        "",
        "| question | doubt | weight | parts | right |",
        "|---|---|---|---|---|",
    ]
    for (question, types), weight in zip(QUESTIONS.items(), weights, strict=True):
        for t in types:
            has = np.array([t in r["amounts"] for r in rows])
            lines.append(
                f"| {question} | `{t}` | {weight:.2f} | {int(has.sum())} | {int((has & right).sum())} |"
            )
    return "\n".join(lines) + "\n"


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("judge").add_argument("seeds", nargs="+", type=int)
    verbs.add_parser("fit")
    told = parser.parse_args(arguments)
    try:
        return fit() if told.verb == "fit" else judge(told.seeds)
    except FuntwinError as e:
        print(f"error: {e}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

"""Reconstruct recordings that have truth and print one row each: every goal's figure, seconds and memory by
stage.

    python benchmarks/reconstruct.py RUNS RECORDING [RECORDING ...] [--set motion.method=clusters] \
        [--table FILE]

Each recording is reconstructed into RUNS/<name>, with default settings or those given; runs found there are
resumed, so that a second call only evaluates. A recording that fails gives a row that says why. Truth is read
by the evaluation alone.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from recon.config import ReconConfig
from recon.evaluation.evaluate import evaluate
from recon.pipeline import reconstruct
from recon.readers import open_recording
from twin.cli.given import settings
from twin.errors import FuntwinError
from twin.files.text import read_json
from twin.runs.manifest import MANIFEST
from twin.storage import load

# metric as the evaluation names it -> column
COLUMNS = {
    "type right": "type",
    "axis": "axis °",
    "pivot, point to line": "pivot mm",
    "state": "state",
    "range": "range",
    "ATE": "ATE mm",
    "up": "up °",
    "part mIoU": "part mIoU",
    "hand mIoU": "hand mIoU",
    "hand on hand-free frames": "hand f.p.",
    "part mesh accuracy": "part mm",
    "part mesh completeness": "part compl.",
    "static mesh accuracy": "static mm",
    "contact": "contact mm",
    "interval IoU": "interval",
    "closed end right": "closed",
}


def measure(recording: Path, runs: Path, config: ReconConfig) -> dict[str, Any]:
    """Figures of one recording by column, the goals it missed, and its stages' seconds and peak memory."""
    run = runs / recording.name
    try:
        reconstruct(open_recording(recording), config, out=run)
        result = evaluate(load(run), recording / "truth")
    except FuntwinError as e:
        return {"name": recording.name, "error": str(e)}
    (run / "evaluation.json").write_text(json.dumps(result.as_dict(), indent=1))
    by_metric: dict[str, list[str]] = {}
    for row in result.rows:
        if row.part != "all parts":
            text = f"{row.value:.3g}" + (f" {row.unit}" if row.metric in ("state", "range") else "")
            by_metric.setdefault(row.metric, []).append(text)
    missed = [f"{r.metric} {r.value:.3g} ({r.goal})" for r in result.rows if r.ok is False]
    stages = {s["name"]: s for s in read_json(run / MANIFEST)["stages"]}
    return {
        "name": recording.name,
        "figures": {c: " / ".join(by_metric.get(m, ["-"])) for m, c in COLUMNS.items()},
        "missed": missed,
        "seconds": {n: s["seconds"] for n, s in stages.items()},
        "peak_mb": max(s["peak_mb"] for s in stages.values()),
    }


def tables(rows: list[dict[str, Any]]) -> str:
    """Two Markdown tables: accuracy with missed goals, then seconds and memory."""
    good = [r for r in rows if "error" not in r]
    lines = ["| recording | " + " | ".join(COLUMNS.values()) + " | missed goals |"]
    lines.append("|---" * (len(COLUMNS) + 2) + "|")
    for r in rows:
        cells = ["failed", *[""] * (len(COLUMNS) - 1), r["error"]] if "error" in r else [
            *r["figures"].values(), "; ".join(r["missed"]) or "none"
        ]  # fmt: skip
        lines.append(f"| {r['name']} | " + " | ".join(cells) + " |")
    met = sum(not r["missed"] for r in good)
    lines += ["", f"{met} of {len(rows)} recordings meet every goal.", ""]
    stages = list(dict.fromkeys(n for r in good for n in r["seconds"]))
    lines += ["| recording | " + " | ".join(f"{s} s" for s in stages) + " | sum s | peak MB |"]
    lines.append("|---" * (len(stages) + 3) + "|")
    for r in good:
        seconds = [r["seconds"].get(s, 0.0) for s in stages]
        cells = [*(f"{s:.1f}" for s in seconds), f"{sum(seconds):.0f}", f"{r['peak_mb']:.0f}"]
        lines.append(f"| {r['name']} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main(argv: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("runs", type=Path, help="folder of the run folders")
    parser.add_argument("recordings", type=Path, nargs="+", help="recordings with truth/")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a setting")
    parser.add_argument("--table", type=Path, help="also write the tables here")
    options = parser.parse_args(argv)
    config = settings(ReconConfig, None, options.set)
    rows = []
    for recording in options.recordings:
        rows.append(measure(recording, options.runs, config))
        print(
            f"{recording.name}: {rows[-1].get('error') or rows[-1]['missed'] or 'all goals met'}", flush=True
        )
    text = tables(rows)
    print(text)
    if options.table:
        options.table.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

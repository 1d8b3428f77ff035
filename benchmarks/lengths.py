"""What a recording costs by its length: one walk cut to several lengths, a table for `speed.md`.

    python -m benchmarks.lengths WALK [--seconds 10 30 60 120 180 600] [--keep FILE]

Each length is `twin reconstruct --end S` with its report in a process of its own, once, after a first run
that fills the caches. FILE keeps what is measured, a length a line, so that a stopped run goes on. Only an
idle machine gives figures that mean something. The line is that of least squares through all lengths.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.speed import measured
from recon.readers import open_recording

_LENGTHS = (10.0, 30.0, 60.0, 120.0, 180.0, 600.0)
Row = Mapping[str, float]


def table(rows: Sequence[Row]) -> list[str]:
    """A row a length, then what a further second costs and how far the lengths are off their line."""
    lines = ["| s | frames | wall s | times its length | CPU s | peak MB |", "|---|---|---|---|---|---|"]
    lines += [
        f"| {r['seconds']:g} | {r['frames']:.0f} | {r['wall']:.0f} | {r['wall'] / r['seconds']:.1f} | {r['cpu']:.0f} | "
        f"{r['peak_mb']:.0f} |"
        for r in rows
    ]
    if len(rows) < 3:
        return lines
    seconds, frames = (np.array([r[k] for r in rows]) for k in ("seconds", "frames"))
    for what, along, unit in (("wall", seconds, "s a second"), ("peak_mb", frames, "MB a frame")):
        values = np.array([r[what] for r in rows])
        slope, offset = np.polyfit(along, values, 1)
        off = np.abs(slope * along + offset - values) / values
        name = {"wall": "Wall time", "peak_mb": "Memory"}[what]
        worst = rows[int(np.argmax(off))]["seconds"]
        lines.append(
            f"\n{name}: {slope:.3g} {unit}; farthest off its line at {worst:g} s, by {off.max():.0%}."
        )
    return lines


def main(argv: Sequence[str] | None = None) -> int:
    """Measure what is missing and print the table; 0 when done."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("walk", type=Path)
    parser.add_argument("--seconds", type=float, nargs="+", default=_LENGTHS)
    parser.add_argument("--keep", type=Path, default=Path("out/lengths.jsonl"))
    args = parser.parse_args(argv)
    times = open_recording(args.walk).times
    times = times - times[0]
    wanted = sorted(s for s in args.seconds if s <= times[-1] + 1.0)
    kept = [json.loads(line) for line in args.keep.read_text().splitlines()] if args.keep.is_file() else []
    args.keep.parent.mkdir(parents=True, exist_ok=True)
    left = [s for s in wanted if s not in {r["seconds"] for r in kept}]
    if left:
        measured(args.walk, "--end", f"{wanted[0]:g}")
    for seconds in left:
        cost = measured(args.walk, "--end", f"{seconds:g}")
        row = {"seconds": seconds, "frames": int((times <= seconds).sum()), "wall": cost.wall, "cpu": cost.cpu, "peak_mb": cost.peak_mb}  # fmt: skip
        kept.append(row)
        with args.keep.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        print(*table([row])[2:], sep="\n", flush=True)
    print(*table(sorted(kept, key=lambda r: r["seconds"])), sep="\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

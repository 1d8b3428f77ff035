"""Wall time, CPU time and memory of whole reconstructions, and where the time goes: `speed.md`.

    python benchmarks/speed.py RECORDING [RECORDING ...] [--times N] [--page FILE]

Each run is `twin reconstruct` with its report in a process of its own. The first run of each recording fills
the caches of compiled kernels and of the disk and is not counted; of the others, medians are told. Only an
idle machine gives figures that mean something.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from twin.files.text import read_json
from twin.runs.manifest import MANIFEST

HEAD = """# Speed of whole reconstructions

`python benchmarks/speed.py RECORDING ...`: `twin reconstruct` with its report, default settings, kernels cached, {cores} cores of an idle
machine, medians of {times} runs. A stage's seconds are wall time; what is outside of them is imports, reading, writing and the report.
"""


@dataclass(frozen=True)
class Cost:
    """Wall and CPU seconds, peak memory in MB, seconds of each stage."""

    wall: float
    cpu: float
    peak_mb: float
    stages: dict[str, float]


def measured(recording: Path, *words: str) -> Cost:
    """One reconstruction, with further words of the command line.

    Raises CalledProcessError where it fails; a verdict other than trusted is none.
    """
    with tempfile.TemporaryDirectory(prefix="speed") as place:
        run = Path(place) / "run"
        command = [sys.executable, "-m", "twin", "reconstruct", str(recording), "-o", str(run), *words]
        start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode not in (0, 2):
            raise subprocess.CalledProcessError(done.returncode, command)
        stages = read_json(run / MANIFEST)["stages"]
    return Cost(
        wall,
        after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
        max(s["peak_mb"] for s in stages),
        {s["name"]: s["seconds"] for s in stages},
    )


def typical(costs: list[Cost]) -> Cost:
    """Medians, each figure for itself; of memory the most."""
    names = costs[0].stages
    return Cost(
        median(c.wall for c in costs),
        median(c.cpu for c in costs),
        max(c.peak_mb for c in costs),
        {n: median(c.stages[n] for c in costs) for n in names},
    )


def page(costs: dict[str, Cost], times: int) -> str:
    """The page: a column for each recording, a row for each stage, then the whole."""
    names = list(dict.fromkeys(n for c in costs.values() for n in c.stages))
    rows = [[f"{n} s", *(f"{c.stages[n]:.1f}" for c in costs.values())] for n in names]
    rows.append(["outside of stages s", *(f"{c.wall - sum(c.stages.values()):.1f}" for c in costs.values())])
    rows.append(["whole s", *(f"{c.wall:.1f}" for c in costs.values())])
    rows.append(["CPU s", *(f"{c.cpu:.1f}" for c in costs.values())])
    rows.append(["peak MB", *(f"{c.peak_mb:.0f}" for c in costs.values())])
    lines = [HEAD.format(cores=len(os.sched_getaffinity(0)), times=times), f"| | {' | '.join(costs)} |"]
    lines += ["|---" * (len(costs) + 1) + "|", *(f"| {' | '.join(r)} |" for r in rows), ""]
    lines.append(f"Median of the whole: {median(c.wall for c in costs.values()):.1f} s.")
    return "\n".join(lines) + "\n"


def main(argv: list[str]) -> int:
    """Measure and write the page; 0 when done."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--times", type=int, default=3, help="counted runs of each recording")
    parser.add_argument("--page", type=Path, default=Path(__file__).with_suffix(".md"))
    options = parser.parse_args(argv)
    costs = {}
    for recording in options.recordings:
        measured(recording)
        costs[recording.name] = typical([measured(recording) for _ in range(options.times)])
        print(f"{recording.name}: {costs[recording.name].wall:.1f} s", flush=True)
    options.page.write_text(page(costs, options.times), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

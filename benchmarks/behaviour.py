"""How the parts of exported twins behave in MuJoCo: the worst of the three formats, for run folders that were
exported.

python benchmarks/behaviour.py RUN... [-o benchmarks/behaviour.md]
"""

from __future__ import annotations

import argparse
import resource
from pathlib import Path

import mujoco

from twin.storage import load
from twin.verification import SUFFIX
from twin.verification.behaviour import BehaviourReport, behave

COLUMNS = ("rest_m", "rest_half_open_m", "open", "close", "sweep_m", "energy", "demonstration_m")
HEADS = ("rest mm", "half open mm", "open", "close", "sweep mm", "energy", "demonstration mm (allowed)")


def lines(name: str, report: BehaviourReport, seconds: float) -> list[str]:
    """One line a part."""
    out = []
    for part in dict.fromkeys(r.part for r in report.rows):
        cells = []
        for column in COLUMNS:
            rows = [r for r in report.rows if (r.part, r.quantity) == (part, column)]
            if not rows:
                cells.append("-")
                continue
            worst = max(r.measured for r in rows)
            text = f"{1e3 * worst:.2f}" if column.endswith("_m") else f"{worst:.0%} left"
            if column == "energy":
                text = f"{worst:+.1%}"
            elif column == "demonstration_m":
                text += f" ({1e3 * rows[0].limit:.1f})"
            cells.append(text)
        failed = [f"{r.format} {r.quantity}" for r in report.failures if r.part == part]
        verdict = ", ".join(failed) or "ok"
        out.append(f"| {name} | {part} | {' | '.join(cells)} | {verdict} | {seconds:.1f} |")
    return out + [f"| {name} | {w} |" for w in report.warnings]


def _cpu_seconds() -> float:
    """What the probes took so far; their wall time depends on what else the machine does."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN")
    parser.add_argument("-o", "--out", type=Path)
    args = parser.parse_args()
    page = [
        "# How exported parts behave",
        "",
        "`python benchmarks/behaviour.py RUN... -o benchmarks/behaviour.md` writes this page; `twin/verification/behaviour.py` says what is asked and",
        f"allowed. MuJoCo {mujoco.__version__}, the worst of URDF, MJCF and USD; CPU seconds for all three.",
        "",
        "| twin | part | " + " | ".join(HEADS) + " | verdict | CPU s |",
        "|---" * (len(HEADS) + 4) + "|",
    ]
    asked = met = 0
    for run in args.runs:
        twin, started = load(run), _cpu_seconds()
        report = behave(twin, {f: run / "export" / f / f"{twin.name}{s}" for f, s in SUFFIX.items()})
        page += lines(run.name, report, _cpu_seconds() - started)
        asked, met = asked + len(report.rows), met + sum(r.ok for r in report.rows)
        print(page[-1], flush=True)
    page += ["", f"{met} of {asked} demands met.", ""]
    if args.out:
        args.out.write_text("\n".join(page), encoding="utf-8")
    print("\n".join(page))


if __name__ == "__main__":
    main()

"""Ask every engine whether it reads what the twin says, and write benchmarks/engines.md.

usage: python benchmarks/engines.py [RUN ...] [--count 200] [--engines all] [--processes 2] [--out FILE.md]

Random twins (benchmarks/scenes/random_twins.py) and the twins of the RUN folders are exported by this code
and probed, each engine in processes of its own. `make engines` sets the engines up.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from datetime import date
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.scenes.random_twins import random_twin
from twin.exporters import complete, export
from twin.scene import Twin
from twin.storage import load
from twin.verification import CheckReport, check_many, chosen_engines
from twin.verification.compare import FIELDS, TOLERANCE, tolerance
from twin.verification.exceptions import TABLE, unsupported
from twin.verification.process import ENGINES
from twin.verification.tables import exceptions

HERE = Path(__file__).resolve().parent


def main(arguments: Sequence[str]) -> int:
    """Exit code 2 when something does not agree."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", metavar="RUN", nargs="*", type=Path, help="folders that hold twin/")
    parser.add_argument("--count", type=int, default=200, help="random twins [200]")
    parser.add_argument("--engines", nargs="+", default=["all"], help="names [all]")
    parser.add_argument("--processes", type=int, default=2, help="engines at a time [2]")
    parser.add_argument(
        "--out", type=Path, default=HERE / "engines.md", help="file to write [benchmarks/engines.md]"
    )
    options = parser.parse_args(arguments)
    engines = chosen_engines(options.engines)
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        twins = [random_twin(seed) for seed in range(options.count)]
        twins += [complete(load(run)) for run in options.runs]
        files = [dict(export(t, Path(folder) / str(k))) for k, t in enumerate(twins)]
        print(f"{len(twins)} twins exported in {time.perf_counter() - started:.0f} s", flush=True)
        reports = check_many(list(zip(twins, files, strict=True)), engines, options.processes)
    seconds = time.perf_counter() - started
    text = page(twins, reports, engines, options, seconds)
    options.out.write_text(text, encoding="utf-8")
    print(text)
    return 0 if all(r.ok for r in reports) else 2


def page(
    twins: Sequence[Twin], reports: Sequence[CheckReport], engines: Sequence[str], options: argparse.Namespace,
    seconds: float,
) -> str:  # fmt: skip
    """The committed page."""
    columns = [(e, f) for e in engines for f in ENGINES[e]]
    recorded = twins[options.count :]
    parts = sum(len(t.parts) for t in twins)
    agree = sum(r.ok for r in reports)
    words = " ".join(
        ["python benchmarks/engines.py", "RUN ..." if recorded else "", f"--count {options.count}"]
    )
    lines = [
        "# Do the engines agree with the twin?",
        "",
        f"Written by `{' '.join(words.split())}` on {date.today().isoformat()}: "
        f"{options.count} random twins of benchmarks/scenes/random_twins.py"
        + (f" and {len(recorded)} from recordings ({', '.join(t.name for t in recorded)})" if recorded else "")
        + f", {parts} moving parts in all; {seconds / 60:.0f} minutes.",
        "",
        (f"**{agree} of {len(twins)} twins agree in every engine and format** on every field that it takes. A field is compared with "
        "what follows from the twin by plain arithmetic (twin/verification/expected.py), which shares no code with the exporters."),
        "",
        (
            "The rollout starts in the middle of every range at half the range per second, every second part backwards, and goes on for "
            "0.5 s with gravity and joint damping. Contacts, limits and dry friction are taken out in every engine, and so is what an "
            "engine adds of its own (default motors, drag, speed limits); engines of first order are extrapolated to a step of zero "
            "(twin/probes). Added joint inertia counts where the format and the engine carry it."
        ),
        "",
        "## Largest difference over all twins",
        "",
        ("Allowed is the largest difference that passes; ten times that for engines in single precision (\\*). axis_deg in degrees; pivot_m, "
        "com_m, mesh_bounds_m, self_collision_m in metres; lower, upper and motion in metres or radians; rollout relative to the way "
        "of the joint or its range, whichever is more; the rest relative. In brackets: known not to be supported, see below."),
        "",
    ]  # fmt: skip
    lines += _differences(reports, columns)
    lines += ["", "## What does not agree", "", *_failures(twins, reports)]
    lines += ["", "## Known not to be supported", ""]
    head, rows = exceptions(set(engines), set(ENGINES["mujoco"]))
    lines += _markdown([*head, "seen"], [[*r, s] for r, s in zip(rows, _seen(reports, engines), strict=True)])
    lines += [
        "", ("A field of this table is compared all the same where the engine yields one; `seen` says in how many parts it still "
        "differed. When one agrees although the twin's value is not what the engine uses instead, `twin check` calls it an unexpected pass."),
        "", "## Engines", "", *_engines(reports, columns), "",
    ]  # fmt: skip
    return "\n".join(lines)


def _differences(reports: Sequence[CheckReport], columns: Sequence[tuple[str, str]]) -> list[str]:
    worst: dict[tuple[str, str, str], float] = {}
    for r in (row for report in reports for row in report.rows):
        key = r.consumer, r.format, r.field
        worst[key] = max(worst.get(key, 0.0), r.difference)
    rows = []
    for field in FIELDS:
        cells = []
        for e, f in columns:
            text = f"{worst[e, f, field]:.1g}" if (e, f, field) in worst else ""
            if text and unsupported(e, f, field):
                text = f"({text})"
            elif text and worst[e, f, field] > tolerance(e, field):
                text = f"**{text}**"
            cells.append(text)
        rows.append([field, f"{TOLERANCE[field]:g}", *cells])
    stars = {e: "\\*" if tolerance(e, "mass") > TOLERANCE["mass"] else "" for e, _ in columns}
    return _markdown(["field", "allowed", *(f"{e}{stars[e]} {f}" for e, f in columns)], rows)


def _failures(twins: Sequence[Twin], reports: Sequence[CheckReport]) -> list[str]:
    lines = []
    for t, report in zip(twins, reports, strict=True):
        lines += [f"- {t.name}: {w}" for w in report.warnings]
        lines += [
            f"- {t.name}, {r.part}, {r.consumer} {r.format}, {r.field}: {r.difference:.2g} of {r.tolerance:g}"
            for r in report.failures
        ]
        lines += [
            f"- {t.name}, {r.part}, {r.consumer} {r.format}, {r.field}: unexpected pass"
            for r in report.unexpected
        ]
    return lines or ["Nothing."]


def _seen(reports: Sequence[CheckReport], engines: Sequence[str]) -> list[str]:
    """For every entry of the table: in how many parts the field was measured and differed."""
    out = []
    for e in TABLE:
        if e.engine in (*engines, "any"):
            rows = [
                r for report in reports for r in report.rows
                if r.field == e.field and r.format == e.format and e.engine in (r.consumer, "any")
            ]  # fmt: skip
            out.append(f"{sum(not r.agrees for r in rows)} of {len(rows)}" if rows else "not measured")
    return out


def _engines(reports: Sequence[CheckReport], columns: Sequence[tuple[str, str]]) -> list[str]:
    rows = []
    for e, f in columns:
        times = [r.seconds[e, f] for r in reports if (e, f) in r.seconds]
        version = next((r.versions[e] for r in reports if r.versions.get(e)), "")
        rows.append(
            [e, version, f, str(len(times)), f"{sum(times):.0f}", f"{sum(times) / max(len(times), 1):.2f}"]
        )
    return _markdown(["engine", "version", "format", "files", "seconds", "a file"], rows)


def _markdown(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [columns, ["---"] * len(columns), *rows]
    return ["| " + " | ".join(line) + " |" for line in lines]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

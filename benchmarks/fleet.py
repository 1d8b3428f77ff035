"""What a batch of recordings costs, and what becomes of faults planted in one: `fleet.md`.

    python -m benchmarks.fleet workers WORK [--backend processes ray] [--workers 1 2 4 8 16] [--seconds 20]
                                            [--units 4] [--memory 200] [--note TEXT]
    python -m benchmarks.fleet disk WORK [--recording assets/recordings/cabinet_drawer]
    python -m benchmarks.fleet planted WORK [RECORDING ...] [--timeout 600] [--workers 2]

`workers` takes stand-in units, which sleep and hold memory, through `twin batch` with so many workers; it
needs no idle machine to tell whether workers get in each other's way, but says what its load was. `disk`
measures the run of one real recording by what `--keep` leaves. `planted` takes real recordings and plants
faults among them (benchmarks/fleet_planted.py). WORK/results.json keeps all figures; each call writes the
page from them.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from benchmarks import fleet_page, fleet_planted
from twin.batch import work as at_work
from twin.batch.journal import latest
from twin.batch.work import slim
from twin.cli.main import run as twin_verb
from twin.files.text import read_json

ROOT = Path(__file__).resolve().parents[1]
UNIT = ROOT / "benchmarks" / "fleet_unit.py"
KEEPS = ("all", "exports", "twin")
_TICK = os.sysconf("SC_CLK_TCK")


def cpu_seconds() -> float:
    """CPU seconds of this process, of its children, theirs, and of all that these have waited for."""
    parents: dict[int, int] = {}
    used: dict[int, float] = {}
    for process in Path("/proc").iterdir():
        if process.name.isdecimal():
            try:
                fields = (process / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            parents[int(process.name)] = int(fields[1])
            used[int(process.name)] = sum(map(int, fields[11:15])) / _TICK
    total = 0.0
    for process_id, seconds in used.items():
        above = process_id
        while above not in (0, os.getpid()):
            above = parents.get(above, 0)
        total += seconds if above else 0.0
    return total


class Watch:
    """The most CPU seconds seen; Ray's processes are gone at the end."""

    def __init__(self) -> None:
        self._began = self._most = cpu_seconds()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look)
        self._thread.start()

    def _look(self) -> None:
        while not self._over.wait(1.0):
            self._most = max(self._most, cpu_seconds())

    def end(self) -> float:
        self._over.set()
        self._thread.join()
        return max(self._most, cpu_seconds()) - self._began


@contextmanager
def cluster(workers: int, memory_mb: int) -> Iterator[list[str]]:
    """Options of a Ray cluster on this machine, whose one node is said to have the cores that workers ask."""
    from ray.cluster_utils import Cluster

    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    os.environ["PYTHONPATH"] = str(ROOT)
    cores = max(workers, len(os.sched_getaffinity(0)))
    node = {"num_cpus": cores, "memory": 4_000_000 * memory_mb * workers, "include_dashboard": False}
    ray = Cluster(initialize_head=True, head_node_args=node)
    try:
        yield ["--backend", "ray", "--address", ray.address]
    finally:
        ray.shutdown()


def stand_ins(folder: Path, count: int) -> str:
    """So many recordings that only have a name; returns what `twin batch` takes."""
    for k in range(count):
        place = folder / f"unit_{k:04d}"
        place.mkdir(parents=True, exist_ok=True)
        (place / "name.txt").write_text(place.name)
    return f"{folder}/*"


def measured(backend: str, workers: int, options: argparse.Namespace) -> dict[str, Any]:
    """Stand-in units on so many workers."""
    count, out = options.units * workers, options.work / "out"
    shutil.rmtree(options.work / "recordings", ignore_errors=True)
    shutil.rmtree(out, ignore_errors=True)
    given = stand_ins(options.work / "recordings", count)
    at_work.PROGRAM = (sys.executable, str(UNIT), str(options.seconds), str(options.memory))
    limit = str(2e-3 * options.memory + 0.1)
    command = ["batch", given, "-o", str(out), "--do", "reconstruct", "--workers", str(workers)]
    load = os.getloadavg()[0]
    with cluster(workers, options.memory + 50) if backend == "ray" else nullcontext(list[str]()) as where:
        watch, began = Watch(), time.monotonic()
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as said:
            code = twin_verb([*command, "--memory", limit, "--json", *where])
        seconds, cpu = time.monotonic() - began, watch.end()
    rows = latest(out)
    if code or len(rows) != count:
        raise SystemExit(
            f"{backend}, {workers} workers: exit code {code}, {len(rows)} of {count}: {said.getvalue()[-500:]}"
        )
    runs = [out / "runs" / unit for unit in sorted(rows)]
    twins = hashlib.sha256(b"".join((run / "twin" / "twin.json").read_bytes() for run in runs[:2]))
    own = sum(float(read_json(run / "cpu.json")["seconds"]) for run in runs)
    return {
        "backend": backend, "workers": workers, "units": count, "unit_s": options.seconds, "unit_mb": options.memory,
        "seconds": round(seconds, 2), "overhead_cpu_s": round((cpu - own) / count, 3), "load": round(load, 1),
        "twins": twins.hexdigest()[:12],
    }  # fmt: skip


def disk(recording: Path, work: Path) -> dict[str, Any]:
    """Bytes of the run of one recording by what is kept of it."""
    out = work / "disk"
    command = [sys.executable, "-m", "twin", "batch", str(recording), "-o", str(out), "--workers", "1"]
    subprocess.run([*command, "--do", "reconstruct,evaluate,export"], check=True, stdout=subprocess.DEVNULL)
    (unit,) = latest(out)
    told: dict[str, Any] = {"recording": recording.name}
    for keep in KEEPS:
        copy = work / f"keep_{keep}"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(out / "runs" / unit, copy, copy_function=os.link)
        slim(copy, keep)
        told[keep] = sum(p.stat().st_size for p in copy.rglob("*") if p.is_file())
        shutil.rmtree(copy)
    return told


def _parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    what = parser.add_subparsers(dest="what", required=True)
    each = {name: what.add_parser(name) for name in ("workers", "disk", "planted")}
    for one in each.values():
        one.add_argument("work", type=Path)
        one.add_argument("--page", type=Path, default=Path(__file__).with_suffix(".md"))
    add = each["workers"].add_argument
    add("--backend", nargs="+", choices=("processes", "ray"), default=["processes", "ray"])
    add("--workers", nargs="+", type=int, default=[1, 2, 4, 8, 16])
    add("--seconds", type=float, default=20.0, help="that a unit sleeps")
    add("--units", type=int, default=4, help="for each worker")
    add("--memory", type=int, default=200, help="MB that a unit holds")
    add("--note", default="", help="what else the machine did, for the page")
    shipped = ROOT / "assets" / "recordings" / "cabinet_drawer"
    each["disk"].add_argument("--recording", type=Path, default=shipped)
    add = each["planted"].add_argument
    add("recordings", nargs="*", type=Path, default=[shipped])
    add("--timeout", type=float, default=600.0, help="s of a unit; more than a recording takes here")
    add("--workers", type=int, default=2)
    return parser.parse_args()


def main() -> int:
    options = _parsed()
    options.work = options.work.resolve()
    options.work.mkdir(parents=True, exist_ok=True)
    results = fleet_page.Results(options.work / "results.json", options.page)
    if options.what == "disk":
        results.keep("disk", disk(options.recording.resolve(), options.work))
    elif options.what == "planted":
        given = [r.resolve() for r in options.recordings]
        results.keep("planted", fleet_planted.tried(given, options.work / "planted", options))
    else:
        for backend in options.backend:
            for workers in options.workers:
                row = measured(backend, workers, options)
                results.row(row, options.note)
                print({**row, "efficiency": round(fleet_page.efficiency(row), 3)}, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

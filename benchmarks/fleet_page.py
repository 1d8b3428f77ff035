"""The page of benchmarks/fleet.py from its figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twin.files.text import read_json, write_json, write_text

# Of one clip on two idle cores: seconds (median of benchmarks/speed.md).
CLIP_S, CLIP_CORES = 63.3, 2

HEAD = """# What a batch of recordings costs

`python -m benchmarks.fleet workers|disk|planted WORK` measures, and writes this page ([how batches work](../docs/fleets.md)).
"""
WORKERS = """
## Workers

Stand-in units: each sleeps {unit_s:g} s and holds {unit_mb} MB, as reconstructions would ask for cores that one machine lacks. A unit is a process
of its own, begun, watched and told as a recording is. Efficiency is units x {unit_s:g} s / (workers x seconds), where seconds are the whole
`twin batch`: for Ray with connecting to a cluster that runs (one node on this machine that says it has a core a worker) and starting a
process of Ray a worker. CPU is what all takes beside the units' own.

{note}
"""
RECKONED = """
## Clips an hour, reckoned

Not measured: {clip} s a clip on {cores} idle cores ([speed](speed.md)) times the efficiency of processes above. {cores} cores a worker.
"""
DISK = """
## Bytes on disk

The recording {recording} through `--do reconstruct,evaluate,export`, one run. What `--keep twin` leaves is
twin, report and settings.

| `--keep` | MB a recording | recordings on 1 TB |
|---|---|---|
"""
PLANTED = """
## Planted faults

Real reconstructions ({recordings}), {workers} workers; units without a fault among them: {of}. Lost is a unit that was told as done and is not
any more, that the retry does not do, or whose twin is other than that of a batch left alone (provenance and name aside).

| planted | told | lost | `--retry failed` does |
|---|---|---|---|
"""


class Results:
    """Figures in a file, and the page that is written from them."""

    def __init__(self, path: Path, page: Path) -> None:
        self._path, self._page = path, page

    def keep(self, what: str, told: Mapping[str, Any]) -> None:
        """Keep the figures of one part in place of the former ones."""
        data = {**read_json(self._path), what: dict(told)}
        write_json(self._path, data)
        write_text(self._page, page(data))

    def row(self, row: Mapping[str, Any], note: str) -> None:
        """Keep a row of the workers; those of other units go."""
        same = ("unit_s", "unit_mb")
        rows = [
            r for r in read_json(self._path).get("workers", {}).get("rows", [])
            if all(r[k] == row[k] for k in same) and (r["backend"], r["workers"]) != (row["backend"], row["workers"])
        ]  # fmt: skip
        rows = sorted([*rows, row], key=lambda r: (r["backend"], r["workers"]))
        self.keep("workers", {"rows": rows, "note": note})


def efficiency(row: Mapping[str, Any]) -> float:
    """Serial seconds of the units over those that all workers had."""
    return float(row["units"] * row["unit_s"] / (row["workers"] * row["seconds"]))


def page(data: Mapping[str, Any]) -> str:
    """All parts whose figures are there."""
    out = [HEAD]
    if "workers" in data:
        out += _workers(data["workers"]["rows"], data["workers"]["note"])
    if "disk" in data:
        told = data["disk"]
        out.append(DISK.format(**told))
        for keep in ("all", "exports", "twin"):
            out.append(f"| {keep} | {told[keep] / 1e6:.1f} | {1e12 / told[keep]:,.0f} |\n")
    if "planted" in data:
        told = data["planted"]
        out.append(PLANTED.format(**{**told, "recordings": ", ".join(told["recordings"])}))
        out += [f"| {' | '.join(map(str, row))} |\n" for row in told["rows"]]
    return "".join(out)


def _workers(rows: Sequence[Mapping[str, Any]], note: str) -> list[str]:
    out = [WORKERS.format(**rows[0], note=note).rstrip() + "\n\n"]
    out.append("| by | workers | units | s | units an hour | efficiency | CPU s a unit | load before |\n")
    out.append("|---|---|---|---|---|---|---|---|\n")
    for r in rows:
        hour = 3600 * r["units"] / r["seconds"]
        cells = [r["backend"], r["workers"], r["units"], f"{r['seconds']:.1f}", f"{hour:.0f}"]
        cells += [f"{100 * efficiency(r):.1f} %", f"{r['overhead_cpu_s']:.2f}", r["load"]]
        out.append(f"| {' | '.join(map(str, cells))} |\n")
    same = len({r["twins"] for r in rows}) == 1
    out.append(
        f"\nTwins of two units that all rows share are {'the same' if same else 'NOT the same'} bytes.\n"
    )
    out.append(RECKONED.format(clip=CLIP_S, cores=CLIP_CORES))
    out.append("\n| workers | cores | clips an hour |\n|---|---|---|\n")
    for r in rows:
        if r["backend"] == "processes":
            an_hour = r["workers"] * 3600 / CLIP_S * min(1.0, efficiency(r))
            out.append(f"| {r['workers']} | {CLIP_CORES * r['workers']} | {an_hour:.0f} |\n")
    return out

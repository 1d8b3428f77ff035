"""DIR/index.html: a card for each unit, with filters and totals, beside the runs that it leads to."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from scipy.stats import binomtest

from twin.batch.batch import State
from twin.batch.table import parts_of
from twin.files.text import read_json, write_text
from twin.page.template import template

INDEX = "index.html"
_LEVELS = ("trusted", "doubtful", "refused", "failed", "working", "waiting")


def write_page(folder: Path, state: State) -> Path:
    """Write the page of a batch as it is now, whole or not at all."""
    cards = [_card(folder, u.id, u.source, state) for u in state.units]
    rows = [state.rows[u.id] for u in state.units if u.id in state.rows]
    context = {
        "name": folder.resolve().name,
        "cards": cards,
        "counts": [(level, sum(c["level"] == level for c in cards)) for level in _LEVELS],
        "reasons": Counter(r for row in rows for r in row.get("reasons", [])).most_common(12),
        "totals": _totals(folder, rows),
        "left": None if state.seconds_left is None or state.done == len(cards) else _time(state.seconds_left),
    }
    write_text(folder / INDEX, str(template(Path(__file__).parent / "index.html.j2").render(context)))
    return folder / INDEX


def _card(folder: Path, unit: str, source: str, state: State) -> dict[str, Any]:
    row = state.rows.get(unit)
    run = folder / "runs" / unit
    base = {
        "id": unit,
        "source": source,
        "picture": "",
        "report": "",
        "parts": [],
        "error": "",
        "reasons": [],
        "missed": [],
    }
    if row is None:
        doing = state.busy.get(unit, "")
        return {
            **base,
            "level": "working" if doing else "waiting",
            "doing": doing,
            "seconds": "",
            "memory": "",
        }
    pictures = sorted((run / "report").glob("frame_*.jpg"))
    twin = read_json(run / "twin" / "twin.json") if row.get("verdict") else {}
    return {
        **base,
        "level": "failed" if row["exit"] == 1 else row.get("verdict") or "failed",
        "doing": "",
        "seconds": _time(row["seconds"]),
        "memory": f"{row['peak_mb'] / 1000:.1f} GB",
        "picture": pictures[len(pictures) // 2].relative_to(folder).as_posix() if pictures else "",
        "report": f"runs/{unit}/report.html" if (run / "report.html").is_file() else "",
        "parts": [_part(p) for p in twin.get("parts", [])],
        "error": row.get("error", ""),
        "reasons": sorted(set(row.get("reasons", []))),
        "missed": [v for v, s in row.get("steps", {}).items() if s["exit"] == 2 and v != "reconstruct"],
    }


def _part(part: Mapping[str, Any]) -> str:
    joint = part["joint"]
    turns = joint["type"] == "revolute"
    span = joint["upper"] - joint["lower"]
    return f"{part['name']}: {'hinge' if turns else 'slide'}, " + (
        f"{span * 57.29578:.0f}°" if turns else f"{1000 * span:.0f} mm"
    )


def _totals(folder: Path, rows: Sequence[Mapping[str, Any]]) -> list[tuple[str, str]]:
    """Rates with their intervals, and sums."""
    parts = [p for r in rows for p in parts_of(folder, r)]
    found = [p for p in parts if p.get("part")]
    true = [p for p in parts if p.get("true_part")]
    out = [
        ("done", f"{len(rows)}"),
        ("with a twin", rate(sum(bool(r.get("verdict")) for r in rows), len(rows))),
        ("trusted twins", rate(sum(r.get("verdict") == "trusted" for r in rows), len(rows))),
        ("parts", f"{len(found)}"),
        ("trusted parts", rate(sum(p["verdict"] == "trusted" for p in found), len(found))),
    ]
    if true:
        good = sum(float(p.get("success", 0)) == 1.0 for p in true)
        out.append(("true parts right, 5° and 2 cm", rate(good, len(true))))
    return [*out, ("computing", _time(sum(r["seconds"] for r in rows)))]


def rate(good: int, of: int) -> str:
    """A share with its Wilson 95 % interval."""
    if not of:
        return "-"
    low, high = binomtest(good, of).proportion_ci(method="wilson")
    return f"{good}/{of} = {100 * good / of:.0f} % [{100 * low:.0f}-{100 * high:.0f}]"


def _time(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"

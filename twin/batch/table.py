"""DIR/parts.csv: every part of every twin with its numbers, for pandas, DuckDB and spreadsheets."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from twin.files.text import read_json, write_text

TABLE = "parts.csv"
_NUMBERS = (
    "axis_x", "axis_y", "axis_z", "pivot_x", "pivot_y", "pivot_z", "lower", "upper", "axis_sigma_deg", "pivot_sigma_m",
    "state_sigma", "mass_kg",
)  # fmt: skip
# Of an evaluation, measures of parts by their columns here; m, rad and shares as `twin evaluate` prints them.
MEASURES = {
    "axis": "axis_error_deg", "pivot, point to line": "pivot_error_mm", "state": "state_error", "range": "range_error",
    "part mIoU": "miou", "contact": "contact_error_mm", "success, 5 deg and 2 cm": "success",
}  # fmt: skip
COLUMNS = ("id", "recording", "part", "type", "verdict", "probability", "reasons", "interactions", *_NUMBERS)
_TRUTH = ("true_part", *MEASURES.values())


def write_table(folder: Path, rows: Mapping[str, Mapping[str, Any]]) -> Path:
    """Write the parts of the units whose rows are given, refused ones left out as twins leave them out.

    A part that was evaluated has the name and the errors of the true part that it stands for. A true part
    that none stands for has a line of its own.
    """
    out = io.StringIO()
    table = csv.DictWriter(out, [*COLUMNS, *_TRUTH], restval="", lineterminator="\n")
    table.writeheader()
    for unit in sorted(rows):
        table.writerows(parts_of(folder, rows[unit]))
    write_text(folder / TABLE, out.getvalue())
    return folder / TABLE


def parts_of(folder: Path, row: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The lines of one unit."""
    run = folder / "runs" / row["id"]
    head = {"id": row["id"], "recording": row.get("recording", "")}
    measured = _measured(folder / "logs" / row["id"] / "evaluate.json")
    out = []
    for part in read_json(run / "twin" / "twin.json").get("parts", []):
        true = next((k for k, m in measured.items() if m.get("found") == part["name"]), "")
        told = {k: v for k, v in measured.get(true, {}).items() if k != "found"}
        out.append({**head, **_numbers(part), "true_part": true, **told})
    found = {line["true_part"] for line in out}
    missed = (k for k in measured if k not in found and not measured[k].get("found"))
    return [*out, *({**head, "true_part": k, "success": 0} for k in missed)]


def _numbers(part: Mapping[str, Any]) -> dict[str, Any]:
    joint, verdict = part["joint"], part.get("verdict") or {}
    sigma, inertial = joint.get("sigma") or {}, part.get("inertial") or {}
    pivot: Iterable[Any] = joint.get("pivot") or ("", "", "")
    values = [
        *joint["axis"], *pivot, joint["lower"], joint["upper"], sigma.get("axis_deg"), sigma.get("pivot_m"),
        sigma.get("state"), inertial.get("mass"),
    ]  # fmt: skip
    return {
        "part": part["name"],
        "type": joint["type"],
        "verdict": verdict.get("level", ""),
        "probability": verdict.get("probability", ""),
        "reasons": " ".join(r["type"] for r in verdict.get("reasons", [])),
        "interactions": len(part.get("motion", {}).get("intervals", [])),
        **{k: "" if v is None else v for k, v in zip(_NUMBERS, values, strict=True)},
    }


def _measured(evaluated: Path) -> dict[str, dict[str, Any]]:
    """Of each true part its measures, and `found`: the name of the part that stands for it."""
    told: dict[str, dict[str, Any]] = {}
    evaluation = read_json(evaluated)
    for row in evaluation.get("rows", []):
        column = MEASURES.get(row["metric"])
        if column is not None and row["part"] not in ("scene", "all parts"):
            told.setdefault(row["part"], {})[column] = row["value"]
    for true, found in evaluation.get("matched", {}).items():
        told.setdefault(true, {})["found"] = found
    return told

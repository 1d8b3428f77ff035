"""What the page shows of a robot's replay: pictures, film, and what happened in each phase."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from twin.files.text import read_json
from twin.report.pictures import jpeg, uri
from twin.report.plots import FILM_LIMIT, film_pictures
from twin.report.sections import Table

PHASE_COLUMNS = (
    "phase", "time", "open: peak / end", "at rest", "slip", "tool off plan", "torque", "unintended contacts", "what went wrong",
)  # fmt: skip


def replay_of(run: Path, film: Path) -> dict[str, Any]:
    """Pictures of one replay and, unless it is too long, its film."""
    small = film.stat().st_size <= FILM_LIMIT
    return {
        "title": " · ".join(film.parent.relative_to(run / "replay").parts),
        "pictures": [jpeg(p) for p in film_pictures(film)],
        "film": uri(film.read_bytes(), "video/mp4") if small else "",
        "path": film.relative_to(run).as_posix(),
        "phases": _phases(film.with_name("report.json")),
    }


def _phases(report: Path) -> Table | None:
    """What happened in each phase of a replay."""
    if not report.is_file():
        return None
    rows = [
        [
            row["phase"],
            f"{row['start']:.1f} to {row['end']:.1f} s",
            f"{100 * row['opening_peak']:z.0f} / {100 * row['opening_final']:z.0f} %",
            "yes" if row["at_rest"] else "no",
            f"{row['slip_mm']:.1f} mm",
            f"{row['tool_error_mm']:.1f} mm",
            f"{100 * row['torque_share']:.0f} %",
            str(row["unintended"]),
            row["reason"],
        ]
        for row in read_json(report)["phases"]
    ]
    return Table("phase by phase", PHASE_COLUMNS, rows)

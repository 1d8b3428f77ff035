"""What the page shows of a robot's replay: its motion in the scene, pictures, film, and what happened in each
phase."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from twin.files.text import read_json
from twin.report.pictures import jpeg, uri
from twin.report.plots import FILM_LIMIT, film_pictures
from twin.report.replayed import LINKS, Replayed, is_of, load_replayed, rounded
from twin.report.sections import Table
from twin.scene import Twin

PHASE_COLUMNS = (
    "phase", "time", "open: peak / end", "at rest", "slip", "tool off plan", "torque", "unintended contacts", "what went wrong",
)  # fmt: skip


@dataclass(frozen=True)
class Replays:
    """What the scene shows of a run's replays.

    told: of each, what the scripts play. robots: .glb files in base64, each once, by the number that `told`
    has. earlier: titles of those that were played with another twin, which the scene does not show.
    """

    told: tuple[dict[str, Any], ...] = ()
    robots: tuple[str, ...] = ()
    earlier: tuple[str, ...] = ()


def replays_of(run: Path, twin: Twin) -> Replays:
    """The replays of a run that say what the robot did; one of an earlier version left its film alone.

    Raises InputError for a damaged one.
    """
    told: list[dict[str, Any]] = []
    robots: dict[str, int] = {}
    earlier: list[str] = []
    for folder in sorted(p for p in (run / "replay").glob("*/*") if p.is_dir()):
        replayed = load_replayed(folder)
        if replayed is None:
            continue
        if not is_of(replayed, twin):
            earlier.append(replayed.title)
            continue
        glb = base64.b64encode((folder / LINKS).read_bytes()).decode()
        told.append({**_motion(replayed), "robot": robots.setdefault(glb, len(robots))})
    return Replays(tuple(told), tuple(robots), tuple(earlier))


def _motion(replayed: Replayed) -> dict[str, Any]:
    return {
        "title": replayed.title,
        "times": rounded(replayed.times),
        "states": {k: rounded(v) for k, v in replayed.states.items()},
        "links": {
            k: {"positions": rounded(at), "quaternions": rounded(turn)}
            for k, (at, turn) in replayed.links.items()
        },
        "column": replayed.column,
    }


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

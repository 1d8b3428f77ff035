"""The page of sealed rates: a row for each run, added and never taken off."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from scipy.stats import binomtest

HEAD = """# Recordings that nobody has looked at

`python -m benchmarks.unseen sealed` measures a commit on 160 random recordings (`twin simulate --random`) whose seeds follow from the
commit, deletes each with its run and logs at once, and keeps only counters. Every sealed run stays here. Definitions: docs/metrics.md.
Brackets hold Wilson 95 % intervals. A baseline row is an earlier commit's code on every fourth clip of the same seeds; it has no
verdicts, so all its parts count as trusted.
"""
COLUMNS = (
    "group", "clips", "parts", "success", "trusted", "trusted that succeed", "successes that are trusted", "invented", "doubtful",
    "failed clips with exit 1 or 2", "causes", "up wrong", "broken",
)  # fmt: skip
GROUPS = ("ordinary", "hard", "negative")
CAUSES = ("cameras", "missed", "type", "axis", "path", "labels")


def write_row(page: Path, commit: str, baseline: str | None, clips: int, counts: Mapping[str, int]) -> None:
    """Append the tables of one run to the page."""
    text = page.read_text(encoding="utf-8") if page.is_file() else HEAD
    page.write_text(text.rstrip() + "\n\n" + section(commit, baseline, clips, counts), encoding="utf-8")


def section(commit: str, baseline: str | None, clips: int, counts: Mapping[str, int]) -> str:
    """Title and two tables: rates by group, and successes by one factor at a time."""
    title = f"## {commit}" if baseline is None else f"## {baseline} on clips of {commit}"
    rows = [_cells(group, counts) for group in GROUPS]
    head = [f"| {' | '.join(COLUMNS)} |", "|" + "---|" * len(COLUMNS)]
    lines = [title, "", f"{clips} clips.", "", *head, *(f"| {' | '.join(r)} |" for r in rows), ""]
    lines += ["| factor | parts | success |", "|---|---|---|"]
    for name in sorted({k.partition(": ")[0] for k in counts} - set(GROUPS)):
        parts, good = counts.get(f"{name}: parts", 0), counts.get(f"{name}: success", 0)
        lines.append(f"| {name} | {parts} | {_rate(good, parts)} |")
    return "\n".join(lines) + "\n"


def _cells(group: str, counts: Mapping[str, int]) -> list[str]:
    def n(key: str) -> int:
        return counts.get(f"{group}: {key}", 0)

    causes = ", ".join(f"{c} {n('cause ' + c)}" for c in CAUSES if n("cause " + c))
    return [
        group, str(n("clips")), str(n("parts")), _rate(n("success"), n("parts")), str(n("trusted")),
        _rate(n("trusted success"), n("trusted")), _rate(n("trusted success"), n("success")),
        f"{n('invented')}, {n('invented trusted')} trusted", str(n("doubtful")),
        _rate(n("exit not 0 where failed"), n("failed clips")), causes or "-", str(n("up wrong")), str(n("broken")),
    ]  # fmt: skip


def _rate(good: int, of: int) -> str:
    if of == 0:
        return "-"
    low, high = binomtest(good, of).proportion_ci(method="wilson")
    return f"{good}/{of} = {100 * good / of:.0f} % [{100 * low:.0f}-{100 * high:.0f}]"

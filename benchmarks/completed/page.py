"""Tables of judged assets, and the page of all sealed runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.completed import counts as bars
from benchmarks.unseen_page import rate

HEAD = """# Completed assets against the simulator's truth

`python -m benchmarks.complete RUN RECORDING/truth ...` judges exported MJCF files, as MuJoCo loads them, by the simulator's truth;
`python -m benchmarks.complete sealed` does so on 40 random recordings, 20 ordinary and 20 hard ones, whose seeds follow from the commit,
deletes each with its run and logs at once and keeps only counters. Every sealed run stays here. Definitions: docs/metrics.md, "Completed
assets". Brackets hold Wilson 95 % intervals. "of all" charges parts that were not found, "of found" does not.
"""
GROUPS = ("ordinary", "hard")
COLUMNS = (
    "recording", "part", "full", "seen layer", "seen", "rear seen", "evidence off", "assumed off", "carcass", "through", "inside",
    "deeper", "handle, mm", "gap", "balls", "shapes", "outside p95, mm", "volume", "open",
)  # fmt: skip


def table(judged: Sequence[Mapping[str, Any]]) -> str:
    """A row for each true part, one for the furniture of each recording; "-" where a figure doesn't apply."""
    lines = [_row(COLUMNS), "|" + "---|" * len(COLUMNS)]
    for one in judged:
        lines += [_row(_part_cells(one["recording"], part)) for part in one["parts"]]
        if one["static"] is not None:
            lines.append(_row(_static_cells(one["recording"], one["static"])))
    return "\n".join(lines) + "\n"


def write_section(page: Path, title: str, body: str) -> None:
    """Append a section to the page."""
    text = page.read_text(encoding="utf-8") if page.is_file() else HEAD
    page.write_text(f"{text.rstrip()}\n\n## {title}\n\n{body}", encoding="utf-8")


def rates(found: Mapping[str, int]) -> str:
    """Rates of a sealed run by group, one line each, and medians to within a bin."""
    lines = ["| measure | bar | " + " | ".join(GROUPS) + " |", "|---|---|" + "---|" * len(GROUPS)]
    for name, bar, key, of in _RATES:
        cells = [rate(found.get(f"{g}: {key}", 0), found.get(f"{g}: {of}", 0)) for g in GROUPS]
        lines.append(_row([name, bar, *cells]))
    for name, key in (
        ("full surface, median of all", "full"),
        ("seen layer alone, median of found", "seen layer"),
        ("carcass, median", "carcass"),
    ):
        lines.append(_row([name, "", *(_median(found, f"{g}: {key} bin ") for g in GROUPS)]))
    for of in ("", "static "):
        for basis in ("evidence", "assumed", "unnamed"):
            cells = [_pooled(found, f"{g}: {of}{basis}") for g in GROUPS]
            lines.append(_row([f"{of or 'part '}inferred area off, {basis}", "", *cells]))
    broken = ", ".join(f"{k} {n}" for k, n in sorted(found.items()) if "broken " in k) or "none"
    return "\n".join([*lines, "", f"Clips without a result, by error: {broken}."]) + "\n"


_RATES = (
    ("clips with a twin", "", "with twin", "clips"),
    ("parts found", "", "found", "parts"),
    ("full surface, of all", "≥ 75 %", "full", "parts"),
    ("full surface, of found", "≥ 75 %", "full", "found"),
    ("full surface where the rear edge was seen", "≥ 85 %", "full, rear seen", "rear seen"),
    ("carcass where an inside or side was seen", "≥ 50 %", "carcass covered", "carcasses"),
    ("parts whose bounded inferred area is on the surface", "≤ 5 % off", "evidence bodies right", "evidence bodies"),
    ("furniture whose bounded inferred area is on the surface", "≤ 5 % off", "static evidence bodies right", "static evidence bodies"),
    ("inferred pieces that are open", "0", "open pieces", "pieces"),
    ("colliders that are open", "0", "open shapes", "shapes"),
    ("drawers that hold all balls, of all", "12 of 12", "drawers that hold all", "drawers"),
    ("balls kept", "", "balls kept", "balls"),
    ("parts not seen through", "≤ 0.5 %", "not seen through", "sights"),
    ("parts not seen through within the outline", "≤ 0.5 %", "not seen through inside", "sights"),
    ("handles right, of all", "± 4 mm", "handle right", "handles"),
    ("handles right or marked assumed, of all", "± 4 mm", "handle right or assumed", "handles"),
    ("gap behind the handle free", "≥ 70 %", "gap free", "gaps"),
    ("parts of few shapes", "≤ 24", "few shapes", "found"),
    ("furniture of few shapes", "≤ 40", "furniture few shapes", "furniture"),
    ("colliders that don't stand out, p95", "≤ 6 mm", "outside", "found"),
    ("volume ratio", ".75-1.3", "ratio", "ratios"),
    ("volume ratio where both faces were seen", ".9-1.15", "two-faced ratio", "two-faced ratios"),
)  # fmt: skip


def _part_cells(recording: str, part: Mapping[str, Any]) -> list[str]:
    head = [recording, part["part"]]
    if not part["found"]:
        return [*head, "not found", *["-"] * 6, _percent(part["carcass"]), *["-"] * (len(COLUMNS) - 10)]
    sight, handle, off = part["sight"] or {}, part["handle"], part["inferred"]
    bar = "-"
    if handle is not None:
        bar = " / ".join(f"{1e3 * handle[k]:.0f}" for k in ("visual", "collider", "true"))
        bar += " assumed" if part["handle assumed"] else ""
    balls = "-" if part["balls"] is None else f"{part['balls']} of {bars.BALLS}"
    return [
        *head, _percent(part["full"]), _percent(part["full, seen layer"]), _percent(part["seen"]), _word(part["rear seen"]),
        *(_percent(off.get(b, {}).get("off")) for b in ("evidence", "assumed")), _percent(part["carcass"]),
        *(_percent(sight.get(k), 2) for k in ("through", "inside", "deeper")),
        bar, _percent(None if handle is None else handle["gap"]), balls,
        str(part["shapes"]), _number(part["outside p95, mm"], 1), _number(part["volume ratio"], 2), _open(part),
    ]  # fmt: skip


def _static_cells(recording: str, static: Mapping[str, Any]) -> list[str]:
    off = static["inferred"]
    cells = [
        recording,
        "furniture",
        *["-"] * 4,
        *(_percent(off.get(b, {}).get("off")) for b in ("evidence", "assumed")),
    ]
    return [*cells, *["-"] * 7, str(static["shapes"]), "-", "-", _open(static)]


def _open(layer: Mapping[str, Any]) -> str:
    return (
        f"{len(layer['open pieces'])} of {layer['pieces']}, {len(layer['open shapes'])} of {layer['shapes']}"
    )


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _percent(share: float | None, digits: int = 1) -> str:
    return "-" if share is None else f"{100 * share:.{digits}f} %"


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _word(value: bool | None) -> str:
    return {None: "-", True: "yes", False: "no"}[value]


def _pooled(found: Mapping[str, int], key: str) -> str:
    area = found.get(f"{key}, cm2", 0)
    return f"{_percent(found.get(f'{key} off, cm2', 0) / area)} of {area / 1e4:.2f} m²" if area else "-"


def _median(found: Mapping[str, int], start: str) -> str:
    bins = sorted((int(k.removeprefix(start)), n) for k, n in found.items() if k.startswith(start) and n)
    total = sum(n for _, n in bins)
    passed = 0
    for low, n in bins:
        passed += n
        if 2 * passed >= total:
            return f"{low}-{min(low + bars.BIN, 100)} % of {total}" if low < 100 else f"100 % of {total}"
    return "-"

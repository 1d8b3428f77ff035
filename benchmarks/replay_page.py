"""The committed page of benchmarks/replay.py."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from datetime import date
from typing import Any

import numpy as np

from robots.trials.statistics import wilson

Row = dict[str, Any]
REACH = {"spot": (0.3, 1.6)}  # m of the contact above the floor; Franka's pedestal is free
CONTROLS = {"position": "stiff", "impedance": "compliant"}


def page(rows: Sequence[Row], trials: int) -> str:
    """Markdown of all rows."""
    robots = list(dict.fromkeys(r["robot"] for r in rows))
    parts = {(r["origin"], r["case"]) for r in rows}
    lines = [
        "# Do robots open and close what the twins show?",
        "",
        (
            f"Written by `python benchmarks/replay.py RUN ... --recordings FOLDER ...` on {date.today().isoformat()}: "
            f"{len(parts)} parts, each opened and closed by {' and '.join(robots)}; {trials} replays with errors of each plan and "
            "control."
        ),
        "",
        "Opened: at least 0.90 of the demonstrated range at the end, and at rest. Clean: also slip <= 10 mm, no joint at its torque",
        "limit or beyond its range, both fingers on the part, <= 2 mm into the static scene. With errors: the real part's axis is 5°, its",
        "pivot 2 cm and its contact 1 cm off in random directions, mass, friction and damping anywhere in their intervals; the twin says",
        "that it is that uncertain. Stiff: the arm's own joint servos; compliant: the hand as a spring of 500 N/m and 60 N m/rad. In reach:",
        "any part for Franka, whose pedestal is free; for Spot, contact 0.3 to 1.6 m above its floor. Parts whose twin shows no floor are marked *:",
        "it is assumed at the scene's lowest point, and heights count from there. A part without a plan counts as failed in every column.",
        "Intervals are Wilson's, 95 %.",
        "",
        "| robot | twins | parts in reach | opened | clean | closed | opened, compliant | errors, stiff | clean | errors, compliant | clean |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for robot in robots:
        mine = [r for r in rows if r["robot"] == robot and in_reach(r)]
        origins = list(dict.fromkeys(r["origin"] for r in mine))
        for name, group in [*((o, [r for r in mine if r["origin"] == o]) for o in origins), ("all", mine)]:
            lines.append(_summary(robot, name, group, trials))
    lines += ["", *_costs(rows), "", *_failures(rows), "", *_why(rows), "", *_table(rows, robots)]
    return "\n".join(lines) + "\n"


def in_reach(row: Row) -> bool:
    """Whether the part counts for the robot."""
    low, high = REACH.get(row["robot"], (-np.inf, np.inf))
    return bool(low <= row["height"] <= high)


def on_assumed_floor(row: Row) -> bool:
    """Whether the twin shows no floor."""
    return bool(row["floor"] == "assumed")


def _summary(robot: str, name: str, rows: Sequence[Row], trials: int) -> str:
    n = len(rows)
    cells = [
        _rate(sum(r["open"]["success"] for r in rows), n),
        _rate(sum(r["open"].get("clean", False) for r in rows), n),
        _rate(sum(r["close"]["success"] for r in rows), n),
        _rate(sum(r["open"].get("impedance", {}).get("success", False) for r in rows), n),
    ]
    for control in CONTROLS:
        done = [r["errors"][control] for r in rows if "errors" in r]
        for what in ("success", "clean"):
            cells.append(_rate(sum(e[what] for e in done), n * trials))
    assumed = sum(on_assumed_floor(r) for r in rows)
    told = f"{n} ({assumed}*)" if assumed else str(n)
    return f"| {robot} | {name} | {told} | {' | '.join(cells)} |"


def _rate(good: int, total: int) -> str:
    if total == 0:
        return "-"
    e = wilson(good, total)
    return f"{good}/{total} = {100 * e.value:.0f} % ({100 * e.low:.0f}–{100 * e.high:.0f})"


def _costs(rows: Sequence[Row]) -> list[str]:
    """CPU time and limits."""
    tasks = [t for r in rows for t in (r["open"], r["close"])]
    replayed = [t for t in tasks if "judge" in t]
    plan = [t["plan_s"] for t in tasks]
    judged = [t["judge"] for t in replayed if t["success"]]
    soft = [t["impedance"] for t in replayed]
    broken = [b for t in replayed if t["success"] for b in t["broken"]]
    broken += [b for s in soft if s["success"] for b in s["broken"]]
    return [
        (
            f"Planning takes {np.median(plan):.1f} s of CPU time (median; at most {max(plan):.1f}), rehearsals included; replay runs at "
            f"{np.median([t['times_real'] for t in replayed]):.0f} times real time (at least {min(t['times_real'] for t in replayed):.0f}), "
            f"compliant {np.median([s['times_real'] for s in soft]):.0f} (at least {min(s['times_real'] for s in soft):.0f})."
        ),
        "",
        f"Limits, by Pinocchio's rnea with the contact wrenches that MuJoCo reports, every 4 ms of the {len(judged)} successful stiff "
        f"replays: largest torque {max(j['torque'] for j in judged):.2f} and velocity {max(j['velocity'] for j in judged):.2f} of the limit, "
        f"nearest to the end of a joint's range {-1000 * max(j['beyond'] for j in judged):.0f} mrad, deepest into the static scene "
        f"{1000 * max(j['depth'] for j in judged):.1f} mm; Pinocchio's torque differs from MuJoCo's by at most "
        f"{max(j['disagreement'] for j in judged):.3f} N m. "
        + (
            f"Not kept: {'; '.join(broken)}."
            if broken
            else "All limits were kept, by the compliant hand as well."
        ),
    ]


def _failures(rows: Sequence[Row]) -> list[str]:
    """Every part that was not opened or closed, or not cleanly, and why."""
    found = []
    for r in rows:
        for goal in ("open", "close"):
            t = r[goal]
            if not t["success"] or not t.get("clean", False):
                result = "no plan" if "reached" not in t else f"{t['reached']:.2f} of the way"
                far = "" if in_reach(r) else " (out of reach)"
                found.append(
                    f"| {r['robot']} | {r['case']}, {r['origin']}{far} | {goal} | {result} | {_short(t['reason'])} |"
                )
    head = ["## What failed, or was not clean", ""]
    if not found:
        return [*head, "Nothing."]
    return [*head, "| robot | part | to | result | why |", "|---|---|---|---|---|", *found]


def _short(reason: str) -> str:
    return reason.partition("; clear the scene")[0].replace("|", "/") or "not at rest"


def _why(rows: Sequence[Row]) -> list[str]:
    """Why replays with errors failed, counted."""
    lines = [
        "## Why replays with errors failed",
        "",
        "| robot | control | reason | replays |",
        "|---|---|---|---|",
    ]
    for robot in dict.fromkeys(r["robot"] for r in rows):
        for control, word in CONTROLS.items():
            counted: Counter[str] = Counter()
            for r in rows:
                if r["robot"] == robot and in_reach(r) and "errors" in r:
                    counted.update(r["errors"][control]["reasons"])
            lines += [
                f"| {robot} | {word} | {_short(why)} | {n} |"
                for why, n in sorted(counted.items(), key=lambda item: (-item[1], item[0]))
            ]
    return lines


def _table(rows: Sequence[Row], robots: Iterable[str]) -> list[str]:
    columns = ["open", "close", "slip mm", "torque", "errors"]
    head = " | ".join(f"{robot} {c}" for robot in robots for c in columns)
    lines = [
        "## Every part",
        "",
        (
            "Share of the way done, stiff; slip and share of the torque limits while opening; of the replays with errors, opened stiff and "
            "compliant."
        ),
        "",
        f"| part | twin | height m | {head} |",
        "|---" * (3 + len(columns) * len(list(robots))) + "|",
    ]
    by = {(r["origin"], r["case"], r["robot"]): r for r in rows}
    for origin, case in dict.fromkeys((r["origin"], r["case"]) for r in rows):
        group = [by[(origin, case, robot)] for robot in robots]
        cells = [c for r in group for c in _cells(r)]
        mark = "*" if on_assumed_floor(group[0]) else ""
        lines.append(f"| {case} | {origin} | {group[0]['height']:.2f}{mark} | {' | '.join(cells)} |")
    return lines


def _cells(row: Row) -> list[str]:
    o, c = row["open"], row["close"]
    errors = row.get("errors")
    told = "-" if errors is None else " ".join(f"{e['success']}/{e['trials']}" for e in errors.values())
    return [
        f"{o['reached']:.2f}" if "reached" in o else "no plan",
        f"{c['reached']:.2f}" if "reached" in c else "no plan",
        f"{o['slip_mm']:.1f}" if "reached" in o else "-",
        f"{o['torque']:.2f}" if "reached" in o else "-",
        told,
    ]

"""The report of behaviour as tables for people."""

from __future__ import annotations

from twin.report.sections import Table
from twin.verification.behaviour import BehaviourReport


def summary(report: BehaviourReport) -> str:
    """One line."""
    refused = [w.partition(":")[0] for w in report.warnings]
    extra = f"; can't be simulated: {', '.join(refused)}" if refused else ""
    return f"{sum(r.ok for r in report.rows)} of {len(report.rows)} demands on behaviour met{extra}"


def tables(report: BehaviourReport) -> list[Table]:
    """What each part does in each format, and every demand that is not met."""
    formats = list(dict.fromkeys(r.format for r in report.rows))
    found = {(r.part, r.quantity, r.format): r for r in report.rows}
    rows = []
    for part, quantity in dict.fromkeys((r.part, r.quantity) for r in report.rows):
        those = [found.get((part, quantity, f)) for f in formats]
        first = next(r for r in those if r is not None)
        values = ["" if r is None else f"{r.measured:.2g}" for r in those]
        verdict = "ok" if all(r is None or r.ok for r in those) else "FAILED"
        rows.append([part, quantity, *values, f"{first.limit:.2g}", first.explanation, verdict])
    columns = ["part", "demand", *formats, "allowed", f"in {formats[0]}" if formats else "", ""]
    shown = [Table("behaviour in MuJoCo", columns, rows)]
    if report.failures:
        failures = [
            [r.format, r.part, r.quantity, f"{r.measured:.3g}", f"{r.limit:.3g}", r.explanation]
            for r in report.failures
        ]
        columns = ["format", "part", "demand", "measured", "allowed", "about it"]
        shown.append(Table("demands that are not met", columns, failures))
    return shown

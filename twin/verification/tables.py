"""Shows the report of a check."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from twin.report.sections import Table
from twin.verification.compare import FIELDS, SINGLE_PRECISION, TOLERANCE
from twin.verification.exceptions import TABLE
from twin.verification.rows import CheckReport, CheckRow

_COLUMNS = 7  # engines and formats side by side


def summary(report: CheckReport) -> str:
    """One line."""
    known = sum(r.status == "known" for r in report.rows)
    agree = sum(r.agrees for r in report.rows)
    extra = f"; {known} are known not to be supported" if known else ""
    refused = [f"{r.format} in {r.consumer}" for r in report.failures if r.field == "loads"]
    extra += f"; can't be loaded: {', '.join(refused)}" if refused else ""
    return f"{agree} of {len(report.rows) - known} comparisons agree{extra}"


def notes(report: CheckReport) -> list[str]:
    """What a reader of the tables has to know."""
    out = [
        f"unexpected pass: {engine} now takes {field} from {fmt}; its entry in twin/verification/exceptions.py can go"
        for engine, fmt, field in dict.fromkeys((r.consumer, r.format, r.field) for r in report.unexpected)
    ]
    single = [e for e in SINGLE_PRECISION if e in report.versions]
    if single:
        out.append(f"{' and '.join(single)} compute in single precision: ten times the difference is allowed")
    return out


def tables(report: CheckReport) -> list[Table]:
    """Largest difference of each quantity by engine and format; disagreements; known gaps."""
    groups: dict[str, list[CheckRow]] = {}
    for r in report.rows:
        groups.setdefault(f"{r.consumer} {r.format}", []).append(r)
    names = list(groups)
    wide = -(-len(names) // max(1, -(-len(names) // _COLUMNS)))  # tables of equal width
    out = [
        Table("largest difference from the twin", *_largest({n: groups[n] for n in names[k : k + wide]}))
        for k in range(0, len(names), max(wide, 1))
    ]
    if report.failures:
        columns = ["format", "engine", "part", "quantity", "twin", "file", "difference", "allowed"]
        rows = [
            [r.format, r.consumer, r.part, r.field, r.expected, r.measured, f"{r.difference:.3g}", f"{r.tolerance:g}"]
            for r in report.failures
        ]  # fmt: skip
        out.append(Table("what does not agree", columns, rows))
    columns, rows = exceptions({r.consumer for r in report.rows}, {r.format for r in report.rows})
    if rows:
        out.append(Table("known not to be supported: in brackets above", columns, rows))
    return out


def _largest(groups: Mapping[str, Sequence[CheckRow]]) -> tuple[list[str], list[list[str]]]:
    body = [
        [
            field,
            f"{TOLERANCE[field]:g}",
            *(_cell([r for r in of if r.field == field]) for of in groups.values()),
        ]
        for field in FIELDS
        if any(r.field == field for of in groups.values() for r in of)
    ]
    body.append(["agrees", "", *("ok" if all(r.ok for r in of) else "FAILED" for of in groups.values())])
    return ["quantity", "allowed", *groups], body


def _cell(rows: Sequence[CheckRow]) -> str:
    """The largest difference, in brackets where it is known not to be supported."""
    if not rows:
        return ""
    text = f"{max(r.difference for r in rows):.1g}"
    return f"({text})" if rows[0].known else text


def exceptions(engines: set[str], formats: set[str]) -> tuple[list[str], list[list[str]]]:
    """Columns and rows of the table of exceptions, for these engines and formats."""
    rows = [
        [e.engine, e.format, e.field, e.reason if e.instead is None else f"{e.reason} (uses {e.instead:g})"]
        for e in TABLE
        if e.format in formats and e.engine in engines | {"any"}
    ]
    return ["engine", "format", "what", "why"], rows

"""Rows and report of a check."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from twin.verification.exceptions import TABLE

Status = Literal["ok", "failed", "known", "unexpected pass"]


@dataclass(frozen=True)
class CheckRow:
    """One comparison. difference and tolerance are in the field's unit (deg for axis, m, rad, kg ...).

    known: reason of the table of exceptions, empty when the engine should agree. told: whether the twin's
    value differs from the one which the engine is known to use instead, so that agreement means something.
    """

    format: str
    consumer: str
    field: str
    part: str
    expected: str
    measured: str
    difference: float
    tolerance: float
    known: str = ""
    told: bool = True

    @property
    def agrees(self) -> bool:
        return self.difference <= self.tolerance

    @property
    def ok(self) -> bool:
        return self.agrees or bool(self.known)

    @property
    def status(self) -> Status:
        if not self.known:
            return "ok" if self.agrees else "failed"
        return "unexpected pass" if self.agrees and self.told else "known"


@dataclass(frozen=True)
class CheckReport:
    """Rows, and whatever a loader warned about or failed with, as "format/engine: text"; versions of the
    engines and the seconds that each took for a format; notes on what limits the comparison."""

    rows: tuple[CheckRow, ...]
    warnings: tuple[str, ...]
    versions: Mapping[str, str] = field(default_factory=dict)
    seconds: Mapping[tuple[str, str], float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """True when every row holds, none is missing and loaders warned only of what the table has."""
        return bool(self.rows) and not self.warnings and all(r.ok for r in self.rows)

    @property
    def failures(self) -> tuple[CheckRow, ...]:
        return tuple(r for r in self.rows if not r.ok)

    @property
    def unexpected(self) -> tuple[CheckRow, ...]:
        """Rows that agree although the table says that the engine does not take the field."""
        return tuple(r for r in self.rows if r.status == "unexpected pass")

    def to_dict(self) -> dict[str, Any]:
        """JSON types; a difference that is not a number is null."""
        return {
            "ok": self.ok,
            "warnings": list(self.warnings),
            "notes": list(self.notes),
            "engines": dict(self.versions),
            "rows": [_plain(r) for r in self.rows],
            "known_unsupported": [
                asdict(e) for e in TABLE if e.engine in {r.consumer for r in self.rows} | {"any"}
            ],
        }


def _plain(row: CheckRow) -> dict[str, Any]:
    out = {**asdict(row), "ok": row.ok, "status": row.status}
    del out["told"]
    if not math.isfinite(row.difference):
        out["difference"] = None
    return out

"""Rows and report of how parts behave."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class BehaviourRow:
    """One demand. measured and limit are in metres at the part's farthest point (rest, sweep, demonstration)
    or shares of the range (open, close) or of the energy at play (energy); inf if the simulation broke."""

    format: str
    part: str
    quantity: str
    measured: float
    limit: float
    explanation: str

    @property
    def ok(self) -> bool:
        return self.measured <= self.limit


@dataclass(frozen=True)
class BehaviourReport:
    """Rows, and what could not be simulated, as "format: text"."""

    rows: tuple[BehaviourRow, ...]
    warnings: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """True when every demand is met in every format."""
        return not self.warnings and all(r.ok for r in self.rows)

    @property
    def failures(self) -> tuple[BehaviourRow, ...]:
        return tuple(r for r in self.rows if not r.ok)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is as it should be and yet worth knowing: parts that their own weight moves."""
        slides = [f"{r.part}: {r.explanation.split(';')[0]}" for r in self.rows if r.quantity == "slides_m"]
        return tuple(dict.fromkeys(slides))

    def to_dict(self) -> dict[str, Any]:
        """JSON types; null for what is infinite."""
        rows = [{**asdict(r), "ok": r.ok} for r in self.rows]
        for r in rows:
            r["measured"] = r["measured"] if math.isfinite(r["measured"]) else None
        return {"ok": self.ok, "warnings": list(self.warnings), "notes": list(self.notes), "rows": rows}

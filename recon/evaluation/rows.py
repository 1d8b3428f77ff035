"""The rows of an evaluation, and their table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from recon.evaluation.columns import aligned
from recon.evaluation.goals import Goal
from recon.evaluation.walk_rows import summary, walk_table
from recon.evaluation.walk_scores import WalkScores


@dataclass(frozen=True)
class Row:
    """One measure of the scene or of one true part.

    value: failures charged. matched: without them, None for a failure. goal: None if only reported.
    """

    metric: str
    part: str
    value: float
    matched: float | None
    unit: str
    goal: Goal | None

    @property
    def ok(self) -> bool | None:
        """Whether the goal is met, None without one."""
        return None if self.goal is None else self.goal.met(self.value)

    def as_dict(self) -> dict[str, Any]:
        return {
            "metric": self.metric,
            "part": self.part,
            "value": self.value,
            "matched": self.matched,
            "unit": self.unit,
            "goal": None if self.goal is None else str(self.goal),
            "ok": self.ok,
        }


@dataclass(frozen=True)
class Evaluation:
    """All rows of one twin against one truth, with the data set's name.

    unknown: measures that this truth does not allow. notes: what was left out of the truth, for people.
    walk: of a recording with several parts or interactions; the goals don't concern it. walk_lacks: the facts
    that this truth doesn't tell and such a walk's measures need. matched: names of the parts found, by those
    of the true parts that they stand for.
    """

    name: str
    rows: tuple[Row, ...]
    unknown: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    walk: WalkScores | None = None
    walk_lacks: tuple[str, ...] = ()
    matched: Mapping[str, str] = field(default_factory=dict)

    @property
    def remarks(self) -> list[str]:
        """Lines that say what these rows don't: what is not known, and why."""
        lacks = ", ".join(self.walk_lacks)
        return [
            *([f"no measures of a walk: the truth doesn't tell {lacks}"] if lacks else []),
            *([f"not known from this truth: {', '.join(self.unknown)}"] if self.unknown else []),
            *self.notes,
        ]

    @property
    def ok(self) -> bool:
        """Whether every goal is met."""
        return all(r.ok is not False for r in self.rows)

    def row(self, metric: str, part: str | None = None) -> Row:
        """The row of a measure (and part). Raises KeyError when there is none."""
        for r in self.rows:
            if r.metric == metric and part in (None, r.part):
                return r
        raise KeyError(f"no row {metric!r} of {part!r}")

    def as_dict(self) -> dict[str, Any]:
        """JSON types only."""
        walk = {} if self.walk is None else {"walk": summary(self.walk)}
        return {
            "recording": self.name,
            "ok": self.ok,
            "rows": [r.as_dict() for r in self.rows],
            "unknown": list(self.unknown),
            "notes": list(self.notes),
            "matched": dict(self.matched),
            **walk,
        }

    def table(self) -> str:
        """Plain text, one line a row."""
        head = ("measure", "of", "value", "matched only", "unit", "goal", "")
        verdict = {None: "", True: "met", False: "MISSED"}
        body = [
            (
                r.metric,
                r.part,
                f"{r.value:.4g}",
                "-" if r.matched is None else f"{r.matched:.4g}",
                r.unit,
                "" if r.goal is None else str(r.goal),
                verdict[r.ok],
            )
            for r in self.rows
        ]
        missed = sum(r.ok is False for r in self.rows)
        goals = sum(r.ok is not None for r in self.rows)
        end = f"{self.name}: {goals - missed} of {goals} goals met"
        walk = [] if self.walk is None else ["", walk_table(self.walk), ""]
        return "\n".join([*aligned([head, *body], right=(2, 3)), *walk, *self.remarks, end])

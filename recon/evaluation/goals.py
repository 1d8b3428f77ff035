"""The goals that `twin evaluate` holds a reconstruction to: one number for every measure, chosen by us."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Goal:
    """A value is good when it is at most (`<=`) or at least (`>=`) the limit."""

    sense: str
    limit: float

    def met(self, value: float) -> bool:
        return value <= self.limit if self.sense == "<=" else value >= self.limit

    def __str__(self) -> str:
        return f"{self.sense} {self.limit:g}"


def at_most(limit: float) -> Goal:
    return Goal("<=", limit)


def at_least(limit: float) -> Goal:
    return Goal(">=", limit)


# By the names of the rows of an evaluation, with the unit where it decides.
GOALS: dict[str | tuple[str, str], Goal] = {
    "ATE": at_most(5.0),
    "up": at_most(2.0),
    "frames with camera": at_least(0.98),
    "type right": at_least(1.0),
    "axis": at_most(1.0),
    "pivot, point to line": at_most(10.0),
    ("state", "deg"): at_most(1.0),
    ("state", "mm"): at_most(5.0),
    ("range", "deg"): at_most(3.0),
    ("range", "mm"): at_most(15.0),
    "opening direction right": at_least(1.0),
    "closed end right": at_least(1.0),
    "moving frames with state": at_least(0.95),
    "interval IoU": at_least(0.8),
    "part mIoU": at_least(0.85),
    "hand mIoU": at_least(0.75),
    "hand on hand-free frames": at_most(0.01),
    "longest gap of labels": at_most(4.0),
    "part mesh accuracy": at_most(5.0),
    "part mesh completeness": at_least(0.95),
    "static mesh accuracy": at_most(10.0),
    "contact": at_most(30.0),
    "spurious parts": at_most(0.0),
}


def goal_of(metric: str, unit: str) -> Goal | None:
    """The goal of a measure, None for one that is only reported."""
    return GOALS.get(metric) or GOALS.get((metric, unit))

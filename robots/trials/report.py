"""What came of trials: each one, the rates of a row, and the report of a part."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from robots.floor import Floor
from robots.reasons import reason
from robots.simulation.report import ReplayReport
from robots.trials.perturbation import Draw, ErrorSizes, Spread
from robots.trials.statistics import CONFIDENCE, Estimate, mean, wilson
from twin.cause import Cause
from twin.geometry import Array

FORMAT = "funtwin-trials/1"
OWN = "the twin's own"
COLUMNS = ("error", "success@.75, static", "success@.90", "clean", "mean opening", "why not")
_DIGITS = 9  # of numbers in trials.json


def _sizes(axis_deg: float = 0.0, pivot_mm: float = 0.0, contact_mm: float = 0.0) -> ErrorSizes:
    return ErrorSizes(float(np.deg2rad(axis_deg)), pivot_mm / 1000, contact_mm / 1000)


# All three errors at once, then each alone; sizes chosen by us around what reconstructions err by.
LADDER = (_sizes(1, 5, 2.5), _sizes(2.5, 10, 5), _sizes(5, 20, 10))
GRID = (
    _sizes(),
    *(_sizes(axis_deg=a) for a in (1, 2, 5)),
    *(_sizes(pivot_mm=p) for p in (5, 10, 20)),
    *(_sizes(contact_mm=c) for c in (5, 10)),
)


@dataclass(frozen=True, eq=False)
class Trial:
    """One draw and what came of it. path_error: m, see `draws.path_error`. closes_itself: the drawn part's
    own weight closes it when nothing holds it at the goal."""

    drawn: Draw
    path_error: float
    closes_itself: bool
    report: ReplayReport

    @property
    def reason(self) -> Cause | None:
        """What went wrong; of a part that was opened and let go, that it falls shut is said instead."""
        r = self.report
        if self.closes_itself and r.faults and r.faults[0].type == "CameBack":
            return reason("ClosedByItself", r.opening_peak, r.opening_final)
        if r.faults:
            return r.faults[0]
        return None if r.at_rest else reason("StillMoving")

    def to_json(self) -> dict[str, Any]:
        """Plain JSON types."""
        d, r = self.drawn, self.report
        pivot = getattr(d.joint, "pivot", None)
        numbers = {
            "mass": d.mass,
            "friction": d.friction,
            "damping": d.damping,
            "frictionloss": d.frictionloss,
            "path_error_mm": 1000 * self.path_error,
            "opening_peak": r.opening_peak,
            "opening_final": r.opening_final,
            "slip_mm": r.slip_mm,
            "torque_share": max(r.torque_share),
        }
        return {
            "axis": _plain(d.joint.axis),
            "pivot": None if pivot is None else _plain(pivot),
            "contact_shift": _plain(d.contact),
            **{key: round(float(value), _DIGITS) for key, value in numbers.items()},
            "at_rest": r.at_rest,
            "success_75": r.success_75,
            "success_90": r.success_90,
            "ok": r.ok,
            "closes_itself": self.closes_itself,
            "reason": "" if self.reason is None else self.reason.text,
        }


@dataclass(frozen=True, eq=False)
class TrialRow:
    """The trials of one size of error; sizes None: the twin's own uncertainty.

    success_75: at least 0.75 open and at rest; success_90: at least 0.90 open at the end; clean: success_90
    with slip, torque and joint limits kept; opening: mean share of the range at the end. reasons: of the
    trials that miss success_75 or success_90, counted by their kind, most frequent first.
    """

    sizes: ErrorSizes | None
    trials: tuple[Trial, ...]

    @property
    def name(self) -> str:
        """What was wrong, in words."""
        return OWN if self.sizes is None else self.sizes.text

    @property
    def success_75(self) -> Estimate:
        return wilson(sum(t.report.success_75 for t in self.trials), len(self.trials))

    @property
    def success_90(self) -> Estimate:
        return wilson(sum(t.report.success_90 for t in self.trials), len(self.trials))

    @property
    def clean(self) -> Estimate:
        return wilson(sum(t.report.ok for t in self.trials), len(self.trials))

    @property
    def opening(self) -> Estimate:
        return mean([t.report.opening_final for t in self.trials])

    @property
    def reasons(self) -> dict[str, int]:
        failed = [t for t in self.trials if not (t.report.success_75 and t.report.success_90)]
        counted = Counter("" if t.reason is None else t.reason.kind for t in failed)
        return dict(sorted(counted.items(), key=lambda item: (-item[1], item[0])))

    def cells(self) -> list[str]:
        """The row of a table, see COLUMNS."""
        rates = [_percent(e) for e in (self.success_75, self.success_90, self.clean, self.opening)]
        return [self.name, *rates, "; ".join(f"{n} x {reason}" for reason, n in self.reasons.items())]

    def summary(self) -> dict[str, Any]:
        """Plain JSON types, without the single trials."""
        s = self.sizes
        sizes = s and {
            "axis_deg": round(float(np.rad2deg(s.axis)), _DIGITS),
            "pivot_mm": round(1000 * s.pivot, _DIGITS),
            "contact_mm": round(1000 * s.contact, _DIGITS),
        }
        rates = {k: asdict(getattr(self, k)) for k in ("success_75", "success_90", "clean", "opening")}
        return {"errors": self.name, "sizes": sizes, **rates, "reasons": self.reasons}

    def to_json(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {**self.summary(), "trials": [t.to_json() for t in self.trials]}


@dataclass(frozen=True, eq=False, repr=False)
class TrialReport:
    """All rows of one part; the twin's uncertainty first. floor: it stands on. assumed: unstated."""

    robot: str
    twin: str
    part: str
    seed: int
    control: str
    stiffness: float
    spread: Spread
    rows: tuple[TrialRow, ...]
    floor: Floor | None = None

    def __repr__(self) -> str:
        told = "; ".join(f"{row.name}: {100 * row.success_90.value:.0f} %" for row in self.rows)
        return f"<TrialReport: {self.robot} brought {self.part!r} to the goal, {told}>"

    @property
    def assumed(self) -> tuple[str, ...]:
        """What the twin did not state, and what was used instead."""
        floor = () if self.floor is None or not self.floor.warning else (self.floor.warning,)
        return (*self.spread.missing, *floor)

    def summary(self) -> dict[str, Any]:
        """Plain JSON types, without the single trials."""
        return {
            "seed": self.seed,
            "floor": self._floor,
            "assumed": list(self.assumed),
            "rows": [r.summary() for r in self.rows],
        }

    @property
    def _floor(self) -> dict[str, Any] | None:
        return None if self.floor is None else asdict(self.floor)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON types; equal for equal runs."""
        s = self.spread
        return {
            "format": FORMAT,
            "robot": self.robot,
            "twin": self.twin,
            "part": self.part,
            "seed": self.seed,
            "control": self.control,
            "stiffness": self.stiffness,
            "confidence": CONFIDENCE,
            "floor": self._floor,
            "spread": {
                "joint_covariance": s.joint.tolist(),
                "contact_sigma": s.contact,
                "mass": s.mass,
                "friction": s.friction,
                "damping": s.damping,
                "frictionloss": s.frictionloss,
            },
            "assumed": list(self.assumed),
            "rows": [row.to_json() for row in self.rows],
        }


def _percent(e: Estimate) -> str:
    return f"{100 * e.value:z.0f} % ({100 * e.low:z.0f}–{100 * e.high:z.0f})"


def _plain(values: Array) -> list[float]:
    return [float(v) for v in np.round(values, _DIGITS)]

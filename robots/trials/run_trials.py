"""How often a plan made from the twin opens the real part, when the twin is only nearly right.

The robot plans once, on the twin. Each trial replays that trajectory in a scene whose part differs from the twin.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robots.config import ReplayConfig
from robots.floor import Floor
from robots.model.catalog import resolve
from robots.reasons import CameBack, ClosedByItself, Reason, StillMoving
from robots.scene.world import build_world, with_collision
from robots.simulation.report import ReplayReport
from robots.trajectory import RobotTrajectory
from robots.trials.batch import Tell, replay_all
from robots.trials.perturbation import Draw, ErrorSizes, Spread, closes_itself, draw, path_error, spread_of
from robots.trials.statistics import CONFIDENCE, Estimate, mean, wilson
from twin.errors import InputError
from twin.files.atomic import write_file
from twin.files.paths import AnyPath
from twin.geometry import Array
from twin.runs.progress import default_progress, silent
from twin.scene import Part, Twin

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
    """One draw and what came of it. path_error: m, see `draws.path_error`. closes_itself: the drawn part's own weight
    closes it when nothing holds it at the goal."""

    drawn: Draw
    path_error: float
    closes_itself: bool
    report: ReplayReport

    @property
    def reason(self) -> Reason | None:
        """What went wrong; of a part that was opened and let go, that it falls shut is said instead."""
        r = self.report
        if self.closes_itself and r.faults and isinstance(r.faults[0], CameBack):
            return ClosedByItself(r.opening_peak, r.opening_final)
        if r.faults:
            return r.faults[0]
        return None if r.at_rest else StillMoving()

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

    success_75: at least 0.75 open and at rest; success_90: at least 0.90 open at the end; clean: success_90 with slip,
    torque and joint limits kept; opening: mean share of the range at the end. reasons: of the trials that miss
    success_75 or success_90, counted by their kind, most frequent first.
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


@dataclass(frozen=True, eq=False)
class TrialReport:
    """All rows of one part; the twin's own uncertainty first. floor: what the robot stands on. assumed: what the twin did not
    state."""

    robot: str
    twin: str
    part: str
    seed: int
    control: str
    stiffness: float
    spread: Spread
    rows: tuple[TrialRow, ...]
    floor: Floor | None = None

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


def run_trials(
    twin: Twin,
    trajectory: RobotTrajectory,
    out: AnyPath | None = None,
    *,
    trials: int = 100,
    grid: bool = False,
    seed: int = 0,
    robot: AnyPath | None = None,
    config: ReplayConfig | None = None,
    workers: int | None = None,
    tell: Tell | None = None,
) -> TrialReport:
    """Replay a trajectory on parts that differ from the twin.

    Args:
        twin: the one that was planned for. out: folder for trials.json and trials.png; nothing is written without it.
        trials: for the twin's own uncertainty, and as many for each size of error: all three kinds together, growing;
            with `grid` each kind alone too. seed: of every draw. robot: when it is not the trajectory's own name.
        workers: processes; default one for each core. The result does not depend on them. tell: called with the number of
            replays done and their total; without it a bar appears on a terminal.

    Raises:
        SceneError: the twin has no such part. InputError: trials < 1, a negative seed, or an unwritable folder.
    """
    check_request(trials, seed)
    config = config or ReplayConfig()
    twin = with_collision(twin)
    part = twin.part(trajectory.part_id)
    world = build_world(
        twin, resolve(robot or trajectory.robot), trajectory.T_world_base, trajectory.pedestal
    )
    spread = spread_of(part)
    rows = rows_of(part, grid)
    draws = [draw(part, spread, sizes, seed, k) for sizes in rows for k in range(trials)]
    with default_progress(None if tell is None else silent) as progress:

        def bar(done: int, total: int) -> None:
            progress("trials", done / total, f"{done} of {total}")

        reports = replay_all(world, trajectory, part, draws, config, workers=workers, tell=tell or bar)
    held, goal = trajectory.T_world_tool[trajectory.phases.index("move"), :3, 3], trajectory.goal
    done = [
        Trial(d, path_error(part, d, held, goal), closes_itself(part, d, goal), r)
        for d, r in zip(draws, reports, strict=True)
    ]
    table = tuple(TrialRow(sizes, tuple(done[k * trials : (k + 1) * trials])) for k, sizes in enumerate(rows))
    report = TrialReport(
        trajectory.robot, twin.name, part.name, seed, config.control, config.stiffness, spread, table,
        trajectory.floor,
    )  # fmt: skip
    if out is not None:
        _write(report, Path(out))
    return report


def check_request(trials: int, seed: int) -> None:
    """Raises InputError for a number of trials or a seed that can't be."""
    if trials < 1:
        raise InputError(
            f"{trials} trials were asked for", "ask for one or more; 100 tell a rate to about 10 %"
        )
    if seed < 0:
        raise InputError(f"the seed of the trials is {seed}", "give 0 or more")


def rows_of(part: Part, grid: bool) -> list[ErrorSizes | None]:
    """Sizes of errors to try; those of a pivot are left out of a slide's."""
    sizes = [*GRID, *LADDER] if grid else list(LADDER)
    if part.joint.kind == "prismatic":
        kept = [ErrorSizes(s.axis, 0.0, s.contact) for s in sizes]
        sizes = list(dict.fromkeys(kept))
    return [None, *sizes]


def _percent(e: Estimate) -> str:
    return f"{100 * e.value:.0f} % ({100 * e.low:.0f}–{100 * e.high:.0f})"


def _plain(values: Array) -> list[float]:
    return [float(v) for v in np.round(values, _DIGITS)]


def _write(report: TrialReport, out: Path) -> None:
    from robots.trials.plot import plot

    picture = plot(report)
    try:
        text = json.dumps(report.to_json(), indent=1, allow_nan=False)
        write_file(out / "trials.json", f"{text}\n".encode())
        write_file(out / "trials.png", picture)
    except OSError as e:
        raise InputError(f"{out} can't be written ({e.strerror})", "choose another output folder") from e


def binned(errors: Sequence[float], successes: Sequence[bool], bins: int) -> list[tuple[float, Estimate]]:
    """Success over error: trials sorted by error in equally full bins; (mean error, rate with interval) of each."""
    order = np.argsort(np.asarray(errors), kind="stable")
    groups = [g for g in np.array_split(order, bins) if len(g)]
    return [
        (float(np.mean([errors[k] for k in g])), wilson(sum(successes[k] for k in g), len(g))) for g in groups
    ]

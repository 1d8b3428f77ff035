"""Robots: plan and replay, headless, what the person in the recording did.

twin = robots.completed(twin)  # shapes, masses and friction, once for what follows
trajectory = robots.plan(twin, "door")
report = robots.replay(twin, trajectory, Path("out"))
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robots.config import PlanConfig as PlanConfig
    from robots.config import ReplayConfig as ReplayConfig
    from robots.demonstration import Demonstration as Demonstration
    from robots.model.catalog import names as names
    from robots.model.catalog import resolve as resolve
    from robots.planning.plan import plan as plan
    from robots.scene.world import completed as completed
    from robots.simulation.replay import replay as replay
    from robots.simulation.report import ReplayReport as ReplayReport
    from robots.trajectory import RobotTrajectory as RobotTrajectory
    from robots.trials.report import TrialReport as TrialReport
    from robots.trials.run_trials import run_trials as run_trials

# name -> module; imported when first used, because MuJoCo and mink take a second to load
_HOME = {
    "names": "model.catalog",
    "resolve": "model.catalog",
    "PlanConfig": "config",
    "ReplayConfig": "config",
    "Demonstration": "demonstration",
    "completed": "scene.world",
    "plan": "planning.plan",
    "replay": "simulation.replay",
    "ReplayReport": "simulation.report",
    "RobotTrajectory": "trajectory",
    "TrialReport": "trials.run_trials",
    "run_trials": "trials.run_trials",
}

__all__ = [
    "Demonstration",
    "PlanConfig",
    "ReplayConfig",
    "ReplayReport",
    "RobotTrajectory",
    "TrialReport",
    "completed",
    "names",
    "plan",
    "replay",
    "resolve",
    "run_trials",
]


if not TYPE_CHECKING:  # a type checker that saw it would take every misspelled name for one that exists

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module 'robots' has no attribute {name!r}")
        return getattr(import_module(f"robots.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

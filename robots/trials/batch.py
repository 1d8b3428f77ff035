"""Many replays of one trajectory at once, each in its own scene, on all cores."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace

from joblib import Parallel, delayed, parallel_config

from robots.config import ReplayConfig
from robots.scene.world import World
from robots.simulation.replay import simulate
from robots.simulation.report import ReplayReport, measure
from robots.trajectory import RobotTrajectory
from robots.trials.perturbation import Draw, perturbed
from twin.interrupt import spared
from twin.scene import Part

Tell = Callable[[int, int], None]
GROUP = 8  # draws that a worker takes at once: some seconds of work


def cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def replay_all(
    world: World,
    trajectory: RobotTrajectory,
    part: Part,
    draws: Sequence[Draw],
    config: ReplayConfig,
    *,
    workers: int | None = None,
    group: int = GROUP,
    tell: Tell | None = None,
) -> list[ReplayReport]:
    """Replay the trajectory in the scene of each draw; reports in the draws' order, whatever the workers.

    The very simulation and measurement of a single replay runs in processes: a step of MuJoCo takes some 40
    us, too short for threads, which would wait for each other's interpreter. `group` draws are one worker's
    at a time; fewer do not pay for starting any.
    """
    groups = [draws[k : k + group] for k in range(0, len(draws), group)]
    workers = min(workers or cores(), len(groups))
    with parallel_config("loky", n_jobs=workers, inner_max_num_threads=1):
        with spared():
            done = Parallel(return_as="generator")(
                delayed(_replay_some)(world, trajectory, part, some, config) for some in groups
            )
        reports: list[ReplayReport] = []
        for some in done:
            reports += some
            if tell:
                tell(len(reports), len(draws))
    return reports


def _replay_some(
    world: World, trajectory: RobotTrajectory, part: Part, draws: Sequence[Draw], config: ReplayConfig
) -> list[ReplayReport]:
    reports = []
    for drawn in draws:
        record, _ = simulate(perturbed(world, part, drawn), trajectory, config)
        drawn_part = replace(part, joint=drawn.joint)
        reports.append(measure(record, trajectory, drawn_part, world.spec, 0.0, None))
    return reports

"""Many replays of one trajectory at once, each in its own scene, on all cores."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from robots.config import ReplayConfig
from robots.draws import Draw, perturbed
from robots.replayer import simulate
from robots.report import ReplayReport, measure
from robots.trajectory import RobotTrajectory
from robots.world import World
from twin.scene import Part

Tell = Callable[[int, int], None]


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
    tell: Tell | None = None,
) -> list[ReplayReport]:
    """Replay the trajectory in the scene of each draw; reports in the order of the draws, whatever the workers.

    The very simulation and measurement of a single replay runs in threads: MuJoCo lets go of the interpreter while it
    steps, which is nine tenths of the time, and forces at contacts, fingers and reasons are the single replay's.
    """

    def one(drawn: Draw) -> ReplayReport:
        record, _ = simulate(perturbed(world, part, drawn), trajectory, config)
        return measure(record, trajectory, replace(part, joint=drawn.joint), world.spec, 0.0, None)

    with ThreadPoolExecutor(workers or cores()) as pool:
        return list(_told(pool.map(one, draws), len(draws), tell))


def _told(reports: Iterator[ReplayReport], total: int, tell: Tell | None) -> Iterator[ReplayReport]:
    for k, report in enumerate(reports):
        if tell:
            tell(k + 1, total)
        yield report

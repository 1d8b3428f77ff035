"""How often a plan made from the twin opens the real part, when the twin is only nearly right.

The robot plans once, on the twin. Each trial replays that trajectory in a scene whose part differs.
"""

from __future__ import annotations

import json
from pathlib import Path

from robots.config import ReplayConfig
from robots.model.catalog import resolve
from robots.scene.as_handled import as_handled
from robots.scene.world import build_world, completed
from robots.trajectory import RobotTrajectory
from robots.trials.batch import Tell, replay_all
from robots.trials.perturbation import ErrorSizes, closes_itself, draw, path_error, spread_of
from robots.trials.report import GRID, LADDER, Trial, TrialReport, TrialRow
from twin.errors import InputError
from twin.files.atomic import write_file
from twin.files.paths import AnyPath
from twin.runs.progress import default_progress, silent
from twin.scene import Part, Twin


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
        twin: the one that was planned for.
        out: folder for trials.json and trials.png; nothing is written without it.
        trials: for the twin's own uncertainty, and as many for each size of error: all three kinds together,
            growing; with `grid` each kind alone too.
        seed: of every draw.
        robot: when it is not the trajectory's own name.
        workers: processes; default one for each core. The result does not depend on them.
        tell: called with the number of replays done and their total; without it a bar appears on a terminal.

    Raises:
        SceneError: the twin has no such part.
        InputError: trials < 1, a negative seed, or an unwritable folder.
    """
    check_request(trials, seed)
    config = config or ReplayConfig()
    twin, part = as_handled(completed(twin), trajectory.part_id)
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


def _write(report: TrialReport, out: Path) -> None:
    from robots.trials.plot import plot

    picture = plot(report)
    try:
        text = json.dumps(report.to_json(), indent=1, allow_nan=False)
        write_file(out / "trials.json", f"{text}\n".encode())
        write_file(out / "trials.png", picture)
    except OSError as e:
        raise InputError(f"{out} can't be written ({e.strerror})", "choose another output folder") from e

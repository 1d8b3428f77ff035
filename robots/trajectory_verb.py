"""The verb `twin trajectory`: what a replay planned, in robots' formats. The command line lists it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robots.replay_verb import parts_to_move, replay_folder
from twin.cli.console import Console, Outcome
from twin.cli.step import judged, run_folder
from twin.errors import InputError
from twin.files.paths import require_writable
from twin.report.sections import Table
from twin.runs.stages import Progress
from twin.storage import load


def trajectory(
    console: Console,
    run: Path,
    robot: str,
    part: str | None,
    formats: Sequence[str],
    out: Path,
    goal: str = "open",
    from_state: str | None = None,
    overwrite: bool = False,
    accept_doubtful: bool = False,
) -> Outcome:
    """What a replay planned, in robots' formats."""
    require_writable(out)
    with console.progress() as progress:
        return trajectory_step(
            progress, run, robot, part, formats, out, goal, from_state, overwrite, accept_doubtful
        )


def trajectory_step(
    progress: Progress,
    run: Path,
    robot: str,
    name: str | None,
    formats: Sequence[str],
    out: Path,
    goal: str = "open",
    from_state: str | None = None,
    overwrite: bool = False,
    accept_doubtful: bool = False,
) -> Outcome:
    """Export what `replay` left of one part into `out`, or of all parts into folders of their names.

    Raises InputError for a part that is not trusted, unless `accept_doubtful`; before anything is written.
    """
    import robots
    from robots.task import task_of

    twin, spec = load(run), robots.resolve(robot)
    parts = parts_to_move(twin, [name] if name else [], run)
    from robots.formats import require_trust

    for part in parts:
        require_trust(part, accept_doubtful, twin)
    sources = []
    for part in parts:
        task = task_of(part, goal, from_state)
        path = replay_folder(run_folder(run), robot, part, task) / "trajectory.json"
        if not path.is_file():
            asked = "".join(
                f" --{k} {v}"
                for k, v in (("goal", goal), ("from-state", from_state))
                if v not in ("open", None)
            )
            raise InputError(
                f"{path} does not exist: no trajectory of {robot} for {part.name} yet",
                f"run `twin replay {run} --robot {robot} --part {part.name}{asked}`",
            )
        from robots.formats import PlannedMotion, native

        sources.append(PlannedMotion(native.load(path), part, spec))
    rows, files = [], {}
    for k, source in enumerate(sources):
        part_name = source.part.name
        progress("trajectory", k / len(sources), part_name)
        place = out if name else out / part_name
        from robots.formats import export_trajectory

        written = export_trajectory(
            source, formats, place, overwrite=overwrite, accept_doubtful=accept_doubtful
        )
        files[part_name] = {f: [str(p) for p in paths] for f, paths in written.items()}
        rows += [[part_name, f, path] for f, paths in files[part_name].items() for path in paths]
    progress("trajectory", 1.0, f"{len(rows)} files")
    table = Table(f"trajectories of {robot}", ["part", "format", "file"], rows)
    floors = [s.trajectory.floor for s in sources if s.trajectory.floor is not None]
    told = list({f.warning: 0 for f in floors if f.warning})
    return judged(Outcome({"files": files}, [table], warnings=told), twin)

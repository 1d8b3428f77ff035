"""The verb `twin replay`: plan and replay what the person in the recording did."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from robots.config import RobotsConfig
from robots.task import MotionRequest, task_of
from twin import geometry as geo
from twin.cli import given
from twin.cli.console import Console, Outcome
from twin.cli.step import Step, judged, page, run_folder, unlogged
from twin.cli.table import OPEN_RECORDING, named
from twin.errors import FuntwinError, InputError, PlanningError
from twin.files.paths import require_writable
from twin.files.text import read_json
from twin.report.sections import Table
from twin.runs.manifest import MANIFEST, opened_with
from twin.runs.settings import from_dict
from twin.runs.stages import Progress
from twin.scene import Part, Twin
from twin.storage import load
from twin.verdict import verdict_line

_COLUMNS = (
    "part",
    "opened",
    "open at the end",
    "slip",
    "torque used",
    "grasp",
    "pedestal",
    "floor",
    "result",
)


def replay(
    console: Console,
    run: Path,
    robot: str,
    parts: Sequence[str],
    recording: Path | None = None,
    stiffness: float | None = None,
    control: str | None = None,
    config: Path | None = None,
    set: Sequence[str] = (),
    **asked: Any,
) -> Outcome:
    """A robot opens or closes the parts. asked: of `MotionRequest`, and what there is to say of trials."""
    request = MotionRequest(**{f.name: asked.pop(f.name) for f in fields(MotionRequest) if f.name in asked})
    options = checked_trials(**asked)
    data, where = given.given_settings(config, set)
    given.put(data, "replay", {"stiffness": stiffness, "control": control})
    settings = from_dict(RobotsConfig, data, where if config or set else "options")
    # of a contact off its part the step tells in its warnings, which the page keeps
    with unlogged("robots.grasp.where_to_hold"), console.progress() as progress, page(run):
        return replay_step(progress, run, robot, parts, settings, options, request, recording).outcome


def checked_trials(trials: int | None = None, grid: bool = False, seed: int = 0) -> dict[str, Any] | None:
    """Arguments of `robots.run_trials`; None where no trials are asked for."""
    if trials is None:
        if grid or seed:
            raise InputError("--grid and --seed belong to trials", "add --trials 100")
        return None
    from robots.trials.run_trials import check_request

    check_request(trials, seed)
    return {"trials": trials, "grid": grid, "seed": seed}


def replay_step(
    progress: Progress,
    run: Path,
    robot: str,
    names: Sequence[str],
    settings: RobotsConfig | None = None,
    trials: Mapping[str, Any] | None = None,
    request: MotionRequest | None = None,
    recording: Path | None = None,
) -> Step:
    """Plan and replay; then `trials` (arguments of `robots.run_trials`) on parts that differ from the
    twin."""
    import robots

    started = time.perf_counter()
    twin, request = load(run), request or MotionRequest()
    parts = parts_to_move(twin, names, run)
    _require_one_part(request.contact, parts)
    for part in parts:
        task_of(part, request.goal, request.from_state)
    robots.resolve(robot)
    config = settings or RobotsConfig()
    require_writable(run_folder(run) / "replay")
    # what follows imports MuJoCo: every wrong answer that can be told without it was told before
    from robots.floor import floor_of
    from robots.grasp.by_shape import NothingToHold

    # one of several parts that can't be held does not keep the others from being moved
    missed = (PlanningError, *([NothingToHold] if len(parts) > 1 else []))
    demonstration, notes, warnings = _demonstration(twin, run_folder(run), recording)
    warnings += _of_contacts(twin, parts) if request.contact is None else []
    ground = floor_of(twin, request.floor)
    warnings += [ground.warning] if ground.warning else []
    twin = _completed(progress, twin, run_folder(run), parts[0], robot, request.contact)
    bench = _Bench(progress, twin, robot, run_folder(run), config, request, ground, demonstration)
    rows, reports, tables = [], {}, []
    for part in parts:
        row, report, note, trajectory = _replay_part(bench, part, missed)
        rows.append([part.name, *row])
        reports[part.name] = report
        notes += note
        if trials and trajectory is not None:
            table, report["trials"], assumed = _trials(bench, trajectory, trials)
            tables.append(table)
            notes += assumed
    summary = "; ".join(f"{r[0]} {r[2]} open at the end" for r in rows)
    tables = [Table(f"replay with {robot}", _COLUMNS, rows), *tables]
    outcome = Outcome({"parts": reports}, tables, notes, warnings, all(r["ok"] for r in reports.values()))
    return Step("replay", judged(outcome, twin), summary, started).recorded(run_folder(run))


def _require_one_part(contact: tuple[float, ...] | None, parts: Sequence[Part]) -> None:
    if contact is not None and len(parts) > 1:
        raise InputError(
            f"--contact is a point on one part, and {len(parts)} are to be moved",
            f"add --part with one of: {', '.join(p.name for p in parts)}",
        )


def _of_contacts(twin: Twin, parts: Sequence[Part]) -> list[str]:
    """Warnings about contacts that are off their parts."""
    from twin.contacts import contacts_off

    off = [o for o in contacts_off(twin) if o.part in {p.name for p in parts}]
    return [f"{o.problem}: its shape decides where to hold it; give --contact X,Y,Z" for o in off]


def parts_to_move(twin: Twin, names: Sequence[str], run: Path) -> list[Part]:
    """The parts of these names, all without names. Raises InputError for a twin without a moving part."""
    parts = [twin.part(n) for n in names] or list(twin.parts)
    if not parts:
        raise InputError(
            f"{run} has no moving part ({verdict_line(twin)})",
            "reconstruct a recording in which something is opened",
        )
    return parts


def _completed(
    progress: Progress,
    twin: Twin,
    run: Path,
    part: Part,
    robot: str,
    contact: tuple[float, ...] | None,
) -> Twin:
    """The twin with all that a simulation needs, for every plan, replay, trial; shapes are `twin export`'s.

    A robot that can't be read and a contact off its part are told before shapes are made.
    """
    import robots
    from robots.grasp.where_to_hold import holds_of
    from robots.model.mjcf import compiled
    from robots.scene.world import is_complete

    if is_complete(twin):
        return twin
    spec = robots.resolve(robot)
    compiled(spec)
    if contact is not None:
        holds_of(twin, part, spec, geo.as_float(contact), 0)
    progress("collision", 0.0, "convex pieces")
    twin = robots.completed(twin, run / "stages" / "collision")
    progress("collision", 1.0, f"{sum(len(p.collision) for p in twin.parts)} pieces on moving parts")
    return twin


def _demonstration(twin: Twin, run: Path, recording: Path | None) -> tuple[Any, list[str], list[str]]:
    """Frames of the recording for the film, notes and warnings; without any the film shows the robot alone.

    Without `recording` the run's manifest says where it is. Raises InputError when it can't be read.
    """
    from robots.demonstration import Demonstration

    known = read_json(run / MANIFEST).get("recording")
    path = recording or (run / known if isinstance(known, str) else None)
    hint = "give the twin's recording with --recording to see the person beside the robot"
    if path is None or (recording is None and not path.exists()):
        return None, [f"the film shows the robot alone; {hint}"], []
    try:
        opened = named(OPEN_RECORDING)(path, **opened_with(run))
    except InputError as e:
        if recording is not None:
            raise
        return None, [], [f"the film shows the robot alone: {e.problem}; {hint}"]
    if twin.recorded is not None and twin.recorded.fingerprint != opened.fingerprint:
        other = f"{path} is not, or no longer, what the twin was made from (its files differ)"
        return None, [], [f"the film shows the robot alone: {other}; {hint}"]
    return Demonstration(len(opened), opened.color), [], []


@dataclass(frozen=True, eq=False)
class _Bench:
    """What the replays of all parts share. floor: a `robots.floor.Floor`; demonstration: for the film."""

    progress: Progress
    twin: Twin
    robot: str
    run: Path
    config: RobotsConfig
    request: MotionRequest
    floor: Any
    demonstration: Any

    def folder(self, part: Part, task: Any) -> Path:
        """Where the replay of a part is kept."""
        return replay_folder(self.run, self.robot, part, task)


def _replay_part(
    bench: _Bench, part: Part, missed: tuple[type[FuntwinError], ...]
) -> tuple[list[str], dict[str, Any], list[str], Any]:
    """Table row, report, notes and trajectory of one part; no way to move it is a missed goal."""
    import robots

    progress, request, floor = bench.progress, bench.request, bench.floor
    progress(f"plan {part.name}", 0.0, "looking for a base and a grasp")
    try:
        trajectory = robots.plan(
            bench.twin,
            part.id,
            bench.robot,
            contact=None if request.contact is None else geo.as_float(request.contact),
            goal=request.goal,
            from_state=request.from_state,
            config=bench.config.plan,
            floor=floor,
        )
    except missed as e:
        progress(f"plan {part.name}", 1.0, "found none")
        row = ["-", "not", "-", "-", "-", "-", floor.text, "FAILED"]
        return row, {"ok": False, "floor": vars(floor), "reason": str(e)}, [f"{part.name}: {e}"], None
    progress(f"plan {part.name}", 1.0, trajectory.grasp)
    progress(f"replay {part.name}", 0.0, "in MuJoCo")
    r = robots.replay(
        bench.twin,
        trajectory,
        bench.folder(part, trajectory),
        robot=bench.robot,
        config=bench.config.replay,
        demonstration=bench.demonstration,
    )
    progress(f"replay {part.name}", 1.0, f"{100 * r.reached:z.0f} % of the way")
    row = [
        f"{100 * r.opening_peak:z.0f} %",
        f"{100 * r.opening_final:z.0f} %",
        f"{r.slip_mm:.1f} mm",
        f"{100 * max(r.torque_share):.0f} %",
        r.grasp,
        f"{r.pedestal:.2f} m",
        floor.text,
        "ok" if r.ok else "FAILED",
    ]
    return row, r.to_json(), [f"{part.name}: {r.reason}"] if r.reason else [], trajectory


def _trials(
    bench: _Bench, trajectory: Any, options: Mapping[str, Any]
) -> tuple[Table, dict[str, Any], list[str]]:
    """Table, data and notes of the trials of one part."""
    import robots
    from robots.trials.report import COLUMNS

    name = f"trials {trajectory.part}"
    bench.progress(name, 0.0, "")

    def tell(done: int, total: int) -> None:
        bench.progress(name, done / total, f"{done} of {total}")

    folder = bench.folder(bench.twin.part(trajectory.part_id), trajectory)
    report = robots.run_trials(
        bench.twin, trajectory, folder, robot=bench.robot, config=bench.config.replay, tell=tell, **options
    )
    table = Table(f"{name}: {options['trials']} for each error", COLUMNS, [r.cells() for r in report.rows])
    return table, report.summary(), [*report.assumed, f"{name}: {folder / 'trials.png'}"]


def replay_folder(run: Path, robot: str, part: Part, task: Any) -> Path:
    """Where the replay of a part from task.start to task.goal is kept: opening, closing, and between."""
    ends = tuple(round(100 * s / part.joint.upper) for s in (task.start, task.goal))
    suffix = {(0, 100): "", (100, 0): "_close"}.get(ends, f"_{ends[0]}_to_{ends[1]}")
    return run / "replay" / Path(robot).stem / f"{part.name}{suffix}"

"""The steps that the command line strings together: each does one thing to a run folder and keeps its tables there.

`recon` and `robots` are named as strings and imported when a step needs them: the twin knows neither.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from twin.cli.console import Outcome
from twin.errors import FuntwinError, InputError, PlanningError
from twin.files.paths import require_writable
from twin.files.text import read_json
from twin.report.sections import Section, Table, save_section
from twin.runs.stages import MANIFEST, Progress
from twin.scene import Part, Twin
from twin.storage import load, update


class Step:
    """What one verb did, how long it took, and a line about it."""

    def __init__(self, verb: str, outcome: Outcome, summary: str, started: float) -> None:
        self.verb, self.outcome, self.summary = verb, outcome, summary
        self.seconds = time.perf_counter() - started

    def kept(self, run: Path) -> Step:
        """Keep the tables for the page."""
        o = self.outcome
        save_section(run, Section(self.verb, o.ok, round(self.seconds, 2), o.tables, o.warnings, o.notes))
        return self


def reconstruct(
    progress: Progress, recording: Any, out: Path, settings: Any, joint_hint: str | None = None
) -> Step:
    """recording: a `recon.Recording`."""
    started = time.perf_counter()
    hint = None if joint_hint is None else named("recon.models:joint_hint")(joint_hint)
    twin = named("recon.pipeline:reconstruct")(recording, settings, out=out, progress=progress, hint=hint)
    manifest = read_json(out / MANIFEST)
    warnings = [
        *manifest.get("warnings", []),
        *(w for s in manifest.get("stages", []) for w in s["warnings"]),
    ]
    rows = [[p.name, *joint_row(p)] for p in twin.parts]
    columns = ["part", "joint", "range", "axis ±", "pivot ±", "mass"]
    stages = {s["name"]: s["seconds"] for s in manifest.get("stages", [])}
    summary = "; ".join(f"{p.name}: {_joint_text(p)}" for p in twin.parts)
    data = {"run": str(out), "parts": [p.name for p in twin.parts], "seconds": stages}
    outcome = Outcome(data, [Table(f"{twin.name} → {out}", columns, rows)], [page_note(out)], warnings)
    return Step("reconstruct", outcome, summary, started)


def export(
    progress: Progress,
    run: Path,
    formats: Sequence[str],
    package: str = "",
    asset: Any = None,
    overwrite: bool = False,
) -> Step:
    started = time.perf_counter()
    twin = load(run)
    folder = run_folder(run) / "export"
    progress("collision", 0.0, "convex pieces")
    cache = run_folder(run) / "stages" / "collision"
    complete = named("twin.exporters:complete")(twin, cache)
    update(twin, complete, run)
    progress("collision", 1.0, f"{sum(len(p.collision) for p in complete.parts)} pieces on moving parts")
    progress("export", 0.0, "")
    files = named("twin.exporters:export")(
        complete, folder, formats, package, asset=asset, overwrite=overwrite
    )
    progress("export", 1.0, ", ".join(files))
    rows = [[name, str(path)] for name, path in files.items()]
    reports = named("twin.exporters.shape_report:collision_reports")(complete, cache)
    data = {
        "files": {name: str(path) for name, path in files.items()},
        "collision": [r.to_json() for r in reports],
    }
    columns = named("twin.exporters.shape_report:COLUMNS")
    tables = [
        Table("export", ["format", "file"], rows),
        Table("collision shapes", columns, [r.row() for r in reports]),
    ]
    warnings = [*files.warnings, *(r.warning for r in reports if r.warning)]
    outcome = Outcome(data, tables, warnings=warnings)
    return Step("export", outcome, ", ".join(files), started).kept(run_folder(run))


def check(
    progress: Progress, run: Path, formats: Sequence[str], engines: Sequence[str] | None = None
) -> Step:
    started = time.perf_counter()
    twin, folder = load(run), run_folder(run) / "export"
    files = {
        f: folder / f / f"{twin.name}{s}"
        for f, s in named("twin.verification:SUFFIX").items()
        if f in formats
    }
    missing = [f for f, path in files.items() if not path.is_file()]
    if missing:
        raise InputError(
            f"{files[missing[0]]} does not exist", f"run `twin export {run} --format {' '.join(missing)}`"
        )
    proofs = named("twin.verification.proofs:prove")(progress, twin, files, engines)
    ok, summary = all(p.ok for p in proofs), "; ".join(p.summary for p in proofs)
    outcome = Outcome(
        {"ok": ok, **{p.key: p.data for p in proofs}},
        [t for p in proofs for t in p.tables],
        [x for p in proofs for x in (*p.notes, p.summary)],
        [w for p in proofs for w in p.warnings],
        ok,
    )
    return Step("check", outcome, summary, started).kept(run_folder(run))


def replay(
    progress: Progress,
    run: Path,
    robot: str,
    names: Sequence[str],
    settings: Mapping[str, Any] | None = None,
    trials: Mapping[str, Any] | None = None,
    goal: str = "open",
    start: str | None = None,
    recording: Path | None = None,
    contact: tuple[float, ...] | None = None,
    floor: float | None = None,
) -> Step:
    """Plan and replay; then, with `trials` (arguments of `robots.run_trials`), on parts that differ from the twin.

    settings: fields of `robots.ReplayConfig`. contact: point (3,) in m where a part is held, twin's world at state 0. floor:
    height (m) in the twin's world.
    """
    started = time.perf_counter()
    twin = load(run)
    parts = [_partnamed(twin, n) for n in names] or list(twin.parts)
    if not parts:
        raise InputError(f"{run} has no moving part", "reconstruct a recording in which something is opened")
    if contact is not None and len(parts) > 1:
        raise InputError(
            f"--contact is a point on one part, and {len(parts)} are to be moved",
            f"add --part with one of: {', '.join(p.name for p in parts)}",
        )
    tasks = {part.id: named("robots.task:task_of")(part, goal, start) for part in parts}
    named("robots:resolve")(robot)
    config = named("robots:ReplayConfig")(**(settings or {}))
    require_writable(run_folder(run) / "replay")
    # what follows imports MuJoCo: every wrong answer that can be told without it was told before
    # one of several parts that can't be held does not keep the others from being moved
    missed = (PlanningError, *([named("robots.grasp.where_to_hold:NothingToHold")] if len(parts) > 1 else []))
    demonstration, notes, warnings = _demonstration(twin, run_folder(run), recording)
    if contact is None:
        off = [o for o in named("twin.contacts:contacts_off")(twin) if o.part in {p.name for p in parts}]
        warnings += [f"{o.problem}: its shape decides where to hold it; give --contact X,Y,Z" for o in off]
    ground = named("robots.floor:floor_of")(twin, floor)
    warnings += [ground.warning] if ground.warning else []
    rows, reports, tables = [], {}, []
    for part in parts:
        row, report, note, trajectory = _replay_part(
            progress,
            twin,
            part,
            robot,
            run_folder(run),
            config,
            tasks[part.id],
            contact,
            ground,
            demonstration,
            missed,
        )
        rows.append([part.name, *row])
        reports[part.name] = report
        notes += note
        if trials and trajectory is not None:
            table, report["trials"], assumed = _trials(
                progress, twin, trajectory, robot, run_folder(run), config, trials
            )
            tables.append(table)
            notes += assumed
    columns = [
        "part",
        "opened",
        "open at the end",
        "slip",
        "torque used",
        "grasp",
        "pedestal",
        "floor",
        "result",
    ]
    ok = all(r["ok"] for r in reports.values())
    summary = "; ".join(f"{r[0]} {r[2]} open at the end" for r in rows)
    tables = [Table(f"replay with {robot}", columns, rows), *tables]
    outcome = Outcome({"parts": reports}, tables, notes, warnings, ok)
    return Step("replay", outcome, summary, started).kept(run_folder(run))


def _demonstration(twin: Twin, run: Path, recording: Path | None) -> tuple[Any, list[str], list[str]]:
    """Frames of the recording for the film, notes and warnings; without any the film shows the robot alone.

    Without `recording` it is looked for where the run's manifest says that it was. Raises InputError when `recording`
    can't be read.
    """
    known = read_json(run / MANIFEST).get("recording")
    path = recording or (run / known if isinstance(known, str) else None)
    hint = "give the twin's recording with --recording to see the person beside the robot"
    if path is None or (recording is None and not path.exists()):
        return None, [f"the film shows the robot alone; {hint}"], []
    try:
        opened = named("recon.readers:open_recording")(path)
    except InputError as e:
        if recording is not None:
            raise
        return None, [], [f"the film shows the robot alone: {e.problem}; {hint}"]
    if twin.recorded is not None and twin.recorded.fingerprint != opened.fingerprint:
        other = f"{path} is not, or no longer, what the twin was made from (its files differ)"
        return None, [], [f"the film shows the robot alone: {other}; {hint}"]
    return named("robots:Demonstration")(len(opened), lambda k: opened.frame(k).color), [], []


def _replay_part(
    progress: Progress,
    twin: Twin,
    part: Part,
    robot: str,
    run: Path,
    config: Any,
    task: Any,
    contact: tuple[float, ...] | None,
    floor: Any,
    demonstration: Any,
    missed: tuple[type[FuntwinError], ...],
) -> tuple[list[str], dict[str, Any], list[str], Any]:
    """Table row, report, notes and trajectory of one part; no way to move it is a missed goal, not a wrong input."""
    progress(f"plan {part.name}", 0.0, "looking for a base and a grasp")
    try:
        trajectory = named("robots:plan")(
            twin, part.id, robot, contact=contact, goal=task.goal, start=task.start, floor=floor
        )
    except missed as e:
        progress(f"plan {part.name}", 1.0, "found none")
        row = ["-", "not", "-", "-", "-", "-", floor.text, "FAILED"]
        return row, {"ok": False, "floor": vars(floor), "reason": str(e)}, [f"{part.name}: {e}"], None
    progress(f"plan {part.name}", 1.0, trajectory.grasp)
    progress(f"replay {part.name}", 0.0, "in MuJoCo")
    folder = _replay_folder(run, robot, part, task)
    r = named("robots:replay")(
        twin, trajectory, folder, robot=robot, config=config, demonstration=demonstration
    )
    progress(f"replay {part.name}", 1.0, f"{100 * r.reached:.0f} % of the way")
    row = [
        f"{100 * r.opening_peak:.0f} %",
        f"{100 * r.opening_final:.0f} %",
        f"{r.slip_mm:.1f} mm",
        f"{100 * max(r.torque_share):.0f} %",
        r.grasp,
        f"{r.pedestal:.2f} m",
        floor.text,
        "ok" if r.ok else "FAILED",
    ]
    return row, r.to_json(), [f"{part.name}: {r.reason}"] if r.reason else [], trajectory


def _trials(
    progress: Progress,
    twin: Twin,
    trajectory: Any,
    robot: str,
    run: Path,
    config: Any,
    options: Mapping[str, Any],
) -> tuple[Table, dict[str, Any], list[str]]:
    """Table, data and notes of the trials of one part."""
    name = f"trials {trajectory.part}"
    progress(name, 0.0, "")

    def tell(done: int, total: int) -> None:
        progress(name, done / total, f"{done} of {total}")

    folder = _replay_folder(run, robot, twin.part(trajectory.part_id), trajectory)
    report = named("robots:run_trials")(
        twin, trajectory, folder, robot=robot, config=config, tell=tell, **options
    )
    columns = named("robots.trials.run_trials:COLUMNS")
    table = Table(f"{name}: {options['trials']} for each error", columns, [r.cells() for r in report.rows])
    return table, report.summary(), [*report.assumed, f"{name}: {folder / 'trials.png'}"]


def _replay_folder(run: Path, robot: str, part: Part, task: Any) -> Path:
    """Where the replay of a part is kept that goes from task.start to task.goal: opening, closing, and between."""
    ends = tuple(round(100 * s / part.joint.upper) for s in (task.start, task.goal))
    suffix = {(0, 100): "", (100, 0): "_close"}.get(ends, f"_{ends[0]}_to_{ends[1]}")
    return run / "replay" / Path(robot).stem / f"{part.name}{suffix}"


def trajectory(
    progress: Progress,
    run: Path,
    robot: str,
    name: str | None,
    formats: Sequence[str],
    out: Path,
    goal: str = "open",
    start: str | None = None,
    overwrite: bool = False,
) -> Outcome:
    """Export what `replay` left of one part into `out`, or of all parts into folders of their names."""
    twin, spec = load(run), named("robots:resolve")(robot)
    parts = [_partnamed(twin, name)] if name else list(twin.parts)
    if not parts:
        raise InputError(f"{run} has no moving part", "reconstruct a recording in which something is opened")
    sources = []
    for part in parts:
        task = named("robots.task:task_of")(part, goal, start)
        path = _replay_folder(run_folder(run), robot, part, task) / "trajectory.json"
        if not path.is_file():
            asked = "".join(
                f" --{k} {v}" for k, v in (("goal", goal), ("start", start)) if v not in ("open", None)
            )
            raise InputError(
                f"{path} does not exist: no trajectory of {robot} for {part.name} yet",
                f"run `twin replay {run} --robot {robot} --part {part.name}{asked}`",
            )
        planned = named("robots.formats.native:load")(path)
        sources.append(named("robots.formats:PlannedMotion")(planned, part, spec))
    rows, files = [], {}
    for k, source in enumerate(sources):
        part_name = source.part.name
        progress("trajectory", k / len(sources), part_name)
        place = out if name else out / part_name
        written = named("robots.formats:export_trajectory")(source, formats, place, overwrite=overwrite)
        files[part_name] = {f: [str(p) for p in paths] for f, paths in written.items()}
        rows += [[part_name, f, path] for f, paths in files[part_name].items() for path in paths]
    progress("trajectory", 1.0, f"{len(rows)} files")
    table = Table(f"trajectories of {robot}", ["part", "format", "file"], rows)
    floors = [s.trajectory.floor for s in sources if s.trajectory.floor is not None]
    return Outcome({"files": files}, [table], warnings=list({f.warning: 0 for f in floors if f.warning}))


def evaluate(progress: Progress, run: Path, truth: Path) -> Step:
    started = time.perf_counter()
    twin, true = (
        load(run),
        named("recon.evaluation.truth:load_truth")(truth),
    )  # before what takes seconds to import
    progress("evaluate", 0.0, "")
    evaluation = named("recon.evaluation.evaluate:evaluate")(twin, true)
    progress("evaluate", 1.0, "")
    goals = [r for r in evaluation.rows if r.ok is not None]
    met = sum(bool(r.ok) for r in goals)
    verdict = {None: "", True: "ok", False: "FAILED"}
    rows = [
        [
            r.metric,
            r.part,
            f"{r.value:.4g} {r.unit}".strip(),
            "-" if r.matched is None else f"{r.matched:.4g}",
            str(r.goal or ""),
            verdict[r.ok],
        ]
        for r in evaluation.rows
    ]
    columns = ["measure", "of", "value", "matched only", "goal", ""]
    summary = f"{met} of {len(goals)} goals met"
    outcome = Outcome(
        evaluation.as_dict(), [Table(evaluation.name, columns, rows)], [summary], ok=evaluation.ok
    )
    return Step("evaluate", outcome, summary, started).kept(run_folder(run))


def run_folder(path: Path) -> Path:
    """The run folder of a path that is one, or that is its twin/."""
    return path.parent if (path / "twin.json").is_file() and path.name == "twin" else path


def _partnamed(twin: Twin, name: str) -> Part:
    return twin.part(int(name) if name.isdecimal() else name)


def joint_row(part: Part) -> list[str]:
    """Type, range, 1 sigma of axis and pivot, and mass of a part, for a table."""
    from twin.report.page import part_facts

    facts = {name: value for name, value, _ in part_facts(part)}
    axis, pivot = (facts.get(k, "").partition(" ± ")[2] for k in ("axis", "pivot"))
    return [part.joint.kind, facts["range"], axis, pivot, facts.get("mass", "")]


def _joint_text(part: Part) -> str:
    from twin.report.page import part_facts

    facts = {name: value for name, value, _ in part_facts(part)}
    return f"{part.joint.kind}, {facts['range']}"


def named(name: str) -> Any:
    """The object "module:attribute"."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)


def page_note(run: Path) -> str:
    return f"report: {run / 'report.html'}"

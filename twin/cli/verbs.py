"""What the verbs of the command line do. Only `twin.cli.main` uses this module."""

from __future__ import annotations

import logging
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from twin.cli import steps
from twin.cli.console import Console, Outcome
from twin.errors import ConfigError, FuntwinError, InputError
from twin.files.assets import asset
from twin.files.paths import require_writable
from twin.report.sections import Table, require_own_page
from twin.runs.run_lock import claimed
from twin.runs.settings import from_dict, read_toml
from twin.runs.stages import MANIFEST
from twin.storage import require_place


def demo(
    console: Console, out: Path, recording: Path | None, robot: str, config: Path | None, set: Sequence[str]
) -> Outcome:
    """The whole chain: reconstruct, evaluate where there is truth, export, check, replay."""
    _require_run(out)
    steps.named("robots:resolve")(robot)
    recording = recording or asset("recordings/cabinet_drawer")
    truth = recording / "truth"
    opened = steps.named("recon.readers:open_recording")(recording)
    with console.progress() as progress, _page(out):
        settings = _settings("recon.config:ReconConfig", config, set)
        done = [steps.reconstruct(progress, opened, out, settings)]
        with claimed(out):
            if truth.is_dir():
                done.append(steps.evaluate(progress, out, truth))
            done.append(steps.export(progress, out, ("urdf", "mjcf", "usd")))
            done.append(steps.check(progress, out, ("urdf", "mjcf", "usd")))
            done.append(steps.replay(progress, out, robot, ()))
    rows = [[s.verb, s.summary, f"{s.seconds:.1f} s", "ok" if s.outcome.ok else "FAILED"] for s in done]
    shown = [t for s in done if not s.outcome.ok or s.verb == "evaluate" for t in s.outcome.tables]
    return Outcome(
        data={"run": str(out), "steps": {s.verb: {"ok": s.outcome.ok, **s.outcome.data} for s in done}},
        tables=[*shown, Table(f"{recording.name} → {out}", ["step", "result", "time", ""], rows)],
        notes=[steps.page_note(out)],
        warnings=[w for s in done if s.verb != "export" for w in s.outcome.warnings],  # the page has them all
        ok=all(s.outcome.ok for s in done),
    )


def simulate(
    console: Console, scene: Path, joint: str, out: Path, config: Path | None, set: Sequence[str]
) -> Outcome:
    """Render a recording with truth."""
    require_writable(out)
    settings = _settings("recon.simulate.config:SimulateConfig", config, set)
    steps.named("recon.simulate.joints:require_joint")(scene, joint)
    with console.progress() as progress:

        def tell(done: int, total: int) -> None:
            progress("simulate", done / total, f"{done} of {total} frames")

        folder = steps.named("recon.simulate:simulate")(scene, joint, out, settings, progress=tell)
    return Outcome({"recording": str(folder)}, notes=[f"recording: {folder}", f"truth: {folder / 'truth'}"])


def reconstruct(
    console: Console,
    recording: Path,
    out: Path,
    layout: str | None,
    joint_hint: str | None,
    config: Path | None,
    set: Sequence[str],
) -> Outcome:
    """Recording to twin."""
    _require_run(out)
    told = _told(config, set)
    opened = steps.named("recon.readers:open_recording")(recording, layout)
    settings = from_dict(steps.named("recon.config:ReconConfig"), *told)
    with console.progress() as progress, _page(out):
        return steps.reconstruct(progress, opened, out, settings, joint_hint).outcome


def import_scene(
    console: Console,
    scene: Path,
    out: Path,
    closed: Sequence[str] = (),
    limits: Sequence[str] = (),
    exclude: Sequence[str] = (),
) -> Outcome:
    """A scene from elsewhere to twin."""
    _require_run(out)
    step = steps.named("twin.importers.step:import_scene")
    with console.progress() as progress, _page(out):
        made: Outcome = step(progress, scene, out, closed, limits, exclude).outcome
        return made


def export(
    console: Console,
    run: Path,
    formats: Sequence[str],
    package: str,
    asset: Sequence[str],
    overwrite: bool = False,
) -> Outcome:
    """Twin to simulation formats."""
    if package:
        steps.named("twin.exporters.package:check_package")(package)
    told = from_dict(steps.named("twin.exporters.asset:AssetInfo"), _texts("--asset", asset), "--asset")
    with console.progress() as progress, _page(run):
        return steps.export(progress, run, formats, package, told, overwrite).outcome


def check(
    console: Console, run: Path, formats: Sequence[str], engines: Sequence[str] | None = None
) -> Outcome:
    """Exported files against the twin."""
    with console.progress() as progress, _page(run):
        return steps.check(progress, run, formats, engines).outcome


def lint(console: Console, paths: Sequence[Path], ignore: Sequence[str], show_rules: bool) -> Outcome:
    """Faults in simulation files, ours or not."""
    from twin.lint import lint as look
    from twin.lint.rules import RULES
    from twin.lint.rules.twins import TWIN_RULES

    if show_rules:
        rules = [[name, rule.catches, rule.matters] for name, rule in RULES.items()]
        rules += [[name, rule.catches, rule.matters] for name, rule in TWIN_RULES.items()]
        data = {"rules": [{"name": n, "catches": c, "matters": m} for n, c, m in rules]}
        return Outcome(data, [Table("rules", ["rule", "finds", "why it matters"], rules)])
    if not paths:
        raise InputError("no file is named", "give URDF, MJCF or USD files or a run folder, or --rules")
    with console.progress() as progress:
        progress("lint", 0.0, "")
        report = look(paths, ignore)
        progress("lint", 1.0, f"{len(report.files)} files")
    tables = []
    for file in report.files:
        mine = [f for f in report.findings if f.file == file]
        rows = [[f.severity, f.rule, f.element, f.value, f"{f.problem}; {f.remedy}"] for f in mine]
        if rows:
            tables.append(Table(file, ["", "rule", "element", "value", "what is wrong, what to do"], rows))
    errors = sum(f.severity == "error" for f in report.findings)
    counted = f"{errors} errors and {len(report.findings) - errors} warnings in {len(report.files)} files"
    return Outcome(report.to_dict(), tables, [*report.notes, counted], ok=report.ok)


def replay(
    console: Console,
    run: Path,
    robot: str,
    parts: Sequence[str],
    stiffness: float | None = None,
    control: str | None = None,
    trials: int | None = None,
    grid: bool = False,
    seed: int = 0,
    goal: str = "open",
    start: str | None = None,
    recording: Path | None = None,
    contact: tuple[float, ...] | None = None,
    floor: float | None = None,
) -> Outcome:
    """A robot opens or closes the parts."""
    options = None
    if trials is not None:
        steps.named("robots.trials.run_trials:check_request")(trials, seed)
        options = {"trials": trials, "grid": grid, "seed": seed}
    elif grid or seed:
        raise InputError("--grid and --seed belong to trials", "add --trials 100")
    asked = {"stiffness": stiffness, "control": control}
    settings = {key: value for key, value in asked.items() if value is not None}
    # of a contact off its part the step tells in its warnings, which the page keeps
    with _unlogged("robots.grasp.where_to_hold"), console.progress() as progress, _page(run):
        return steps.replay(
            progress, run, robot, parts, settings, options, goal, start, recording, contact, floor
        ).outcome


def trajectory(
    console: Console,
    run: Path,
    robot: str,
    part: str | None,
    formats: Sequence[str],
    out: Path,
    goal: str = "open",
    start: str | None = None,
    overwrite: bool = False,
) -> Outcome:
    """What a replay planned, in robots' formats."""
    require_writable(out)
    with console.progress() as progress:
        return steps.trajectory(progress, run, robot, part, formats, out, goal, start, overwrite)


def evaluate(console: Console, run: Path, truth: Path) -> Outcome:
    """Twin against truth."""
    with console.progress() as progress, _page(run):
        return steps.evaluate(progress, run, truth).outcome


def doctor(console: Console) -> Outcome:
    """What this machine lacks."""
    from twin.cli.doctor import HOW_TO_INSTALL, diagnose, remedies

    with console.progress() as progress:
        progress("doctor", 0.0, "drawing a picture")
        findings = diagnose()
        progress("doctor", 1.0, "")
    rows = [
        [f.name, f.detail, "ok" if f.ok else ("missing" if f.needed else "not installed (optional)")]
        for f in findings
    ]
    commands = remedies(findings)
    extras = [f"optional: {f.name}: {f.remedy}" for f in findings if not f.ok and not f.needed]
    if any(f.python for f in findings):
        extras.append(HOW_TO_INSTALL)
    notes = [] if commands else ["everything that is needed is here"]
    problem = f"something that is needed is missing or altered; {'; '.join(commands)}" if commands else ""
    data = {"findings": [vars(f) for f in findings], "commands": commands}
    return Outcome(
        data,
        [Table("this machine", ["what", "found", ""], rows)],
        [*notes, *extras],
        ok=not commands,
        problem=problem,
    )


def engines(console: Console, install: Sequence[str]) -> Outcome:
    """The environments of the programs that judge exports; makes those that are named."""
    from twin.engines import ENGINES, engine
    from twin.engines import install as make

    chosen = list(ENGINES) if "all" in install else [engine(n).name for n in install]
    with console.progress() as progress:
        for k, name in enumerate(chosen):
            progress("engines", k / len(chosen), f"installing {name}")
            make([name])
        if chosen:
            progress("engines", 1.0, ", ".join(chosen))
    rows = [[e.name, e.purpose, str(e.folder) if e.installed else "not installed"] for e in ENGINES.values()]
    data = {"engines": {e.name: str(e.folder) if e.installed else None for e in ENGINES.values()}}
    missing = [e.name for e in ENGINES.values() if not e.installed]
    notes = [f"install with: twin engines --install {' '.join(missing)}"] if missing else []
    return Outcome(data, [Table("engines", ["name", "what for", "where"], rows)], notes)


@contextmanager
def _unlogged(name: str) -> Iterator[None]:
    """Keep the warnings of a logger from the terminal, where the verb tells them itself."""
    logger = logging.getLogger(name)
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


@contextmanager
def _page(run: Path) -> Iterator[None]:
    """Hold the run and render its page when the verb is done, also when it failed for a reason the user can mend after it
    changed the run.

    A run folder that is not there yet is held by what makes it.
    """
    place = steps.run_folder(run)
    with claimed(place) if place.is_dir() else nullcontext():
        require_own_page(place)
        before = _shown(place)
        try:
            yield
        except FuntwinError:
            if (place / MANIFEST).is_file() and _shown(place) != before:
                steps.named("twin.report:render")(place)
            raise
        with claimed(place):
            steps.named("twin.report:render")(place)


def _shown(run: Path) -> dict[Path, int]:
    """When what the page shows was written last."""
    files = (run / MANIFEST, run / "twin" / "twin.json", *(run / "report").glob("*.json"))
    return {f: f.stat().st_mtime_ns for f in files if f.is_file()}


def _require_run(out: Path) -> None:
    """Raises InputError unless a twin can be written to the run folder; cheap, for before anything is computed."""
    require_writable(out)
    require_place(out / "twin")


def _settings(cls: str, path: Path | None, assignments: Sequence[str]) -> Any:
    """The configuration class named by `cls`, from a TOML file and KEY=VALUE texts on top of it."""
    data, where = _told(path, assignments)
    return from_dict(steps.named(cls), data, where)


def _told(path: Path | None, assignments: Sequence[str]) -> tuple[dict[str, Any], str]:
    """Settings as they were given, and by what."""
    data = {} if path is None else read_toml(path)
    where = "--set" if path is None else str(path)
    for text in assignments:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise ConfigError(f"--set {text!r} is not KEY=VALUE", "write for example --set seed=3")
        _assign(data, key.strip().split("."), value.strip())
    return data, where


def _texts(option: str, assignments: Sequence[str]) -> dict[str, str]:
    """KEY=VALUE texts as a mapping; the values stay texts."""
    data = {}
    for text in assignments:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise ConfigError(
                f"{option} {text!r} is not KEY=VALUE", f"write for example {option} license=CC0-1.0"
            )
        data[key.strip()] = value.strip()
    return data


def _assign(data: dict[str, Any], keys: Sequence[str], text: str) -> None:
    for key in keys[:-1]:
        data = data.setdefault(key, {})
        if not isinstance(data, dict):
            raise ConfigError(f"--set {'.'.join(keys)}: {key!r} is a value, not a table")
    try:
        data[keys[-1]] = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        data[keys[-1]] = text  # a bare word is a text

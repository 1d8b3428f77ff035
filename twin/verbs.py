"""What the verbs of the command line do. Only `twin.cli` uses this module.

`recon` and `robots` are named as strings and imported when a verb needs them: the twin knows neither.
"""

from __future__ import annotations

import time
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, fields
from importlib import import_module
from pathlib import Path
from typing import Any

from twin.console import Console, Outcome
from twin.errors import ConfigError, FuntwinError, InputError, PlanningError
from twin.report.sections import Section, Table, save_section
from twin.scene import Part, Twin
from twin.settings import from_dict
from twin.stages import MANIFEST, Progress, read_json
from twin.storage import load, save

RECORDINGS = Path(__file__).resolve().parents[1] / "assets" / "recordings"


def demo(
    console: Console, out: Path, recording: Path | None, robot: str, config: Path | None, set: Sequence[str]
) -> Outcome:
    """The whole chain: reconstruct, evaluate where there is truth, export, check, replay."""
    recording = recording or _shipped_recording()
    truth = recording / "truth"
    with console.progress() as progress, _page(out):
        steps = [
            _reconstruct(progress, recording, out, None, _settings("recon.config:ReconConfig", config, set))
        ]
        if truth.is_dir():
            steps.append(_evaluate(progress, out, truth))
        steps.append(_export(progress, out, ("urdf", "mjcf", "usd")))
        steps.append(_check(progress, out, ("urdf", "mjcf", "usd")))
        steps.append(_replay(progress, out, robot, ()))
    rows = [[s.verb, s.summary, f"{s.seconds:.1f} s", "ok" if s.outcome.ok else "FAILED"] for s in steps]
    failed = [t for s in steps if not s.outcome.ok for t in s.outcome.tables]
    return Outcome(
        data={"run": str(out), "steps": {s.verb: {"ok": s.outcome.ok, **s.outcome.data} for s in steps}},
        tables=[*failed, Table(f"{recording.name} → {out}", ["step", "result", "time", ""], rows)],
        notes=[_page_note(out)],
        warnings=[w for s in steps for w in s.outcome.warnings],
        ok=all(s.outcome.ok for s in steps),
    )


def simulate(
    console: Console, scene: Path, joint: str, out: Path, config: Path | None, set: Sequence[str]
) -> Outcome:
    """Render a recording with truth."""
    settings = _settings("recon.simulate.config:SimulateConfig", config, set)
    with console.progress() as progress:

        def tell(done: int, total: int) -> None:
            progress("simulate", done / total, f"{done} of {total} frames")

        folder = _named("recon.simulate:simulate")(scene, joint, out, settings, progress=tell)
    return Outcome({"recording": str(folder)}, notes=[f"recording: {folder}", f"truth: {folder / 'truth'}"])


def reconstruct(
    console: Console, recording: Path, out: Path, layout: str | None, config: Path | None, set: Sequence[str]
) -> Outcome:
    """Recording to twin."""
    settings = _settings("recon.config:ReconConfig", config, set)
    with console.progress() as progress, _page(out):
        return _reconstruct(progress, recording, out, layout, settings).outcome


def export(console: Console, run: Path, formats: Sequence[str]) -> Outcome:
    """Twin to simulation formats."""
    with console.progress() as progress, _page(run):
        return _export(progress, run, formats).outcome


def check(console: Console, run: Path, formats: Sequence[str]) -> Outcome:
    """Exported files against the twin."""
    with console.progress() as progress, _page(run):
        return _check(progress, run, formats).outcome


def replay(console: Console, run: Path, robot: str, parts: Sequence[str]) -> Outcome:
    """A robot opens the parts."""
    with console.progress() as progress, _page(run):
        return _replay(progress, run, robot, parts).outcome


def evaluate(console: Console, run: Path, truth: Path) -> Outcome:
    """Twin against truth."""
    with console.progress() as progress, _page(run):
        return _evaluate(progress, run, truth).outcome


def doctor(console: Console) -> Outcome:
    """What this machine lacks."""
    from twin.doctor import diagnose, remedies

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
    notes = [] if commands else ["everything that is needed is here"]
    problem = f"something that is needed is missing; run: {' && '.join(commands)}" if commands else ""
    data = {"findings": [vars(f) for f in findings], "commands": commands}
    return Outcome(
        data,
        [Table("this machine", ["what", "found", ""], rows)],
        [*notes, *extras],
        ok=not commands,
        problem=problem,
    )


class _Step:
    """What one verb did, how long it took, and a line about it."""

    def __init__(self, verb: str, outcome: Outcome, summary: str, started: float) -> None:
        self.verb, self.outcome, self.summary = verb, outcome, summary
        self.seconds = time.perf_counter() - started

    def kept(self, run: Path) -> _Step:
        """Keep the tables for the page."""
        o = self.outcome
        save_section(run, Section(self.verb, o.ok, round(self.seconds, 2), o.tables, o.warnings, o.notes))
        return self


def _reconstruct(progress: Progress, recording: Path, out: Path, layout: str | None, settings: Any) -> _Step:
    started = time.perf_counter()
    opened = _named("recon.recording:open_recording")(recording, layout)
    twin = _named("recon.pipeline:reconstruct")(opened, settings, out=out, progress=progress)
    manifest = read_json(out / MANIFEST)
    warnings = [
        *manifest.get("warnings", []),
        *(w for s in manifest.get("stages", []) for w in s["warnings"]),
    ]
    rows = [[p.name, *_part_row(p)] for p in twin.parts]
    columns = ["part", "joint", "range", "axis ±", "pivot ±", "mass", "held at, m"]
    stages = {s["name"]: s["seconds"] for s in manifest.get("stages", [])}
    summary = "; ".join(f"{p.name}: {_joint_text(p)}" for p in twin.parts)
    data = {"run": str(out), "parts": [p.name for p in twin.parts], "seconds": stages}
    outcome = Outcome(data, [Table(f"{twin.name} → {out}", columns, rows)], [_page_note(out)], warnings)
    return _Step("reconstruct", outcome, summary, started)


def _export(progress: Progress, run: Path, formats: Sequence[str]) -> _Step:
    started = time.perf_counter()
    twin = load(run)
    folder = run_folder(run) / "export"
    progress("collision", 0.0, "convex pieces")
    complete = _named("twin.export:complete")(twin)
    if complete is not twin:
        save(complete, run_folder(run) / "twin")
    progress("collision", 1.0, f"{sum(len(p.collision) for p in complete.parts)} pieces on moving parts")
    progress("export", 0.0, "")
    files = _named("twin.export:export")(complete, folder, formats)
    progress("export", 1.0, ", ".join(files))
    rows = [[name, str(path)] for name, path in files.items()]
    data = {"files": {name: str(path) for name, path in files.items()}}
    outcome = Outcome(data, [Table("export", ["format", "file"], rows)], warnings=files.warnings)
    return _Step("export", outcome, ", ".join(files), started).kept(run_folder(run))


def _check(progress: Progress, run: Path, formats: Sequence[str]) -> _Step:
    started = time.perf_counter()
    twin = load(run)
    progress("check", 0.0, "loading the files in other programs")
    report = _named("twin.check:check")(twin, run_folder(run) / "export", formats)
    progress("check", 1.0, "")
    met = sum(bool(r.ok) for r in report.rows)
    columns = [f.name.replace("_", " ") for f in fields(report.rows[0])] if report.rows else []
    rows = [[_cell(getattr(r, f.name)) for f in fields(r)] for r in report.rows]
    summary = f"{met} of {len(rows)} comparisons agree"
    data = {"rows": [asdict(r) for r in report.rows]}
    outcome = Outcome(data, [Table("check", columns, rows)], [summary], ok=report.ok)
    return _Step("check", outcome, summary, started).kept(run_folder(run))


def _replay(progress: Progress, run: Path, robot: str, names: Sequence[str]) -> _Step:
    started = time.perf_counter()
    twin = load(run)
    parts = [_part_named(twin, n) for n in names] or list(twin.parts)
    if not parts:
        raise InputError(f"{run} has no moving part", "reconstruct a recording in which something is opened")
    rows, reports, notes = [], {}, []
    for part in parts:
        row, report, note = _replay_part(progress, twin, part, robot, run_folder(run))
        rows.append([part.name, *row])
        reports[part.name] = report
        notes += note
    columns = ["part", "opened", "open at the end", "slip", "torque used", "grasp", "pedestal", "result"]
    ok = all(r["ok"] for r in reports.values())
    summary = "; ".join(f"{r[0]} opened {r[1]}" for r in rows)
    outcome = Outcome({"parts": reports}, [Table(f"replay with {robot}", columns, rows)], notes, ok=ok)
    return _Step("replay", outcome, summary, started).kept(run_folder(run))


def _replay_part(
    progress: Progress, twin: Twin, part: Part, robot: str, run: Path
) -> tuple[list[str], dict[str, Any], list[str]]:
    """Table row, report and notes of one part; no way to open it is a missed goal, not a wrong input."""
    progress(f"plan {part.name}", 0.0, "looking for a base and a grasp")
    try:
        trajectory = _named("robots:plan")(twin, part.id, robot)
    except PlanningError as e:
        progress(f"plan {part.name}", 1.0, "found none")
        row = ["0 %", "0 %", "", "", "", "", "FAILED"]
        return row, {"ok": False, "reason": str(e)}, [f"{part.name}: {e}"]
    progress(f"plan {part.name}", 1.0, trajectory.grasp)
    progress(f"replay {part.name}", 0.0, "in MuJoCo")
    folder = run / "replay" / Path(robot).stem / part.name
    r = _named("robots:replay")(twin, trajectory, folder, robot=robot)
    progress(f"replay {part.name}", 1.0, f"{100 * r.opening_peak:.0f} % opened")
    row = [
        f"{100 * r.opening_peak:.0f} %",
        f"{100 * r.opening_final:.0f} %",
        f"{r.slip_mm:.1f} mm",
        f"{100 * max(r.torque_share):.0f} %",
        r.grasp,
        f"{r.pedestal:.2f} m",
        "ok" if r.ok else "FAILED",
    ]
    return row, r.to_json(), [f"{part.name}: {r.reason}"] if r.reason else []


def _evaluate(progress: Progress, run: Path, truth: Path) -> _Step:
    started = time.perf_counter()
    twin = load(run)
    progress("evaluate", 0.0, "")
    evaluation = _named("recon.evaluate:evaluate")(twin, truth)
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
            str(r.bar or ""),
            verdict[r.ok],
        ]
        for r in evaluation.rows
    ]
    columns = ["measure", "of", "value", "matched only", "goal", ""]
    summary = f"{met} of {len(goals)} goals met"
    outcome = Outcome(
        evaluation.as_dict(), [Table(evaluation.name, columns, rows)], [summary], ok=evaluation.ok
    )
    return _Step("evaluate", outcome, summary, started).kept(run_folder(run))


def run_folder(path: Path) -> Path:
    """The run folder of a path that is one, or that is its twin/."""
    return path.parent if (path / "twin.json").is_file() and path.name == "twin" else path


@contextmanager
def _page(run: Path) -> Iterator[None]:
    """Render the page when the verb is done, also when it failed for a reason the user can mend."""
    from twin.report import render

    try:
        yield
    except FuntwinError:
        if (run / MANIFEST).is_file():
            render(run)
        raise
    render(run_folder(run))


def _page_note(run: Path) -> str:
    return f"report: {run / 'report.html'}"


def _settings(cls: str, path: Path | None, assignments: Sequence[str]) -> Any:
    """The configuration class named by `cls`, from a TOML file and KEY=VALUE texts on top of it."""
    data: dict[str, Any] = {}
    where = "--set"
    if path is not None:
        where = str(path)
        try:
            data = tomllib.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError as e:
            raise ConfigError(f"{path} does not exist", "give the path of a TOML file") from e
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as e:
            raise ConfigError(
                f"{path} is not readable TOML: {e}", "see https://toml.io for the syntax"
            ) from e
    for text in assignments:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise ConfigError(f"--set {text!r} is not KEY=VALUE", "write for example --set seed=3")
        _assign(data, key.strip().split("."), value.strip())
    return from_dict(_named(cls), data, where)


def _assign(data: dict[str, Any], keys: Sequence[str], text: str) -> None:
    for key in keys[:-1]:
        data = data.setdefault(key, {})
        if not isinstance(data, dict):
            raise ConfigError(f"--set {'.'.join(keys)}: {key!r} is a value, not a table")
    try:
        data[keys[-1]] = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        data[keys[-1]] = text  # a bare word is a text


def _shipped_recording() -> Path:
    found = sorted(p.parent for p in RECORDINGS.glob("*/color")) if RECORDINGS.is_dir() else []
    if not found:
        raise InputError(
            f"the shipped recording is not in {RECORDINGS}",
            "run in a checkout of the project, or give --recording",
        )
    return found[0]


def _part_named(twin: Twin, name: str) -> Part:
    return twin.part(int(name) if name.isdecimal() else name)


def _part_row(part: Part) -> list[str]:
    from twin.report.page import part_facts

    facts = {name: value for name, value, _ in part_facts(part)}
    axis, pivot = (facts.get(k, "").partition(" ± ")[2] for k in ("axis", "pivot"))
    held = facts.get("hand holds at", "").partition(" m,")[0]
    return [part.joint.kind, facts["range"], axis, pivot, facts.get("mass", ""), held]


def _joint_text(part: Part) -> str:
    from twin.report.page import part_facts

    facts = {name: value for name, value, _ in part_facts(part)}
    return f"{part.joint.kind}, {facts['range']}"


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "ok" if value else "FAILED"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _named(name: str) -> Any:
    """The object "module:attribute"."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)

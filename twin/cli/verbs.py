"""The verbs of the twin itself, and the chain of all. The command line names them in its table."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twin.cli import given
from twin.cli.console import Console, Outcome
from twin.cli.step import Step, judged, page, page_note, require_run, run_folder
from twin.cli.table import CHAIN, SETTINGS, TRACKS_SEEN, named
from twin.errors import InputError
from twin.files.assets import asset
from twin.report.sections import Table
from twin.runs.run_lock import claimed
from twin.runs.settings import as_dict, from_dict
from twin.runs.stages import Progress
from twin.storage import load, update


def demo(
    console: Console,
    out: Path,
    recording: Path | None,
    robot: str,
    config: Path | None,
    set: Sequence[str],
    **opening: Any,
) -> Outcome:
    """The whole chain: reconstruct, evaluate, export, check, replay. opening: of `recon.open_recording`."""
    require_run(out)
    named(CHAIN["resolve"])(robot)
    recording = recording or asset("recordings/cabinet_drawer")
    truth = recording / "truth"
    opened = named(CHAIN["open_recording"])(recording, **opening)
    with console.progress() as progress, page(out):
        settings = given.settings(named(SETTINGS["reconstruct"]), config, set)
        done: list[Step] = [named(CHAIN["reconstruct"])(progress, opened, out, settings)]
        with claimed(out):
            if truth.is_dir():
                done.append(named(CHAIN["evaluate"])(progress, out, truth))
            done.append(export_step(progress, out, ("urdf", "mjcf", "usd")))
            done.append(check_step(progress, out, ("urdf", "mjcf", "usd")))
            twin = load(out)
            if twin.parts:
                done.append(named(CHAIN["replay"])(progress, out, robot, ()))
    rows = [[s.verb, s.summary, f"{s.seconds:.1f} s", "ok" if s.outcome.ok else "FAILED"] for s in done]
    shown = [t for s in done if not s.outcome.ok or s.verb == "evaluate" for t in s.outcome.tables]
    outcome = Outcome(
        data={"run": str(out), "steps": {s.verb: {"ok": s.outcome.ok, **s.outcome.data} for s in done}},
        tables=[*shown, Table(f"{recording.name} → {out}", ["step", "result", "time", ""], rows)],
        notes=[page_note(out)],
        warnings=[w for s in done if s.verb != "export" for w in s.outcome.warnings],  # the page has them all
        ok=all(s.outcome.ok for s in done),
        doubt=done[0].outcome.doubt,
    )
    return judged(outcome, twin)


def import_scene(
    console: Console,
    scene: Path,
    out: Path,
    closed: Sequence[str] = (),
    limits: Sequence[str] = (),
    exclude: Sequence[str] = (),
    visual_groups: Sequence[int] = (),
) -> Outcome:
    """A scene from elsewhere to twin."""
    require_run(out)
    from twin.cli.import_step import import_step

    with console.progress() as progress, page(out):
        return import_step(progress, scene, out, closed, limits, exclude, visual_groups).outcome


def export(
    console: Console,
    run: Path,
    formats: Sequence[str],
    package: str,
    asset: Sequence[str],
    overwrite: bool = False,
    config: Path | None = None,
    set: Sequence[str] = (),
    **shown: str | None,
) -> Outcome:
    """Twin to simulation formats. shown: of `AssetView`, what the user says."""
    if package:
        from twin.exporters.package import check_package

        check_package(package)
    from twin.exporters.asset import AssetInfo

    told = from_dict(AssetInfo, given.texts("--asset", asset), "--asset")
    shapes = _collision(config, set)
    with console.progress() as progress, page(run):
        return export_step(progress, run, formats, package, told, overwrite, shown, shapes).outcome


def export_step(
    progress: Progress,
    run: Path,
    formats: Sequence[str],
    package: str = "",
    asset: Any = None,
    overwrite: bool = False,
    shown: Mapping[str, str | None] | None = None,
    collision: Mapping[str, Any] | None = None,
) -> Step:
    """collision: settings of the shapes by name; if any, shapes that the program made before are remade."""
    from twin import exporters
    from twin.collision import collision_config
    from twin.collision.meetings import shapes_of
    from twin.completion import without_shapes
    from twin.completion.asset import usual_view
    from twin.exporters.shape_report import COLUMNS, collision_reports, inferred_tables

    started = time.perf_counter()
    twin = load(run)
    folder = run_folder(run) / "export"
    progress("collision", 0.0, "convex pieces")
    cache = run_folder(run) / "stages" / "collision"
    view = usual_view(twin).but(shown or {})
    bare = twin if collision is None else without_shapes(twin, view.geometry != "seen")
    complete = exporters.complete(bare, cache, view, collision)
    update(twin, complete, run)
    asset_twin = view.of(complete)
    progress("collision", 1.0, f"{sum(len(shapes_of(p)) for p in asset_twin.parts)} pieces on moving parts")
    progress("export", 0.0, "")
    footage = exporters.Footage(folder.parent, named(TRACKS_SEEN)(folder.parent) if "rrd" in formats else {})
    files = exporters.export(
        complete,
        folder,
        formats,
        package,
        cache,
        asset=asset,
        overwrite=overwrite,
        view=view,
        collision=collision,
        footage=footage,
    )
    progress("export", 1.0, ", ".join(files))
    rows = [[name, str(path)] for name, path in files.items()]
    reports = collision_reports(asset_twin, cache, collision_config(collision))
    data = {
        "files": {name: str(path) for name, path in files.items()},
        "collision": [r.to_json() for r in reports],
        "overlaps": [vars(m) for m in files.overlaps],
    }
    tables = [
        Table("export", ["format", "file"], rows),
        *inferred_tables(asset_twin),
        Table("collision shapes", COLUMNS, [r.row() for r in reports]),
    ]
    warnings = [*files.warnings, *(r.warning for r in reports if r.warning)]
    doubt = "; ".join(m.text for m in files.overlaps)
    outcome = judged(Outcome(data, tables, warnings=warnings, ok=not doubt, doubt=doubt), twin)
    return Step("export", outcome, ", ".join(files), started).recorded(run_folder(run))


def _collision(config: Path | None, set: Sequence[str]) -> Mapping[str, Any] | None:
    """Settings of collision shapes by name, None unless somebody gives any."""
    if not (config or set):
        return None
    by_name: Mapping[str, Any] = as_dict(given.settings(named(SETTINGS["export"]), config, set).collision)
    return by_name


def check(
    console: Console,
    run: Path,
    formats: Sequence[str],
    engines: Sequence[str] | None = None,
    config: Path | None = None,
    set: Sequence[str] = (),
) -> Outcome:
    """Exported files against the twin."""
    from twin.verification.config import CheckConfig

    settings = given.settings(CheckConfig, config, set)
    with console.progress() as progress, page(run):
        return check_step(progress, run, formats, engines, settings).outcome


def check_step(
    progress: Progress,
    run: Path,
    formats: Sequence[str],
    engines: Sequence[str] | None = None,
    settings: Any = None,
) -> Step:
    from twin.verification import SUFFIX

    started = time.perf_counter()
    twin, folder = load(run), run_folder(run) / "export"
    files = {f: folder / f / f"{twin.name}{s}" for f, s in SUFFIX.items() if f in formats}
    missing = [f for f, path in files.items() if not path.is_file()]
    if missing:
        raise InputError(
            f"{files[missing[0]]} does not exist", f"run `twin export {run} --format {' '.join(missing)}`"
        )
    from twin.verification.proofs import prove

    proofs = prove(progress, twin, files, engines, settings)
    ok, summary = all(p.ok for p in proofs), "; ".join(p.summary for p in proofs)
    outcome = Outcome(
        {"ok": ok, **{p.key: p.data for p in proofs}},
        [t for p in proofs for t in p.tables],
        [x for p in proofs for x in (*p.notes, p.summary)],
        [w for p in proofs for w in p.warnings],
        ok,
    )
    outcome = judged(outcome, twin)
    return Step("check", outcome, summary, started).recorded(run_folder(run))


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

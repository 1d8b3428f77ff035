"""The verbs that make recordings and twins, and compare them with the truth. The command line names them in its table."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from twin.cli import given
from twin.cli.console import Console, Outcome
from twin.cli.step import Step, joint_row, joint_text, page, page_note, require_run, run_folder
from twin.files.paths import require_writable
from twin.files.text import read_json
from twin.report.sections import Table
from twin.runs.manifest import MANIFEST
from twin.runs.settings import from_dict
from twin.runs.stages import Progress
from twin.storage import load


def simulate(
    console: Console, scene: Path, joint: str, out: Path, config: Path | None, set: Sequence[str]
) -> Outcome:
    """Render a recording with truth."""
    from recon.simulate.config import SimulateConfig

    require_writable(out)
    settings = given.settings(SimulateConfig, config, set)
    from recon.simulate.joints import require_joint

    require_joint(scene, joint)
    with console.progress() as progress:

        def tell(done: int, total: int) -> None:
            progress("simulate", done / total, f"{done} of {total} frames")

        from recon.simulate import simulate as render

        folder = render(scene, joint, out, settings, progress=tell)
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
    require_run(out)
    told = given.told(config, set)
    from recon.readers import open_recording

    opened = open_recording(recording, layout)
    from recon.config import ReconConfig  # imports what takes seconds

    settings = from_dict(ReconConfig, *told)
    with console.progress() as progress, page(out):
        return reconstruct_step(progress, opened, out, settings, joint_hint).outcome


def reconstruct_step(
    progress: Progress, recording: Any, out: Path, settings: Any, joint_hint: str | None = None
) -> Step:
    """recording: a `recon.Recording`."""
    started = time.perf_counter()
    from recon import models, pipeline

    hint = None if joint_hint is None else models.joint_hint(joint_hint)
    twin = pipeline.reconstruct(recording, settings, out=out, progress=progress, hint=hint)
    manifest = read_json(out / MANIFEST)
    warnings = [
        *manifest.get("warnings", []),
        *(w for s in manifest.get("stages", []) for w in s["warnings"]),
    ]
    rows = [[p.name, *joint_row(p)] for p in twin.parts]
    columns = ["part", "joint", "range", "axis ±", "pivot ±", "mass"]
    stages = {s["name"]: s["seconds"] for s in manifest.get("stages", [])}
    summary = "; ".join(f"{p.name}: {joint_text(p)}" for p in twin.parts)
    data = {"run": str(out), "parts": [p.name for p in twin.parts], "seconds": stages}
    outcome = Outcome(data, [Table(f"{twin.name} → {out}", columns, rows)], [page_note(out)], warnings)
    return Step("reconstruct", outcome, summary, started)


def evaluate(console: Console, run: Path, truth: Path) -> Outcome:
    """Twin against truth."""
    with console.progress() as progress, page(run):
        return evaluate_step(progress, run, truth).outcome


def evaluate_step(progress: Progress, run: Path, truth: Path) -> Step:
    started = time.perf_counter()
    from recon.evaluation.truth import load_truth

    twin, true = load(run), load_truth(truth)  # before what takes seconds to import
    from recon.evaluation import evaluate as evaluation_of

    progress("evaluate", 0.0, "")
    evaluation = evaluation_of.evaluate(twin, true)
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

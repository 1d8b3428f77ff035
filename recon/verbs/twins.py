"""The verbs that make recordings and twins, and compare them with the truth."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from twin.cli import given
from twin.cli.console import Console, Outcome
from twin.cli.step import Step, joint_row, joint_text, judged, page, page_note, require_run, run_folder
from twin.errors import InputError
from twin.files.paths import require_writable
from twin.files.text import read_json
from twin.report.sections import Table
from twin.runs.manifest import MANIFEST, opened_with
from twin.runs.settings import from_dict
from twin.runs.stages import Progress
from twin.runs.threads import import_ahead
from twin.storage import load
from twin.verdict import verdict_line

# Of what a recording was opened with, what says which frames a twin was made from
_WHICH_FRAMES = ("depth_delay", "start", "end")


def simulate(
    console: Console,
    scene: Path | None,
    joint: str | None,
    random: int | None,
    out: Path,
    config: Path | None,
    set: Sequence[str],
    depth_lag: int | Literal["drawn"] = 0,
    walk: int | None = None,
    seconds: float | None = None,
) -> Outcome:
    """Render a recording with truth: of one part of a scene, or all of it drawn from a seed."""
    require_writable(out)
    drawn = "--random" if random is not None else "--walk"
    if random is not None and walk is not None:
        raise InputError("--random and --walk draw different recordings", "give one of both")
    if (random is not None or walk is not None) and (scene is not None or joint is not None):
        raise InputError(f"{drawn} draws a scene of its own", "leave the scene and --joint out")
    if seconds is not None and walk is None:
        raise InputError(
            f"--seconds {seconds:g} is the length of a walk", "give --walk SEED, or leave it out"
        )
    with console.progress() as progress:

        def tell(done: int, total: int) -> None:
            progress("simulate", done / total, f"{done} of {total} frames")

        told: dict[str, Any] = {"progress": tell, "depth_lag": depth_lag}
        seed = walk if random is None else random
        if seed is not None:
            folder = _drawn(out, seed, seconds, random is None, (config, set), told)
        elif scene is None or joint is None:
            raise InputError(
                "twin simulate needs a scene and --joint, --random or --walk",
                "for example: twin simulate scene.xml --joint door -o OUT, or twin simulate --random 7 -o OUT",
            )
        else:
            from recon.simulate.config import SimulateConfig

            settings = given.settings(SimulateConfig, config, set)
            from recon.simulate.joints import require_joint

            require_joint(scene, joint)
            from recon.simulate import simulate as render

            folder = render(scene, joint, out, settings, **told)
    return Outcome({"recording": str(folder)}, notes=[f"recording: {folder}", f"truth: {folder / 'truth'}"])


def _drawn(
    out: Path,
    seed: int,
    seconds: float | None,
    walks: bool,
    chosen: tuple[Path | None, Sequence[str]],
    told: dict[str, Any],
) -> Path:
    """A clip or a walk from a seed. chosen: the user's --config and --set; told: progress and depth_lag."""
    from recon.simulate.config import SimulateConfig

    given.settings(SimulateConfig, *chosen)  # refuses what is none
    settings = given.given_settings(*chosen)[0]
    if walks:
        from recon.simulate import simulate_walk

        return simulate_walk(seed, out, seconds=seconds, settings=settings, **told)
    from recon.simulate import simulate_random

    return simulate_random(seed, out, settings=settings, **told)


def reconstruct(
    console: Console,
    recording: Path,
    out: Path,
    type_hint: str | None,
    at: Sequence[tuple[int, int, int | float]],
    intervals: Sequence[tuple[int | float, ...]],
    types: Sequence[Literal["hinge", "slide"]],
    up: str | tuple[float, ...] | None,
    config: Path | None,
    set: Sequence[str],
    **opening: Any,
) -> Outcome:
    """Recording to twin. opening: of `recon.open_recording`."""
    require_run(out)
    data, where = given.given_settings(config, set)
    from recon.readers import open_recording

    opened = open_recording(recording, **opening)
    from recon.recording.said import words_said

    words = words_said(opened, at, intervals, types)
    kind = types[0] if types and not words else None
    given.put(data, "said", {"parts": [str(word) for word in words], "type": kind, "up": up})
    from recon.config import ReconConfig  # imports what takes seconds

    settings = from_dict(ReconConfig, data, where if config or set else "options")
    with console.progress() as progress, page(out):
        return reconstruct_step(progress, opened, out, settings, type_hint).outcome


def reconstruct_step(
    progress: Progress, recording: Any, out: Path, settings: Any, type_hint: str | None = None
) -> Step:
    """recording: a `recon.Recording`."""
    started = time.perf_counter()
    from recon import models, pipeline
    from recon.verbs.of_walk import UNSOLVED, handled_text, moved_unseen, notes, unsolved_rows

    import_ahead("open3d", "trimesh", "matplotlib.backends.backend_svg")  # for masses and the page
    hint = None if type_hint is None else models.joint_hint(type_hint)
    twin = pipeline.reconstruct(recording, settings, out=out, progress=progress, hint=hint)
    manifest = read_json(out / MANIFEST)
    stages = manifest.get("stages", [])
    warnings = [*manifest.get("warnings", []), *notes(stages, recording)]
    several = any("/" in s["name"] for s in stages)
    if several:
        warnings += moved_unseen(twin, recording)
    unsolved = unsolved_rows(out, twin, recording) if several else []
    rows = [[p.name, *joint_row(p)] for p in twin.parts]
    columns = ["part", "joint", "range", "axis ±", "pivot ±", "mass"]
    if several or any(len(p.motion.intervals) > 1 for p in twin.parts):
        columns.append("handled")
        rows = [[*row, handled_text(p)] for row, p in zip(rows, twin.parts, strict=True)]
    seconds = {s["name"]: s["seconds"] for s in stages}
    summary = "; ".join(f"{p.name}: {joint_text(p)}" for p in twin.parts) or "no part"
    data = {"run": str(out), "parts": [p.name for p in twin.parts], "seconds": seconds}
    tables = [Table(f"{twin.name} → {out}", columns, rows)]
    if unsolved:
        data["unsolved"] = [dict(zip(UNSOLVED, row, strict=True)) for row in unsolved]
        tables.append(Table(f"{twin.name}, not solved", UNSOLVED, unsolved))
    trusted = twin.verdict is None or twin.verdict.trusted
    outcome = Outcome(
        data,
        tables,
        [page_note(out)],
        warnings,
        ok=trusted,
        doubt="" if trusted else verdict_line(twin),
    )
    return Step("reconstruct", judged(outcome, twin), summary, started)


def evaluate(console: Console, run: Path, truth: Path) -> Outcome:
    """Twin against truth."""
    with console.progress() as progress, page(run):
        return evaluate_step(progress, run, truth).outcome


def evaluate_step(progress: Progress, run: Path, truth: Path) -> Step:
    started = time.perf_counter()
    from recon.evaluation.read_truth import load_truth

    twin, true = load(run), load_truth(truth)  # before what takes seconds to import
    told = {k: v for k, v in opened_with(run_folder(run)).items() if k in _WHICH_FRAMES}
    from recon.evaluation import evaluate as evaluation_of
    from recon.readers import open_recording

    recording = open_recording(true.folder.parent, **told) if told and true.tells_surfaces else None

    progress("evaluate", 0.0, "")
    evaluation = evaluation_of.evaluate(twin, true, recording)
    progress("evaluate", 1.0, "")
    goals = [r for r in evaluation.rows if r.ok is not None]
    met = sum(bool(r.ok) for r in goals)
    verdict = {None: "", True: "ok", False: "FAILED"}
    rows = [
        [
            r.metric,
            r.part,
            f"{r.value:.4g} {r.unit}".removesuffix("share").strip(),
            "-" if r.matched is None else f"{r.matched:.4g}",
            str(r.goal or ""),
            verdict[r.ok],
        ]
        for r in evaluation.rows
    ]
    columns = ["measure", "of", "value", "matched only", "goal", ""]
    summary = f"{met} of {len(goals)} goals met"
    walk, said = _walk_tables(evaluation)
    outcome = Outcome(
        evaluation.as_dict(),
        [Table(evaluation.name, columns, rows), *walk],
        [*said, *evaluation.remarks, summary],
        ok=evaluation.ok,
    )
    return Step("evaluate", outcome, summary, started).recorded(run_folder(run))


def _walk_tables(evaluation: Any) -> tuple[list[Table], list[str]]:
    """The tables of a walk's measures and parts, and lines about parts that are none; nothing of a clip.

    evaluation: a `recon.evaluation.rows.Evaluation`.
    """
    if evaluation.walk is None:
        return [], []
    from recon.evaluation import walk_rows

    rows = [r.cells for r in walk_rows.walk_rows(evaluation.walk)]
    parts = [walk_rows.part_cells(p) for p in evaluation.walk.parts]
    return [
        Table(f"{evaluation.name}, the walk", walk_rows.COLUMNS, rows),
        Table(f"{evaluation.name}, its parts", walk_rows.PART_COLUMNS, parts),
    ], walk_rows.remarks(evaluation.walk)

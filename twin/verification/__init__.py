"""Proof that exported files say what the twin says: independent engines load them, compared with it.

The expected values come from the twin by plain arithmetic and share no code with the export.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from twin.completion.asset import is_reconstructed, view_of
from twin.errors import InputError, nearest_name
from twin.files.paths import AnyPath
from twin.names import several
from twin.physics import without_rests
from twin.scene import Twin
from twin.verification.compare import Truth, compare, far_away, loads
from twin.verification.config import CheckConfig
from twin.verification.exceptions import expected_to_say
from twin.verification.expected import TIMES, filled
from twin.verification.process import ENGINES, OURS, ask, python_of
from twin.verification.rows import CheckReport, CheckRow

__all__ = ["CheckReport", "CheckRow", "ENGINES", "OURS", "SUFFIX", "check", "check_many", "chosen_engines"]

_SHARE = 50  # files for one process of an engine
SUFFIX = {"urdf": ".urdf", "mjcf": ".xml", "usd": ".usda"}


def check(
    source: Twin | AnyPath,
    exports: Mapping[str, AnyPath] | None = None,
    engines: str | Sequence[str] = OURS,
    processes: int = CheckConfig().processes,
) -> CheckReport:
    """Load every exported file in every engine that reads its format and compare with the twin.

    Args:
        source: a twin with mass and friction, or a run folder (or its folder twin/).
        exports: format -> file. Left out for a run folder: RUN/export/<format>/.
        engines: one or several names, or "all"; those that come with this project by default.
        processes: how many engines load files at the same time.

    Returns:
        rows for whether the file loads, tree, joint type, axis (1e-3 deg), pivot (1e-5 m), limits (1e-5),
        damping, dry friction, armature and contact friction (1e-5 relative), mass and inertia as a world
        tensor (1e-5 relative), centre of mass (1e-5 m), bounds of the visual mesh (1e-4 m), motion in 11
        states (1e-5), diagonal of the mass matrix (1e-5 relative), a damped rollout of
        0.5 s (1e-3 of the way) and self-collision (1 mm); ten times that for engines in single precision.

    Raises:
        InputError: nothing was exported, a file is missing, an engine is not known or reads none of the
            formats, or the twin has no masses.
        MissingDependencyError: an engine's environment is not installed.
    """
    twin, files = _inputs(source, exports)
    return check_many([(as_exported(twin, files), files)], several(engines), processes)[0]


def as_exported(twin: Twin, files: Mapping[str, Path]) -> Twin:
    """The twin as files show it: with or without the inferred layer and the room, in their frame."""
    view = view_of(files.values())
    return without_rests(twin) if view.plain and is_reconstructed(twin) else view.of(twin)


def chosen_engines(names: Sequence[str]) -> tuple[str, ...]:
    """Names of engines, "all" spelt out. Raises InputError with the nearest name for an unknown one."""
    for n in names:
        if n not in ENGINES and n != "all":
            close = nearest_name(n, list(ENGINES))
            hint = f"did you mean {close!r}? " if close else ""
            raise InputError(
                f"engine {n!r} is not known", f"{hint}known: {', '.join(ENGINES)}, all; validators for USD"
            )
    return tuple(ENGINES) if "all" in names else tuple(dict.fromkeys(names))


def check_many(
    sources: Sequence[tuple[Twin, Mapping[str, Path]]],
    engines: Sequence[str] = OURS,
    processes: int = CheckConfig().processes,
) -> list[CheckReport]:
    """A report for every (twin, files); an engine starts once for all files, `processes` at a time."""
    known = {id(twin): Truth(twin) for twin, _ in sources}  # a twin may come with several files
    truths = [known[id(twin)] for twin, _ in sources]
    jobs: dict[str, list[tuple[int, str, dict[str, Any]]]] = {}
    for engine in chosen_engines(engines):
        python_of(engine)
        jobs[engine] = [
            (k, fmt, _job(truths[k], fmt, files[fmt]))
            for k, (_, files) in enumerate(sources)
            for fmt in ENGINES[engine]
            if fmt in files
        ]
    jobs = {engine: of for engine, of in jobs.items() if of}
    if not jobs:
        formats = sorted({f for _, files in sources for f in files})
        raise InputError(
            f"{', '.join(engines)} reads no {' or '.join(formats)}", "ask another engine or format"
        )
    shares = [(e, of[k : k + _SHARE]) for e, of in jobs.items() for k in range(0, len(of), _SHARE)]
    answers: dict[str, list[Any]] = {e: [] for e in jobs}
    with ThreadPoolExecutor(max_workers=processes) as pool:
        told = pool.map(lambda share: ask(share[0], [j for _, _, j in share[1]]), shares)
        for (engine, _), part in zip(shares, told, strict=True):
            answers[engine] += part
    return [_report(k, truth, jobs, answers) for k, truth in enumerate(truths)]


def _job(truth: Truth, fmt: str, path: Path) -> dict[str, Any]:
    c = truth.course
    return {
        "path": str(path), "format": fmt, "parts": [p.name for p in truth.twin.parts], "states": c.states.tolist(),
        "state": c.state.tolist(), "position": c.position.tolist(), "velocity": c.velocity.tolist(), "times": list(TIMES),
    }  # fmt: skip


def _report(
    k: int,
    truth: Truth,
    jobs: Mapping[str, Sequence[tuple[int, str, Any]]],
    answers: Mapping[str, Sequence[Any]],
) -> CheckReport:
    rows: list[CheckRow] = []
    warnings: list[str] = []
    versions, seconds = {}, {}
    for engine, asked in jobs.items():
        for (which, fmt, _), told in zip(asked, answers[engine], strict=True):
            if which != k:
                continue
            warnings += [
                f"{fmt}/{engine}: {x}" for x in told["warnings"] if not expected_to_say(engine, fmt, x)
            ]
            versions[engine], seconds[engine, fmt] = told["version"], told["seconds"]
            rows.append(loads(engine, fmt, told["error"]))
            if told["error"]:
                warnings.append(f"{fmt}/{engine}: can't be loaded: {' '.join(told['error'].split())}")
            else:
                rows += compare(engine, fmt, truth, told["parts"])
    return CheckReport(tuple(rows), tuple(warnings), versions, seconds, far_away(truth.twin))


def _inputs(source: Twin | AnyPath, exports: Mapping[str, AnyPath] | None) -> tuple[Twin, dict[str, Path]]:
    if isinstance(source, Twin):
        twin = source
    else:
        from twin.storage import load

        twin = load(Path(source))
        if exports is None:
            run = Path(source) if (Path(source) / "export").is_dir() else Path(source).parent
            found = {f: run / "export" / f / f"{twin.name}{s}" for f, s in SUFFIX.items()}
            exports = {f: p for f, p in found.items() if p.exists()}
    if not exports:
        raise InputError(f"nothing exported was found for twin {twin.name!r}", "run twin export first")
    files = {f: Path(p).resolve() for f, p in exports.items()}
    for p in files.values():
        if not p.exists():
            raise InputError(f"{p} does not exist", "run twin export again")
    filled(twin)
    return twin, files

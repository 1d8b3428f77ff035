"""Proof that exported files say what the twin says: independent programs load them and are compared with the twin.

The expected values come from the twin by plain arithmetic and share no code with the export.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from twin import geometry as geo
from twin._module_call import call_as
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Part, Revolute, Twin

CONSUMERS: Mapping[str, tuple[str, ...]] = {
    "mujoco": ("urdf", "mjcf", "usd"),
    "pinocchio": ("urdf", "mjcf"),
    "yourdfpy": ("urdf",),
}
SUFFIX = {"urdf": ".urdf", "mjcf": ".xml", "usd": ".usda"}
STATES = 11
_SECONDS = 300  # a probe that takes longer hangs


@dataclass(frozen=True)
class CheckRow:
    """One comparison. difference and tolerance are in the unit of the field (deg for axis, m, rad, kg relative ...)."""

    format: str
    consumer: str
    field: str
    part: str
    expected: str
    measured: str
    difference: float
    tolerance: float

    @property
    def ok(self) -> bool:
        return self.difference <= self.tolerance


@dataclass(frozen=True)
class CheckReport:
    """Rows, and whatever a loader warned about or failed with, as "format/consumer: text"."""

    rows: tuple[CheckRow, ...]
    warnings: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """True when every row holds, none is missing and no loader warned."""
        return bool(self.rows) and not self.warnings and all(r.ok for r in self.rows)

    @property
    def failures(self) -> tuple[CheckRow, ...]:
        return tuple(r for r in self.rows if not r.ok)

    def to_dict(self) -> dict[str, Any]:
        """JSON types."""
        return {
            "ok": self.ok,
            "warnings": list(self.warnings),
            "rows": [{**asdict(r), "ok": r.ok} for r in self.rows],
        }


def check(source: Twin | Path | str, exports: Mapping[str, Path] | None = None) -> CheckReport:
    """Load every exported file in every program that reads its format and compare with the twin.

    Args:
        source: a twin with mass and friction, or a run folder (or its folder twin/).
        exports: format -> file. Left out for a run folder: RUN/export/<format>/.
    Returns:
        rows for joint type, axis (1e-3 deg), pivot (1e-5 m), limits (1e-5), damping and friction, mass, inertia as a world
        tensor (1e-5 relative), centre of mass (1e-5 m), bounds of the visual mesh (1e-4 m), motion in 11 states (1e-5) and
        self-collision (1 mm).
    Raises:
        InputError: nothing was exported, a file is missing, or the twin has no masses.
    """
    twin, files = _inputs(source, exports)
    names = [p.name for p in twin.parts]
    states = [
        [p.joint.lower + f * (p.joint.upper - p.joint.lower) for p in twin.parts]
        for f in np.linspace(0, 1, STATES)
    ]
    jobs = {c: {f: files[f] for f in formats if f in files} for c, formats in CONSUMERS.items()}
    jobs = {c: chosen for c, chosen in jobs.items() if chosen}
    with ThreadPoolExecutor(max_workers=2) as pool:
        answers = dict(zip(jobs, pool.map(lambda c: _ask(c, jobs[c], names, states), jobs), strict=True))
    rows: list[CheckRow] = []
    warnings: list[str] = []
    for consumer, answer in answers.items():
        for fmt in jobs[consumer]:
            told = answer[fmt]
            warnings += [f"{fmt}/{consumer}: {text}" for text in told["warnings"]]
            if told["error"]:
                warnings.append(f"{fmt}/{consumer}: can't be loaded: {told['error']}")
                continue
            for part in twin.parts:
                rows += _compare(fmt, consumer, twin, part, told["parts"][part.name], states)
    return CheckReport(tuple(rows), tuple(warnings))


def _inputs(source: Twin | Path | str, exports: Mapping[str, Path] | None) -> tuple[Twin, dict[str, Path]]:
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
    for p in exports.values():
        if not p.exists():
            raise InputError(f"{p} does not exist", "run twin export again")
    for part in twin.parts:
        if part.inertial is None or part.physics is None:
            raise InputError(
                f"part {part.name!r} of the twin has no mass to compare with",
                "run twin export, which fills it in",
            )
    return twin, {f: Path(p).resolve() for f, p in exports.items()}


def _ask(
    consumer: str, files: Mapping[str, Path], parts: list[str], states: list[list[float]]
) -> dict[str, Any]:
    """Run a probe in a process of its own, in an empty folder (MuJoCo leaves a log where it runs)."""
    with tempfile.TemporaryDirectory() as folder:
        request, answer = Path(folder) / "request.json", Path(folder) / "answer.json"
        content = {
            "consumer": consumer,
            "files": {f: str(p) for f, p in files.items()},
            "parts": parts,
            "states": states,
        }
        request.write_text(json.dumps(content), encoding="utf-8")
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]),
        }
        try:
            done = subprocess.run(  # noqa: S603  (this interpreter, this package, no shell)
                [sys.executable, "-m", "twin.probes", str(request), str(answer)],
                cwd=folder, env=environment, capture_output=True, text=True, timeout=_SECONDS, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return _failed(files, f"no answer within {_SECONDS} s")
        if not answer.exists():
            last = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
            return _failed(files, last[0])
        result: dict[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
        return result


def _failed(files: Iterable[str], why: str) -> dict[str, Any]:
    return {f: {"parts": {}, "warnings": [], "error": why} for f in files}


def _compare(
    fmt: str, consumer: str, twin: Twin, part: Part, got: Mapping[str, Any], states: list[list[float]]
) -> list[CheckRow]:  # fmt: skip
    rows: list[CheckRow] = []

    def add(field: str, expected: Any, measured: Any, difference: Any, tolerance: float) -> None:
        difference = float(difference) if np.isfinite(difference) else float("inf")
        rows.append(
            CheckRow(fmt, consumer, field, part.name, _text(expected), _text(measured), difference, tolerance)
        )

    joint, inertial, physics = part.joint, part.inertial, part.physics
    if inertial is None or physics is None:
        raise InputError(f"part {part.name!r} of the twin has no mass", "run twin export, which fills it in")
    add("type", joint.kind, got["type"], 0.0 if got["type"] == joint.kind else np.inf, 0.0)
    add("axis_deg", joint.axis, got["axis"], np.rad2deg(geo.angle_between(joint.axis, got["axis"])), 1e-3)
    if isinstance(joint, Revolute):
        off = geo.point_line_distance(got["pivot"], joint.pivot, joint.axis)
        add("pivot_m", joint.pivot, got["pivot"], off, 1e-5)
    for name in ("lower", "upper"):
        add(name, getattr(joint, name), got[name], abs(got[name] - getattr(joint, name)), 1e-5)
    for name in ("damping", "frictionloss"):
        if name in got:
            want = getattr(physics, name).value
            add(name, want, got[name], abs(got[name] - want) / max(want, 1e-9), 1e-5)
    mass = inertial.mass.value
    add("mass", mass, got["mass"], abs(got["mass"] / mass - 1), 1e-5)
    add("com_m", inertial.com, got["com"], np.linalg.norm(np.array(got["com"]) - inertial.com), 1e-5)
    tensor = np.array(got["inertia"])
    scale = np.linalg.norm(inertial.inertia)
    add(
        "inertia",
        np.diag(inertial.inertia),
        np.diag(tensor),
        np.linalg.norm(tensor - inertial.inertia) / scale,
        1e-5,
    )
    if got.get("bounds") is not None:
        want = np.stack([part.mesh.vertices.min(axis=0), part.mesh.vertices.max(axis=0)])
        add("mesh_bounds_m", want, got["bounds"], np.abs(np.array(got["bounds"]) - want).max(), 1e-4)
    ids = [p.id for p in twin.parts]
    want = np.stack([twin.part_pose(part.id, dict(zip(ids, row, strict=True))) for row in states])
    add(
        "motion",
        f"{STATES} states",
        f"{len(got['motion'])} states",
        _pose_error(np.array(got["motion"]), want),
        1e-5,
    )
    if "collision" in got:
        add("self_collision_m", 0.0, got["collision"], got["collision"], 1e-3)
    return rows


def _pose_error(got: Array, want: Array) -> float:
    """Greatest difference of any element of the poses (n, 4, 4): radians (small angles) and metres."""
    return float(np.abs(got - want).max()) if got.shape == want.shape else float("inf")


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value
    return " ".join(f"{v:.6g}" for v in np.asarray(value, dtype=np.float64).ravel())


call_as(__name__, "check")

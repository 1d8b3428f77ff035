"""Mass and inertia."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.geometry import Array
from twin.lint.model import Body, Fault, LintModel, Severity

# Four digits move the moments of a flat plate, which meet the inequality exactly, by this much; chosen by us.
_TRIANGLE = 1e-3


def missing(model: LintModel) -> Iterator[Fault]:
    told: set[str] = set()
    assumed: list[str] = []
    frames = _frames(model)
    for joint, bodies, shapes in model.moving():
        if (
            any(b.mass is not None and b.name not in frames for b in bodies)
            or joint.child in told
            or not bodies
        ):
            continue
        told |= {b.name for b in bodies}
        sources = {b.inferred for b in bodies} - {""}
        element = next((b.element for b in bodies if b.name == joint.child), joint.element)
        if "default density" in sources and (
            model.format == "mjcf" or any(s.role == "collision" for s in shapes)
        ):
            assumed.append(element)
        elif not sources or sources == {"default density"}:
            severity: Severity = "error" if shapes or model.format == "urdf" else "warning"
            why = next((f": {b.weightless}" for b in bodies if b.weightless), "")
            yield Fault(
                severity, element, "none written", f"it moves and has no mass{why}", "write mass, centre and inertia"
            )  # fmt: skip
    if assumed:  # once for all: who leaves the mass to the reader does so everywhere
        more = f" and {len(assumed) - 1} more" if len(assumed) > 1 else ""
        yield Fault(
            "warning", f"{assumed[0]}{more}", "none written",
            "the mass comes from the shapes at the reader's default density, 1000 kg/m³",
            "write mass, centre and inertia, or the density",
        )  # fmt: skip


def _frames(model: LintModel) -> set[str]:
    """Bodies that only mark a place on another: rigidly attached to it, and with a mass of zero."""
    attached = {j.child for j in model.joints if j.kind == "fixed"}
    return {b.name for b in model.bodies if b.mass == 0 and b.name in attached}


def value(model: LintModel) -> Iterator[Fault]:
    frames = _frames(model)
    for b in model.bodies:
        if b.mass is not None and not (np.isfinite(b.mass) and b.mass > 0) and b.name not in frames:
            yield Fault(
                "error", b.element, f"{b.mass:g} kg", "its mass is not positive and finite", "write the mass in kilograms"
            )  # fmt: skip


def inertia_missing(model: LintModel) -> Iterator[Fault]:
    for b in model.bodies:
        if (
            b.mass is not None
            and b.mass > 0
            and (b.inertia is None or (model.format == "usd" and not b.inertia.any()))
        ):
            what = (
                "physics:diagonalInertia and physics:principalAxes" if model.format == "usd" else "<inertia>"
            )
            yield Fault(
                "error",
                b.element,
                f"mass {b.mass:g} kg alone",
                "it has a mass but no inertia",
                f"write {what} with the mass",
            )


def _moments(model: LintModel) -> Iterator[tuple[Body, Array]]:
    for b in model.bodies:
        if b.inertia is not None and b.mass is not None and b.mass > 0:
            if model.format == "usd" and not b.inertia.any():
                continue  # USD's way of saying: not given
            moments: Array = np.full(3, np.nan)
            if np.isfinite(b.inertia).all():
                moments = np.asarray(np.linalg.eigvalsh(b.inertia), dtype=np.float64)
            yield b, moments


def inertia_positive(model: LintModel) -> Iterator[Fault]:
    """A point mass is one that is rigidly attached to a body: then it is a warning."""
    group = model.groups()
    for b, moments in _moments(model):
        if np.all(moments > 0):
            continue
        point = not moments.any() and any(
            group[o.name] == group[b.name] and o.inertia is not None and o.inertia.any() for o in model.bodies
        )
        yield Fault(
            "warning" if point else "error", b.element, _text(moments), "its inertia is not positive definite and finite",
            "compute it again, about the centre of mass; thin bodies have small moments, not zero ones",
        )  # fmt: skip


def inertia_triangle(model: LintModel) -> Iterator[Fault]:
    for body, moments in _moments(model):
        a, b, c = np.sort(moments)
        if a > 0 and c > (a + b) * (1 + _TRIANGLE):
            yield Fault(
                "error", body.element, _text(moments), "one principal moment exceeds the other two together",
                "compute the inertia again, about the centre of mass, and look for swapped elements",
            )  # fmt: skip


def _text(moments: Array) -> str:
    return " ".join(f"{m:.4g}" for m in moments) + " kg m²"

"""Shapes: scale, colliders, meshes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.geometry import Array
from twin.lint.meshes import crosses_itself, open_edges, surface_problem
from twin.lint.model import WORLD, Fault, LintModel, Severity, Shape

# axes that must scale alike
_ROUND = {"sphere": (0, 1, 2), "capsule": (0, 1, 2), "cylinder": (0, 1), "cone": (0, 1)}
_URDF = ("box", "cylinder", "sphere", "mesh")
_ALIKE = 1e-4  # relative; float32 scale operations are exact to 1e-7


def _uneven(scale: Array) -> bool:
    return not np.isfinite(scale).all() or float(np.ptp(scale)) > _ALIKE * float(np.abs(scale).max())


def scale(model: LintModel) -> Iterator[Fault]:
    remedy = "put the scale into the points and sizes of the shapes, and leave the body at 1"
    for b in model.bodies:
        if _uneven(b.scale):
            yield Fault("error", b.element, _text(b.scale), "a rigid body is scaled unevenly", remedy)
    uneven = {b.name for b in model.bodies if _uneven(b.scale)}
    for s in model.shapes:
        if (
            s.role == "collision"
            and s.kind in _ROUND
            and s.body not in uneven
            and _uneven(s.scale[list(_ROUND[s.kind])])
        ):
            yield Fault(
                "error",
                s.element,
                _text(s.scale),
                f"a {s.kind} is scaled unevenly",
                "use another shape, or a mesh",
            )


def _text(values: Array) -> str:
    return " ".join(f"{x:.6g}" for x in values)


def missing(model: LintModel) -> Iterator[Fault]:
    told: set[str] = set()
    for joint, bodies, shapes in model.moving():
        names = {b.name for b in bodies}
        if names & told or any(s.role == "collision" for s in shapes):
            continue
        told |= names
        drawn = [s for s in shapes if s.role == "visual"]
        if drawn:
            element = next((b.element for b in bodies if b.name == joint.child), joint.element)
            yield Fault(  # a mark or a pane may be meant to be without
                "warning", element, f"{len(drawn)} drawn, 0 to touch", "a moving part has no collision shape",
                "add convex shapes that cover it",
            )  # fmt: skip


def unknown(model: LintModel) -> Iterator[Fault]:
    """A capsule is in no version of URDF: MuJoCo and PyBullet read it, others leave it out without a word."""
    for s in model.shapes:
        if model.format != "urdf" or s.kind in _URDF:
            continue
        severity: Severity = "warning" if s.kind == "capsule" else "error"
        yield Fault(
            severity, s.element, "nothing" if s.kind == "other" else f"<{s.kind}>", "its geometry is no shape of URDF",
            "use " + ", ".join(f"<{k}>" for k in _URDF[:-1]) + f" or <{_URDF[-1]}>",
        )  # fmt: skip


def approximation(model: LintModel) -> Iterator[Fault]:
    group = model.groups()
    for s in model.shapes:
        moves = s.body != WORLD and group.get(s.body, WORLD) != WORLD
        if s.role == "collision" and moves and s.approximation in ("", "none", "meshSimplification"):
            value = s.approximation or "none written (none by USD's rules)"
            yield Fault(
                "error",
                s.element,
                value,
                "a moving body collides as a triangle mesh",
                "apply MeshCollisionAPI with approximation convexHull or convexDecomposition",
            )


def unusable(model: LintModel) -> Iterator[Fault]:
    for s in model.shapes:
        if s.problem:
            yield Fault("error", s.element, s.problem, "its mesh can't be read", "export the mesh again")
        elif s.surface is not None and (why := surface_problem(s.surface)):
            severity: Severity = "error" if s.role == "collision" else "warning"
            yield Fault(severity, s.element, why, "its mesh holds no usable surface", "export the mesh again")


def _usable(model: LintModel) -> Iterator[Shape]:
    for s in model.shapes:
        if (
            s.role == "collision"
            and s.surface is not None
            and not s.problem
            and not surface_problem(s.surface)
        ):
            yield s


def open_surface(model: LintModel) -> Iterator[Fault]:
    for s in _usable(model):
        if s.surface is not None and (n := open_edges(s.surface)):
            yield Fault(
                "warning",
                s.element,
                f"{n} of its edges don't join two faces",
                "its collision mesh is not closed",
                "close it, or use its convex hull",
            )


def self_intersecting(model: LintModel) -> Iterator[Fault]:
    known: dict[int, bool] = {}  # several shapes may share one mesh, and the test is slow
    for s in _usable(model):
        if s.surface is None:
            continue
        if id(s.surface) not in known:
            known[id(s.surface)] = crosses_itself(s.surface)
        if known[id(s.surface)]:
            yield Fault(
                "warning", s.element, f"{len(s.surface.faces)} faces", "its collision mesh passes through itself",
                "use its convex hull, or split it into convex pieces",
            )  # fmt: skip

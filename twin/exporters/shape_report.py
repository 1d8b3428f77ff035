"""What `twin export` says about collision shapes: number, fit, time and what was assumed."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from twin.collision import CollisionConfig
from twin.collision.cache import ShapeCache
from twin.collision.fit import Fit, fit_of
from twin.collision.meetings import shapes_of
from twin.collision.solid import Solid
from twin.physics import read_materials, shell_inertial
from twin.report.sections import Table
from twin.scene import Box, Mesh, Part, Twin

_TOLD = 0.1  # share of the boards' area from which an unseen back is worth a warning


@dataclass(frozen=True)
class ShapeReport:
    """A part's shapes against its own mesh.

    closed: the fit's volume ratio refers to what the closed mesh encloses, else to area x thickness as its
    mass does. seconds: on the clock when the shapes were made, or None. warning: of unseen thickness.
    """

    part: str
    boxes: int
    fit: Fit
    closed: bool
    seconds: float | None
    warning: str = ""

    def to_json(self) -> dict[str, Any]:
        """Plain values; lengths in metres."""
        out = asdict(self)
        return {"part": out.pop("part"), "boxes": out.pop("boxes"), **out.pop("fit"), **out}

    def row(self) -> list[str]:
        """Cells under COLUMNS."""
        f = self.fit
        ratio = "" if f.ratio is None else f"{f.ratio:.2f}" + ("" if self.closed else " (estimated)")
        mm = [f"{1e3 * v:.1f} mm" for v in (f.outside, f.missed)]
        seconds = "" if self.seconds is None else f"{self.seconds:.1f} s"
        return [self.part, str(f.shapes), str(self.boxes), ratio, *mm, seconds]


COLUMNS = ["part", "shapes", "boxes", "volume ratio", "stands out, p95", "uncovered, p95", "made in"]


def collision_reports(
    twin: Twin, cache_dir: Path | None = None, config: CollisionConfig | None = None
) -> list[ShapeReport]:
    """One report for every part with shapes; `with_collision` kept seconds and thickness in cache_dir."""
    cache = ShapeCache(cache_dir, asdict(CollisionConfig() if config is None else config))
    return [_report(p, cache) for p in twin.parts if shapes_of(p) and len(p.mesh.faces)]


def inferred_tables(twin: Twin) -> list[Table]:
    """A row for every inferred piece, its basis and its reason; no table where nothing is inferred."""
    owners = [(twin.static.name, twin.static.completion), *((p.name, p.completion) for p in twin.parts)]
    rows = [
        [name, p.name, p.role, p.basis, p.reason]
        for name, layer in owners
        if layer is not None
        for p in layer.pieces
    ]
    return [Table("inferred pieces", ["body", "piece", "role", "rests on", "why"], rows)] if rows else []


def _report(part: Part, cache: ShapeCache) -> ShapeReport:
    solid = Solid.of_mesh(part.mesh)
    closed = bool(solid.closed) and not solid.open
    shapes = shapes_of(part)
    fit = fit_of(shapes, solid, None if closed else _slabs(part.mesh))
    kept = cache.read(cache.key_of_mesh(part.mesh))
    numbers = kept[1] if kept is not None else {}
    boxes = sum(isinstance(s, Box) for s in shapes)
    warning = _warning(part.name, numbers) if part.completion is None else ""
    return ShapeReport(part.name, boxes, fit, closed, numbers.get("seconds"), warning)


def _slabs(mesh: Mesh) -> float | None:
    """Volume (m^3) of an open mesh, as for its mass: area x thickness of the table's default material."""
    table = read_materials()
    material = table.material(table.default)
    if mesh.area < 1e-9:
        return None
    return float(shell_inertial(mesh, material).mass.value / material.density.value)


def _warning(name: str, numbers: dict[str, float]) -> str:
    unseen = numbers.get("edge", 0.0) + numbers.get("table", 0.0)
    if unseen < _TOLD:
        return ""
    sources = [
        text.format(numbers[key])
        for key, text in (("edge", "edges for {:.0%}"), ("table", "a table for {:.0%}"))
        if numbers.get(key, 0.0) > 0.005
    ]
    return f"{name}: the back of {unseen:.0%} of its boards was never seen; thickness from {' and '.join(sources)}"

"""Whether the whole surface is there, whether what was inferred lies on it, and which of it the recording
shows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.completed.asset import Geom, merged
from recon.evaluation.metrics import DistanceField
from recon.evaluation.truth import TruthPart
from twin import geometry as geo
from twin.collision.pieces import pieces_of
from twin.collision.solid import Solid, spread
from twin.geometry import Array
from twin.scene import Completion, Mesh

POINTS = 20_000  # on a surface: a share is then known to 0.3 %
WITHIN = 0.010  # m, as completeness has it
OFF = 0.020  # m from the true surface, an inferred triangle is wrong
REAR = 0.03  # m of a sliding part that are its rear edge
REAR_SHARE = 0.001  # of the part's depth pixels, chosen by us: with fewer on it, a rear edge was not seen
SIDE_SHARE = (
    0.05  # of a carcass' surface beside its front, chosen by us: with less, no inside and no side was seen
)
FACE_SHARE = 0.5  # of a board's face, chosen by us: with less it was not seen
_FACES = 200  # the largest of a board, among which is one of its sides
_FACING = 0.9  # cosine, chosen by us: faces of one side of a board


def covered(true: Mesh, shown: Iterable[Geom]) -> float:
    """Share of the outside of a true body that has surface within `WITHIN`."""
    points = Solid.of_mesh(true).surface(POINTS)
    return _share(DistanceField(merged(g.mesh for g in shown)).distance(points) <= WITHIN)


@dataclass(frozen=True)
class InferredArea:
    """Area (m^2) that was inferred on one basis, and the share of it further than `OFF` from the true
    surface."""

    area: float
    off: float


def inferred_areas(
    shown: Iterable[Geom], completion: Completion | None, true: Mesh
) -> dict[str, InferredArea]:
    """Inferred area by basis: evidence, assumed, or "unnamed" for what the twin's inferred layer doesn't
    list."""
    basis: Mapping[str, str] = {} if completion is None else {p.name: str(p.basis) for p in completion.pieces}
    groups: dict[str, list[Mesh]] = {}
    for g in shown:
        if g.inferred is not None:
            groups.setdefault(basis.get(g.inferred, "unnamed"), []).append(g.mesh)
    surface, out = DistanceField(true), {}
    for name, meshes in sorted(groups.items()):
        mesh = merged(meshes)
        corners = mesh.vertices[mesh.faces]
        area = float(geo.triangle_areas(corners).sum())
        points = spread(corners, POINTS)[0] if area > 0 else np.zeros((0, 3))
        out[name] = InferredArea(area, _share(surface.distance(points) > OFF))
    return out


def is_closed(mesh: Mesh) -> bool:
    """Whether every edge is met by two faces, one in each direction; corners at one place are one."""
    _, joined = np.unique(np.asarray(mesh.vertices, np.float32), axis=0, return_inverse=True)
    faces = joined.reshape(-1)[mesh.faces]
    there = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
    there = there[there[:, 0] != there[:, 1]]  # of a face without area
    if not len(there):
        return False
    code = there.max() + 1
    forth, back = np.unique(there @ [code, 1]), np.unique(there[:, ::-1] @ [code, 1])
    return len(forth) == len(there) and np.array_equal(forth, back)


def rear_share(part: TruthPart, seen: Array) -> float | None:
    """Share of a sliding part's depth pixels (n, 3) that lie on the last `REAR` metres against its way; None
    for a hinged one."""
    if part.joint.kind != "prismatic":
        return None
    if not len(seen):
        return 0.0
    last = float((part.closed_mesh.vertices @ part.joint.axis).min())
    return _share(seen @ part.joint.axis <= last + REAR)


def seen_share(true: Mesh, seen: Array) -> float:
    """Share of the outside of a true body that has a depth pixel (n, 3) within `WITHIN`."""
    return _share(_near(Solid.of_mesh(true).surface(POINTS), seen))


def both_faces_seen(true: Mesh, seen: Array) -> bool:
    """Whether the two sides of the part's largest board were both seen, half of each at least."""
    board = max(
        (m for m, _ in pieces_of(true)), key=lambda m: float(geo.triangle_areas(m.vertices[m.faces]).sum())
    )
    corners = board.vertices[board.faces]
    normals, areas = geo.triangle_normals(corners)
    largest = np.argsort(-areas, kind="stable")[:_FACES]
    facing = normals[largest] @ normals.T > _FACING
    normal = normals[largest[int(np.argmax(facing @ areas))]]
    shares = []
    for sign in (1.0, -1.0):
        side = corners[sign * normals @ normal > _FACING]
        shares.append(_share(_near(spread(side, POINTS // 4)[0], seen)) if len(side) else 0.0)
    return min(shares) >= FACE_SHARE


def side_share(carcass: Mesh, outward: Array, seen: Array) -> float:
    """Share of a carcass' outside that doesn't face the way its front does (3,) with a depth pixel (n, 3)
    within `WITHIN`."""
    pieces = pieces_of(carcass)
    every = [spread(m.vertices[m.faces], _count(m, carcass)) for m, _ in pieces]
    points, normals = (np.concatenate(rows) for rows in zip(*every, strict=True))
    return _share(_near(points[normals @ outward <= _FACING], seen))


def _count(piece: Mesh, whole: Mesh) -> float:
    areas = [float(geo.triangle_areas(m.vertices[m.faces]).sum()) for m in (piece, whole)]
    return POINTS * areas[0] / max(areas[1], 1e-12)


def _near(points: Array, seen: Array) -> Array:
    from scipy.spatial import cKDTree

    if not len(seen) or not len(points):
        return np.zeros(len(points), bool)
    return np.asarray(cKDTree(seen).query(points, distance_upper_bound=WITHIN)[0] <= WITHIN)


def _share(of: Array) -> float:
    return float(np.mean(of)) if len(of) else 0.0

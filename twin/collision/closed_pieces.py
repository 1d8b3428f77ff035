"""Collision shapes of closed surfaces: a box or a hull if the body is convex, CoACD's pieces if not.

CoACD (Wei et al. 2022, "Approximate Convex Decomposition for 3D Meshes with Collision-Aware Concavity and
Tree Search") splits a closed body where that lowers its concavity most. It needs one that is closed as it is:
its own closing remeshes the surface with voxels, which thickens it (benchmarks/collision.md), so surfaces
with holes don't come here. It runs in a process of its own, because some meshes make it spin or crash; then
the caller covers the surface instead.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.collision.convex import box_of, hull_of, triangles_of
from twin.collision.main_axes import main_axes, outline_axes
from twin.collision.splitting import bulge
from twin.geometry import Array
from twin.mesh import edges, signed_volume
from twin.scene import Box, Collision, Mesh

# of processor time in CoACD, where bodies of furniture take 1-6; not of the clock: load must not tell
_SECONDS = 8
_CLOCK = 300  # s, should the machine stand still
_SEEDS = (0, 1)
_CONVEX = 0.02  # a body that fills its hull but for this share is convex
_ROUGH = 0.35  # a surface with more hollow edges is noise, on which CoACD would not end
_EVEN = 0.003  # m: unevenness that is noise


def closed_piece_shapes(
    piece: Mesh, tolerance: float, most: int, split: bool = True
) -> list[Collision] | None:
    """Shapes, at most `most`, of a closed piece of a mesh; None if it is no single body or not split.

    Args:
        tolerance: concavity (m) that CoACD leaves.
        split: whether CoACD may be asked; it takes seconds.
    """
    oriented = outward(piece)
    hull = None if oriented is None else hull_of(oriented.vertices)
    if oriented is None or hull is None:
        return None
    if enclosed(oriented) > (1 - _CONVEX) * hull.volume:
        return [box_of(hull) or hull.mesh]
    triangles = triangles_of(oriented)
    box = rough_box(triangles, enclosed(oriented))
    if box is not None:
        return [box]
    if bulge(hull, triangles, _EVEN) <= _EVEN:
        return [hull.mesh]
    smooth = split and most > 1 and concave_share(oriented) < _ROUGH
    pieces = coacd_pieces(oriented, tolerance, most) if smooth else []
    hulls = [h for h in (hull_of(p.vertices) for p in pieces) if h is not None]
    return [box_of(h) or h.mesh for h in hulls] or None


def concave_share(mesh: Mesh) -> float:
    """Share of the length of a closed, outward mesh's edges at which its faces form a hollow of over 3 deg.

    About a tenth on furniture, a quarter on the tube of a handle, half on what is scanned: every other edge.
    """
    normal, _ = geo.triangle_normals(mesh.vertices[mesh.faces])
    ends = edges(mesh.faces)
    owner, opposite = np.repeat(np.arange(len(mesh.faces)), 3), mesh.faces[:, [2, 0, 1]].ravel()
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    same = np.flatnonzero(np.all(ends[order[:-1]] == ends[order[1:]], axis=1))
    one, two = order[same], order[same + 1]
    away = mesh.vertices[opposite[two]] - mesh.vertices[ends[one, 0]]
    before = np.einsum("ij,ij->i", away, normal[owner[one]]) > 0
    bent = np.einsum("ij,ij->i", normal[owner[one]], normal[owner[two]]) < np.cos(np.deg2rad(3.0))
    length = np.linalg.norm(mesh.vertices[ends[one, 1]] - mesh.vertices[ends[one, 0]], axis=1)
    return float(length[before & bent].sum() / max(length.sum(), 1e-300))


def rough_box(triangles: Array, volume: float) -> Box | None:
    """Box that a closed surface (n, 3, 3) around `volume` (m^3) is but for noise; None of another body.

    Each side goes through the middle of the surface that faces its way from the outer tenth of the body.
    """
    axes = outline_axes(triangles)
    middle = triangles.mean(axis=1)
    facing, size = geo.triangle_normals(triangles)
    for last in (False, False, True):
        ends, planes = np.zeros((2, 3)), []
        for k, axis in enumerate(axes.T):
            along = middle @ axis
            margin = max(0.1 * float(np.ptp(along)), 2 * _EVEN)
            for end, outer in ((0, along < along.min() + margin), (1, along > along.max() - margin)):
                side = outer & ((2 * end - 1) * (facing @ axis) > 0.8)
                if not side.any():
                    return None
                ends[end, k] = np.average(along[side], weights=size[side])
                planes.append((float(size[side].sum()), k, side))
        if not last:  # directions of single faces are noise: turn towards the planes of whole sides
            axes = _squared_up(
                axes, [(k, middle[side]) for _, k, side in sorted(planes, key=lambda p: -p[0])]
            )
    extent = ends[1] - ends[0]
    if np.any(extent < 1e-3) or abs(volume / np.prod(extent) - 1) > 0.05:
        return None
    away = np.abs(middle @ axes - ends.mean(axis=0)) - extent / 2
    # of a point near the surface of a box: its distance from the nearest side's plane
    off = np.abs(away.max(axis=1))
    if np.average(off > _EVEN, weights=size) > 0.05:
        return None
    return Box(geo.make_pose(axes, axes @ ends.mean(axis=0)), extent)


def _squared_up(axes: Array, sides: list[tuple[int, Array]]) -> Array:
    """Axes (3, 3) turned so that the first side's plane (points) is square to its axis, then the next."""
    first, points = sides[0]
    normal = _plane_normal(points, axes[:, first])
    second, points = next((k, p) for k, p in sides if k != first)
    across = _plane_normal(points, axes[:, second])
    across = geo.unit(across - normal * (normal @ across))
    out = np.zeros((3, 3))
    out[:, first], out[:, second] = normal, across
    third = 3 - first - second
    out[:, third] = np.cross(normal, across)
    out[:, third] *= np.sign(np.linalg.det(out))
    return out


def _plane_normal(points: Array, like: Array) -> Array:
    """Unit normal (3,) of the plane through points (n, 3); `like` if none lies within 10 degrees of it."""
    if len(points) < 3:
        return like
    spread, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[1:]
    normal = axes[2] * np.sign(axes[2] @ like)
    return normal if spread[1] > 0 and normal @ like > 0.985 else like


def enclosed(mesh: Mesh) -> float:
    """Volume (m^3) inside a closed mesh, negative when it is wound inside out."""
    return signed_volume(mesh.vertices[mesh.faces] - mesh.vertices.mean(axis=0))


def outward(mesh: Mesh) -> Mesh | None:
    """The mesh wound outward; None where its faces can't be wound alike, or enclose nothing."""
    faces = _wound_alike(mesh.faces)
    if faces is None:
        return None
    alike = Mesh(mesh.vertices, faces)
    volume = enclosed(alike)
    if abs(volume) < 1e-12:
        return None
    return alike if volume > 0 else Mesh(mesh.vertices, faces[:, ::-1].copy())


def _wound_alike(faces: NDArray[np.int32]) -> NDArray[np.int32] | None:
    """The faces of one connected piece, turned so that each edge is run along as often in either sense."""
    if _balanced(faces):
        return faces
    start = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    owner = np.tile(np.arange(len(faces)), 3)
    key = np.sort(start, axis=1)
    order = np.lexsort((key[:, 1], key[:, 0]))
    if len(order) % 2 or np.any(key[order[::2]] != key[order[1::2]]):
        return None
    one, two = order[::2], order[1::2]
    against = np.all(start[one] == start[two], axis=1)  # both faces run along the edge in the same sense
    near: list[list[tuple[int, bool]]] = [[] for _ in faces]
    for a, b, turn in zip(owner[one].tolist(), owner[two].tolist(), against.tolist(), strict=True):
        near[a].append((b, turn))
        near[b].append((a, turn))
    turned = np.full(len(faces), -1)
    turned[0], todo = 0, [0]
    while todo:
        a = todo.pop()
        for b, turn in near[a]:
            if turned[b] < 0:
                turned[b] = int(turned[a]) ^ int(turn)
                todo.append(b)
    alike = np.where((turned == 1)[:, None], faces[:, ::-1], faces).astype(np.int32)
    return alike if _balanced(alike) else None


def _balanced(faces: NDArray[np.int32]) -> bool:
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, back = (e[np.lexsort((e[:, 1], e[:, 0]))] for e in (ends, ends[:, ::-1]))
    return bool(np.array_equal(there, back))


def coacd_pieces(
    mesh: Mesh, tolerance: float, most: int, seconds: int = _SECONDS, **settings: float | str | bool
) -> list[Mesh]:
    """CoACD's convex pieces of a closed, outward mesh: the fewer of what two seeds give, [] if both fail.

    The two run side by side. About one body in ten hangs a seed; it is ended after `seconds` of CPU time.

    Args:
        settings: of `coacd.run_coacd`, over those in `coacd_worker`.
    """
    axes = main_axes(mesh.vertices[mesh.faces])  # CoACD cuts across the axes of its frame
    center = mesh.vertices.mean(axis=0)
    given = {
        "vertices": (mesh.vertices - center) @ axes,
        "faces": mesh.faces,
        "tolerance": tolerance,
        "most": most,
    }
    found: list[list[Mesh]] = []
    with tempfile.TemporaryDirectory(prefix="funtwin-coacd-") as name:
        running = []
        for seed in _SEEDS:
            folder = Path(name) / str(seed)
            folder.mkdir()
            named = {f"set_{k}": v for k, v in ({"seed": seed} | settings).items()}
            np.savez(folder / "mesh.npz", **_arrays(given | named))
            running.append((_start(folder, seconds), folder / "pieces.npz"))
        for process, result in running:
            if _ended_well(process) and result.is_file():
                with np.load(result, allow_pickle=False) as data:
                    rows = [(data[f"{k}_vertices"], data[f"{k}_faces"]) for k in range(int(data["count"]))]
                found.append([Mesh(v @ axes.T + center, f) for v, f in rows])
    return min((f for f in found if f), key=len, default=[])


def _start(folder: Path, seconds: int) -> subprocess.Popen[bytes]:
    """CoACD on folder/mesh.npz, in a process of its own on one core."""
    worker = Path(__file__).with_name("coacd_worker.py")
    command = [
        sys.executable,
        str(worker),
        str(folder / "mesh.npz"),
        str(folder / "pieces.npz"),
        str(seconds),
    ]
    return subprocess.Popen(  # noqa: S603  (this interpreter, this package, no shell)
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )  # fmt: skip


def _arrays(values: dict[str, Any]) -> dict[str, Any]:
    return {k: np.asarray(v) for k, v in values.items()}


def _ended_well(process: subprocess.Popen[bytes]) -> bool:
    try:
        return process.wait(_CLOCK) == 0
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return False

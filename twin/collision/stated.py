"""Collision shapes that somebody stated: whether each is the convex body that engines take it for, and where two meet."""

from __future__ import annotations

from collections.abc import Iterator, Set

import numpy as np

from twin import geometry as geo
from twin.collision.clearance import carried, model_of, sweep_states
from twin.collision.convex import Hull, hull_of, triangles_of
from twin.collision.decimation import decimated
from twin.collision.pieces import pieces_of
from twin.collision.solid import Solid, spread
from twin.errors import SceneError
from twin.geometry import Array
from twin.mesh import used_vertices
from twin.scene import Collision, Mesh, Part, StaticPart, Twin

_HOLLOW = 0.04  # of a shape's diagonal, chosen by us: noise of 1.5 mm on 100 mm of board stays below
_SHEET = 1e-5  # m, chosen by us: thinner is flat, no engine takes it for a body
_FACES = 5000  # a shape of more is judged by as many
_POINTS = 3000  # on the hull, and on the surface
_ROUGH = 0.75  # of an open surface may look inward by more: noise turns faces at its edges
_MEET = 1e-4  # m, chosen by us: less deep is rounding
_STEP = 0.02  # m: as CollisionConfig.step


def owners_of(twin: Twin) -> list[StaticPart | Part]:
    """The static scene, then the parts."""
    return [twin.static, *twin.parts]


def require_convex(twin: Twin) -> None:
    """Raises SceneError that names the first collision mesh that is not a convex body: engines would fill its hollows, and
    refuse one that is flat."""
    for owner in owners_of(twin):
        for k, shape in enumerate(owner.collision):
            if not isinstance(shape, Mesh):
                continue
            if _flat(shape):
                raise SceneError(
                    f"collision[{k}] of {owner.name!r} is flat: its {len(shape.faces)} faces enclose nothing",
                    "give it a thickness, or leave the list empty and `twin export` makes shapes",
                )
            depth, size = hollow(shape)
            if depth > _HOLLOW * size:
                raise SceneError(
                    f"collision[{k}] of {owner.name!r} is not convex: its hull lies up to {1e3 * depth:.3g} mm off its surface, "
                    f"{depth / size:.0%} of its size, where {_HOLLOW:.0%} are allowed",
                    "split it into convex pieces, or leave the list empty and `twin export` makes it",
                )


def _flat(mesh: Mesh) -> bool:
    """Whether the faces lie in one plane, or there are none."""
    points = used_vertices(mesh)
    if len(points) < 4:
        return True
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return float(np.ptp(points @ axes[2])) < _SHEET


def hollow(mesh: Mesh) -> tuple[float, float]:
    """How deep (m) a mesh falls in behind its convex hull, and the hull's diagonal (m).

    That is the greatest distance of the hull from the surface, which holds for thin and noisy bodies, where a share of the
    volume would not, and asks nothing of what lies inside. Where sides are missing, less if the faces there are lie on the
    hull: how far they are, the way they face, from its outside. A flat mesh has no inside: 0.
    """
    size = (
        float(np.linalg.norm(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0)))
        if len(mesh.faces)
        else 0.0
    )
    if size <= 0:
        return 0.0, 1.0
    small = decimated(Mesh((mesh.vertices - mesh.vertices[mesh.faces[0, 0]]) / size, mesh.faces), _FACES)
    triangles = triangles_of(small)
    hull = hull_of(triangles.reshape(-1, 3)) if len(triangles) else None
    if hull is None:
        return 0.0, size
    off = np.abs(Solid([], [small]).signed_distance(spread(hull.vertices[hull.faces], _POINTS)[0]))
    depth = float(off.max())
    if depth > _HOLLOW and not all(closed for _, closed in pieces_of(small)):
        points, normals = spread(triangles, _POINTS)
        sides = [float(np.quantile(_way_out(hull, points, s * normals), _ROUGH)) for s in (1, -1)]
        depth = min(depth, *sides)
    return depth * size, size


def _way_out(hull: Hull, points: Array, directions: Array) -> Array:
    """How far (n,) m it is from points (n, 3) in a hull along unit directions (n, 3) to its outside."""
    corners = hull.vertices[hull.faces]
    normal, _ = geo.triangle_normals(corners)
    toward = directions @ normal.T
    room = np.einsum("ij,ij->i", corners[:, 0], normal) - points @ normal.T
    far = np.where(toward > 1e-6, np.maximum(room, 0.0) / np.maximum(toward, 1e-6), np.inf)
    return np.asarray(far.min(axis=1))


def meetings(twin: Twin, made: Set[str] = frozenset()) -> list[str]:
    """One line for every two lists of collision shapes that meet while a part opens, with depth and state; parts and what
    they are mounted on may touch.

    Args:
        made: names of the parts and the static scene whose shapes were made here; the others were stated.
    """
    shapes = [list(o.collision) for o in owners_of(twin)]
    names = [o.name for o in owners_of(twin)]
    deepest: dict[tuple[str, str], tuple[float, str]] = {}
    for owners, depth, where in _contacts(twin, shapes):
        pair = (names[owners[0]], names[owners[1]])
        if depth > deepest.get(pair, (_MEET, ""))[0]:
            deepest[pair] = (depth, where)
    return [
        f"the collision shapes of {a!r} and {b!r} overlap by {1e3 * depth:.1f} mm {where}; {_why([n for n in (a, b) if n in made])}"
        for (a, b), (depth, where) in deepest.items()
    ]


def _why(made: list[str]) -> str:
    """Why shapes overlap, some of which were made."""
    if not made:
        return "they were left as stated"
    return (
        f"those made for {' and '.join(map(repr, made))} could not be cut free: state shapes that keep clear"
    )


def _contacts(twin: Twin, shapes: list[list[Collision]]) -> Iterator[tuple[tuple[int, int], float, str]]:
    """Owners, depth (m) and the state of every contact while one part opens at a time."""
    import mujoco

    for part in twin.parts:
        model = model_of(twin, shapes, carried(twin, part), 0.0)
        data = mujoco.MjData(model)
        owner = [int(model.geom(g).name.split("_")[1]) for g in range(model.ngeom)]
        address = int(model.joint(f"joint_{part.id}").qposadr[0])
        unit = "rad" if part.joint.kind == "revolute" else "m"
        for state in sweep_states(part, _STEP):
            data.qpos[address] = state
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            for c in data.contact:
                a, b = sorted((owner[c.geom[0]], owner[c.geom[1]]))
                yield (a, b), -float(c.dist), f"with {part.name!r} at {state:.2f} {unit}"

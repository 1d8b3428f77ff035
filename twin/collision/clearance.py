"""Makes collision shapes give way where a moving part would touch them.

MuJoCo's own collision detection finds the contacts over each part's range, also between the sampled states.
The shape that has to give way loses what lies beyond the contact plane; a large shape is split first, so that
only its piece at the contact gives way.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np

from twin import geometry as geo
from twin.collision.contact_model import model_of
from twin.collision.convex import Hull, clip, hull_of
from twin.geometry import Array
from twin.scene import Box, Collision, Part, Revolute, Twin

_ROUNDS = 60  # a round takes about 0.1 s; each splits or cuts every shape in the way once
_KEEP = 0.4  # a clip may not take more than this share of a large shape: the shape is split instead
_LARGE = 0.12  # m
_REACH = 0.05  # m to each side of a contact: the piece that is split off

# m: the opening is sampled so that no point moves further; chosen by us
STEP = 0.02

Owners = frozenset[int]


@dataclass(frozen=True)
class Touch:
    """Shape `index` of `owner` (0 static, then parts) comes too near: it must keep normal . x <= offset."""

    owner: int
    index: int
    depth: float
    point: Array
    normal: Array
    offset: float


def sweep_states(part: Part, step: float) -> Array:
    """States (n,) from lower to upper, no point of the part's mesh moving further than `step` between two."""
    j = part.joint
    radius = _radius(j, part.mesh.vertices) if isinstance(j, Revolute) and len(part.mesh.vertices) else 1.0
    return np.linspace(
        j.lower, j.upper, int(np.clip(np.ceil((j.upper - j.lower) * radius / step), 2, 100)) + 1
    )


def _radius(joint: Revolute, points: Array) -> float:
    """Greatest distance (m) of points (n, 3) from the axis."""
    away = points - joint.pivot
    return float(np.linalg.norm(away - np.outer(away @ joint.axis, joint.axis), axis=1).max())


@dataclass(frozen=True)
class Yielding:
    """Who gives way to whom; an owner is 0, the static scene, or 1 and more, a part.

    fixed: owners whose shapes somebody stated: nothing of them is cut, what they touch gives way. ignored:
    pairs of owners that may touch. only: where given, the pairs of owners that may not.
    """

    fixed: Set[int] = frozenset()
    ignored: Set[Owners] = frozenset()
    only: Set[Owners] | None = None

    def matters(self, one: int, other: int) -> bool:
        """Whether one of two owners has to give way when they touch: of two that are fixed neither does."""
        pair = frozenset((one, other))
        wanted = pair not in self.ignored if self.only is None else pair in self.only
        return wanted and not pair <= self.fixed

    def yields(self, one: int, other: int) -> bool:
        """Whether the first of two owners gives way: the static scene to parts, the later of two parts."""
        if (one in self.fixed) != (other in self.fixed):
            return other in self.fixed
        return one == 0 or one > other > 0


EVERYTHING = Yielding()  # all shapes were made, and no pair may touch


def make_clear(
    twin: Twin, shapes: list[list[Collision]], clearance: float, step: float, yielding: Yielding = EVERYTHING
) -> list[list[Collision]]:
    """Cut shapes (static first, then one list per part) until parts keep `clearance` from others over range.

    A part and the part it is mounted on may touch. Shapes cut down to the same rest stay once.
    """
    shapes = [list(s) for s in shapes]
    found = _touches(twin, twin.parts, shapes, clearance, step, yielding)
    touches = _deepest(found.values())
    for _ in range(_ROUNDS):
        if not touches:
            break
        _give_way(shapes, touches, clearance)
        # shapes only lose: a part that touched nothing goes on so
        found = _touches(twin, [p for p in twin.parts if found.get(p.id)], shapes, clearance, step, yielding)
        touches = _deepest(found.values())
    for owner, index in sorted({(t.owner, t.index) for t in touches}, reverse=True):
        if owner == 0:  # could not be cut free in all rounds
            del shapes[0][index]
    return [s if k in yielding.fixed else _distinct(s) for k, s in enumerate(shapes)]


def _distinct(shapes: list[Collision]) -> list[Collision]:
    """Each shape once, to a micrometre."""
    seen: dict[bytes, Collision] = {}
    for s in shapes:
        points = np.round(points_of(s) / 1e-6) + 0.0
        seen.setdefault(points[np.lexsort(points.T)].tobytes(), s)
    return list(seen.values())


def _give_way(shapes: list[list[Collision]], touches: list[Touch], clearance: float) -> None:
    for t in sorted(touches, key=lambda t: (t.owner, t.index), reverse=True):
        piece = shapes[t.owner][t.index]
        hull = hull_of(points_of(piece))
        left = None if hull is None else clip(hull, -t.normal, -t.offset + 1e-5)
        new: list[Collision] = []
        if hull is not None and (left is None or left.volume < (1 - _KEEP) * hull.volume):
            pieces = _split_around(hull, t.point)
            if pieces:
                shapes[t.owner][t.index : t.index + 1] = [p.mesh for p in pieces]
                continue
            left = left if left is not None and left.volume > 0.2 * hull.volume else None
        if left is not None and np.linalg.svd(left.vertices - left.vertices.mean(0))[1][2] > clearance / 4:
            new = [left.mesh]
        shapes[t.owner][t.index : t.index + 1] = new


def _split_around(hull: Hull, point: Array) -> list[Hull]:
    """Split a large hull beside a point on it, across its longest direction; [] when it is not large."""
    _, _, axes = np.linalg.svd(hull.vertices - hull.vertices.mean(axis=0), full_matrices=False)
    spans = np.ptp(hull.vertices @ axes.T, axis=0)
    k = int(np.argmax(spans))
    if spans[k] < _LARGE:
        return []
    axis, at = axes[k], float(axes[k] @ point)
    along = hull.vertices @ axis
    cuts = [c for c in (at - _REACH, at + _REACH) if along.min() + 0.01 < c < along.max() - 0.01]
    edges = [-np.inf, *cuts, np.inf]
    out = []
    for low, high in pairwise(edges):
        piece: Hull | None = hull
        if np.isfinite(low):
            piece = clip(hull, axis, low)
        if piece is not None and np.isfinite(high):
            piece = clip(piece, -axis, -high)
        if piece is not None:
            out.append(piece)
    return out if len(out) > 1 else []


def find_touches(
    twin: Twin, shapes: list[list[Collision]], clearance: float, step: float, yielding: Yielding = EVERYTHING
) -> list[Touch]:
    """The deepest touch of every shape within `clearance` that has to give way, one part opened at a time.

    Between two states of the sweep a thin edge could slip past unseen, so what moves is tested as the hull of
    each shape at both ends of the step: it holds the shape in every state between them (of a turning one all
    but the rise of its arcs above their chords, which is added to the clearance).
    """
    return _deepest(_touches(twin, twin.parts, shapes, clearance, step, yielding).values())


def _touches(
    twin: Twin, parts: Sequence[Part], shapes: list[list[Collision]], clearance: float, step: float, yielding: Yielding
) -> dict[int, list[Touch]]:  # fmt: skip
    """What comes too near while each of some parts opens, by its id."""
    return {
        p.id: list(_touches_of(twin, shapes, p, clearance, step, yielding))
        for p in parts
        if yielding.only is None or any(carried(twin, p) & pair for pair in yielding.only)
    }


def _deepest(touches: Iterable[Sequence[Touch]]) -> list[Touch]:
    """The deepest touch of every shape."""
    worst: dict[tuple[int, int], Touch] = {}
    for t in chain.from_iterable(touches):
        key = (t.owner, t.index)
        if key not in worst or t.depth < worst[key].depth:
            worst[key] = t
    return [worst[k] for k in sorted(worst)]


def _touches_of(
    twin: Twin, shapes: list[list[Collision]], part: Part, clearance: float, step: float, yielding: Yielding
) -> Iterator[Touch]:  # fmt: skip
    """What comes too near while one part opens; several touches of one shape are possible."""
    import mujoco

    states = sweep_states(part, step)
    moving = carried(twin, part)
    delta = part.joint.pose(float(states[1] - states[0]))
    swept = [[_swept(s, delta) for s in own] if i in moving else own for i, own in enumerate(shapes)]
    margin = clearance
    if isinstance(part.joint, Revolute):
        rise = 1.0 - np.cos((states[1] - states[0]) / 2)
        margin += float(
            rise * max((_radius(part.joint, points_of(s)) for i in moving for s in shapes[i]), default=0.0)
        )
    model = model_of(twin, _within_reach(swept, moving, part, states, margin), moving, margin)
    data = mujoco.MjData(model)
    names = [model.geom(g).name.split("_") for g in range(model.ngeom)]
    owner = np.array([int(n[1]) for n in names])
    index = np.array([int(n[2]) for n in names])
    address = int(model.joint(f"joint_{part.id}").qposadr[0])
    for state in states[:-1]:
        data.qpos[address] = state
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        found = data.contact
        for n in np.flatnonzero(found.dist < margin - 1e-5):
            a, b = found.geom[n]
            if not yielding.matters(int(owner[a]), int(owner[b])):
                continue
            toward, depth = found.frame[n, :3].copy(), float(found.dist[n])  # from a to b
            gives, sign = (a, 1.0) if yielding.yields(int(owner[a]), int(owner[b])) else (b, -1.0)
            surface = found.pos[n] + sign * toward * depth / 2  # of the one that stays
            key = (int(owner[gives]), int(index[gives]))
            piece = shapes[key[0]][key[1]]
            yield _touch(twin, key, piece, depth, surface, sign * toward, margin, part, states, float(state))


def _within_reach(
    shapes: list[list[Collision]], moving: set[int], part: Part, states: Array, margin: float
) -> list[list[Collision | None]]:
    """The shapes of each owner; None in the place of one that stays and that nothing of what moves comes
    near, by the boxes along the axes around both."""
    points = [points_of(s) for i in moving for s in shapes[i]]
    if not points:
        return [list(own) for own in shapes]
    swept = np.concatenate([geo.transform(part.joint.pose(s), np.concatenate(points)) for s in states])
    low, high = swept.min(axis=0) - 2 * margin, swept.max(axis=0) + 2 * margin

    def near(shape: Collision) -> bool:
        own = points_of(shape)
        return bool(np.all(own.max(axis=0) > low) and np.all(own.min(axis=0) < high))

    return [[s if i in moving or near(s) else None for s in own] for i, own in enumerate(shapes)]


def _touch(
    twin: Twin, key: tuple[int, int], piece: Collision, depth: float, surface: Array, toward: Array, margin: float,
    part: Part, states: Array, state: float,
) -> Touch:  # fmt: skip
    """The touch in state 0 of the shape that gives way, at the end of the step where it reaches further."""
    if key[0] not in carried(twin, part):
        return Touch(key[0], key[1], depth, surface, toward, float(toward @ surface) - margin)
    delta = part.joint.pose(float(states[1] - states[0]))
    at = part.joint.pose(state)
    ends = (at, at @ delta)
    reach = [float((geo.transform(e, points_of(piece)) @ toward).max()) for e in ends]
    back = geo.invert_pose(ends[int(np.argmax(reach))])
    point, normal = geo.transform(back, surface[None])[0], geo.rotate(back, toward)
    return Touch(key[0], key[1], depth, point, normal, float(normal @ point) - margin)


def carried(twin: Twin, part: Part) -> set[int]:
    """Owners of the shapes that move with a part: itself and the parts on it."""
    ids = {part.id}
    for _ in twin.parts:
        ids |= {p.id for p in twin.parts if p.parent in ids}
    return {i + 1 for i, p in enumerate(twin.parts) if p.id in ids}


def _swept(piece: Collision, delta: Array) -> Collision:
    """The hull of a shape before and after it moves by delta (4, 4)."""
    points = points_of(piece)
    hull = hull_of(np.concatenate([points, geo.transform(delta, points)]))
    return piece if hull is None else hull.mesh


def points_of(piece: Collision) -> Array:
    """Corners (n, 3) of a shape in the world at state 0."""
    return piece.corners if isinstance(piece, Box) else piece.vertices

"""Where one sees through an asset although the furniture is there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.completed.asset import Asset, merged
from recon.evaluation.truth import NOTHING, TruthPart
from recon.simulate.ray_caster import Caster
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Mesh

VIEWS_DEG = ((0.0, 0.0), (30.0, 0.0), (-30.0, 0.0), (0.0, 30.0), (0.0, -20.0))  # aside, above; of the front
STATES = 21
REACH = 3.0  # m of a ray
DISTANCE = 1.5  # m of a view from the middle of what it looks at, chosen by us: a person's
SIDE = 160  # rays along a side of a view, chosen by us: 1 cm apart at furniture of 1.6 m
_LEVEL = 0.2  # of a unit normal, chosen by us: what is told apart of directions
_SIDES = 0.05  # of the upright area, chosen by us: less is no side of a part
RIM = 0.010  # m: as far as the outline of an asset may be off, where surface counts as there
_AROUND = 8  # rays around one
_TOUCH = 1e-3  # m: the furniture is among what stands still, and single precision tells the two apart
DEEPER = 0.05  # m behind the true surface, chosen by us: more than any thickness


@dataclass(frozen=True)
class Sight:
    """Rays over all views and states.

    Attributes:
        rays: that meet the true furniture within `REACH`, before anything else that stands still.
        through: share of them that meet nothing of the asset.
        inside: share that does so further than `RIM` from the true outline.
        deeper: share of all rays that meet the asset only `DEEPER` behind the true surface, or not at all.
    """

    rays: int
    through: float
    inside: float
    deeper: float


def see_through(
    asset: Asset, name: str, true: TruthPart, carcass: Mesh | None, static: Mesh, outward: Array
) -> Sight | None:
    """Look at a part of the asset and at the true one, both opened as far at once; None where no ray meets
    the true one.

    Args:
        name: of the part in the asset.
        carcass: true furniture, None where it is not known: then only the part counts.
        static: all that truly stands still.
        outward: unit direction (3,) in which the part's front looks.
    """
    states = np.linspace(0.0, min(asset.upper(name), true.travel), STATES)
    true_moves = [true.joint.pose(s) for s in states]
    moves = [asset.moved(name, float(s)) for s in states]
    body = true.closed_mesh
    casters = _Casters(
        body,
        NOTHING if carcass is None else carcass,
        static,
        merged(g.mesh for g in asset.visuals(name)),
        merged(g.mesh for g in asset.geoms if g.visual and g.owner != name and not g.room),
    )
    target = np.concatenate([body.vertices, np.zeros((0, 3)) if carcass is None else carcass.vertices])
    counts = sum(
        (casters.look(view_rays(target, outward, view), true_moves, moves) for view in VIEWS_DEG),
        start=np.zeros(4),
    )
    met = int(counts[0])
    return Sight(met, *(counts[1:] / met).tolist()) if met else None


def front_of(part: Mesh, cameras: Array) -> Array:
    """Level unit direction (3,) in which the front of a true part looks: of its upright faces, that towards
    the cameras (n, 4, 4)."""
    normals, areas = geo.triangle_normals(part.vertices[part.faces])
    towards = cameras[:, :3, 3].mean(axis=0) - part.area_centroid
    upright = np.abs(normals[:, 2]) < _LEVEL
    if not upright.any():
        return geo.unit(towards * [1.0, 1.0, 0.0])
    normals, areas = normals[upright], areas[upright]
    keys = np.round(normals / _LEVEL).astype(np.int64)
    sides = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    size = np.bincount(sides, weights=areas)
    found = np.stack([np.bincount(sides, weights=areas * normals[:, k]) for k in range(3)], axis=1)
    large = geo.unit(found[size > _SIDES * areas.sum()] * [1.0, 1.0, 0.0])
    return np.asarray(large[int(np.argmax(large @ towards))])


def view_rays(target: Array, outward: Array, view: tuple[float, float]) -> Array:
    """Rays (SIDE * SIDE, 6), origin and unit direction, towards points (n, 3).

    view: degrees aside, to the right seen from there, and above the front, which looks along `outward` (3,).
    """
    middle = 0.5 * (target.min(axis=0) + target.max(axis=0))
    up = np.array([0.0, 0.0, 1.0])
    level = outward - (outward @ up) * up
    level = geo.unit(level) if np.linalg.norm(level) > 0.1 else np.array([0.0, -1.0, 0.0])
    aside, above = np.radians(view)
    across = np.cross(up, level)
    towards = np.cos(above) * (np.cos(aside) * level + np.sin(aside) * across) + np.sin(above) * up
    radius = float(np.linalg.norm(target - middle, axis=1).max())
    eye = middle + max(DISTANCE, 1.05 * radius) * towards
    right = geo.unit(np.cross(up, towards))
    over = np.cross(towards, right)
    half = radius * np.linspace(-1.0, 1.0, SIDE)
    points = middle + half[None, :, None] * right + half[:, None, None] * over
    directions = geo.unit((points - eye).reshape(-1, 3))
    return np.concatenate([np.broadcast_to(eye, directions.shape), directions], axis=1)


class _Casters:
    """The true furniture and the asset, each apart in what moves and what stands."""

    def __init__(self, part: Mesh, carcass: Mesh, static: Mesh, shown_part: Mesh, shown_rest: Mesh) -> None:
        self._part, self._carcass, self._static, self._shown, self._rest = (
            _Distance(m) for m in (part, carcass, static, shown_part, shown_rest)
        )

    def look(self, rays: Array, true_moves: Sequence[Array], moves: Sequence[Array]) -> Array:
        """Over all states, how many rays (4,) meet the true furniture, pass the asset, pass it away from the
        true outline, go deeper."""
        carcass, static, rest = self._carcass(rays), self._static(rays), self._rest(rays)
        counts = np.zeros(4)
        for T_true, T in zip(true_moves, moves, strict=True):
            true = np.minimum(self._part(_carried(rays, T_true)), carcass)
            met = (true <= REACH) & (true <= static + _TOUCH)
            found = rest.copy()
            found[met] = np.minimum(found[met], self._shown(_carried(rays[met], T)))
            passed = met & ~(found <= REACH)
            inside = self._surrounded(rays[passed], true[passed], T_true)
            deeper = met & ~(found <= true + DEEPER)
            counts += [np.count_nonzero(m) for m in (met, passed, inside, deeper)]
        return counts

    def _surrounded(self, rays: Array, hits: Array, T_true: Array) -> NDArray[np.bool_]:
        """Whether the true furniture, met `hits` (n,) m along rays (n, 6), is also there `RIM` to all sides
        of them."""
        out = np.ones(len(rays), bool)
        if not len(rays):
            return out
        points = rays[:, :3] + hits[:, None] * rays[:, 3:]
        right = geo.unit(np.cross(rays[:, 3:], [0.0, 0.0, 1.0]))
        over = np.cross(right, rays[:, 3:])
        for angle in np.arange(_AROUND) * (2 * np.pi / _AROUND):
            beside = points + RIM * (np.cos(angle) * right + np.sin(angle) * over)
            near = np.concatenate([rays[:, :3], geo.unit(beside - rays[:, :3])], axis=1)
            true = np.minimum(self._part(_carried(near, T_true)), self._carcass(near))
            out &= (true <= REACH + RIM) & (true <= self._static(near) + _TOUCH)
        return out


class _Distance:
    """How far rays (n, 6) go to a mesh (n,); infinite past it."""

    def __init__(self, mesh: Mesh) -> None:
        self._caster = None
        if len(mesh.faces):
            self._caster = Caster()
            self._caster.add(mesh.vertices, mesh.faces)

    def __call__(self, rays: Array) -> Array:
        if self._caster is None or not len(rays):
            return np.full(len(rays), np.inf)
        return np.asarray(self._caster.first(rays)[0], np.float64)


def _carried(rays: Array, T: Array) -> Array:
    """Rays (n, 6) as something sees them that was moved by T (4, 4)."""
    back = geo.invert_pose(T)
    return np.concatenate([geo.transform(back, rays[:, :3]), geo.rotate(back, rays[:, 3:])], axis=1)

"""Twelve balls let go above an opened drawer: which stay in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from scipy.ndimage import label

from benchmarks.completed.asset import Asset
from recon.evaluation.truth import TruthPart
from recon.simulate.ray_caster import Caster
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Mesh

RADIUS, MASS, ABOVE, SECONDS = 0.020, 0.050, 0.05, 3.0  # m, kg, m above the rim, s
GRID = (3, 4)
LEAST = (0.15, 0.20)  # m that an opened inside measures at least
_CELL = 0.002  # m of the grid that finds a drawer's inside
_FLAT = 0.004  # m, chosen by us: cells of one floor
_LEVEL = 0.2  # chosen by us: a drawer runs level, its axis that far from it at most
# kg or kg m^2 added to every joint: under the weight of the balls it moves by under a millionth of a metre
_LOCK = 1e6


@dataclass(frozen=True)
class Inside:
    """Where things lie in a true drawer, at its most closed state shown.

    Attributes:
        axes: columns (3, 3): across, along the opening, up.
        low: smallest corner (2,) of the free floor across and along, metres.
        high: its largest corner (2,).
        floor: height of the floor's top.
        rim: height of the sides' top.
        front: how far along the opening the inner face of the front lies.
    """

    axes: Array
    low: Array
    high: Array
    floor: float
    rim: float
    front: float

    def opened(self, state: float) -> tuple[Array, Array]:
        """Corners (2,) and (2,) of the part of the floor that has come out past where the front's inner face
        was, opened by `state` m."""
        low = np.array([self.low[0], max(self.low[1] + state, self.front)])
        return low, self.high + [0.0, state]


def inside_of(part: TruthPart) -> Inside | None:
    """The inside of a true drawer; None of what is none: it turns, doesn't run level, or has no floor behind
    a front."""
    axis = part.joint.axis
    if part.joint.kind != "prismatic" or abs(axis[2]) > _LEVEL:
        return None
    along = geo.unit(axis * [1.0, 1.0, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    axes = np.stack([np.cross(along, up), along, up], axis=1)
    mesh = part.closed_mesh
    local = Mesh(mesh.vertices @ axes, mesh.faces)
    heights, start = _heights(local)
    found = _floor_cells(heights)
    if found is None:
        return None
    cells, floor = found
    rows, columns = (np.flatnonzero(cells.any(axis=k)) for k in (1, 0))
    low = start + _CELL * (np.array([rows[0], columns[0]]) - 0.5)
    high = start + _CELL * (np.array([rows[-1], columns[-1]]) + 0.5)
    if high[1] > local.vertices[:, 1].max() - _CELL:
        return None  # no front
    sides = heights[max(rows[0] - 40, 0) : rows[-1] + 41, columns[0] : columns[-1] + 1]
    return Inside(axes, low, high, floor, float(np.nanmax(sides)), float(high[1]))


def _heights(mesh: Mesh) -> tuple[Array, Array]:
    """Height of the topmost surface over a grid (across, along), NaN where there is none, and the middle (2,)
    of its first cell."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    count = np.maximum(np.ceil((high - low)[:2] / _CELL).astype(int), 1)
    start = low[:2] + 0.5 * _CELL
    x, y = np.meshgrid(*(s + _CELL * np.arange(n) for s, n in zip(start, count, strict=True)), indexing="ij")
    top = np.full(x.size, high[2] + 1.0)
    rays = np.stack(
        [x.ravel(), y.ravel(), top, *np.broadcast_to([[0.0], [0.0], [-1.0]], (3, x.size))], axis=1
    )
    caster = Caster()
    caster.add(mesh.vertices, mesh.faces)
    t = caster.first(rays).t.astype(np.float64)
    return np.where(np.isfinite(t), top - t, np.nan).reshape(x.shape), start


def _floor_cells(heights: Array) -> tuple[Array, float] | None:
    """The largest connected level area (cells) below the highest surface, and its height; None where it is
    too small for a drawer."""
    levels = np.round(heights / _FLAT)
    told = np.isfinite(levels)
    values, counts = np.unique(levels[told], return_counts=True)
    if not len(values):
        return None
    floor = float(np.median(heights[levels == values[int(np.argmax(counts))]]))
    numbered, pieces = label(told & (np.abs(heights - floor) < _FLAT))
    if not pieces:
        return None
    sizes = np.bincount(numbered.ravel())[1:]
    cells = numbered == 1 + int(np.argmax(sizes))
    spans = sorted(_CELL * np.ptp(np.flatnonzero(cells.any(axis=k))) for k in (0, 1))
    walled = float(np.nanmax(heights)) > floor + 2 * RADIUS
    return (cells, floor) if walled and spans[0] >= LEAST[0] and spans[1] >= LEAST[1] else None


def opens_far(part: TruthPart) -> Inside | None:
    """The inside of a true drawer that comes out by `LEAST` where the recording shows it open furthest; None
    of all else."""
    inside = inside_of(part)
    if inside is None:
        return None
    low, high = inside.opened(part.travel)
    return inside if min(high - low) >= LEAST[0] and max(high - low) >= LEAST[1] else None


def balls_kept(asset: Asset, name: str, part: TruthPart) -> int | None:
    """How many of the balls lie in the asset's drawer after `SECONDS`; None where the true part is no drawer
    that opens far enough."""
    inside = opens_far(part)
    if inside is None:
        return None
    state = asset.upper(name)
    low, high = inside.opened(min(state, part.travel))
    size = high - low
    count = GRID if size[1] >= size[0] else GRID[::-1]
    at = [low[k] + size[k] * (np.arange(n) + 0.5) / n for k, n in enumerate(count)]
    x, y = np.meshgrid(*at, indexing="ij")
    drop = np.full(x.size, inside.rim + ABOVE + RADIUS)
    start = np.stack([x.ravel(), y.ravel(), drop], axis=1) @ inside.axes.T
    end = dropped(
        asset.path, asset.joint(name), state, geo.transform(geo.invert_pose(asset.T_truth_asset), start)
    )
    local = geo.transform(asset.T_truth_asset, end) @ inside.axes
    out = [0.0, min(state, part.travel)]
    within = np.all((local[:, :2] > inside.low + out) & (local[:, :2] < inside.high + out), axis=1)
    return int(np.count_nonzero(within & (local[:, 2] > inside.floor)))


def dropped(path: Path, joint: int, state: float, start: Array) -> Array:
    """Middles (n, 3) of balls that were let go at `start` (n, 3), in the model's world; the joint is held at
    `state`, all others at 0."""
    spec = mujoco.MjSpec.from_file(str(path))
    for key in list(spec.keys):  # states of fewer joints than there will be
        spec.delete(key)
    for own in spec.joints:
        own.armature = _LOCK
    for k, point in enumerate(start):
        ball = spec.worldbody.add_body(name=f"ball_{k}", pos=point)
        ball.add_freejoint()
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], mass=MASS)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[model.jnt_qposadr[joint]] = state
    for _ in range(round(SECONDS / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return np.stack([data.body(f"ball_{k}").xpos.copy() for k in range(len(start))])

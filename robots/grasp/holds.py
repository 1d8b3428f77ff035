"""Where and how the gripper takes hold: the human contact refined on the part's own geometry.

A contact point lifted from a hand lies inside the fist and can be off by 3 cm, more than half a finger's length. What
protrudes from the part's dominant plane near it, a bar or a knob, says better where the fingers belong; a part from
which nothing protrudes is taken by its edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from robots.model.spec import RobotSpec
from twin import geometry as geo
from twin.geometry import Array
from twin.mesh import sample_surface
from twin.robust import mad_sigma
from twin.scene import ContactPath, Mesh

_SAMPLES = 60_000
_NEAR = 0.08  # m; a handle farther from the contact than this is another handle: 3 cm error plus the fist
_CELL = 0.012  # m; protruding points closer than this belong together, above the voxel of a fused mesh
_MIN_HEIGHT = 0.010  # m above the plane: twice the 5 mm noise of a fused mesh
_MAX_HEIGHT = 0.15  # what stands out farther is a wall of the part, such as a drawer's front seen from above
_PINCH = 0.03  # m of a rim between the fingers and behind them: a fingertip is 2 cm long
_SIDE = 0.06  # m to either side of a contact within which a rim is looked for
_ELONGATED = 1.8  # length over width from which a handle is a bar


@dataclass(frozen=True, eq=False)
class Hold:
    """Something the gripper can close on, in the world at state 0.

    centre: (3,) m, middle of what is held. rotation: (3, 3), columns = closing direction, along the handle, out of the
    part (the hand comes from there). thickness: m along the closing direction. depth: m from the middle to the surface
    that faces the palm. stand_off: free depth in m behind the middle, as far as the fingers may reach. refined: found on
    the mesh, not only told by the hand.
    """

    kind: Literal["bar", "knob", "edge", "contact"]
    centre: Array
    rotation: Array
    thickness: float
    depth: float
    stand_off: float
    refined: bool


@dataclass(frozen=True, eq=False)
class Plane:
    """normal @ x == offset; noise: robust spread of the surface about it (m)."""

    normal: Array
    offset: float
    noise: float


def find_holds(mesh: Mesh, contact: ContactPath, spec: RobotSpec, seed: int = 0) -> list[Hold]:
    """Ways to hold a part near a contact, best first. Never empty: the contact itself is the last resort.

    Args:
        mesh: the part at state 0, noise up to about 5 mm.
        contact: of the hand.
        spec: the gripper; what is thicker than its stroke can't be held.
    """
    points, normals = sample_surface(mesh, _SAMPLES, np.random.default_rng(seed))
    holds: list[Hold] = []
    if len(points):
        plane = dominant_plane(points, normals, contact)
        holds = _protruding(points, plane, contact, spec)
        if not holds:
            holds = _edges(points, plane, contact)
        widest = spec.stroke - 0.004
        holds = [h for h in holds if h.thickness <= widest]
    stand_off = 0.02
    raw = Hold(
        "contact", contact.point, contact.rotation, contact.width, contact.width / 2, stand_off, refined=False
    )
    return holds or [raw]


def dominant_plane(points: Array, normals: Array, contact: ContactPath) -> Plane:
    """The large flat face in front of which the contact lies.

    Its normal is the mean of the normals that agree with the contact's outward direction, sharpened twice; its height
    the outermost of the well-filled ones, so an inner wall of a drawer does not win over the front.
    """
    normal = np.array(contact.rotation[:, 2])
    for cone in (45.0, 25.0, 15.0):
        close = normals @ normal > np.cos(np.deg2rad(cone))
        if np.count_nonzero(close) < 50:
            break
        normal = geo.unit(normals[close].mean(axis=0))
    facing = points[normals @ normal > 0.75]
    if len(facing) < 50:
        facing = points
    height = facing @ normal
    edges = np.arange(height.min() - 0.01, height.max() + 0.015, 0.005)
    filled = np.convolve(np.histogram(height, edges)[0], np.ones(3), mode="same")
    k = int(np.flatnonzero(filled >= 0.4 * filled.max())[-1])
    peak = max(range(max(k - 4, 0), k + 1), key=lambda i: filled[i])
    offset = float(edges[peak] + 0.0025)
    for _ in range(3):
        near = np.abs(facing @ normal - offset) < 0.012
        if np.count_nonzero(near) < 50:
            break
        centre = facing[near].mean(axis=0)
        _, vectors = np.linalg.eigh(np.cov((facing[near] - centre).T))
        flat = vectors[:, 0] * np.sign(vectors[:, 0] @ normal)
        if flat @ normal > np.cos(np.deg2rad(10)):
            normal = flat
        offset = float(np.median(facing[near] @ normal))
    near_heights = facing[np.abs(facing @ normal - offset) < 0.02] @ normal - offset
    return Plane(normal, offset, mad_sigma(near_heights))


def _protruding(points: Array, plane: Plane, contact: ContactPath, spec: RobotSpec) -> list[Hold]:
    height = points @ plane.normal - plane.offset
    floor = max(_MIN_HEIGHT, 3.0 * plane.noise)
    cluster = _nearest_cluster(points[height > floor], contact.point)
    if cluster is None or float(np.quantile(cluster @ plane.normal, 0.99)) - plane.offset > _MAX_HEIGHT:
        return []
    basis = _plane_basis(cluster, plane.normal, contact)
    local = (cluster - contact.point) @ basis  # closing, along, out
    top = float(np.quantile(local[:, 2], 0.97))
    base = float(plane.offset - contact.point @ plane.normal)
    outer = local[local[:, 2] > base + 0.5 * (top - base)]
    extent = np.quantile(outer[:, :2], 0.98, axis=0) - np.quantile(outer[:, :2], 0.02, axis=0)
    if extent[1] > _ELONGATED * extent[0] or extent[1] > spec.stroke:
        return [_bar(local, outer, basis, base, contact)]
    return _knobs(outer, basis, base, top, contact)


def clusters(points: Array) -> list[Array]:
    """Connected groups of points, each (n, 3) with at least 20 points and 1 cm across."""
    if len(points) < 20:
        return []
    cells = np.floor((points - points.min(axis=0)) / _CELL).astype(int)
    grid = np.zeros(cells.max(axis=0) + 1, dtype=bool)
    grid[tuple(cells.T)] = True
    label, count = ndimage.label(grid, structure=np.ones((3, 3, 3)))
    group = label[tuple(cells.T)]
    found = [points[group == g] for g in range(1, count + 1)]
    return [m for m in found if len(m) >= 20 and np.ptp(m, axis=0).max() >= 0.01]


def _nearest_cluster(points: Array, near: Array) -> Array | None:
    """The connected group of points nearest to `near`, None when it is too far or too small."""
    best, best_cost = None, np.inf
    for members in clusters(points):
        distance = float(cKDTree(members).query(near)[0])
        if distance < min(_NEAR, best_cost):
            best, best_cost = members, distance
    return best


def _plane_basis(cluster: Array, normal: Array, contact: ContactPath) -> Array:
    """Closing direction, along the cluster, out of the plane, as columns."""
    flat = cluster - cluster.mean(axis=0)
    flat = flat - np.outer(flat @ normal, normal)
    _, vectors = np.linalg.eigh(flat.T @ flat)
    along = geo.unit(vectors[:, 2] - normal * (vectors[:, 2] @ normal))
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(flat.T @ flat), 0))
    told = contact.rotation[:, 1] - normal * (contact.rotation[:, 1] @ normal)
    if spread[2] < 1.5 * spread[1] and np.linalg.norm(told) > 0.3:
        along = geo.unit(told)  # no long side of its own: the hand's direction decides
    if along @ contact.rotation[:, 1] < 0:
        along = -along
    return np.stack([np.cross(along, normal), along, normal], axis=1)


def _bar(local: Array, outer: Array, basis: Array, base: float, contact: ContactPath) -> Hold:
    """Section of a bar nearest to the contact where the fingers have room behind it."""
    low, high = np.quantile(outer[:, 1], [0.01, 0.99])
    inset = min(0.015, 0.3 * (high - low))
    stations = np.arange(low + inset, high - inset + 1e-9, 0.005)
    rows = []
    for y in stations:
        section = outer[np.abs(outer[:, 1] - y) < 0.012]
        behind = local[np.abs(local[:, 1] - y) < 0.012]
        if len(section) >= 8:
            c0, c1 = np.quantile(section[:, 0], [0.03, 0.97])
            z0, z1 = float(np.quantile(behind[:, 2], 0.05)), float(np.quantile(section[:, 2], 0.97))
            rows.append((y, c0, c1, z0, z1))
    if not rows:
        rows = [(0.5 * (low + high), *np.quantile(outer[:, 0], [0.03, 0.97]), base, float(outer[:, 2].max()))]
    table = np.array(rows)
    gap = table[:, 3] - base
    roomy = table[gap >= 0.6 * gap.max()]
    y, c0, c1, z0, z1 = roomy[np.argmin(np.abs(roomy[:, 0]))]
    thickness = float(np.median(roomy[:, 2] - roomy[:, 1]))
    # A scan sees the front of a bar better than its back: it is at least as deep as half its thickness, and no deeper
    # than the room it leaves; a bar melted into the panel counts as deep as it is thick.
    depth = float(np.clip(z1 - z0, 0.5 * thickness, 1.2 * thickness))
    centre = np.array([0.5 * (c0 + c1), y, z1 - depth / 2])
    return Hold(
        "bar",
        contact.point + basis @ centre,
        basis,
        thickness,
        depth / 2,
        max(float(centre[2] - base), 0.005),
        refined=True,
    )


def _knobs(outer: Array, basis: Array, base: float, top: float, contact: ContactPath) -> list[Hold]:
    """A knob may be closed on along either in-plane direction; the thinner one first."""
    low, high = np.quantile(outer[:, :2], [0.03, 0.97], axis=0)
    size = high - low
    depth = float(np.clip(top - np.quantile(outer[:, 2], 0.03), 0.008, 0.03))
    middle = (low + high) / 2
    centre = contact.point + basis @ np.array([middle[0], middle[1], top - depth / 2])
    stand_off = max(top - depth / 2 - base, 0.005)
    turned = np.stack([basis[:, 1], -basis[:, 0], basis[:, 2]], axis=1)
    holds = [
        Hold("knob", centre, frame, float(thick), depth / 2, stand_off, refined=True)
        for frame, thick in ((basis, size[0]), (turned, size[1]))
    ]
    return sorted(holds, key=lambda h: h.thickness)


def _edges(points: Array, plane: Plane, contact: ContactPath) -> list[Hold]:
    """Rims that the fingers can pinch: as the hand held it, then the borders of the dominant face, nearest first."""
    told = contact.rotation[:, 1] - plane.normal * (contact.rotation[:, 1] @ plane.normal)
    along = geo.unit(told) if np.linalg.norm(told) > 0.3 else geo.orthogonal_basis(plane.normal)[:, 0]
    side = np.cross(along, plane.normal)
    borders = [
        np.stack([plane.normal, np.cross(out, plane.normal), out], axis=1)
        for out in (side, -side, along, -along)
    ]
    found = [_rim(points, rotation, contact.point) for rotation in (contact.rotation, *borders)]
    holds = [h for h in found[1:] if h is not None]
    holds.sort(key=lambda h: float(np.linalg.norm(h.centre - contact.point)))
    return [h for h in found[:1] if h is not None] + holds[:2]


def _rim(points: Array, rotation: Array, near: Array) -> Hold | None:
    """The outermost strip of the part near a point, seen along the third column of `rotation`."""
    local = (points - near) @ rotation
    column = local[(np.abs(local[:, 1]) < 0.02) & (np.abs(local[:, 0]) < _SIDE)]
    if len(column) < 20:
        return None
    rim = float(np.quantile(column[:, 2], 0.99))
    strip = column[rim - column[:, 2] < _PINCH]
    if abs(rim) > 0.12 or len(strip) < 20:
        return None
    low, high = (float(q) for q in np.quantile(strip[:, 0], [0.02, 0.98]))
    if max(high, -low) > _SIDE - 0.004:
        return None  # it goes on beyond what was looked at: a solid body or a face seen on edge, no rim
    depth = 0.4 * _PINCH
    centre = near + rotation @ np.array([(low + high) / 2, 0.0, rim - depth])
    return Hold("edge", centre, rotation, max(high - low, 0.004), depth, _PINCH, refined=True)

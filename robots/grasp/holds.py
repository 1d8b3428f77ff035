"""Where and how the gripper takes hold: the human contact refined on the part's own geometry.

A contact point lifted from a hand lies inside the fist and can be off by 3 cm, more than half a finger's
length. What protrudes from the part's dominant plane near it, a bar or a knob, says better where the fingers
belong; a part from which nothing protrudes is taken by its edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from robots.model.spec import RobotSpec
from twin import geometry as geo
from twin.collision.convex import cut, triangles_of
from twin.geometry import Array
from twin.handles import CELL, TALLEST, Face, frame_of, is_bar, long_side, outermost_face, split
from twin.mesh import sample_surface
from twin.scene import ContactPath, Mesh

_SAMPLES = 60_000
# points on what stands off a face: 1 m^2 of it is still sampled finer than a cell of the finder
_STANDING = 40_000
_NEAR = 0.08  # m; a handle farther from the contact than this is another handle: 3 cm error plus the fist
_PINCH = 0.03  # m of a rim between the fingers and behind them: a fingertip is 2 cm long
SIDE = 0.06  # m to either side of a contact within which a rim is looked for
_CRUMB = 3e-4  # m^2; less surface than on a knob of 1 cm is noise
_SLACK = 0.004  # m that the open gripper needs beside what it holds


@dataclass(frozen=True, eq=False)
class Hold:
    """Something the gripper can close on, in the world at state 0.

    centre: (3,) m, middle of what is held. rotation: (3, 3), columns = closing direction, along the handle,
    out of the part (the hand comes from there). thickness: m along the closing direction. depth: m from the
    middle to the surface that faces the palm. stand_off: free depth in m behind the middle, as far as the
    fingers may reach. refined: found on the mesh, not only told by the hand.
    """

    kind: Literal["bar", "knob", "edge", "contact"]
    centre: Array
    rotation: Array
    thickness: float
    depth: float
    stand_off: float
    refined: bool


def find_holds(mesh: Mesh, contact: ContactPath, spec: RobotSpec, seed: int = 0) -> list[Hold]:
    """Ways to hold a part near a contact, best first. Never empty: the contact itself is the last resort.

    Args:
        mesh: the part at state 0, noise up to about 5 mm.
        contact: of the hand.
        spec: the gripper; what is thicker than its stroke can't be held.
    """
    holds = [h for h in shaped_holds(mesh, contact, spec, seed) if h.thickness <= widest(spec)]
    stand_off = 0.02
    raw = Hold(
        "contact", contact.point, contact.rotation, contact.width, contact.width / 2, stand_off, refined=False
    )
    return holds or [raw]


def widest(spec: RobotSpec) -> float:
    """The thickest (m) that a gripper takes between its fingers."""
    return spec.stroke - _SLACK


def shaped_holds(mesh: Mesh, contact: ContactPath, spec: RobotSpec, seed: int = 0) -> list[Hold]:
    """What the mesh offers near a contact, best first, for any gripper: bars and knobs, or rims."""
    rng = np.random.default_rng(seed)
    points, normals = sample_surface(mesh, _SAMPLES, rng)
    if not len(points):
        return []
    face = dominant_face(points, normals, contact)
    standing = protruding(mesh, face, rng)
    return _protruding(standing, face, contact, spec) or _edges(points, face.normal, contact)


def dominant_face(points: Array, normals: Array, contact: ContactPath) -> Face:
    """The large flat face in front of which the contact lies.

    Its normal is the mean of the normals that agree with the contact's outward direction, sharpened twice;
    its height the outermost well-filled one, so an inner wall of a drawer does not win over the front.
    """
    normal = np.array(contact.rotation[:, 2])
    for cone in (45.0, 25.0, 15.0):
        close = normals @ normal > np.cos(np.deg2rad(cone))
        if np.count_nonzero(close) < 50:
            break
        normal = geo.unit(normals[close].mean(axis=0))
    facing = points[normals @ normal > 0.75]
    return outermost_face(facing if len(facing) >= 50 else points, normal, one_sided=len(facing) >= 50)


def protruding(mesh: Mesh, face: Face, rng: np.random.Generator) -> list[Array]:
    """What of a mesh stands off a face: connected groups of points (n, 3) on it, each 1 cm across or more.

    Only the surface that stands off is sampled: a share of the samples of a whole door would leave gaps in a
    thin handle. What is too high for a handle is cut off a little above, where `Face.low_enough` sees it.
    """
    _, above = cut(triangles_of(mesh), face.normal, face.offset + face.skin)
    off, _ = cut(above, face.normal, face.offset + TALLEST + CELL)
    surface = Mesh(off.reshape(-1, 3), np.arange(3 * len(off), dtype=np.int32).reshape(-1, 3))
    points, _ = sample_surface(surface, _STANDING, rng)
    least = _CRUMB * _STANDING / max(surface.area, 1e-12)  # points
    return [g for g in split(points) if len(g) >= least and np.ptp(g, axis=0).max() >= 0.01]


def _protruding(standing: list[Array], face: Face, contact: ContactPath, spec: RobotSpec) -> list[Hold]:
    groups = [(float(cKDTree(g).query(contact.point)[0]), k, g) for k, g in enumerate(standing)]
    distance, _, nearest = min(groups, default=(np.inf, 0, np.zeros((0, 3))), key=lambda row: row[:2])
    if distance > _NEAR or not face.low_enough(nearest):
        return []
    outer, top = face.outer_half(nearest)
    along, length, width = long_side(outer, face.normal)
    told = contact.rotation[:, 1] - face.normal * (contact.rotation[:, 1] @ face.normal)
    if not is_bar(length, width) and np.linalg.norm(told) > 0.3:
        along = geo.unit(told)  # no long side of its own: the hand's direction decides
    if along @ contact.rotation[:, 1] < 0:
        along = -along
    basis = frame_of(along, face.normal)
    base = -float(face.height(contact.point))
    outer = (outer - contact.point) @ basis  # closing, along, out
    if is_bar(length, width) or length > spec.stroke:
        return [_bar((nearest - contact.point) @ basis, outer, basis, base, contact)]
    return _knobs(outer, basis, base, base + top, contact)


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
    # A scan sees the front of a bar better than its back: it is at least as deep as half its thickness, and
    # no deeper than the room it leaves; a bar melted into the panel counts as deep as it is thick.
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


def _edges(points: Array, normal: Array, contact: ContactPath) -> list[Hold]:
    """Rims that the fingers can pinch: as held by hand, then the dominant face's borders, nearest first."""
    told = contact.rotation[:, 1] - normal * (contact.rotation[:, 1] @ normal)
    along = geo.unit(told) if np.linalg.norm(told) > 0.3 else geo.orthogonal_basis(normal)[:, 0]
    side = np.cross(along, normal)
    borders = [np.stack([normal, np.cross(out, normal), out], axis=1) for out in (side, -side, along, -along)]
    found = [_rim(points, rotation, contact.point) for rotation in (contact.rotation, *borders)]
    holds = [h for h in found[1:] if h is not None]
    holds.sort(key=lambda h: float(np.linalg.norm(h.centre - contact.point)))
    return [h for h in found[:1] if h is not None] + holds[:2]


def _rim(points: Array, rotation: Array, near: Array) -> Hold | None:
    """The outermost strip of the part near a point, seen along the third column of `rotation`."""
    local = (points - near) @ rotation
    column = local[(np.abs(local[:, 1]) < 0.02) & (np.abs(local[:, 0]) < SIDE)]
    if len(column) < 20:
        return None
    rim = float(np.quantile(column[:, 2], 0.99))
    strip = column[rim - column[:, 2] < _PINCH]
    if abs(rim) > 0.12 or len(strip) < 20:
        return None
    low, high = (float(q) for q in np.quantile(strip[:, 0], [0.02, 0.98]))
    if max(high, -low) > SIDE - 0.004:
        return None  # it goes on beyond what was looked at: a solid body or a face seen on edge, no rim
    depth = 0.4 * _PINCH
    centre = near + rotation @ np.array([(low + high) / 2, 0.0, rim - depth])
    return Hold("edge", centre, rotation, max(high - low, 0.004), depth, _PINCH, refined=True)

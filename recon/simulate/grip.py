"""Where a hand takes hold of a part: the handle that protrudes from it, or its free edge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from recon.simulate.mjcf import Articulation
from recon.simulate.ray_caster import Caster
from recon.simulate.surfaces import Surface, merged_mesh
from twin.errors import InputError, nearest_name
from twin.geometry import Array, unit
from twin.handles import STANDS_OFF, is_bar, long_side, upright
from twin.mesh import sample_surface
from twin.scene import Mesh

GRID = 48  # rays per side that look at the part from each direction
LAYER = 0.016  # metres of the outermost layer that holds the bar, not its posts
SAMPLES = 6000


@dataclass(frozen=True)
class Grasp:
    """Where and how a part is held, world frame at state 0.

    Attributes:
        point: grip centre (3,), inside the fist: on the bar's axis.
        bar: unit direction (3,) along the bar.
        outward: unit direction (3,) from the part towards the person.
        width: thickness of what is held, metres.
        source: "handle", "edge" or the name that was asked for.
    """

    point: Array
    bar: Array
    outward: Array
    width: float
    source: str


def find_grasp(scene: Articulation, handle: str | None, rng: np.random.Generator) -> Grasp:
    """Find the grip of the scene's part.

    The part is looked at from the directions its large faces point to, with all closed; what lies over
    STANDS_OFF before the seen face is the handle. Parts without one are held at the edge that moves most.

    Raises:
        InputError: `handle` is neither a site nor a geom of the part.
    """
    views = _views(scene)
    if handle is not None:
        return _named(scene, handle, views[0])
    for direction, face in views:
        found = _handle(scene, direction, face, rng)
        if found is not None:
            return found
    return _edge(scene, views[0])


def _views(scene: Articulation) -> list[tuple[Array, float]]:
    """Directions in which the closed part can be seen, largest visible area first, with its offset."""
    part = merged_mesh(list(scene.part))
    caster = Caster()
    for surface in scene.static:
        caster.add(surface.vertices, surface.faces)
    part_id = caster.add(np.asarray(part.vertices), np.asarray(part.faces))
    found: list[tuple[float, Array, float]] = []
    for direction in _face_directions(part):
        if direction[2] < -0.7:  # nobody looks from below
            continue
        side = unit(np.cross(direction, [0.2, 0.3, 1.0] if abs(direction[2]) < 0.9 else [1.0, 0.0, 0.0]))
        other = np.cross(direction, side)
        local = np.asarray(part.vertices) @ np.stack([side, other, direction], axis=1)
        low, high = local.min(axis=0), local.max(axis=0)
        cells = [low[k] + (np.arange(GRID) + 0.5) / GRID * (high[k] - low[k]) for k in (0, 1)]
        a, b = (g.ravel() for g in np.meshgrid(*cells))
        start = a[:, None] * side + b[:, None] * other + (high[2] + 0.25) * direction
        rays = np.concatenate([start, np.broadcast_to(-direction, start.shape)], axis=1).astype(np.float32)
        hits = caster.first(rays)
        seen = hits.mesh == part_id
        if not seen.any():
            continue
        area = float(seen.mean() * np.prod(high[:2] - low[:2]))
        offsets = high[2] + 0.25 - hits.t[seen]
        counts, edges = np.histogram(
            offsets, bins=np.arange(offsets.min() - 0.005, offsets.max() + 0.01, 0.005)
        )
        found.append((area, direction, float(edges[int(counts.argmax()) + 1])))
    if not found:
        raise InputError(
            f"the part of joint {scene.name!r} can't be seen from outside", "choose another joint"
        )
    found.sort(key=lambda f: -f[0])
    return [(direction, offset) for _, direction, offset in found]


def _face_directions(part: trimesh.Trimesh) -> list[Array]:
    """Distinct directions (at least 20 degrees apart) of the part's faces, of 4 % of its area or more."""
    normals, areas = np.asarray(part.face_normals), np.asarray(part.area_faces)
    out: list[Array] = []
    left = areas > 0.0
    while left.any():
        weights = np.where(left, areas, 0.0)
        seed = normals[int(weights.argmax())]
        near = left & (normals @ seed > np.cos(np.radians(20.0)))
        if areas[near].sum() >= 0.04 * areas.sum():
            out.append(unit(areas[near] @ normals[near]))
        left &= ~near
    return out


def _handle(scene: Articulation, outward: Array, face: float, rng: np.random.Generator) -> Grasp | None:
    """The handle in front of the face at offset `face` along `outward`; absent when nothing protrudes."""
    part = merged_mesh(list(scene.part))
    points = np.asarray(part.vertices)
    height = points @ outward
    if height.max() <= face + STANDS_OFF:
        return None
    bar = points[height > height.max() - LAYER]
    if len(bar) < 8:  # too few vertices to show the shape
        samples, _ = sample_surface(Mesh(part.vertices, part.faces), SAMPLES, rng)
        bar = np.concatenate([bar, samples[samples @ outward > height.max() - LAYER]])
    along, length, width = long_side(bar, outward, outliers=0.0)
    if not is_bar(length, width):  # a knob: held as a vertical bar where that is possible
        along = upright(outward)
    across = unit(np.cross(outward, along))
    shift = float(rng.uniform(-0.12, 0.12)) * max(0.0, length - 0.10)
    point = (_middle(bar, along) + shift) * along + _middle(bar, across) * across
    axis_height = _axis_height(part, point, outward, face, float(height.max()))
    return Grasp(point + axis_height * outward, along, outward, max(width, 0.008), "handle")


def _middle(points: Array, direction: Array) -> float:
    along = points @ direction
    return 0.5 * (float(along.min()) + float(along.max()))


def _axis_height(part: trimesh.Trimesh, foot: Array, outward: Array, face: float, top: float) -> float:
    """Offset along `outward` of the bar's middle: between its outer side and what a ray from behind meets."""
    caster = Caster()
    caster.add(np.asarray(part.vertices), np.asarray(part.faces))
    behind = face + 0.3 * (top - face)
    ray = np.concatenate([foot + behind * outward, outward]).astype(np.float32)[None]
    met = float(caster.first(ray).t[0])
    inner = behind + met if np.isfinite(met) and behind + met < top - 1e-4 else top - LAYER
    return 0.5 * (inner + top)


def _edge(scene: Articulation, view: tuple[Array, float]) -> Grasp:
    """The middle of the edge that moves most (for a slide: that lies farthest ahead along the motion)."""
    outward, face = view
    vertices = np.asarray(merged_mesh(list(scene.part)).vertices)
    front = vertices[vertices @ outward > face - 0.03]
    if scene.kind == "prismatic" and abs(scene.axis @ outward) < 0.7:
        reach = front @ (-scene.axis)  # a sliding door is pulled at the edge away from where it goes
    elif scene.kind == "prismatic":
        reach = front[:, 2]
    else:
        reach = np.linalg.norm(np.cross(front - scene.pivot, scene.axis), axis=1)
    edge = front[reach > reach.max() - 0.02]
    low, high = edge.min(axis=0), edge.max(axis=0)
    along = np.eye(3)[int(np.argmax(high - low))]
    along = unit(along - (along @ outward) * outward)
    point = 0.5 * (low + high)
    point = point + (face - point @ outward) * outward
    return Grasp(point, along, outward, 0.02, "edge")


def _named(scene: Articulation, name: str, view: tuple[Array, float]) -> Grasp:
    """Grasp at a site, or around a geom, of the part."""
    geoms: dict[str, Surface] = {s.name: s for s in scene.part}
    outward = view[0]
    if name in scene.sites:
        along = upright(outward)
        return Grasp(scene.sites[name], along, outward, 0.02, name)
    if name not in geoms:
        there = sorted([*geoms, *scene.sites])
        near = nearest_name(name, there)
        hint = f"did you mean {near!r}? " if near else ""
        raise InputError(f"the part has no site or geom {name!r}", f"{hint}there are: {', '.join(there)}")
    vertices = geoms[name].vertices
    centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    _, _, axes = np.linalg.svd(vertices - vertices.mean(axis=0), full_matrices=False)
    along = unit(axes[0] - (axes[0] @ outward) * outward)
    across = unit(np.cross(outward, along))
    return Grasp(centre, along, outward, float(np.ptp(vertices @ across)), name)

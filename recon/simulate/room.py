"""The room around a scene: floor, walls, ceiling, pictures, boxes and books, to track cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recon.simulate.mjcf import Articulation
from recon.simulate.surfaces import Surface, box
from recon.simulate.textures import Material, make_material
from twin.geometry import Array, exp_so3, make_pose, transform

SIDE = 0.9  # metres of room left and right of the furniture
BEHIND = 2.4  # metres in front of the furniture
ABOVE = 0.8  # metres above the furniture
CEILING = 2.55
WALL = 0.05


def build_room(
    scene: Articulation,
    outward: Array,
    clutter: int,
    contrast: float,
    rng: np.random.Generator,
    others: Sequence[Articulation] = (),
) -> tuple[tuple[Surface, ...], Array, Array]:
    """Surfaces of a room around, with its inner corners (3,), (3,). others: parts that move as well.

    The wall behind the furniture touches it, opposite to where the part faces (`outward`, flattened).
    """
    facing = outward * [1.0, 1.0, 0.0]
    axis = int(np.argmax(np.abs(facing))) if np.linalg.norm(facing) > 0.3 else 1
    sign = float(np.sign(facing[axis])) if np.linalg.norm(facing) > 0.3 else -1.0
    low, high = scene.lower.copy(), scene.upper.copy()
    other = 1 - axis
    low[other] -= SIDE * rng.uniform(0.5, 1.0)
    high[other] += SIDE * rng.uniform(0.5, 1.0)
    if sign > 0:
        high[axis] += BEHIND
        low[axis] -= 0.002
    else:
        low[axis] -= BEHIND
        high[axis] += 0.002
    planes = [float(s.vertices[:, 2].max()) for s in scene.static if s.name.startswith("plane:")]
    floor = max(planes) if planes else float(scene.lower[2])
    low[2] = floor
    high[2] = max(floor + CEILING, float(scene.upper[2]) + ABOVE)
    surfaces = shell(low, high, scene.has_floor, contrast, rng)
    surfaces += _pictures(scene, low, high, axis, sign, contrast, rng)
    ways = [way for part in (scene, *others) for way in _way(part)]
    surfaces += _clutter(scene, surfaces, ways, low, high, axis, sign, clutter, contrast, rng)
    return tuple(surfaces), low, high


def block(name: str, low: Array, high: Array, material: Material, rng: np.random.Generator) -> Surface:
    """A box between two corners (3,), metres."""
    vertices, faces = box((float(high[0] - low[0]), float(high[1] - low[1]), float(high[2] - low[2])))
    offset = make_pose(None, rng.uniform(-1.0, 1.0, 3))
    return Surface(name, vertices + 0.5 * (low + high), faces, material, offset)


def shell(
    low: Array, high: Array, has_floor: bool, contrast: float, rng: np.random.Generator
) -> list[Surface]:
    """Walls and ceiling about the inner corners (3,), and a floor unless the scene has one."""
    wall = make_material(str(rng.choice(["plaster", "plaster", "tiles"])), contrast, rng)
    walls = [wall, make_material("plaster", contrast, rng)]
    out = []
    for axis in (0, 1):
        for side in (0, 1):
            a, b = low - WALL, high + WALL
            if side == 0:
                b[axis] = low[axis]
            else:
                a[axis] = high[axis]
            out.append(block("wall", a, b, walls[axis if rng.random() < 0.7 else 0], rng))
    a, b = low - WALL, high + WALL
    a[2] = high[2]
    out.append(block("ceiling", a, b, make_material("plaster", contrast, rng), rng))
    if not has_floor:
        a, b = low - WALL, high + WALL
        b[2] = low[2]
        floor = make_material(str(rng.choice(["tiles", "wood", "speckle"])), contrast, rng)
        out.append(block("floor", a, b, floor, rng))
    return out


def _pictures(
    scene: Articulation,
    low: Array,
    high: Array,
    axis: int,
    sign: float,
    contrast: float,
    rng: np.random.Generator,
) -> list[Surface]:
    """Pictures on the wall behind the furniture and on the side walls, clear of the furniture's outline."""
    out: list[Surface] = []
    other = 1 - axis
    back = low[axis] if sign > 0 else high[axis]
    width = high[other] - low[other]
    for k in range(4):
        size = rng.uniform(0.22, 0.42, 2)
        a, b = np.zeros(3), np.zeros(3)
        centre = low[other] + (k + 0.5 + rng.uniform(-0.15, 0.15)) / 4.0 * width
        base = max(float(scene.upper[2]) + 0.15, low[2] + 1.15)
        if base + size[1] > high[2] - 0.05:
            continue
        a[other], b[other] = centre - 0.5 * size[0], centre + 0.5 * size[0]
        a[axis], b[axis] = back - 0.012, back + 0.012
        a[2] = base + rng.uniform(0.0, 0.1)
        b[2] = a[2] + size[1]
        out.append(block("picture", a, b, make_material("poster", contrast, rng), rng))
    for side in (low[other], high[other]):
        for _ in range(2):
            size = rng.uniform(0.3, 0.6, 2)
            a, b = np.zeros(3), np.zeros(3)
            centre = rng.uniform(low[axis] + 0.4, high[axis] - 0.4)
            a[axis], b[axis] = centre - 0.5 * size[0], centre + 0.5 * size[0]
            a[other], b[other] = side - 0.012, side + 0.012
            a[2] = low[2] + rng.uniform(0.6, 1.5)
            b[2] = a[2] + size[1]
            out.append(block("picture", a, b, make_material("poster", contrast, rng), rng))
    return out


def _clutter(
    scene: Articulation,
    walls: list[Surface],
    ways: list[Array],
    low: Array,
    high: Array,
    axis: int,
    sign: float,
    count: int,
    contrast: float,
    rng: np.random.Generator,
) -> list[Surface]:
    """Boxes and books: on top of the furniture, and on the floor beside it, clear of the part's way."""
    out: list[Surface] = []
    other = 1 - axis
    front = scene.upper[axis] if sign > 0 else scene.lower[axis]
    tops = _free_tops(scene)
    occupied = [*(s.vertices for s in [*scene.static, *walls]), *ways]
    for k in range(count):
        material = make_material("poster" if k % 3 else str(rng.choice(["speckle", "wood"])), contrast, rng)
        on_top = k % 2 == 0 and len(tops) > 0
        size = rng.uniform([0.06, 0.06, 0.08], [0.2, 0.2, 0.28]) if on_top else rng.uniform(0.18, 0.42, 3)
        if on_top:
            position = tops[int(rng.integers(len(tops)))].copy()
        else:
            left = rng.random() < 0.5
            position = np.zeros(3)
            edge = low[other] + 0.26 if left else high[other] - 0.26
            position[other] = edge + rng.uniform(-0.05, 0.05)
            position[axis] = front + sign * rng.uniform(-0.3, 1.2)
            position[2] = low[2]
        thing = upright_box("clutter", size, position, float(rng.uniform(-0.6, 0.6)), material)
        if any(_overlap(thing.vertices, taken) for taken in [*occupied, *(s.vertices for s in out)]):
            continue
        out.append(with_grain(thing, rng))
    return out


def upright_box(name: str, size: Array, position: Array, angle: float, material: Material) -> Surface:
    """A box of full `size` (3,) m, turned by `angle` rad about z, whose lower side is at `position` (3,)."""
    turn = exp_so3(np.array([0.0, 0.0, angle]))
    vertices, faces = box((float(size[0]), float(size[1]), float(size[2])))
    placed = vertices @ turn.T + position + [0.0, 0.0, 0.5 * size[2]]
    return Surface(name, placed, faces, material, make_pose(turn.T, -turn.T @ position))


def with_grain(surface: Surface, rng: np.random.Generator) -> Surface:
    """The same with its texture shifted at random."""
    texture = surface.T_texture_object.copy()
    texture[:3, 3] += rng.uniform(-1.0, 1.0, 3)
    return replace(surface, T_texture_object=texture)


def _way(part: Articulation) -> list[Array]:
    """The vertices (V, 3) of a part on its way, which stays clear."""
    states = np.linspace(0.0, part.span, 7)
    return [transform(part.pose(float(s)), surface.vertices) for s in states for surface in part.part]


def _free_tops(scene: Articulation) -> Array:
    """Points (n, 3) on upward faces of the furniture that nothing covers within 0.35 m, part excepted."""
    points = []
    for surface in scene.static:
        if surface.name.startswith("plane:"):
            continue
        a, b = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
        if min(b[0] - a[0], b[1] - a[1]) < 0.25 or b[2] < scene.lower[2] + 0.3:
            continue
        for u in np.linspace(0.15, 0.85, 7):
            for v in (0.45, 0.7, 0.85):
                points.append([a[0] + u * (b[0] - a[0]), a[1] + v * (b[1] - a[1]), b[2] + 1e-3])
    covers = [(s.vertices.min(axis=0), s.vertices.max(axis=0)) for s in [*scene.static, *scene.part]]
    out = [
        p
        for p in points
        if not any(
            a[0] - 0.06 < p[0] < b[0] + 0.06
            and a[1] - 0.06 < p[1] < b[1] + 0.06
            and b[2] > p[2] + 1e-3
            and a[2] < p[2] + 0.35
            for a, b in covers
        )
    ]
    return np.array(out).reshape(-1, 3)


def _overlap(a: Array, b: Array) -> bool:
    low, high = np.maximum(a.min(axis=0), b.min(axis=0)), np.minimum(a.max(axis=0), b.max(axis=0))
    return bool(np.all(high - low > 1e-4))

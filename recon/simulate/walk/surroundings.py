"""What a furnished room has besides furniture: floor, walls and ceiling, pictures, things on tops, lamps."""

from __future__ import annotations

import numpy as np

from recon.simulate.render import Lights
from recon.simulate.room import block, shell, upright_box, with_grain
from recon.simulate.surfaces import Surface
from recon.simulate.textures import make_material
from recon.simulate.walk.layout import Layout
from twin.geometry import Array

Rng = np.random.Generator
# Pictures that are tried on each wall
_PICTURES = 5
# m of two lamps under the ceiling, and their light, more than in a clip: a room is larger than its corner
_LAMPS = (0.34, 0.28)
_POWERS = ((6.0, 5.7, 5.1), (4.4, 4.5, 4.8))
_SKY = (0.55, 0.56, 0.58)


def room_surfaces(layout: Layout, clutter: int, contrast: float, rng: Rng) -> tuple[Surface, ...]:
    """Shell, pictures clear of the furniture, and so many things on its tops."""
    walls = shell(layout.low, layout.high, False, contrast, rng)
    return (*walls, *_pictures(layout, contrast, rng), *_things(layout, clutter, contrast, rng))


def _pictures(layout: Layout, contrast: float, rng: Rng) -> list[Surface]:
    taken = [s.closed.bounds for s in layout.stands]
    out: list[Surface] = []
    for axis in (0, 1):
        other = 1 - axis
        for side in (layout.low[axis], layout.high[axis]):
            for _ in range(_PICTURES):
                size = rng.uniform([0.3, 0.3], [0.7, 0.6])
                middle = rng.uniform([layout.low[other] + 0.4, 1.2], [layout.high[other] - 0.4, 1.85])
                low, high = np.zeros(3), np.zeros(3)
                low[axis], high[axis] = side - 0.012, side + 0.012
                low[[other, 2]], high[[other, 2]] = middle - size / 2, middle + size / 2
                if not any(_overlap(low, high, a, b, 0.05) for a, b in taken):
                    taken.append((low, high))
                    out.append(block("picture", low, high, make_material("poster", contrast, rng), rng))
    return out


def _things(layout: Layout, count: int, contrast: float, rng: Rng) -> list[Surface]:
    """Boxes and books on tops, at their rear, where hands don't come by."""
    tops = [(s, t) for s in layout.stands for t in s.piece.tops]
    out: list[Surface] = []
    taken: list[tuple[Array, Array]] = []
    for k in range(count if tops else 0):
        stand, top = tops[int(rng.integers(len(tops)))]
        size = rng.uniform([0.06, 0.06, 0.08], [0.2, 0.18, 0.28])
        half = 0.5 * top.size[:2] - 0.5 * float(np.hypot(*size[:2]))
        if np.any(half <= 0.0):
            continue
        spot = top.T_world_box[:3, 3] + np.append(rng.uniform([-half[0], 0.0], half), 0.5 * top.size[2])
        place = stand.pose[:3, :3] @ spot + stand.pose[:3, 3]
        material = make_material("poster" if k % 3 else str(rng.choice(["speckle", "wood"])), contrast, rng)
        made = upright_box("clutter", size, place, float(rng.uniform(-0.6, 0.6)), material)
        low, high = made.vertices.min(axis=0), made.vertices.max(axis=0)
        if not any(_overlap(low, high, a, b, 0.01) for a, b in taken):
            taken.append((low, high))
            out.append(with_grain(made, rng))
    return out


def _overlap(low: Array, high: Array, other_low: Array, other_high: Array, apart: float) -> bool:
    return bool(np.all(np.minimum(high, other_high) - np.maximum(low, other_low) > -apart))


def room_lamps(layout: Layout) -> Lights:
    """Two lamps under the ceiling at a third and two thirds of the room's longer side; ambient all over."""
    low, high = layout.low, layout.high
    axis = int(np.argmax((high - low)[:2]))
    shapes = []
    for share, size in zip((0.3, 0.72), _LAMPS, strict=True):
        centre = 0.5 * (low + high)
        centre[axis] = low[axis] + share * (high - low)[axis]
        centre[2] = high[2] - 0.08
        shapes.append(np.stack([centre, [size, 0.0, 0.0], [0.0, size, 0.0]]))
    powers, sky = np.array(_POWERS, np.float32), np.array(_SKY, np.float32)
    return Lights(np.stack(shapes).astype(np.float32), powers, sky)

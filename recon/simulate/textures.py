"""Procedural materials: tileable albedo images drawn from a seed. Nothing is photographed or copied."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from recon.simulate.painters import (
    Image,
    fabric,
    laminate,
    metal,
    plain,
    plaster,
    poster,
    skin,
    speckle,
    stripes,
    tiles,
    wood,
)
from twin.geometry import Array


@dataclass(frozen=True)
class Material:
    """How a surface looks. `image` (SIZE, SIZE, 3) is linear albedo in 0..1; one tile spans `tile` metres;
    `gloss` 0..1 gives highlights and, on dark surfaces, missing depth.
    """

    name: str
    image: Image
    tile: float
    gloss: float


PAINTERS: dict[str, tuple[Callable[[np.random.Generator, Array], Image], float, float]] = {
    # kind: painter, metres a tile, gloss (chosen by us so that details are 3 to 30 mm, as on real surfaces)
    "wood": (wood, 0.55, 0.25),
    "speckle": (speckle, 0.60, 0.35),
    "tiles": (tiles, 0.90, 0.30),
    "plaster": (plaster, 0.80, 0.05),
    "laminate": (laminate, 0.50, 0.30),
    "metal": (metal, 0.30, 0.60),
    "fabric": (fabric, 0.25, 0.00),
    "skin": (skin, 0.15, 0.15),
    "poster": (poster, 0.60, 0.20),
    "dark": (speckle, 0.40, 0.90),
    "plain": (plain, 0.50, 0.15),
    "stripes": (stripes, 0.35, 0.10),
    "glossy": (plain, 0.50, 0.90),
}

PALETTES: dict[str, list[tuple[float, float, float]]] = {
    "wood": [(0.42, 0.24, 0.12), (0.55, 0.38, 0.2), (0.62, 0.47, 0.29), (0.3, 0.17, 0.09), (0.5, 0.3, 0.17)],
    "speckle": [(0.5, 0.48, 0.45), (0.62, 0.6, 0.55), (0.3, 0.32, 0.34), (0.45, 0.38, 0.33)],
    "tiles": [(0.62, 0.58, 0.52), (0.4, 0.5, 0.52), (0.55, 0.36, 0.28), (0.7, 0.7, 0.68)],
    "plaster": [(0.66, 0.63, 0.56), (0.5, 0.56, 0.58), (0.62, 0.54, 0.44), (0.58, 0.6, 0.5)],
    "laminate": [
        (0.66, 0.65, 0.6),
        (0.35, 0.45, 0.5),
        (0.45, 0.52, 0.4),
        (0.6, 0.42, 0.35),
        (0.36, 0.36, 0.4),
    ],
    "metal": [(0.5, 0.5, 0.5), (0.45, 0.42, 0.36), (0.3, 0.3, 0.32)],
    "fabric": [(0.16, 0.2, 0.32), (0.3, 0.12, 0.13), (0.2, 0.27, 0.2), (0.33, 0.3, 0.26)],
    "skin": [(0.72, 0.46, 0.35), (0.55, 0.33, 0.23), (0.36, 0.2, 0.13), (0.78, 0.54, 0.43)],
    "poster": [(0.75, 0.72, 0.62), (0.2, 0.35, 0.5), (0.6, 0.3, 0.15), (0.35, 0.5, 0.3)],
    "dark": [(0.05, 0.05, 0.055), (0.07, 0.06, 0.06)],
    "plain": [(0.75, 0.74, 0.72), (0.5, 0.5, 0.52), (0.25, 0.3, 0.36), (0.6, 0.52, 0.42)],
    "stripes": [(0.6, 0.5, 0.38), (0.55, 0.57, 0.6), (0.35, 0.25, 0.2)],
    "glossy": [(0.78, 0.78, 0.77), (0.1, 0.1, 0.11), (0.45, 0.08, 0.08)],
}

# Linear albedo from light to dark, after the six types of Fitzpatrick (1988); values chosen by us.
SKIN_TONES = [
    (0.80, 0.58, 0.48),
    (0.72, 0.46, 0.35),
    (0.62, 0.39, 0.27),
    (0.50, 0.30, 0.19),
    (0.32, 0.18, 0.11),
    (0.17, 0.09, 0.06),
]

HINTS: dict[str, tuple[str, ...]] = {
    # words in a material's name -> kind
    "metal": ("metal", "steel", "handle", "chrome", "alumin", "brass", "knob"),
    "dark": ("glass", "black", "window", "burner", "oven_black"),
    "wood": ("wood", "oak", "pine", "walnut", "birch", "beech"),
    "speckle": ("marble", "stone", "granite", "counter", "worktop", "terrazzo"),
    "tiles": ("tile", "brick", "floor"),
    "plaster": ("wall", "plaster", "ceiling"),
    "fabric": ("fabric", "cloth", "carpet"),
    "laminate": ("paint", "laminate", "white", "lacquer"),
    "poster": ("poster", "picture", "book", "carton"),
    "plain": ("plain",),
    "stripes": ("stripe",),
    "glossy": ("glossy",),
}


def kind_of(name: str, rng: np.random.Generator) -> str:
    """Kind of surface that a material's name suggests; without a hint one is drawn."""
    for kind, words in HINTS.items():
        if any(word in name.lower() for word in words):
            return kind
    return str(rng.choice(["wood", "wood", "laminate", "speckle"]))


def make_material(
    kind: str, contrast: float, rng: np.random.Generator, colour: Array | None = None
) -> Material:
    """A material of `kind` (see PAINTERS) with its own drawing; `contrast` scales it about its mean."""
    painter, tile, gloss = PAINTERS[kind]
    if colour is None:
        palette = PALETTES[kind]
        colour = np.array(palette[int(rng.integers(len(palette)))])
    colour = np.clip(colour * rng.uniform(0.88, 1.12) + rng.uniform(-0.02, 0.02, 3), 0.02, 0.9)
    image = painter(rng, colour)
    mean = image.reshape(-1, 3).mean(axis=0)
    image = np.clip(mean + contrast * (image - mean), 0.004, 0.98).astype(np.float32)
    return Material(kind, image, tile * float(rng.uniform(0.85, 1.2)), gloss)


def skin_material(tone: int | None, contrast: float, rng: np.random.Generator) -> Material:
    """Skin of one of SKIN_TONES, counted from the lightest; None: of one that is drawn."""
    return make_material("skin", contrast, rng, None if tone is None else np.array(SKIN_TONES[tone]))


def material_for(name: str, rgb: Array, contrast: float, rng: np.random.Generator) -> Material:
    """The material of an MJCF geom: kind from its material's name; paint keeps `rgb` unless grey."""
    own = np.random.default_rng([int(rng.integers(2**31)), zlib.crc32(name.encode())])
    kind = kind_of(name, own)
    coloured = kind in ("laminate", "plaster", "fabric", "tiles") and float(rgb.max() - rgb.min()) > 0.08
    return make_material(kind, contrast, own, np.clip(rgb, 0.02, 0.9) if coloured else None)


def mipmaps(image: Image) -> list[Image]:
    """The image and its halvings down to 4 x 4 texels, each the mean of 2 x 2."""
    levels = [image]
    while levels[-1].shape[0] > 4:
        prev = levels[-1]
        levels.append((prev[::2, ::2] + prev[1::2, ::2] + prev[::2, 1::2] + prev[1::2, 1::2]) / np.float32(4))
    return levels

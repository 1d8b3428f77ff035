"""The scene beside an MJCF model: a floor below it, light and sky around it, and where a viewer stands."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from twin import geometry as geo
from twin.exporters.tree import Link, Tree, front, numbers
from twin.geometry import Array
from twin.scene import Mesh

_ASIDE = 25.0  # deg: the scene's first view is not straight from the front
# Shares of a surface's own colour that each light shows: together 0.98, so that white stays below 255
# wherever it faces; what faces the camera alone has 0.83, what faces no light 0.5. Highlights would add to
# that and are left out. Chosen by us.
_HEADLIGHT = {"ambient": 0.5, "diffuse": 0.33, "specular": 0.0}
_LAMP = 0.15


def remarks(tree: Tree) -> list[Any]:
    """The verdict as a file's first comment, without the two minuses no comment may hold; or nothing."""
    return [] if tree.verdict is None else [ET.Comment(f" {re.sub('-{2,}', '-', tree.told)} ")]


def _azimuth(tree: Tree) -> float:
    """Azimuth (deg) of a camera that looks at the front, a little from the side."""
    ahead = front(tree)
    return float(np.rad2deg(np.arctan2(-ahead[1], -ahead[0]))) + _ASIDE


def scene(tree: Tree) -> ET.Element:
    """A floor below the model, light and sky around it."""
    points = [k.drawn for k in tree.links if len(k.drawn)]
    low = points[0].min(axis=0) if points else np.zeros(3)
    high = points[0].max(axis=0) if points else np.ones(3)
    # a camera 1.5 extents away sees all
    center, extent = (low + high) / 2, 0.7 * float(np.linalg.norm(high - low))
    root = ET.Element("mujoco", model=f"{tree.name}_scene")
    root.extend(remarks(tree))
    ET.SubElement(root, "include", file=f"{tree.name}.xml")
    ET.SubElement(
        root, "statistic", center=numbers(np.round(center, 4)), extent=numbers(round(max(extent, 0.1), 4))
    )
    visual = ET.SubElement(root, "visual")
    shades = {k: numbers([v] * 3) for k, v in _HEADLIGHT.items()}
    ET.SubElement(visual, "headlight", shades)
    ET.SubElement(
        visual,
        "global",
        azimuth=numbers(round(_azimuth(tree), 1)),
        elevation="-20",
        offwidth="1280",
        offheight="960",
    )
    asset = ET.SubElement(root, "asset")
    ET.SubElement(
        asset, "texture", name="sky", type="skybox", builtin="gradient", rgb1="0.75 0.82 0.9", rgb2="0.3 0.36 0.45",
        width="256", height="1536",
    )  # fmt: skip
    ET.SubElement(
        asset, "texture", name="floor", type="2d", builtin="checker", rgb1="0.78 0.78 0.76", rgb2="0.7 0.7 0.68",
        width="256", height="256",
    )  # fmt: skip
    ET.SubElement(asset, "material", name="floor", texture="floor", texrepeat="2 2", texuniform="true")
    world = ET.SubElement(root, "worldbody")
    ET.SubElement(
        world, "light", pos=numbers(np.round(center + [0, 0, 3.0], 4)), dir="0 0 -1", directional="true",
        diffuse=numbers([_LAMP] * 3), specular="0 0 0",
    )  # fmt: skip
    ET.SubElement(
        world, "geom", name="floor", type="plane", size="0 0 0.05", material="floor",
        pos=numbers([0.0, 0.0, np.floor(min(low[2], _lowest(tree)) * 1000 - 1) / 1000]),
    )  # fmt: skip
    return root


def _lowest(tree: Tree) -> float:
    """Lowest z (m) of any collision shape of a moving part, one part open or all; inf without one."""
    shares = np.linspace(0.0, 1.0, 21)
    rows = [
        {k.name: s for k in chosen} for chosen in [tree.moving, *([k] for k in tree.moving)] for s in shares
    ]
    found = [np.inf]
    for link in tree.moving:
        points = [c.vertices if isinstance(c, Mesh) else c.corners for c in link.collision]
        if points:
            shape = np.concatenate(points)
            found += [geo.transform(_placed(tree, link, row), shape)[:, 2].min() for row in rows]
    return float(min(found))


def _placed(tree: Tree, link: Link, opened: dict[str, float]) -> Array:
    """Pose (4, 4) of a link in the world when joints are opened by these shares of their ranges."""
    pose = geo.make_pose(translation=link.offset)
    j = link.joint
    if j is not None:
        state = opened.get(link.name, 0.0) * j.upper
        turned = j.kind == "revolute"
        pose = pose @ (
            geo.make_pose(geo.exp_so3(j.axis * state))
            if turned
            else geo.make_pose(translation=j.axis * state)
        )
    parent = next((k for k in tree.links if k.name == link.parent), None)
    return pose if parent is None else _placed(tree, parent, opened) @ pose

"""Catches in MJCF: a contact that can pull, between a magnet on the part and a plate on what carries it.

MuJoCo (3.11 and later) lets a pair of geoms stick: up to the force `adhesion` it holds, and across `gap` it
pulls with that force (its documentation, Computation, "Adhesion"). The two geoms are in no collision but this
one, and nobody sees them. The plate of a hinge faces the way that the magnet has in the middle of its width
w: there the lever is r, at both ends r cos(w / 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np

from twin import geometry as geo
from twin.exporters.links import Link, Tree, TreeCatch, TreeJoint, numbers
from twin.geometry import Array
from twin.physics.simulation import HOLDING_IMPEDANCE

# m. Magnet and plate are small, but seen in a viewer. Chosen by us.
_RADIUS = 0.002
_THICK = 0.002
# m by which the plate is wider than the magnet's way. Chosen by us.
_MARGIN = 0.005


@dataclass(frozen=True, eq=False)
class Magnet:
    """How a catch is made in MuJoCo.

    Attributes:
        pull: N, of the contact.
        gap: m, between magnet and plate where it lets go.
        plate: (4, 4) pose of the plate in the link's frame at state 0, z to the magnet.
        half: (3,) m, half sizes of the plate.
    """

    pull: float
    gap: float
    plate: Array
    half: Array


def magnet(joint: TreeJoint, catch: TreeCatch) -> Magnet:
    """The contact that does what a catch does: its force along the joint at state 0, up to its width.

    On a slide it is the catch itself. On a hinge the force is sqrt(cos(w / 2)) times that of the
    catch at both ends of the width and as much above it in the middle: within 2.3 % at 0.6 rad.
    """
    if joint.kind == "prismatic":
        ahead, side, pull, gap, way = joint.axis, 0.0, catch.force, catch.width, np.zeros(3)
    else:
        foot = joint.axis * float(joint.axis @ catch.place)
        arm = catch.place - foot
        r, half = float(np.linalg.norm(arm)), catch.width / 2
        middle = geo.exp_so3(joint.axis * half) @ arm
        ahead = geo.unit(np.cross(joint.axis, middle))
        pull, gap, side = (
            catch.force / (r * float(np.sqrt(np.cos(half)))),
            2 * r * float(np.sin(half)),
            r * (1 - float(np.cos(half))),
        )
        way = middle - arm - ahead * float(ahead @ (middle - arm))  # across the pull
    plate = geo.make_pose(
        geo.rotation_between([0.0, 0.0, 1.0], ahead), catch.place + way - ahead * (_RADIUS + _THICK)
    )
    wide = side + _RADIUS + _MARGIN
    return Magnet(float(pull), float(gap), plate, np.array([wide, wide, _THICK]))


def add_catches(root: ET.Element, tree: Tree, main: str) -> None:
    """Write the catches of a model whose bodies stand; without any not a byte."""
    caught = [
        (k, k.joint, k.joint.catch) for k in tree.moving if k.joint is not None and k.joint.catch is not None
    ]
    if not caught:
        return
    group = {"contype": "0", "conaffinity": "0", "group": "4", "density": "0", "rgba": "0.9 0.7 0.1 1"}
    outer = root.find("default/default")
    contact = root.find("contact")
    assert outer is not None
    assert contact is not None  # parts that move are kept apart from what carries them
    ET.SubElement(ET.SubElement(outer, "default", {"class": f"{main}_catch"}), "geom", group)
    bodies = {b.get("name"): b for b in root.iter("body")}
    for link, joint, catch in caught:
        _add(bodies[link.name], bodies[link.parent], contact, link, joint, catch, f"{main}_catch")


def _add(
    body: ET.Element,
    carrier: ET.Element,
    contact: ET.Element,
    link: Link,
    joint: TreeJoint,
    catch: TreeCatch,
    of_class: str,
) -> None:
    made, names = magnet(joint, catch), (f"{link.name}_catch", f"{link.name}_catch_plate")
    ET.SubElement(
        body,
        "geom",
        {"class": of_class},
        name=names[0],
        type="sphere",
        size=numbers(_RADIUS),
        pos=numbers(catch.place),
    )
    ET.SubElement(
        carrier, "geom", {"class": of_class}, name=names[1], type="box", size=numbers(made.half),
        pos=numbers(link.offset + made.plate[:3, 3]), quat=numbers(geo.quat_wxyz_from_matrix(made.plate[:3, :3])),
    )  # fmt: skip
    contact.append(ET.Comment(f" {joint.name}: {joint.caught.replace('--', '-')} "))
    ET.SubElement(
        contact, "pair", name=names[0], geom1=names[1], geom2=names[0], condim="1", gap=numbers(made.gap),
        adhesion=numbers(made.pull), solimp=numbers([HOLDING_IMPEDANCE] * 2),
    )  # fmt: skip

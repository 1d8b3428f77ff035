"""What shows when MuJoCo runs the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from benchmarks.lint_faults.planting import FRONT, RIGHT, U_DOOR, Mutations, Xml, attr, prim, set_, shift

MUTATIONS = Mutations()
_add, _usd, _xml = MUTATIONS.add, MUTATIONS.usd, MUTATIONS.xml

_add(
    "urdf", "refused", "box without size", set_("link[@name='door']/collision/geometry/box", size="0.5 0 0.5")
)
_add("mjcf", "refused", "unknown element", lambda root, _: ET.SubElement(root, "bogus"))


@_usd("refused", "two inertias")
def _(stage: Any, _: Path) -> None:
    from pxr import Sdf

    body = prim(stage, "/drawer")
    body.AddAppliedSchema("NewtonMassAPI")
    body.CreateAttribute("newton:inertia", Sdf.ValueTypeNames.DoubleArray, False).Set([1, 1, 1, 0, 0, 0])


def _thick(size: str) -> str:
    """A front 6 cm deeper: 27 mm of it inside of the carcass."""
    x, y, z = (float(v) for v in size.split())
    return f"{x} {y + 0.06} {z}"


@_xml("urdf", "overlap-at-rest", "front too thick")
def _(root: Xml, _: Path) -> None:
    e = root.find("link[@name='door']/collision/geometry/box")
    e.set("size", _thick(e.get("size")))


@_xml("mjcf", "overlap-at-rest", "front too thick")
def _(root: Xml, _: Path) -> None:
    e = root.find(".//geom[@name='door_collision_0']")
    x, y, z = (float(v) for v in e.get("size").split())
    e.set("size", f"{x} {y + 0.03} {z}")


_add(
    "usd",
    "overlap-at-rest",
    "front too thick",
    attr("/door_collision_0", "xformOp:scale", lambda v: type(v)(v[0], 5 * v[1], v[2])),
)


def _obstacle() -> np.ndarray:
    """Where a block on the closed door stands 12 cm before the drawer's front (world)."""
    cabinet = np.array([0.9, 0.35, 0.15])
    return cabinet + 0.15 * FRONT + 0.70 * np.array([0, 0, 1.0]) + 0.2 * RIGHT


@_xml("urdf", "limit-unreachable", "blocked")
def _(root: Xml, _: Path) -> None:
    hinge = np.array([float(x) for x in root.find(f"{U_DOOR}/origin").get("xyz").split()])
    collision = ET.SubElement(root.find("link[@name='door']"), "collision")
    ET.SubElement(collision, "origin", xyz=shift("0 0 0", _obstacle() - hinge))
    ET.SubElement(ET.SubElement(collision, "geometry"), "box", size="0.1 0.1 0.1")


@_xml("mjcf", "limit-unreachable", "blocked")
def _(root: Xml, _: Path) -> None:
    door = root.find(".//body[@name='door']")
    hinge = np.array([float(x) for x in door.get("pos").split()])
    ET.SubElement(
        door,
        "geom",
        {"class": "cabinet_collision"},
        type="box",
        size="0.05 0.05 0.05",
        pos=shift("0 0 0", _obstacle() - hinge),
    )


@_usd("limit-unreachable", "blocked")
def _(stage: Any, _: Path) -> None:
    from pxr import Gf, UsdGeom, UsdPhysics

    door = prim(stage, "/door")
    hinge = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(door).ExtractTranslation())
    cube = UsdGeom.Cube.Define(stage, door.GetPath().AppendChild("block"))
    cube.CreateSizeAttr(0.1)
    cube.AddTranslateOp().Set(Gf.Vec3d(*(_obstacle() - hinge).tolist()))
    UsdPhysics.CollisionAPI.Apply(cube.GetPrim())


_add("urdf", "limit-unreachable", "friction", set_("joint[@name='drawer_joint']/dynamics", friction="15"))
_add("mjcf", "limit-unreachable", "friction", set_(".//joint[@name='drawer_joint']", frictionloss="15"))
_add("usd", "limit-unreachable", "friction", attr("/drawer_joint", "newton:friction", 15.0))
_add("mjcf", "limit-unreachable", "damping", set_(".//joint[@name='drawer_joint']", damping="5000"))
_add(
    "urdf",
    "drift-at-rest",
    "cabinet leans",
    set_("joint[@name='carcass_to_world']/origin", rpy=shift("0 0 0", 0.2 * RIGHT)),
)
_add(
    "mjcf",
    "drift-at-rest",
    "gravity leans",
    lambda root, _: ET.SubElement(root, "option", gravity=shift("0 0 -9.81", 2 * FRONT)),
)
_add(
    "usd",
    "drift-at-rest",
    "gravity leans",
    attr("/PhysicsScene", "physics:gravityDirection", lambda v: type(v)(*(0.2 * FRONT - [0, 0, 1]).tolist())),
)

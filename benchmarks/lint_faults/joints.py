"""Joints, and the tree and the names that they make."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from benchmarks.lint_faults.planting import (
    M_DOOR,
    RIGHT,
    U_DOOR,
    Mutations,
    Xml,
    attr,
    drop,
    prim,
    set_,
    shift,
)

MUTATIONS = Mutations()
_add, _usd, _xml = MUTATIONS.add, MUTATIONS.usd, MUTATIONS.xml

# joints
_add("urdf", "limits-order", "swapped", set_(f"{U_DOOR}/limit", lower="1.4", upper="0"))
_add("mjcf", "limits-order", "swapped", set_(M_DOOR, range="1.4 0"))
_add("usd", "limits-order", "swapped", attr("/door_joint", "physics:lowerLimit", 90.0))
_add("urdf", "limits-empty", "no room", set_(f"{U_DOOR}/limit", lower="0.5", upper="0.5"))
_add("mjcf", "limits-empty", "no room", set_(M_DOOR, range="0.5 0.5"))
_add("usd", "limits-empty", "no room", attr("/drawer_joint", "physics:upperLimit", 0.0))
_add("urdf", "limits-empty", "not a number", set_(f"{U_DOOR}/limit", upper="nan"))
_add("urdf", "limits-missing", "no effort", drop(f"{U_DOOR}/limit", "effort"))
_add("urdf", "limits-missing", "no velocity", drop(f"{U_DOOR}/limit", "velocity"))
_add("urdf", "limits-missing", "no upper", drop(f"{U_DOOR}/limit", "upper"))
_add("urdf", "limits-missing", "no limit", drop(f"{U_DOOR}/limit"))
_add("urdf", "limits-unit", "degrees", set_(f"{U_DOOR}/limit", upper="80.2"))
_add("mjcf", "limits-unit", "degrees", set_(M_DOOR, range="0 80.2"))
_add("mjcf", "limits-unit", "no angle in the compiler", drop("compiler", "angle"))
_add("usd", "limits-unit", "radians", attr("/door_joint", "physics:upperLimit", 1.4))
_add("usd", "limits-unit", "half a turn in radians", attr("/door_joint", "physics:upperLimit", 3.1416))
_add("urdf", "limits-small", "converted twice", set_(f"{U_DOOR}/limit", upper="0.0244"))
_add("urdf", "limits-small", "slide of 0.35 mm", set_("joint[@name='drawer_joint']/limit", upper="0.00035"))
_add("mjcf", "limits-small", "converted twice", set_(M_DOOR, range="0 0.0244"))
_add("usd", "limits-small", "slide of 0.35 mm", attr("/drawer_joint", "physics:upperLimit", 0.00035))
_add("urdf", "axis", "zero", set_(f"{U_DOOR}/axis", xyz="0 0 0"))
_add("urdf", "axis", "length two", set_(f"{U_DOOR}/axis", xyz="0 0 -2"))
_add("mjcf", "axis", "zero", set_(M_DOOR, axis="0 0 0"))
_add("usd", "axis", "quaternion of length two", attr("/door_joint", "physics:localRot1", lambda q: q * 2.0))
_add(
    "usd",
    "joint-frames",
    "one side moved",
    attr("/door_joint", "physics:localPos0", lambda p: type(p)(p[0] + 0.1, p[1], p[2])),
)
_add(
    "usd",
    "joint-frames",
    "one side turned",
    attr("/door_joint", "physics:localRot0", lambda q: type(q)(0.5, 0.5, 0.5, 0.5)),
)


@_xml("urdf", "pivot-off-part", "10 cm beside")
def _(root: Xml, _: Path) -> None:
    d = -0.1 * RIGHT
    for e, sign in [
        (root.find(f"{U_DOOR}/origin"), 1),
        *((e, -1) for e in root.findall("link[@name='door']/*/origin")),
    ]:
        e.set("xyz", shift(e.get("xyz"), sign * d))
    for joint in root.findall("joint"):
        if joint.find("parent").get("link") == "door":
            joint.find("origin").set("xyz", shift(joint.find("origin").get("xyz"), -d))


_add("mjcf", "pivot-off-part", "10 cm beside", set_(M_DOOR, pos=shift("0 0 0", -0.1 * RIGHT)))


@_usd("pivot-off-part", "10 cm beside")
def _(stage: Any, _: Path) -> None:
    for side in "01":
        a = prim(stage, "/door_joint").GetAttribute(f"physics:localPos{side}")
        a.Set(type(a.Get())(*(np.array(a.Get(), float) - 0.1 * RIGHT).tolist()))


_add("urdf", "joint-target", "no such parent", set_(f"{U_DOOR}/parent", link="nowhere"))


@_usd("joint-target", "no such parent")
def _(stage: Any, _: Path) -> None:
    prim(stage, "/door_joint").GetRelationship("physics:body0").SetTargets(["/cabinet/nowhere"])


# structure and names
_add("urdf", "tree-cycle", "door on its own flap", set_(f"{U_DOOR}/parent", link="flap"))


@_xml("urdf", "tree-cycle", "two parents")
def _(root: Xml, _: Path) -> None:
    joint = ET.SubElement(root, "joint", name="second", type="fixed")
    ET.SubElement(joint, "parent", link="carcass")
    ET.SubElement(joint, "child", link="flap")


@_usd("tree-cycle", "door on its own flap")
def _(stage: Any, _: Path) -> None:
    joint = prim(stage, "/door_joint")
    joint.GetRelationship("physics:body0").SetTargets([prim(stage, "/flap").GetPath()])
    flap = prim(stage, "/flap_joint").GetAttribute("physics:localPos0").Get()
    joint.GetAttribute("physics:localPos0").Set(-flap)


_add("urdf", "tree-roots", "two", drop("joint[@name='carcass_to_world']"))
_add("urdf", "name-duplicate", "joint", set_("joint[@name='flap_joint']", name="door_joint"))
_add("mjcf", "name-duplicate", "joint", set_(".//joint[@name='flap_joint']", name="door_joint"))
_add("urdf", "name-illegal", "umlaut and blank", set_(U_DOOR, name="Tür 1"))
_add("mjcf", "name-illegal", "umlaut and blank", set_(M_DOOR, name="Tür 1"))

"""Sizes of parts, and what is drawn elsewhere than it collides."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.lint_faults.planting import RIGHT, U_DRAWER, Mutations, Xml, each, prim, set_, shift

MUTATIONS = Mutations()
_add, _usd, _xml = MUTATIONS.add, MUTATIONS.usd, MUTATIONS.xml
_U_DOOR, _M_DOOR = "link[@name='door']/visual", ".//geom[@name='door_visual']"
_LYING = Rotation.from_rotvec(np.pi / 2 * RIGHT)

for _name, _factor in (("millimetres", 1e3), ("kilometres", 1e-3)):
    _scale = " ".join([repr(_factor)] * 3)
    _add("urdf", "part-size", _name, each(f"{U_DRAWER}//mesh", lambda e, s=_scale: e.set("scale", s)))

    @_xml("mjcf", "part-size", _name)
    def _(root: Xml, _: Path, scale: str = _scale) -> None:
        meshes = [e for e in root.findall("asset/mesh") if e.get("name", "").startswith("drawer")]
        for e in meshes:
            e.set("scale", scale)

    @_usd("part-size", _name)
    def _(stage: Any, _: Path, factor: float = _factor) -> None:
        for p in stage.Traverse():
            if p.GetTypeName() == "Mesh" and "/drawer/" in str(p.GetPath()):
                points = p.GetAttribute("points")
                points.Set(type(points.Get())((factor * np.array(points.Get())).tolist()))


_add(
    "urdf",
    "collider-elsewhere",
    "visual in kilometres",
    set_(f"{_U_DOOR}/geometry/mesh", scale="0.001 0.001 0.001"),
)
_add(
    "urdf",
    "collider-elsewhere",
    "visual lies",
    set_(f"{_U_DOOR}/origin", rpy=shift("0 0 0", _LYING.as_euler("xyz"))),
)
_add("urdf", "collider-elsewhere", "visual beside", set_(f"{_U_DOOR}/origin", xyz="2 0 0"))
_add(
    "mjcf",
    "collider-elsewhere",
    "visual lies",
    set_(_M_DOOR, axisangle=f"{shift('0 0 0', RIGHT)} {np.pi / 2!r}"),
)
_add("mjcf", "collider-elsewhere", "visual beside", set_(_M_DOOR, pos="2 0 0"))


@_xml("urdf", "collider-elsewhere", "GLB with y up")
def _(root: Xml, folder: Path) -> None:
    import trimesh

    mesh: Any = trimesh.load_mesh(str(folder / "meshes" / "door_visual.obj"))
    upright = Rotation.from_euler("z", -0.5)  # the cabinet is yawed
    plain = trimesh.Trimesh((Rotation.from_euler("x", -np.pi / 2) * upright).apply(mesh.vertices), mesh.faces)
    plain.export(folder / "meshes" / "door.glb")
    set_(f"{_U_DOOR}/geometry/mesh", filename="meshes/door.glb")(root, folder)
    set_(f"{_U_DOOR}/origin", rpy="0 0 0.5")(root, folder)


@_usd("collider-elsewhere", "visual lies")
def _(stage: Any, _: Path) -> None:
    points = prim(stage, "/door_visual").GetAttribute("points")
    points.Set(type(points.Get())(_LYING.apply(np.array(points.Get())).tolist()))


for _kind in ("capsule", "cone"):

    @_xml("urdf", "shape-unknown", _kind)
    def _(root: Xml, _: Path, kind: str = _kind) -> None:
        visual = ET.SubElement(root.find("link[@name='drawer']"), "visual")
        ET.SubElement(visual, "origin", root.find(f"{U_DRAWER}/inertial/origin").attrib)
        ET.SubElement(ET.SubElement(visual, "geometry"), kind, radius="0.01", length="0.1")

"""URDF writer: a fixed `world` link, full inertials, one collision element per convex piece."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from twin import geometry as geo
from twin.exporters.asset import AssetInfo
from twin.exporters.mjcf import material_name, write_xml
from twin.exporters.mjcf_scene import remarks
from twin.exporters.obj import hull, textured
from twin.exporters.tree import (
    EFFORT_LIMIT,
    VELOCITY_LIMIT,
    Link,
    Tree,
    catches_lost,
    clear_of_each_other,
    numbers,
)
from twin.geometry import Array
from twin.names import unused
from twin.physics.simulation import HOLDING_ITERATIONS
from twin.scene import Mesh

MESHES = "meshes/"


def write(tree: Tree, folder: Path, _asset: AssetInfo) -> tuple[Path, list[str]]:
    """Write `<name>.urdf` and meshes/ into `folder`; returns the path and what URDF can't carry."""
    meshes = folder / "meshes"
    meshes.mkdir(parents=True, exist_ok=True)
    root = ET.Element("robot", name=tree.name)
    root.extend(remarks(tree))
    # MuJoCo would otherwise merge the static scene into its world body and drop all visuals.
    mujoco = ET.SubElement(root, "mujoco")
    ET.SubElement(
        mujoco,
        "compiler",
        fusestatic="false",
        discardvisual="false",
        strippath="false",
        balanceinertia="false",
    )
    if any(k.joint is not None and k.joint.holds for k in tree.links):
        ET.SubElement(mujoco, "option", noslip_iterations=str(HOLDING_ITERATIONS))
    ET.SubElement(root, "link", name="world")
    links = [*(k.name for k in tree.links), "world"]
    joints = [f"{tree.root.name}_to_world", *(k.joint.name for k in tree.links if k.joint is not None)]
    for link in tree.links:
        _link(root, link, meshes, links)
        _joint(root, link)
        if link.grasp is not None:
            frame = unused(f"{link.name}_grasp", links)
            links.append(frame)
            _massless(ET.SubElement(root, "link", name=frame))
            fixed = ET.SubElement(root, "joint", name=unused(f"{frame}_joint", joints), type="fixed")
            ET.SubElement(fixed, "parent", link=link.name)
            ET.SubElement(fixed, "child", link=frame)
            _origin(fixed, link.grasp)
    path = folder / f"{tree.name}.urdf"
    write_xml(root, path)
    return path, _not_carried(tree)


def _not_carried(tree: Tree) -> list[str]:
    lost = [
        "urdf: contact friction is not carried (URDF has none); set it in the simulator",
        f"urdf: pairs that must not collide are not carried (URDF has none); {clear_of_each_other(tree)}",
        "urdf: the keyframes closed and open are not carried (URDF has none)",
    ]
    lost += [f"urdf: {text} (URDF has none)" for text in catches_lost(tree)]
    if any(k.grasp is not None for k in tree.links):
        lost.append("urdf: grasp frames are carried as massless links <part>_grasp (URDF has no sites)")
    return lost


def _link(root: ET.Element, link: Link, folder: Path, links: Sequence[str]) -> None:
    """Shapes get names that no link has: yourdfpy keeps both in one scene graph and loses one of them."""
    element = ET.SubElement(root, "link", name=link.name)
    inertial = ET.SubElement(element, "inertial")
    _origin(inertial, geo.make_pose(translation=link.com))
    ET.SubElement(inertial, "mass", value=numbers(link.mass))
    i = link.inertia
    ET.SubElement(
        inertial, "inertia", ixx=numbers(i[0, 0]), ixy=numbers(i[0, 1]), ixz=numbers(i[0, 2]),
        iyy=numbers(i[1, 1]), iyz=numbers(i[1, 2]), izz=numbers(i[2, 2]),
    )  # fmt: skip
    for shown in link.visuals:
        files = textured(shown.mesh, shown.name, shown.color)
        for file, content in files.files.items():
            (folder / file).write_bytes(content)
        if shown.basis != "seen":
            element.append(ET.Comment(f" {shown.basis}: {re.sub('-{2,}', '-', shown.reason)} "))
        visual = ET.SubElement(element, "visual", name=unused(shown.name, links))
        _origin(visual, np.eye(4))
        ET.SubElement(ET.SubElement(visual, "geometry"), "mesh", filename=f"{MESHES}{files.obj}")
        material = ET.SubElement(visual, "material", name=material_name(link, shown))
        # readers multiply the texture with this colour (PyBullet), or draw the mesh in it without any texture
        color = (1.0, 1.0, 1.0) if files.png else files.color
        ET.SubElement(material, "color", rgba=numbers([*color, 1.0]))
    for name, piece in link.shapes.items():
        collision = ET.SubElement(element, "collision", name=unused(name, links))
        if isinstance(piece, Mesh):
            (folder / f"{name}.obj").write_bytes(hull(piece))
            _origin(collision, np.eye(4))
            ET.SubElement(ET.SubElement(collision, "geometry"), "mesh", filename=f"{MESHES}{name}.obj")
        else:
            _origin(collision, piece.T_world_box)
            ET.SubElement(ET.SubElement(collision, "geometry"), "box", size=numbers(piece.size))


def _massless(element: ET.Element) -> None:
    """Say that a link weighs nothing: PyBullet gives one that is silent a mass of 1 kg."""
    inertial = ET.SubElement(element, "inertial")
    _origin(inertial, np.eye(4))
    ET.SubElement(inertial, "mass", value="0.0")
    ET.SubElement(inertial, "inertia", dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "0.0"))


def _joint(root: ET.Element, link: Link) -> None:
    if link.joint is None:
        fixed = ET.SubElement(root, "joint", name=f"{link.name}_to_world", type="fixed")
        ET.SubElement(fixed, "parent", link="world")
        ET.SubElement(fixed, "child", link=link.name)
        _origin(fixed, np.eye(4))
        return
    j = link.joint
    joint = ET.SubElement(root, "joint", name=j.name, type=j.kind)
    ET.SubElement(joint, "parent", link=str(link.parent))
    ET.SubElement(joint, "child", link=link.name)
    _origin(joint, geo.make_pose(translation=link.offset))
    ET.SubElement(joint, "axis", xyz=numbers(j.axis))
    ET.SubElement(
        joint, "limit", lower=numbers(j.lower), upper=numbers(j.upper),
        effort=numbers(EFFORT_LIMIT[j.kind]), velocity=numbers(VELOCITY_LIMIT[j.kind]),
    )  # fmt: skip
    ET.SubElement(joint, "dynamics", damping=numbers(j.damping), friction=numbers(j.frictionloss))
    if j.caught:
        joint.append(
            ET.Comment(f" not simulated, URDF has no word for it: {re.sub('-{2,}', '-', j.caught)} ")
        )


def _origin(element: ET.Element, pose: Array) -> None:
    ET.SubElement(element, "origin", xyz=numbers(pose[:3, 3]), rpy=numbers(roll_pitch_yaw(pose[:3, :3])))


def roll_pitch_yaw(rotation: Array) -> Array:
    """Fixed-axis roll, pitch, yaw (3,) rad of a rotation (3, 3): R = Rz(yaw) Ry(pitch) Rx(roll), always."""
    r = rotation
    cos_pitch = float(np.hypot(r[0, 0], r[1, 0]))
    pitch = float(np.arctan2(-r[2, 0], cos_pitch))
    if cos_pitch < 1e-9:  # roll and yaw turn about the same axis: put all into roll
        return np.array([np.arctan2(-r[1, 2], r[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(r[2, 1], r[2, 2]), pitch, np.arctan2(r[1, 0], r[0, 0])])

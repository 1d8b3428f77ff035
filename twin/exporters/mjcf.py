"""MJCF writer in the manner of Menagerie: default classes, explicit inertials, a separate scene.xml."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from twin import geometry as geo
from twin.exporters.asset import AssetInfo
from twin.exporters.mjcf_catch import add_catches
from twin.exporters.mjcf_scene import remarks, scene
from twin.exporters.obj import hull, textured
from twin.exporters.tree import Link, Tree, Visual, numbers, spawn
from twin.inferred import BASES
from twin.names import scene_file, unused
from twin.physics import simulation
from twin.scene import Mesh

_MJ_TYPE = {"revolute": "hinge", "prismatic": "slide"}


@dataclass(frozen=True)
class Document:
    """A model as MJCF in memory: its XML and the content of each file it names (in assets/ beside it)."""

    xml: str
    assets: Mapping[str, bytes]

    def spec(self) -> Any:
        """A fresh mujoco.MjSpec of it, to edit or attach to. ValueError if MuJoCo can't read it."""
        import mujoco

        return mujoco.MjSpec.from_string(self.xml, assets=dict(self.assets))


def document(tree: Tree) -> Document:
    """The model of a twin, which `write` writes and a replay runs."""
    root, files = ET.Element("mujoco", model=tree.name), dict[str, bytes]()
    root.extend(remarks(tree))
    ET.SubElement(root, "compiler", angle="radian", meshdir="assets", texturedir="assets")
    ET.SubElement(
        root, "option", timestep=numbers(simulation.TIMESTEP), integrator=simulation.INTEGRATOR,
        cone=simulation.CONE, impratio=numbers(simulation.IMPRATIO), gravity=numbers([0, 0, -simulation.GRAVITY]),
    )  # fmt: skip
    _defaults(root, tree)
    asset = ET.SubElement(root, "asset")
    world = ET.SubElement(root, "worldbody")
    for link in tree.standing:
        body = ET.SubElement(world, "body", name=link.name, childclass=_main_class(tree))
        _fill(body, link, tree, asset, files)
    _excludes(root, tree)
    add_catches(root, tree, _main_class(tree))
    if tree.whole:
        _sensors(root, tree)
        _reasons(root, tree)
    _keyframes(root, tree)
    return Document(_text(root), files)


def write(tree: Tree, folder: Path, _asset: AssetInfo) -> tuple[Path, list[str]]:
    """Write `<name>.xml`, its scene (scene.xml) and assets/ into `folder`; returns the model's path and
    warnings (none: MJCF carries everything a tree holds)."""
    assets = folder / "assets"
    assets.mkdir(parents=True, exist_ok=True)
    model = document(tree)
    for name, content in model.assets.items():
        (assets / name).write_bytes(content)
    path = folder / f"{tree.name}.xml"
    path.write_text(model.xml, encoding="utf-8", newline="\n")
    write_xml(scene(tree), folder / scene_file(tree.name))
    return path, []


def write_xml(root: ET.Element, path: Path) -> None:
    """Write indented XML, the same bytes every time."""
    path.write_text(_text(root), encoding="utf-8", newline="\n")


def _text(root: ET.Element) -> str:
    ET.indent(root, "  ")
    return ET.tostring(root, encoding="unicode") + "\n"


def _main_class(tree: Tree) -> str:
    """Class of the whole model; "main" is MuJoCo's own, above all classes."""
    return unused(tree.name, ["main"])


def _defaults(root: ET.Element, tree: Tree) -> None:
    """Classes are named after the model, so that several twins fit into one scene."""
    name = _main_class(tree)
    main = ET.SubElement(ET.SubElement(root, "default"), "default", {"class": name})
    visual = ET.SubElement(main, "default", {"class": f"{name}_visual"})
    drawn = {"type": "mesh", "contype": "0", "conaffinity": "0", "group": "2", "density": "0"}
    ET.SubElement(visual, "geom", drawn)
    if tree.whole:  # what no camera saw whole has classes of its own, so that a scene can shade or hide it
        for basis in BASES:
            inner = ET.SubElement(visual, "default", {"class": f"{name}_{basis}"})
            # once more: Drake takes none of a class from the class around it
            ET.SubElement(inner, "geom", drawn)
    collision = ET.SubElement(main, "default", {"class": f"{name}_collision"})
    touch = {"friction": _friction(tree.root)} if tree.whole else {}
    ET.SubElement(collision, "geom", {"group": "3", "rgba": "0.6 0.3 0.3 0.4", **touch})
    site = ET.SubElement(main, "default", {"class": f"{name}_grasp"})
    ET.SubElement(site, "site", type="sphere", size="0.008", group="4", rgba="0.1 0.8 0.2 1")
    if tree.whole:
        region = ET.SubElement(main, "default", {"class": f"{name}_region"})
        ET.SubElement(region, "site", type="box", group="5", rgba="0.2 0.4 0.9 0.15")


def _fill(body: ET.Element, link: Link, tree: Tree, asset: ET.Element, files: dict[str, bytes]) -> None:
    """Write inertial, joint, geoms and children of a link into its body."""
    i, j = link.inertia, link.joint
    full = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    ET.SubElement(body, "inertial", pos=numbers(link.com), mass=numbers(link.mass), fullinertia=numbers(full))
    if j is not None:
        joint = ET.SubElement(
            body, "joint", name=j.name, type=_MJ_TYPE[j.kind], axis=numbers(j.axis),
            range=numbers([j.lower, j.upper]), damping=numbers(j.damping), frictionloss=numbers(j.frictionloss),
            armature=numbers(j.armature),
        )  # fmt: skip
        if j.holds:
            joint.set("solimpfriction", numbers([simulation.HOLDING_IMPEDANCE] * 2))
    for shown in link.visuals:
        _visual(body, link, shown, _main_class(tree), asset, files)
    _collision(body, link, tree, asset, files)
    _regions(body, link, _main_class(tree))
    if link.grasp is not None:
        ET.SubElement(
            body, "site", {"class": f"{_main_class(tree)}_grasp"}, name=f"{link.name}_grasp",
            pos=numbers(link.grasp[:3, 3]), quat=numbers(geo.quat_wxyz_from_matrix(link.grasp[:3, :3])),
        )  # fmt: skip
    for child in tree.children(link.name):
        inner = ET.SubElement(body, "body", name=child.name, pos=numbers(child.offset))
        _fill(inner, child, tree, asset, files)


def material_name(link: Link, shown: Visual) -> str:
    """What the material of something drawn is called."""
    return f"{_look_owner(link, shown)}_material"


def _look_owner(link: Link, shown: Visual) -> str:
    """Whose name a look bears: the link's for what was seen, else the piece's own."""
    return link.name if shown.basis == "seen" else shown.name


def _visual(
    body: ET.Element, link: Link, shown: Visual, kind: str, asset: ET.Element, files: dict[str, bytes]
) -> None:
    drawn = textured(shown.mesh, shown.name, shown.color)
    files.update(drawn.files)
    material = {"name": material_name(link, shown), "specular": "0.2", "shininess": "0.2"}
    if drawn.png:
        name = f"{_look_owner(link, shown)}_texture"
        ET.SubElement(asset, "texture", name=name, type="2d", file=drawn.png)
        material["texture"] = name
    else:
        material["rgba"] = numbers([*drawn.color, 1.0])
    ET.SubElement(asset, "material", material)
    ET.SubElement(asset, "mesh", name=shown.name, file=drawn.obj, inertia="shell")
    of_class = f"{kind}_visual" if shown.basis == "seen" else f"{kind}_{shown.basis}"
    ET.SubElement(
        body, "geom", {"class": of_class}, name=shown.name, mesh=shown.name, material=material["name"]
    )  # fmt: skip


def _friction(link: Link) -> str:
    return numbers([link.friction, simulation.TORSIONAL, simulation.ROLLING])


def _collision(body: ET.Element, link: Link, tree: Tree, asset: ET.Element, files: dict[str, bytes]) -> None:
    of_class = f"{_main_class(tree)}_collision"
    usual = tree.whole and _friction(link) == _friction(tree.root)
    touch = {} if usual else {"friction": _friction(link)}
    for name, piece in link.shapes.items():
        if isinstance(piece, Mesh):
            files[f"{name}.obj"] = hull(piece)
            ET.SubElement(asset, "mesh", name=name, file=f"{name}.obj")
            ET.SubElement(body, "geom", {"class": of_class}, name=name, type="mesh", mesh=name, **touch)
        else:
            ET.SubElement(
                body, "geom", {"class": of_class}, name=name, type="box", size=numbers(piece.size / 2),
                pos=numbers(piece.T_world_box[:3, 3]),
                quat=numbers(geo.quat_wxyz_from_matrix(piece.T_world_box[:3, :3])), **touch,
            )  # fmt: skip


def _regions(body: ET.Element, link: Link, kind: str) -> None:
    """Free space inside: a box site to place things in, and a site on its floor to put them down at."""
    for region in link.regions:
        pose, size = region.box.T_world_box, region.box.size
        turn = numbers(geo.quat_wxyz_from_matrix(pose[:3, :3]))
        ET.SubElement(
            body, "site", {"class": f"{kind}_region"}, name=f"{region.name}_region", pos=numbers(pose[:3, 3]), quat=turn,
            size=numbers(size / 2),
        )  # fmt: skip
        ET.SubElement(
            body, "site", {"class": f"{kind}_grasp"}, name=f"{region.name}_spawn", pos=numbers(spawn(region))
        )


def _sensors(root: ET.Element, tree: Tree) -> None:
    """State and speed of every joint."""
    if tree.moving:
        sensors = ET.SubElement(root, "sensor")
        for joint in (k.joint for k in tree.moving if k.joint is not None):
            ET.SubElement(sensors, "jointpos", name=f"{joint.name}_pos", joint=joint.name)
            ET.SubElement(sensors, "jointvel", name=f"{joint.name}_vel", joint=joint.name)


def _reasons(root: ET.Element, tree: Tree) -> None:
    """Why each inferred piece is there, by the name of its geom."""
    inferred = [v for k in tree.links for v in k.visuals if v.basis != "seen"]
    if inferred:
        custom = ET.SubElement(root, "custom")
        for shown in inferred:
            ET.SubElement(custom, "text", name=shown.name, data=f"{shown.basis}: {shown.reason}")


def _excludes(root: ET.Element, tree: Tree) -> None:
    """The pairs of bodies that don't collide."""
    if tree.filtered:
        contact = ET.SubElement(root, "contact")
        for first, second in tree.filtered:
            ET.SubElement(contact, "exclude", body1=first, body2=second)


def _keyframes(root: ET.Element, tree: Tree) -> None:
    joints = [k.joint for k in tree.links if k.joint is not None]
    if joints:
        key = ET.SubElement(root, "keyframe")
        ET.SubElement(key, "key", name="closed", qpos=numbers([0.0] * len(joints)))
        ET.SubElement(key, "key", name="open", qpos=numbers([j.upper for j in joints]))

"""Faults planted into exported files, one at a time: what `twin lint` must find, and by which rule.

Also used by benchmarks/lint.py, which asks the public validators about the same files.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from tests.twin.scenes import cabinet_twin
from twin import geometry as geo
from twin.scene import Box, Mesh, Twin

Xml = ET.Element
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
_FACES = np.array([t for a, b, c, d in _QUADS for t in ((a, b, c), (a, c, d))], np.int32)
# The cabinet is yawed by 0.5 rad: its right and its front in the world.
RIGHT, FRONT = np.array([np.cos(0.5), np.sin(0.5), 0.0]), np.array([np.sin(0.5), -np.cos(0.5), 0.0])


def lint_twin() -> Twin:
    """A cabinet with door, flap on the door, lid and drawer; the drawer collides by meshes, the rest by boxes."""
    twin = cabinet_twin(nested=True, lid=True)
    parts = tuple(
        replace(p, collision=tuple(as_mesh(b) for b in p.collision)) if p.name == "drawer" else p
        for p in twin.parts
    )
    return replace(twin, parts=parts)


def as_mesh(box: Box) -> Mesh:
    return Mesh(geo.transform(box.T_world_box, _CORNERS * box.size), _FACES)


@dataclass(frozen=True)
class Mutation:
    """`plant(main file)` makes one fault, which `rule` must find."""

    format: str
    rule: str
    name: str
    plant: Callable[[Path], None]

    @property
    def id(self) -> str:
        return f"{self.format}-{self.rule}-{self.name}".replace(" ", "-")


MUTATIONS: list[Mutation] = []


def _xml(fmt: str, rule: str, name: str) -> Callable[[Callable[[Xml, Path], None]], None]:
    def register(change: Callable[[Xml, Path], None]) -> None:
        def plant(path: Path) -> None:
            root = ET.fromstring(path.read_text(encoding="utf-8"))  # noqa: S314  (a file this test wrote)
            change(root, path.parent)
            path.write_text(ET.tostring(root, encoding="unicode"), encoding="utf-8")

        MUTATIONS.append(Mutation(fmt, rule, name, plant))

    return register


def _usd(rule: str, name: str) -> Callable[[Callable[[Any, Path], None]], None]:
    """Changes are opinions in the root layer, the strongest, wherever the fact itself is written."""

    def register(change: Callable[[Any, Path], None]) -> None:
        def plant(path: Path) -> None:
            from pxr import Usd

            stage = Usd.Stage.Open(str(path))
            change(stage, path.parent)
            stage.GetRootLayer().Save()

        MUTATIONS.append(Mutation("usd", rule, name, plant))

    return register


def _add(fmt: str, rule: str, name: str, change: Callable[[Any, Path], None]) -> None:
    (_usd(rule, name) if fmt == "usd" else _xml(fmt, rule, name))(change)


def set_(where: str, **values: str) -> Callable[[Xml, Path], None]:
    """Set attributes of the element at an ElementTree path."""

    def change(root: Xml, _: Path) -> None:
        e = root.find(where)
        assert e is not None, where
        for k, v in values.items():
            e.set(k.rstrip("_"), v)

    return change


def drop(where: str, *keys: str) -> Callable[[Xml, Path], None]:
    """Remove attributes of the element at a path, or all elements there."""

    def change(root: Xml, _: Path) -> None:
        found = root.findall(where)
        assert found, where
        for e in found:
            for k in keys:
                del e.attrib[k]
            if not keys:
                parent = next(p for p in root.iter() if e in list(p))
                parent.remove(e)

    return change


def attr(path: str, name: str, value: Any) -> Callable[[Any, Path], None]:
    """Set an attribute of the prim whose path ends with `path`; None blocks it."""

    def change(stage: Any, _: Path) -> None:
        a = prim(stage, path).GetAttribute(name)
        assert a, (path, name)
        if value is None:
            a.Block()
        else:
            a.Set(value(a.Get()) if callable(value) else value)

    return change


def prim(stage: Any, ending: str) -> Any:
    found = [p for p in stage.Traverse() if str(p.GetPath()).endswith(ending)]
    assert len(found) == 1, (ending, found)
    return found[0]


def meta(key: str, value: Any) -> Callable[[Any, Path], None]:
    return lambda stage, _: stage.ClearMetadata(key) if value is None else stage.SetMetadata(key, value)


def _shift(values: Any, offset: Any) -> str:
    return " ".join(
        repr(float(x)) for x in np.array([float(v) for v in str(values).split()]) + np.asarray(offset)
    )


U_DOOR, M_DOOR = "joint[@name='door_joint']", ".//joint[@name='door_joint']"
U_DRAWER, M_DRAWER = "link[@name='drawer']", ".//body[@name='drawer']"

# ---- units -------------------------------------------------------------------------------------------------------------
_add("usd", "units-kilograms", "missing", meta("kilogramsPerUnit", None))
_add("usd", "units-kilograms", "grams", meta("kilogramsPerUnit", 0.001))
_add("usd", "units-metres", "missing", meta("metersPerUnit", None))
_add("usd", "units-metres", "centimetres", meta("metersPerUnit", 0.01))


def _other_layer(key: str, value: Any) -> Callable[[Any, Path], None]:
    """Set metadata of a layer that the stage is made of."""

    def change(stage: Any, _: Path) -> None:
        layer = sorted(
            (k for k in stage.GetUsedLayers() if not k.anonymous and k != stage.GetRootLayer()),
            key=lambda k: k.GetDisplayName(),
        )[0]
        layer.pseudoRoot.SetInfo(key, value)
        layer.Save()

    return change


_add("usd", "units-kilograms", "a layer in grams", _other_layer("kilogramsPerUnit", 0.001))
_add("usd", "units-metres", "a layer in centimetres", _other_layer("metersPerUnit", 0.01))
_add("usd", "up-axis", "a layer with Y", _other_layer("upAxis", "Y"))
_add("usd", "up-axis", "missing", meta("upAxis", None))
_add("usd", "up-axis", "Y", meta("upAxis", "Y"))
_add("urdf", "number-unreadable", "mass in words", set_(f"{U_DRAWER}/inertial/mass", value="heavy"))
_add("urdf", "number-unreadable", "axis of two numbers", set_(f"{U_DOOR}/axis", xyz="0 1"))
# ---- mass and inertia --------------------------------------------------------------------------------------------------
_add("urdf", "mass-missing", "no inertial", drop(f"{U_DRAWER}/inertial"))
_add("mjcf", "mass-missing", "no inertial", drop(f"{M_DRAWER}/inertial"))


@_usd("mass-missing", "no mass")
def _(stage: Any, _: Path) -> None:
    from pxr import UsdPhysics

    prim(stage, "/drawer").RemoveAPI(UsdPhysics.MassAPI)


for _value in ("0", "-3", "nan"):
    _add("urdf", "mass-value", _value, set_(f"{U_DRAWER}/inertial/mass", value=_value))
    _add("mjcf", "mass-value", _value, set_(f"{M_DRAWER}/inertial", mass=_value))
    _add("usd", "mass-value", _value, attr("/drawer", "physics:mass", float(_value)))
_add("urdf", "inertia-missing", "mass alone", drop(f"{U_DRAWER}/inertial/inertia"))
_add("usd", "inertia-missing", "mass alone", attr("/drawer", "physics:diagonalInertia", None))
_add("urdf", "inertia-positive", "negative", set_(f"{U_DRAWER}/inertial/inertia", ixx="-0.1"))
_add("mjcf", "inertia-positive", "negative", set_(f"{M_DRAWER}/inertial", fullinertia="-0.1 0.1 0.1 0 0 0"))
_add(
    "usd",
    "inertia-positive",
    "negative",
    attr("/drawer", "physics:diagonalInertia", lambda v: type(v)(-v[0], v[1], v[2])),
)
_add("urdf", "inertia-triangle", "one moment tenfold", set_(f"{U_DRAWER}/inertial/inertia", izz="2.7"))
_add(
    "mjcf",
    "inertia-triangle",
    "one moment tenfold",
    set_(f"{M_DRAWER}/inertial", fullinertia="0.13 0.16 2.7 0 0 0"),
)
_add(
    "usd",
    "inertia-triangle",
    "one moment tenfold",
    attr("/drawer", "physics:diagonalInertia", lambda v: type(v)(v[0], v[1], 10 * v[2])),
)


@_usd("body-scale", "body stretched")
def _(stage: Any, _: Path) -> None:
    from pxr import Gf, UsdGeom

    UsdGeom.Xformable(prim(stage, "/drawer")).AddScaleOp().Set(Gf.Vec3f(1, 1.2, 1))


# ---- joints ------------------------------------------------------------------------------------------------------------
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
        e.set("xyz", _shift(e.get("xyz"), sign * d))
    for joint in root.findall("joint"):
        if joint.find("parent").get("link") == "door":
            joint.find("origin").set("xyz", _shift(joint.find("origin").get("xyz"), -d))


_add("mjcf", "pivot-off-part", "10 cm beside", set_(M_DOOR, pos=_shift("0 0 0", -0.1 * RIGHT)))


@_usd("pivot-off-part", "10 cm beside")
def _(stage: Any, _: Path) -> None:
    for side in "01":
        a = prim(stage, "/door_joint").GetAttribute(f"physics:localPos{side}")
        a.Set(type(a.Get())(*(np.array(a.Get(), float) - 0.1 * RIGHT).tolist()))


_add("urdf", "joint-target", "no such parent", set_(f"{U_DOOR}/parent", link="nowhere"))


@_usd("joint-target", "no such parent")
def _(stage: Any, _: Path) -> None:
    prim(stage, "/door_joint").GetRelationship("physics:body0").SetTargets(["/cabinet/nowhere"])


# ---- structure and names -----------------------------------------------------------------------------------------------
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
# ---- shapes ------------------------------------------------------------------------------------------------------------
_add("urdf", "collider-missing", "none", drop("link[@name='door']/collision"))
_add("mjcf", "collider-missing", "none", drop(".//body[@name='door']/geom[@class='cabinet_collision']"))


@_usd("collider-missing", "none")
def _(stage: Any, _: Path) -> None:
    from pxr import UsdPhysics

    for p in list(stage.Traverse()):
        if "/door_collision_" in str(p.GetPath()):
            p.RemoveAPI(UsdPhysics.CollisionAPI)


_add("usd", "collider-approximation", "none", attr("/drawer_collision_0", "physics:approximation", "none"))
_add(
    "usd", "collider-approximation", "not written", attr("/drawer_collision_0", "physics:approximation", None)
)


def _rewrite(text: str | Callable[[str], str]) -> Callable[[Any, Path], None]:
    """Replace the drawer's first collision mesh file."""

    def change(_: Any, folder: Path) -> None:
        (path,) = folder.rglob("drawer_collision_0.obj")
        path.write_text(text if isinstance(text, str) else text(path.read_text()))

    return change


def _crossing(text: str) -> str:
    """A second, small box in the same file that pokes 5 mm out of the front."""
    vertices = [
        np.array([float(x) for x in line.split()[1:]]) for line in text.splitlines() if line.startswith("v ")
    ]
    center = np.mean(vertices, axis=0)
    more = [f"v {x} {y} {z}" for x, y, z in (center + 0.009 * FRONT + 0.6 * (v - center) for v in vertices)]
    faces = [
        [int(x) + len(vertices) for x in line.split()[1:]]
        for line in text.splitlines()
        if line.startswith("f ")
    ]
    return text + "\n".join([*more, *(f"f {a} {b} {c}" for a, b, c in faces)]) + "\n"


def _without_a_face(text: str) -> str:
    return "\n".join(text.splitlines()[:-1]) + "\n"


for _fmt in ("urdf", "mjcf"):
    _add(_fmt, "mesh-unusable", "no mesh in the file", _rewrite("not a mesh\n"))
    _add(_fmt, "mesh-unusable", "empty file", _rewrite(""))
    _add(_fmt, "mesh-open", "a face lost", _rewrite(_without_a_face))
    _add(_fmt, "mesh-self-intersecting", "two boxes cross", _rewrite(_crossing))
_add("usd", "mesh-unusable", "no points", attr("/drawer_collision_0", "points", lambda p: type(p)()))
_add(
    "usd",
    "mesh-unusable",
    "counts and indices differ",
    attr("/drawer_collision_0", "faceVertexCounts", lambda c: type(c)(list(c)[:-1])),
)


@_usd("mesh-open", "a face lost")
def _(stage: Any, _: Path) -> None:
    mesh = prim(stage, "/drawer_collision_0")
    for name, lost in (("faceVertexCounts", 1), ("faceVertexIndices", 3)):
        a = mesh.GetAttribute(name)
        a.Set(type(a.Get())(list(a.Get())[:-lost]))


# ---- files -------------------------------------------------------------------------------------------------------------
@_xml("urdf", "path-absolute", "mesh")
def _(root: Xml, folder: Path) -> None:
    e = root.find(f"{U_DRAWER}/collision/geometry/mesh")
    e.set("filename", str((folder / e.get("filename")).resolve()))


@_xml("mjcf", "path-absolute", "texture")
def _(root: Xml, folder: Path) -> None:
    e = root.find("asset/texture")
    e.set("file", str((folder / "assets" / e.get("file")).resolve()))


@_usd("path-absolute", "texture")
def _(stage: Any, _: Path) -> None:
    a = _texture(stage)
    a.Set(str(Path(a.Get().resolvedPath).resolve()))


def _texture(stage: Any) -> Any:
    return next(
        a
        for p in stage.Traverse()
        for a in p.GetAttributes()
        if a.GetName() == "inputs:file" and a.Get() and "drawer" in a.Get().path
    )


_add("urdf", "path-missing", "mesh", set_(f"{U_DRAWER}/collision/geometry/mesh", filename="meshes/none.obj"))
_add("mjcf", "path-missing", "mesh", set_("asset/mesh[@name='drawer_collision_0']", file="none.obj"))
_add("usd", "path-missing", "texture", lambda stage, _: _texture(stage).Set("./textures/none.png"))


@_xml("urdf", "path-outside", "mesh")
def _(root: Xml, folder: Path) -> None:
    (folder / "meshes" / "drawer_collision_0.obj").rename(folder.parent / "drawer.obj")
    root.find(f"{U_DRAWER}/collision/geometry/mesh").set("filename", "../drawer.obj")


@_xml("mjcf", "path-outside", "mesh")
def _(root: Xml, folder: Path) -> None:
    (folder / "assets" / "drawer_collision_0.obj").rename(folder.parent / "drawer.obj")
    root.find("asset/mesh[@name='drawer_collision_0']").set("file", "../../drawer.obj")


@_usd("path-outside", "texture")
def _(stage: Any, folder: Path) -> None:
    a = _texture(stage)
    (folder.parent / "drawer.png").write_bytes(Path(a.Get().resolvedPath).read_bytes())
    a.Set("../drawer.png")


# ---- what it does in MuJoCo --------------------------------------------------------------------------------------------
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
    attr("/door_collision_0", "xformOp:scale", lambda v: type(v)(v[0], v[1] + 0.06, v[2])),
)


def _obstacle(size: float = 0.1) -> np.ndarray:
    """Where a block on the closed door stands 12 cm before the drawer's front (world)."""
    cabinet = np.array([0.9, 0.35, 0.15])
    return cabinet + 0.15 * FRONT + 0.70 * np.array([0, 0, 1.0]) + 0.2 * RIGHT


@_xml("urdf", "limit-unreachable", "blocked")
def _(root: Xml, _: Path) -> None:
    hinge = np.array([float(x) for x in root.find(f"{U_DOOR}/origin").get("xyz").split()])
    collision = ET.SubElement(root.find("link[@name='door']"), "collision")
    ET.SubElement(collision, "origin", xyz=_shift("0 0 0", _obstacle() - hinge))
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
        pos=_shift("0 0 0", _obstacle() - hinge),
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
    set_("joint[@name='carcass_to_world']/origin", rpy=_shift("0 0 0", 0.2 * RIGHT)),
)
_add(
    "mjcf",
    "drift-at-rest",
    "gravity leans",
    lambda root, _: ET.SubElement(root, "option", gravity=_shift("0 0 -9.81", 2 * FRONT)),
)
_add(
    "usd",
    "drift-at-rest",
    "gravity leans",
    attr("/PhysicsScene", "physics:gravityDirection", lambda v: type(v)(*(0.2 * FRONT - [0, 0, 1]).tolist())),
)

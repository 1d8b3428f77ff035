"""Reads URDF as written."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.lint.meshes import counts_y_up, load_surface, locate
from twin.lint.model import WORLD, Body, FileMesh, Joint, Kind, LintModel, Reference, Shape
from twin.lint.primitives import box_points, cylinder_points
from twin.lint.xml import read_xml

_Y_TO_Z = geo.exp_so3([np.pi / 2, 0, 0])
_KINDS: dict[str, Kind] = {
    "revolute": "revolute", "continuous": "continuous", "prismatic": "prismatic", "fixed": "fixed", "floating": "free",
}  # fmt: skip


@dataclass
class _File:
    """What one pass over the file gathers."""

    path: Path
    lines: dict[ET.Element, int]
    unread: list[tuple[str, str]] = field(default_factory=list)
    references: list[Reference] = field(default_factory=list)
    surfaces: dict[Path, tuple[FileMesh | None, str]] = field(default_factory=dict)

    def where(self, element: ET.Element, owner: str) -> str:
        return f"{owner} (line {self.lines[element]})"

    def floats(self, element: ET.Element | None, key: str, count: int, owner: str) -> Array | None:
        """Numbers of an attribute; None when it is not written or they can't be read (which is noted)."""
        text = None if element is None else element.get(key)
        if element is None or text is None:
            return None
        try:
            values = np.array([float(t) for t in text.split()])
        except ValueError:
            values = np.zeros(0)
        if len(values) != count:
            self.unread.append((self.where(element, owner), f'{key}="{text}"'))
            return None
        return values

    def number(self, element: ET.Element | None, key: str, owner: str) -> float | None:
        values = self.floats(element, key, 1, owner)
        return None if values is None else float(values[0])

    def pose(self, parent: ET.Element, owner: str) -> Array:
        """The <origin> of an element, identity where it is not written."""
        origin = parent.find("origin")
        xyz, rpy = self.floats(origin, "xyz", 3, owner), self.floats(origin, "rpy", 3, owner)
        roll, pitch, yaw = np.zeros(3) if rpy is None else rpy
        turn = geo.exp_so3([0, 0, yaw]) @ geo.exp_so3([0, pitch, 0]) @ geo.exp_so3([roll, 0, 0])
        return geo.make_pose(turn, np.zeros(3) if xyz is None else xyz)


def read(path: Path) -> LintModel:
    """Read a URDF file. Raises InputError when it is not one."""
    root, lines = read_xml(path)
    if root.tag != "robot":
        raise InputError(
            f"{path} is no URDF: its root element is <{root.tag}>", "give the description's main file"
        )
    f = _File(path, lines)
    links = [(e, e.get("name", "")) for e in root.findall("link")]
    joints = [_joint(f, e) for e in root.findall("joint")]
    poses = _rest_poses([n for _, n in links], [(j, p) for j, p in joints])
    bodies, shapes = [], []
    for element, name in links:
        bodies.append(_body(f, element, name))
        for role in ("visual", "collision"):
            shapes += [_shape(f, e, name, role, poses.get(name)) for e in element.findall(role)]
    placed = tuple(_placed(j, p, poses) for j, p in joints)
    children = {j.child for j in placed}
    known = {n for _, n in links}
    base = tuple(  # a consumer fixes the root to the world, or lets it float: for the rules it stands
        Joint(f"{n} (root)", f"link {n!r}", "fixed", WORLD, n, implied=True)
        for n in known - children - {WORLD}
    )
    for e in root.iter("texture"):
        if written := e.get("filename"):
            f.references.append(Reference(f.where(e, "texture"), written, locate(written, path.parent)))
    named = [("link", n, f.where(e, f"link {n!r}")) for e, n in links]
    named += [("joint", j.name, j.element) for j in placed]
    return LintModel(
        path,
        "urdf",
        tuple(bodies),
        placed + base,
        tuple(shapes),
        tuple(f.references),
        tuple(named),
        tuple(f.unread),
    )


def _body(f: _File, element: ET.Element, name: str) -> Body:
    owner = f"link {name!r}"
    inertial = element.find("inertial")
    if inertial is None:
        return Body(name, f.where(element, owner))
    mass = inertial.find("mass")
    value = f.number(mass, "value", owner)
    f.pose(inertial, owner)
    i, tensor = inertial.find("inertia"), None
    if i is not None:
        keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        got = [f.number(i, k, owner) for k in keys]
        if all(g is not None for g in got[:3]):
            xx, yy, zz, xy, xz, yz = (0.0 if g is None else g for g in got)
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    unread = value is None and mass is not None and mass.get("value") is not None
    return Body(name, f.where(inertial, owner), value, tensor, "unreadable" if unread else "")


def _joint(f: _File, element: ET.Element) -> tuple[Joint, Array]:
    """The joint, not yet placed in the world, and its origin in the parent."""
    name = element.get("name", "")
    owner = f"joint {name!r}"
    kind = _KINDS.get(element.get("type", ""), "other")
    limit, axis = element.find("limit"), element.find("axis")
    parent, child = element.find("parent"), element.find("child")
    movable = kind in ("revolute", "prismatic")
    demanded = ("lower", "upper", "effort", "velocity") if movable else ()
    written = set() if limit is None else {k for k in demanded if limit.get(k) is not None}
    joint = Joint(
        name, f.where(element, owner), kind,
        "" if parent is None else parent.get("link", ""),
        "" if child is None else child.get("link", ""),
        unit="m" if kind == "prismatic" else "rad" if kind == "revolute" else "",
        lower=f.number(limit, "lower", owner) if movable else None,
        upper=f.number(limit, "upper", owner) if movable else None,
        axis=(f.floats(axis, "xyz", 3, owner) if axis is not None else np.array([1.0, 0, 0])) if kind != "fixed" else None,
        missing=tuple(k for k in demanded if k not in written),
    )  # fmt: skip
    return joint, f.pose(element, owner)


def _rest_poses(links: list[str], joints: list[tuple[Joint, Array]]) -> dict[str, Array]:
    """Poses of all links that hang on a root; links in a cycle have none."""
    children = {j.child for j, _ in joints}
    poses = {n: np.eye(4) for n in links if n not in children}
    waiting = list(joints)
    while waiting:
        left = []
        for j, origin in waiting:
            if j.parent in poses and j.child in links:
                poses.setdefault(j.child, poses[j.parent] @ origin)
            else:
                left.append((j, origin))
        if len(left) == len(waiting):
            break
        waiting = left
    return poses


def _placed(joint: Joint, origin: Array, poses: dict[str, Array]) -> Joint:
    if joint.parent not in poses:
        return joint
    pose = poses[joint.parent] @ origin
    axis = None if joint.axis is None else pose[:3, :3] @ joint.axis
    return replace(joint, axis_world=axis, pivot_world=pose[:3, 3])


def _shape(f: _File, element: ET.Element, link: str, role: str, pose: Array | None) -> Shape:
    owner = f"link {link!r} {role}"
    place = f.pose(element, owner)
    geometry = element.find("geometry")
    inner = None if geometry is None or not len(geometry) else geometry[0]
    kind = "other" if inner is None else inner.tag
    local, upright, surface, problem = None, None, None, ""
    if kind == "box" and (size := f.floats(inner, "size", 3, owner)) is not None:
        local = box_points(size)
    elif kind == "sphere" and (radius := f.number(inner, "radius", owner)) is not None:
        local = box_points(np.full(3, 2 * radius))
    elif kind in ("cylinder", "capsule"):
        radius, length = f.number(inner, "radius", owner), f.number(inner, "length", owner)
        if radius is not None and length is not None:
            local = cylinder_points(radius, length + 2 * radius if kind == "capsule" else length)
    elif kind == "mesh" and inner is not None and (written := inner.get("filename")):
        found = locate(written, f.path.parent)
        f.references.append(Reference(f.where(inner, owner), written, found))
        scale = f.floats(inner, "scale", 3, owner)
        if found is not None:
            if found not in f.surfaces:
                f.surfaces[found] = load_surface(found)
            surface, problem = f.surfaces[found]
        if found is not None and surface is not None and len(surface.vertices):
            local = surface.vertices * (1.0 if scale is None else scale)
            if counts_y_up(found):
                upright = surface.vertices @ _Y_TO_Z.T * (1.0 if scale is None else scale)
    points, upright = (
        None if p is None or pose is None else geo.transform(pose @ place, p) for p in (local, upright)
    )
    return Shape(
        f.where(element, owner),
        link,
        "visual" if role == "visual" else "collision",
        kind,
        points,
        surface,
        problem,
        upright=upright,
    )

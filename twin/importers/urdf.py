"""Reads URDF: yourdfpy parses it, meshes are looked for as `twin lint` does."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from twin import geometry as geo
from twin.errors import InputError, SceneError
from twin.geometry import Array
from twin.importers.look import Lost, painted
from twin.importers.mesh_file import mesh_file
from twin.importers.shapes import box, capsule, convex, cylinder, ellipsoid, is_convex
from twin.importers.source import Source, SourceBody, SourceJoint, SourceMass
from twin.importers.urdf_look import material_of, primitive, turned_upright
from twin.importers.urdf_text import parsed
from twin.lint.meshes import locate
from twin.mesh import joined
from twin.scene import Box, Collision, Mesh


def read(path: Path) -> Source:
    """Read a URDF file. Raises InputError."""
    robot = parsed(path)
    links = {k.name: k for k in robot.links}
    if len(links) < len(robot.links):
        raise InputError(
            f"{path} has two links {Counter(k.name for k in robot.links).most_common(1)[0][0]!r}",
            "rename one",
        )
    above = _joints_above(path, robot)
    materials, lost = {m.name: m for m in robot.materials}, Lost()
    bodies: list[SourceBody] = []
    notes: list[str] = []
    poses: dict[str, Array] = {}
    wild = [j.name for j in robot.joints if j.origin is not None and not np.isfinite(j.origin).all()]
    if wild:
        raise InputError(f"{path}: the origin of joint {wild[0]!r} is not finite", "correct the number")

    def add(name: str) -> None:
        joint = above.get(name)
        origin = np.eye(4) if joint is None or joint.origin is None else joint.origin
        poses[name] = origin if joint is None else poses[joint.parent] @ origin
        try:
            bodies.append(_body(path, links[name], joint, poses[name], materials, notes, lost))
        except (SceneError, ValueError) as e:  # numbers that are none, sizes that no shape has
            raise InputError(f"{path}: link {name!r}: {e}", "correct the number") from e
        for other in robot.joints:
            if other.parent == name:
                add(other.child)

    for name in links:
        if name not in above:
            add(name)
    left = sorted(set(links) - set(poses))
    if left:
        raise InputError(f"{path}: link {left[0]!r} hangs on itself", "links must form a tree")
    notes += [
        f"joint {j.name!r} follows {j.mimic.joint!r} (mimic): the twin moves it by itself"
        for j in robot.joints
        if j.mimic is not None
    ]
    return Source(path, robot.name, tuple(bodies), (*notes, *lost.notes()))


def _joints_above(path: Path, robot: Any) -> dict[str, Any]:
    """Link -> the joint that it hangs on."""
    names = {k.name for k in robot.links}
    above: dict[str, Any] = {}
    for j in robot.joints:
        for end in (j.parent, j.child):
            if end not in names:
                raise InputError(f"{path}: joint {j.name!r} names the link {end!r}, which is not there")
        if j.child in above:
            raise InputError(
                f"{path}: link {j.child!r} hangs on two joints, {above[j.child].name!r} and {j.name!r}",
                "a twin is a tree: leave one of them out",
            )
        above[j.child] = j
    return above


def _body(
    path: Path, link: Any, joint: Any, pose: Array, materials: dict[str, Any], notes: list[str], lost: Lost
) -> SourceBody:
    def placed(shape: Any, upright: bool) -> Array:
        mesh = _surface(path, shape.geometry, f"link {link.name!r}", upright)
        return mesh.vertices if shape.origin is None else geo.transform(shape.origin, mesh.vertices)

    upright = turned_upright(path, link, placed, notes)
    visual: list[Mesh] = []
    for k, v in enumerate(link.visuals):
        place, owner = pose if v.origin is None else pose @ v.origin, f"visual {k} of link {link.name!r}"
        visual += [m.transformed(place) for m in _visual(path, v, owner, materials, lost, upright)]
    collision: list[Collision] = []
    usable = True
    for k, c in enumerate(link.collisions):
        place, owner = pose if c.origin is None else pose @ c.origin, f"collision {k} of link {link.name!r}"
        if c.geometry.box is not None:
            collision.append(Box(place, c.geometry.box.size))
            continue
        mesh = _surface(path, c.geometry, owner, _file(path, c.geometry, owner) in upright)
        hull = convex(mesh)
        if hull is None or not is_convex(mesh):
            usable = False
            notes.append(f"{owner} is not convex: shapes are made from the surface instead")
        else:
            collision.append(hull.transformed(place))
    if joint is None or joint.type == "fixed":
        moves: tuple[SourceJoint | None, str, bool] = (None, "", False)
    else:
        moves = _motion(joint, pose)
    return SourceBody(
        link.name,
        None if joint is None else joint.parent,
        moves[0],
        tuple(visual),
        tuple(collision),
        _mass(link.inertial, pose),
        refused=moves[1],
        loose=moves[2],
        shapes=usable,
    )


def _motion(joint: Any, pose: Array) -> tuple[SourceJoint | None, str, bool]:
    """The joint, or why it can't be one of a twin, or that its child floats."""
    if joint.type == "floating":
        return None, "", True
    if joint.type not in ("revolute", "continuous", "prismatic"):
        return None, f"joint {joint.name!r} is of type {joint.type!r}", False
    axis = np.asarray(joint.axis, dtype=np.float64)
    if axis.shape != (3,) or not np.all(np.isfinite(axis)) or np.linalg.norm(axis) < 1e-9:
        return None, f"joint {joint.name!r} has the axis {axis.tolist()}", False
    bounded = joint.limit if joint.type != "continuous" else None
    resists = joint.dynamics
    return (
        SourceJoint(
            joint.name,
            "prismatic" if joint.type == "prismatic" else "revolute",
            geo.unit(geo.rotate(pose, axis)),
            pose[:3, 3].copy(),
            0.0,
            None if bounded is None else bounded.lower,
            None if bounded is None else bounded.upper,
            damping=_number(resists, "damping"),
            frictionloss=_number(resists, "friction"),
        ),
        "",
        False,
    )


def _number(dynamics: Any, key: str) -> float | None:
    text = None if dynamics is None else getattr(dynamics, key)
    return None if text is None else float(text)


def _mass(inertial: Any, pose: Array) -> SourceMass | None:
    if inertial is None or not inertial.mass:
        return None
    if inertial.mass < 0:
        raise SceneError(f"mass must be positive, got {inertial.mass:g} kg")
    place = pose if inertial.origin is None else pose @ inertial.origin
    tensor = np.zeros((3, 3)) if inertial.inertia is None else np.asarray(inertial.inertia, np.float64)
    turned = place[:3, :3] @ tensor @ place[:3, :3].T
    return SourceMass(float(inertial.mass), place[:3, 3].copy(), (turned + turned.T) / 2)


def _visual(
    path: Path, v: Any, owner: str, materials: dict[str, Any], lost: Lost, upright: frozenset[Path]
) -> list[Mesh]:
    """What is drawn of a visual, in its own frame."""
    tell, file = lost.by(owner), _file(path, v.geometry, owner)
    color, picture = material_of(path, v.material, materials, tell)
    if file is None:
        kind = next((k for k, shape in vars(v.geometry).items() if shape is not None), "")
        return [primitive(kind, _surface(path, v.geometry, owner), color, picture, tell)]
    scale = _scale(v.geometry)
    meshes, own = mesh_file(file, scale, f"{path}: {owner}", tell, picture, file in upright)
    return meshes if own else [painted(m, color) for m in meshes]


def _surface(path: Path, geometry: Any, owner: str, upright: bool = False) -> Mesh:
    """A geometry in its own frame, without its look; the mesh of a file turned upright or not."""
    tube = getattr(geometry, "capsule", None)
    for shape in (geometry.box, geometry.cylinder, geometry.sphere, tube):
        sizes = np.hstack([np.zeros(0), *vars(shape).values()]) if shape is not None else np.ones(1)
        if not np.all(sizes > 0) or not np.isfinite(sizes).all():
            raise SceneError(f"the sizes of {owner} must be positive, got {sizes.tolist()}")
    if geometry.box is not None:
        return box(geometry.box.size)
    if tube is not None:
        return capsule(tube.radius, tube.length)
    if geometry.cylinder is not None:
        return cylinder(geometry.cylinder.radius, geometry.cylinder.length)
    if geometry.sphere is not None:
        return ellipsoid(np.full(3, geometry.sphere.radius))
    file = _file(path, geometry, owner)
    if file is None:
        raise InputError(f"{path}: {owner} has no shape", "give a box, cylinder, sphere or mesh")
    return joined(mesh_file(file, _scale(geometry), f"{path}: {owner}", Lost().by(owner), upright=upright)[0])


def _scale(geometry: Any) -> Array:
    scale = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
    return np.broadcast_to(np.asarray(scale, np.float64), (3,))


def _file(path: Path, geometry: Any, owner: str) -> Path | None:
    """The mesh file of a geometry; None for a primitive."""
    if geometry.mesh is None:
        return None
    found = locate(geometry.mesh.filename, path.parent)
    if found is None:
        raise InputError(
            f"{path}: {owner} names {geometry.mesh.filename!r}, which can't be found from here",
            "put the package beside the file",
        )
    return found

"""Reads MJCF as written: MuJoCo parses (defaults, includes, frames), and places things if it compiles."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence, Set
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from twin.errors import InputError
from twin.geometry import Array
from twin.lint.meshes import load_surface
from twin.lint.model import WORLD, Body, FileMesh, Joint, Kind, LintModel, Reference, Shape
from twin.lint.primitives import box_points, cylinder_points
from twin.lint.xml import read_xml

_UNNAMED = "(unnamed) "
_DEFAULT_DENSITY = 1000.0  # kg/m^3, MuJoCo's
_NAMED = {
    "body",
    "geom",
    "joint",
    "freejoint",
    "site",
    "camera",
    "light",
    "mesh",
    "texture",
    "material",
    "hfield",
}


def read(path: Path) -> LintModel:
    """Read an MJCF file. Raises InputError when it is not one; what MuJoCo refuses is kept as `refused`."""
    import mujoco

    root, lines = read_xml(path)
    if root.tag not in ("mujoco", "mujocoinclude"):
        raise InputError(f"{path} is no MJCF: its root element is <{root.tag}>", "give the model's main file")
    names = tuple(_names(path, root, lines, path.parent, set()))
    try:
        spec = _spec(path)
    except ValueError as e:
        return LintModel(path, "mjcf", names=names, refused=_one_line(e))
    refused, model, data = "", None, None
    try:
        spec.compiler.discardvisual = False
        spec.compiler.fusestatic = False
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
    except ValueError as e:
        refused = _one_line(e)
        spec = _spec(path)  # a failed compilation leaves nothing to read
    references = list(_references(spec, path.parent, set(_files(root, path.parent, set()))))
    files = {r.element: r for r in references}
    weighs = spec.compiler.inertiagrouprange
    bodies = [_body(b, weighs) for b in spec.bodies if b.name != WORLD or b.parent is not None]
    joints = [j for b in spec.bodies if b.parent is not None for j in _joints(spec, b, data)]
    shapes = [_shape(spec, g, model, data, files) for g in spec.geoms]
    return LintModel(
        path, "mjcf", tuple(bodies), tuple(joints), tuple(shapes), tuple(references), names, refused=refused
    )


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _label(kind: str, thing: Any) -> str:
    """How a finding names an element: unnamed ones by their line."""
    line = f" ({thing.info})" if thing.info and thing.info != "line 0" else ""  # 0: from an included file
    named = thing.name and not thing.name.startswith(_UNNAMED)
    return f"{kind} {thing.name!r}{line}" if named else f"{kind}{line or ' without a name'}"


def _spec(path: Path) -> Any:
    """The specification, with names for bodies that have none, so that joints can name them."""
    import mujoco

    spec = mujoco.MjSpec.from_file(str(path.resolve()))
    for k, body in enumerate(spec.bodies):
        if not body.name:
            body.name = f"{_UNNAMED}{k}"
    return spec


def _names(
    path: Path, element: ET.Element, lines: dict[ET.Element, int], folder: Path, seen: set[Path]
) -> Iterator[tuple[str, str, str]]:
    """(kind, name, element) of everything in the tree and the assets, includes read in place."""
    for child in element:
        if child.tag == "include" and (file := child.get("file")):
            target = folder / file
            if target.is_file() and target.resolve() not in seen:  # MuJoCo refuses to read a file twice
                seen.add(target.resolve())
                inner, inner_lines = read_xml(target)
                yield from _names(target, inner, inner_lines, folder, seen)
        elif child.tag not in (
            "default",
            "equality",
            "actuator",
            "sensor",
            "tendon",
            "contact",
            "keyframe",
            "deformable",
        ):
            if child.tag in _NAMED and (name := child.get("name")):
                kind = "joint" if child.tag == "freejoint" else child.tag
                yield kind, name, f"{kind} {name!r} ({path.name} line {lines[child]})"
            yield from _names(path, child, lines, folder, seen)


def _files(element: ET.Element, folder: Path, seen: set[Path]) -> Iterator[str]:
    """What attributes of the tree and of the files that it includes name as files."""
    for e in element.iter():
        named = [value for key, value in e.attrib.items() if key.startswith("file")]
        yield from named
        target = folder / named[0] if e.tag == "include" and named else None
        if target is not None and target.is_file() and target.resolve() not in seen:
            seen.add(target.resolve())
            yield from _files(read_xml(target)[0], folder, seen)


def _references(spec: Any, folder: Path, stated: Set[str]) -> Iterator[Reference]:
    """Mesh, height field and texture files, as written behind their meshdir or texturedir.

    MuJoCo tells by an absolute path what an included file names beside itself; no file states it (`stated`).
    """
    for kind, things, base in (
        ("mesh", spec.meshes, spec.meshdir),
        ("hfield", spec.hfields, spec.meshdir),
        ("texture", spec.textures, spec.texturedir),
    ):
        for t in things:
            for file in [t.file, *(t.cubefiles if kind == "texture" else ())]:
                if file:
                    beside = Path(file).is_absolute() and file not in stated
                    found = os.path.relpath(file, folder.resolve()) if beside else file
                    name = found.replace("\\", "/").rsplit("/", 1)[-1] if spec.strippath else found
                    written = f"{base.rstrip('/')}/{name}" if base and not Path(name).is_absolute() else name
                    yield Reference(_label(kind, t), written, folder / written)


def _body(b: Any, weighs: Sequence[int]) -> Body:
    """Mass and inertia as an <inertial> says, else as MuJoCo takes it: geoms of the groups `weighs`."""
    if b.explicitinertial:
        full = np.asarray(b.fullinertia, dtype=np.float64)
        if np.isnan(full[0]) or not np.any(full):
            tensor = np.diag(np.asarray(b.inertia, dtype=np.float64))
        else:
            xx, yy, zz, xy, xz, yz = full
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return Body(b.name, _label("body", b), float(b.mass), tensor)
    counted = [g for g in b.geoms if weighs[0] <= g.group <= weighs[1]]
    solid = [g for g in counted if not (np.isnan(g.mass) and g.density == 0) and g.mass != 0]
    untold = [g for g in solid if np.isnan(g.mass) and g.density == _DEFAULT_DENSITY]
    inferred = "default density" if untold else "density" if solid else ""
    return Body(
        b.name, _label("body", b), inferred=inferred, weightless="" if counted else _uncounted(b, weighs)
    )


def _uncounted(b: Any, weighs: Sequence[int]) -> str:
    """Why none of a body's geoms counts for its mass; empty without geoms."""
    groups = sorted({int(g.group) for g in b.geoms})
    span = f"groups {weighs[0]} to {weighs[1]}" if weighs[0] < weighs[1] else f"group {weighs[0]}"
    takes = f"takes masses from geoms of {span}"
    has = f"body {b.name!r} has geoms in {' and '.join(map(str, groups))} alone"
    return f'inertiagrouprange="{weighs[0]} {weighs[1]}" {takes}, and {has}' if groups else ""


def _joints(spec: Any, b: Any, data: Any) -> Iterator[Joint]:
    """The joints of a body, a fixed one where it has none."""
    import mujoco

    kinds: dict[int, Kind] = {
        int(mujoco.mjtJoint.mjJNT_HINGE): "revolute", int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
        int(mujoco.mjtJoint.mjJNT_FREE): "free", int(mujoco.mjtJoint.mjJNT_BALL): "other",
    }  # fmt: skip
    parent = WORLD if b.parent.parent is None else b.parent.name
    if not len(b.joints):
        yield Joint("fixed", _label("body", b), "fixed", parent, b.name)
    for j in b.joints:
        kind = kinds[int(j.type)]
        lower, upper = (float(x) for x in np.asarray(j.range)[:2])
        # "limited" left to itself means: limited when a range is written
        off, on = mujoco.mjtLimited.mjLIMITED_FALSE, mujoco.mjtLimited.mjLIMITED_TRUE
        limited = j.limited != off and (j.limited == on or (lower, upper) != (0.0, 0.0))
        bounded = limited and kind in ("revolute", "prismatic")
        yield Joint(
            j.name, _label("joint", j), "continuous" if kind == "revolute" and not limited else kind,
            parent, b.name,
            unit="m" if kind == "prismatic" else ("deg" if spec.compiler.degree else "rad") if kind == "revolute" else "",
            lower=lower if bounded else None, upper=upper if bounded else None,
            axis=np.array(j.axis) if kind in ("revolute", "prismatic") else None,
            axis_world=None if data is None else np.array(data.xaxis[j.id]),
            pivot_world=None if data is None else np.array(data.xanchor[j.id]),
        )  # fmt: skip


def _shape(spec: Any, g: Any, model: Any, data: Any, files: dict[str, Reference]) -> Shape:
    """A geom; its points are known when the model compiles."""
    import mujoco

    touches = g.contype != 0 or g.conaffinity != 0
    body = WORLD if g.parent.parent is None else g.parent.name
    kind = str(mujoco.mjtGeom(int(g.type)).name).removeprefix("mjGEOM_").lower()
    surface, problem, points = None, "", None
    if kind == "mesh":
        mesh = spec.mesh(g.meshname)
        if model is not None:
            surface = _compiled_surface(model, int(model.geom_dataid[g.id]))
        elif mesh is not None and mesh.file:
            path = files[_label("mesh", mesh)].path
            if path is not None and path.suffix.lower() in (".obj", ".stl"):
                surface, problem = load_surface(path)
    if model is not None:
        points = _points(kind, surface, model, data, g.id)
    role = "collision" if touches else "visual"
    return Shape(
        _label("geom", g),
        body,
        "collision" if role == "collision" else "visual",
        kind,
        points,
        surface,
        problem,
    )


def _compiled_surface(model: Any, mesh: int) -> FileMesh:
    v0, vn = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    f0, fn = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    return FileMesh(
        model.mesh_vert[v0 : v0 + vn].astype(np.float64), model.mesh_face[f0 : f0 + fn].astype(np.int64)
    )


def _points(kind: str, surface: FileMesh | None, model: Any, data: Any, geom: int) -> Array | None:
    size = model.geom_size[geom]
    local = {
        "box": lambda: box_points(2 * size),
        "ellipsoid": lambda: box_points(2 * size),
        "sphere": lambda: box_points(np.full(3, 2 * size[0])),
        "cylinder": lambda: cylinder_points(float(size[0]), 2 * float(size[1])),
        "capsule": lambda: cylinder_points(float(size[0]), 2 * float(size[1] + size[0])),
        "mesh": lambda: None if surface is None else surface.vertices,
    }.get(kind, lambda: None)()
    if local is None:
        return None
    place: Array = local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    return place

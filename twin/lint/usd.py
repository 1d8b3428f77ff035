"""Reads USD as composed, with UsdPhysics; asset paths as written in every layer."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.lint.meshes import is_absolute
from twin.lint.model import WORLD, Body, FileMesh, Joint, Kind, LintModel, Reference, Shape, StageUnits
from twin.lint.primitives import box_points, cylinder_points
from twin.lint.usd_prims import authored, body_of, enabled, has, matrix_of, scales

_AXES = {"X": 0, "Y": 1, "Z": 2}


def read(path: Path) -> LintModel:
    """Read a USD file with everything it refers to. Raises InputError when it can't be opened."""
    from pxr import Tf, Usd, UsdGeom, UsdPhysics

    if not path.is_file():
        raise InputError(f"{path} can't be read: no such file", "check the path")
    try:
        stage = Usd.Stage.Open(str(path.resolve()))
    except Tf.ErrorException as e:
        raise InputError(f"{path} can't be opened as USD: {_first_line(e)}", "open it in usdview") from e
    cache = UsdGeom.XformCache()
    prims = list(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
    rigid = {
        p
        for p in prims
        if has(p, "PhysicsRigidBodyAPI") and enabled(UsdPhysics.RigidBodyAPI(p).GetRigidBodyEnabledAttr())
    }
    bodies = tuple(_body(p, cache) for p in prims if p in rigid)
    links = [
        p for p in prims if p.IsA(UsdPhysics.Joint) and enabled(UsdPhysics.Joint(p).GetJointEnabledAttr())
    ]
    loops = not any(has(p, "PhysicsArticulationRootAPI") for p in prims)  # only articulations must be trees
    joints = [_joint(UsdPhysics.Joint(p), rigid, cache, loops) for p in links]
    held = {j.child for j in joints} | {j.parent for j in joints}
    free = [Joint(f"{b.name} (free)", b.element, "free", WORLD, b.name) for b in bodies if b.name not in held]
    shapes = [s for p in prims if p.IsA(UsdGeom.Gprim) for s in _shapes(p, rigid, cache)]
    units = None
    if bodies or any(p.IsA(UsdPhysics.Joint) or has(p, "PhysicsCollisionAPI") for p in prims):
        units = _units(stage)
    return LintModel(
        path, "usd", bodies, (*joints, *free), tuple(shapes), tuple(_references(stage)), units=units
    )  # fmt: skip


def _first_line(error: Exception) -> str:
    said = [str(getattr(a, "commentary", a)).split("matching PXR")[0].strip() for a in error.args]
    return said[0] if said else type(error).__name__


def _units(stage: Any) -> StageUnits:
    from pxr import UsdGeom, UsdPhysics

    others = [
        (layer.GetDisplayName(), key, str(layer.pseudoRoot.GetInfo(key)))
        for layer in stage.GetUsedLayers()
        for key in ("metersPerUnit", "kilogramsPerUnit", "upAxis")
        if layer.pseudoRoot.HasInfo(key) and layer.pseudoRoot.GetInfo(key) != stage.GetMetadata(key)
    ]
    return StageUnits(
        float(UsdGeom.GetStageMetersPerUnit(stage)) if UsdGeom.StageHasAuthoredMetersPerUnit(stage) else None,
        float(UsdPhysics.GetStageKilogramsPerUnit(stage))
        if UsdPhysics.StageHasAuthoredKilogramsPerUnit(stage)
        else None,
        str(UsdGeom.GetStageUpAxis(stage)) if stage.HasAuthoredMetadata("upAxis") else None,
        tuple(sorted(others)),
    )


def _body(prim: Any, cache: Any) -> Body:
    from pxr import Usd, UsdPhysics

    name, scale = str(prim.GetPath()), scales(matrix_of(prim, cache))
    told = any(_told_density(p) for p in Usd.PrimRange(prim, Usd.TraverseInstanceProxies()))
    inferred = "density" if told else "default density"
    if not has(prim, "PhysicsMassAPI"):
        return Body(name, name, inferred=inferred, scale=scale)
    api = UsdPhysics.MassAPI(prim)
    mass, moments = authored(api.GetMassAttr()), authored(api.GetDiagonalInertiaAttr())
    tensor = None if moments is None else np.diag(np.array(moments, dtype=np.float64))
    return Body(
        name,
        name,
        None if mass is None else float(mass),
        tensor,
        inferred if mass is None else "",
        scale=scale,
    )


def _told_density(prim: Any) -> bool:
    """True when a mass or density is written for a prim, or for the physics material that is bound to it."""
    from pxr import UsdPhysics, UsdShade

    api = UsdPhysics.MassAPI(prim)
    if has(prim, "PhysicsMassAPI") and (authored(api.GetMassAttr()) or authored(api.GetDensityAttr())):
        return True
    if not has(prim, "PhysicsCollisionAPI"):
        return False
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
    return bool(material and authored(UsdPhysics.MaterialAPI(material.GetPrim()).GetDensityAttr()))


def _joint(joint: Any, rigid: set[Any], cache: Any, loops: bool) -> Joint:
    from pxr import UsdPhysics

    prim = joint.GetPrim()
    ends: list[str] = []
    frames: list[Array | None] = []
    sides = (
        (joint.GetBody0Rel(), joint.GetLocalPos0Attr(), joint.GetLocalRot0Attr()),
        (joint.GetBody1Rel(), joint.GetLocalPos1Attr(), joint.GetLocalRot1Attr()),
    )
    stage = prim.GetStage()
    for rel, pos, rot in sides:
        targets = rel.GetTargets()
        target = stage.GetPrimAtPath(targets[0]) if targets else None
        if targets and not target:
            ends.append(str(targets[0]))  # dangling: a rule names it
            frames.append(None)
            continue
        ends.append(WORLD if target is None else body_of(target, rigid))
        place = np.eye(4) if target is None else matrix_of(target, cache)
        frames.append(_frame(place, pos.Get(), rot.Get()))
    if ends[1] == WORLD:  # the second end may be the world as well as the first
        ends.reverse()
        frames.reverse()
    name = str(prim.GetPath())
    kind: Kind = "other"
    axis = lower = upper = None
    for k, cls in (("revolute", UsdPhysics.RevoluteJoint), ("prismatic", UsdPhysics.PrismaticJoint)):
        if prim.IsA(cls):
            kind = "revolute" if k == "revolute" else "prismatic"
            typed = cls(prim)
            lower, upper = authored(typed.GetLowerLimitAttr()), authored(typed.GetUpperLimitAttr())
            letter = str(typed.GetAxisAttr().Get())
            axis = np.eye(3)[_AXES[letter]] if letter in _AXES else np.zeros(3)
    if prim.IsA(UsdPhysics.FixedJoint):
        kind = "fixed"
    if kind == "revolute" and all(x is None or np.isinf(x) for x in (lower, upper)):
        kind = "continuous"
    own = frames[1]
    length = max((_norm(rot.Get()) for _, _, rot in sides), key=lambda n: abs(n - 1))
    return Joint(
        name, name, kind, ends[0], ends[1], unit={"revolute": "deg", "prismatic": "m"}.get(kind, ""),  # type: ignore[arg-type]
        lower=_finite(lower), upper=_finite(upper),
        axis=None if axis is None else axis * length,
        axis_world=None if own is None or axis is None else own[:3, :3] @ axis,
        pivot_world=None if own is None else own[:3, 3],
        gap=_gap(frames, axis if kind in ("revolute", "continuous", "prismatic") else None, kind),
        loop=loops or bool(joint.GetExcludeFromArticulationAttr().Get()),
    )  # fmt: skip


def _frame(body: Array, position: Any, rotation: Any) -> Array:
    """World pose of a joint's frame in a body: positions scale with the body, directions don't."""
    out = np.eye(4)
    out[:3, 3] = (body @ [*map(float, position or (0, 0, 0)), 1.0])[:3]
    q = (
        np.array([1.0, 0, 0, 0])
        if rotation is None
        else np.array([rotation.GetReal(), *rotation.GetImaginary()])
    )
    n = np.linalg.norm(q)
    scale = scales(body)
    turn = body[:3, :3] / np.where(scale > 0, scale, 1.0)
    out[:3, :3] = turn @ geo.matrix_from_quat_wxyz(q / n if n > 0 else np.array([1.0, 0, 0, 0]))
    return out


def _finite(limit: Any) -> float | None:
    """A limit; None where it is infinite, which is USD's way of saying that there is none."""
    return None if limit is None or np.isinf(limit) else float(limit)


def _norm(quaternion: Any) -> float:
    return 1.0 if quaternion is None else float(quaternion.GetLength())


def _gap(frames: list[Array | None], axis: Array | None, kind: str) -> tuple[float, float]:
    """Distance (m) and angle (rad) between the joint's frames in the two bodies, where the joint is fixed."""
    a, b = frames
    if a is None or b is None or axis is None:
        return 0.0, 0.0
    offset = b[:3, 3] - a[:3, 3]
    direction_a, direction_b = a[:3, :3] @ axis, b[:3, :3] @ axis
    if kind == "prismatic":
        offset = offset - (offset @ direction_a) * direction_a
    angle = float(np.arctan2(np.linalg.norm(np.cross(direction_a, direction_b)), direction_a @ direction_b))
    return float(np.linalg.norm(offset)), angle


def _shapes(prim: Any, rigid: set[Any], cache: Any) -> Iterator[Shape]:
    """A gprim as a collision shape, or as a visual one when it is drawn."""
    from pxr import UsdGeom, UsdPhysics

    collides = has(prim, "PhysicsCollisionAPI") and enabled(
        UsdPhysics.CollisionAPI(prim).GetCollisionEnabledAttr()
    )
    if not collides and str(UsdGeom.Imageable(prim).ComputePurpose()) in ("guide", "proxy"):
        return
    kind = str(prim.GetTypeName()).lower()
    matrix = matrix_of(prim, cache)
    surface, problem, local, approximation = None, "", _primitive(prim, kind), None
    if kind == "mesh":
        surface, problem = _surface(UsdGeom.Mesh(prim))
        local = None if surface is None or not len(surface.vertices) else surface.vertices
        approximation = ""
        if has(prim, "PhysicsMeshCollisionAPI"):
            approximation = str(authored(UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr()) or "")
    points = None if local is None else geo.transform(matrix, local)
    name = str(prim.GetPath())
    yield Shape(
        name, body_of(prim, rigid), "collision" if collides else "visual", kind, points, surface, problem,
        approximation, scales(matrix),
    )  # fmt: skip


def _primitive(prim: Any, kind: str) -> Array | None:
    def number(name: str) -> float:
        value = prim.GetAttribute(name).Get()
        return 0.0 if value is None else float(value)

    axis = _AXES.get(str(prim.GetAttribute("axis").Get()), 2) if prim.HasAttribute("axis") else 2
    if kind == "cube":
        return box_points(np.full(3, number("size")))
    if kind == "sphere":
        return box_points(np.full(3, 2 * number("radius")))
    if kind in ("cylinder", "cone"):
        return cylinder_points(number("radius"), number("height"), axis)
    if kind == "capsule":
        return cylinder_points(number("radius"), number("height") + 2 * number("radius"), axis)
    return None


def _surface(mesh: Any) -> tuple[FileMesh | None, str]:
    """The mesh with its polygons cut into fans."""
    points = np.array(mesh.GetPointsAttr().Get() or np.zeros((0, 3)), dtype=np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get() or [], dtype=np.int64)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get() or [], dtype=np.int64)
    if counts.sum() != len(indices):
        return None, f"faceVertexCounts sum up to {counts.sum()}, but there are {len(indices)} indices"
    starts = np.cumsum(counts) - counts
    faces = [
        np.stack(
            [
                indices[starts[counts > k]],
                indices[starts[counts > k] + k - 1],
                indices[starts[counts > k] + k],
            ],
            1,
        )
        for k in range(2, int(counts.max(initial=0)))
    ]
    return FileMesh(points, np.concatenate(faces) if faces else np.zeros((0, 3), np.int64)), ""


def _references(stage: Any) -> Iterator[Reference]:
    """Every asset path in every layer the stage is made of, and where it leads."""
    from pxr import Ar, Sdf, UsdUtils

    for layer in stage.GetUsedLayers():
        if layer.anonymous:
            continue
        written: list[str] = []
        copy = Sdf.Layer.CreateAnonymous()
        copy.TransferContent(layer)
        UsdUtils.ModifyAssetPaths(copy, lambda p, kept=written: (kept.append(p), p)[1])
        for text in dict.fromkeys(t for t in written if t):
            if "://" in text and not is_absolute(text):
                yield Reference(f"layer {layer.GetDisplayName()}", text, None)
                continue
            found = Ar.GetResolver().Resolve(layer.ComputeAbsolutePath(text))
            path = Path(str(found)) if found else Path(layer.ComputeAbsolutePath(text))
            yield Reference(f"layer {layer.GetDisplayName()}", text, path)

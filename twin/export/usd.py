"""USD writer: UsdPhysics with the Newton schemas' joint damping and friction, SI units, z up.

One .usda with textures beside it: bodies are siblings under the default prim (rigid bodies must not nest), joints carry the tree. The
stage is an articulation fixed to the world.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt

from twin import geometry as geo
from twin.export.obj import bake, corner_normals, mean_color, write_image
from twin.export.tree import ARMATURE, Link, Tree
from twin.geometry import Array
from twin.scene import Mesh


def write(tree: Tree, folder: Path) -> tuple[Path, list[str]]:
    """Write `<name>.usda` into `folder`; returns the path and what USD can't carry."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{tree.name}.usda"
    stage = Usd.Stage.CreateInMemory()
    stage.SetMetadata(
        "comment", "A functional digital twin: metres, kilograms, seconds; angles of joint limits in degrees."
    )
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, f"/{tree.name}")
    Usd.ModelAPI(root).SetKind(Kind.Tokens.component)
    stage.SetDefaultPrim(root.GetPrim())
    _extent(root, tree)
    scene = UsdPhysics.Scene.Define(stage, "/PhysicsScene")
    scene.CreateGravityDirectionAttr(Gf.Vec3f(0, 0, -1))
    scene.CreateGravityMagnitudeAttr(9.81)
    origins = world_origins(tree)
    UsdGeom.Scope.Define(stage, f"/{tree.name}/Materials")
    for link in tree.links:
        _body(stage, tree, link, origins[link.name], folder)
    UsdGeom.Scope.Define(stage, f"/{tree.name}/Joints")
    for link in tree.links:
        _joint(stage, tree, link)
    stage.GetRootLayer().Export(str(path))
    return path, _not_carried(tree)


def _not_carried(tree: Tree) -> list[str]:
    lost = ["usd: the keyframes closed and open are not carried (UsdPhysics has none)"]
    if any(k.grasp is not None for k in tree.links):
        lost.append("usd: grasp frames are plain Xforms <part>/<part>_grasp without a physics meaning")
    return lost


def world_origins(tree: Tree) -> dict[str, Array]:
    """World position (3,) of every link's frame at state 0."""
    origins: dict[str, Array] = {}
    for link in tree.links:
        origins[link.name] = link.offset + (origins[link.parent] if link.parent is not None else 0.0)
    return origins


def _extent(root: UsdGeom.Xform, tree: Tree) -> None:
    origins = world_origins(tree)
    points = [k.visual.vertices + origins[k.name] for k in tree.links if len(k.visual.vertices)]
    if points:
        low, high = np.min([p.min(0) for p in points], 0), np.max([p.max(0) for p in points], 0)
        UsdGeom.ModelAPI.Apply(root.GetPrim()).SetExtentsHint(_points(np.stack([low, high])))


def _body(stage: Usd.Stage, tree: Tree, link: Link, origin: Array, folder: Path) -> None:
    path = f"/{tree.name}/{link.name}"
    body = UsdGeom.Xform.Define(stage, path)
    body.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, origin)))
    UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
    if link.parent is None:
        UsdPhysics.ArticulationRootAPI.Apply(body.GetPrim())
    else:
        pairs = UsdPhysics.FilteredPairsAPI.Apply(body.GetPrim())
        pairs.CreateFilteredPairsRel().AddTarget(f"/{tree.name}/{link.parent}")
    if link.mass is not None and link.com is not None and link.inertia is not None:
        _mass(body.GetPrim(), link.mass, link.com, link.inertia)
    if len(link.visual.faces):
        _visual(stage, f"{path}/{link.name}_visual", link, f"/{tree.name}/Materials/{link.name}_look", folder)
    touch = _touch(stage, f"/{tree.name}/Materials/{link.name}_contact", link.friction)
    for k, piece in enumerate(link.collision):
        name = f"{path}/{link.name}_collision_{k}"
        if isinstance(piece, Mesh):
            prim = _hull(stage, name, piece)
        else:
            cube = UsdGeom.Cube.Define(stage, name)
            cube.CreateSizeAttr(1.0)
            cube.CreateExtentAttr(_points(np.array([[-0.5] * 3, [0.5] * 3])))
            _place(cube, piece.T_world_box)
            cube.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, piece.size)))
            prim = cube.GetPrim()
        UsdGeom.Imageable(prim).CreatePurposeAttr(UsdGeom.Tokens.guide)
        UsdPhysics.CollisionAPI.Apply(prim)
        _group(prim, "MjcCollisionAPI", 3)
        binding = UsdShade.MaterialBindingAPI.Apply(prim)
        binding.Bind(
            touch
        )  # some readers look only at the all-purpose binding, MuJoCo only at the physics one
        binding.Bind(touch, UsdShade.Tokens.weakerThanDescendants, "physics")
    if link.grasp is not None:
        _place(UsdGeom.Xform.Define(stage, f"{path}/{link.name}_grasp"), link.grasp)


def _mass(prim: Usd.Prim, mass: float, com: Array, inertia: Array) -> None:
    """Mass, centre, principal moments and axes together: with mass alone, readers fall back to a density."""
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    api = UsdPhysics.MassAPI.Apply(prim)
    api.CreateMassAttr(float(mass))
    api.CreateCenterOfMassAttr(Gf.Vec3f(*map(float, com)))
    api.CreateDiagonalInertiaAttr(Gf.Vec3f(*map(float, moments)))
    api.CreatePrincipalAxesAttr(_quat(axes))


def _joint(stage: Usd.Stage, tree: Tree, link: Link) -> None:
    own = f"/{tree.name}/{link.name}"
    if link.joint is None:
        fixed = UsdPhysics.FixedJoint.Define(stage, f"/{tree.name}/Joints/{link.name}_to_world")
        fixed.CreateBody1Rel().SetTargets([own])
        _frames(fixed, np.zeros(3), np.eye(3))
        return
    j = link.joint
    path = f"/{tree.name}/Joints/{j.name}"
    joint = UsdPhysics.RevoluteJoint.Define(stage, path) if j.kind == "revolute" else UsdPhysics.PrismaticJoint.Define(stage, path)  # fmt: skip
    joint.CreateBody0Rel().SetTargets([f"/{tree.name}/{link.parent}"])
    joint.CreateBody1Rel().SetTargets([own])
    joint.CreateAxisAttr(UsdPhysics.Tokens.x)
    _frames(joint, link.offset, geo.rotation_between([1.0, 0.0, 0.0], j.axis))
    scale = np.rad2deg(1.0) if j.kind == "revolute" else 1.0
    joint.CreateLowerLimitAttr(float(j.lower * scale))
    joint.CreateUpperLimitAttr(float(j.upper * scale))
    prim = joint.GetPrim()
    prim.AddAppliedSchema("NewtonJointAPI")
    for name, value in (
        ("newton:damping", j.damping / scale),
        ("newton:friction", j.frictionloss),
        ("newton:armature", ARMATURE[j.kind]),
    ):
        prim.CreateAttribute(name, Sdf.ValueTypeNames.Float, custom=False).Set(float(value))


def _frames(joint: UsdPhysics.Joint, position: Array, rotation: Array) -> None:
    """The joint's frame in both bodies: at `position` (3,) in the parent, at the origin of the child."""
    joint.CreateLocalPos0Attr(Gf.Vec3f(*map(float, position)))
    joint.CreateLocalRot0Attr(_quat(rotation))
    joint.CreateLocalPos1Attr(Gf.Vec3f(0, 0, 0))
    joint.CreateLocalRot1Attr(_quat(rotation))


def _visual(stage: Usd.Stage, path: str, link: Link, look: str, folder: Path) -> None:
    """A mesh with its colours twice: as a texture and as the display colours of its vertices."""
    mesh, baked = link.visual, bake(link.visual)
    faces = mesh.faces[baked.order]
    shape = _mesh(stage, path, Mesh(mesh.vertices, faces, mesh.colors))
    normals, index = corner_normals(mesh.vertices, faces)
    api = UsdGeom.PrimvarsAPI(shape)
    _primvar(api, "normals", Sdf.ValueTypeNames.Normal3fArray, _points(normals[index.ravel()]))
    png = ""
    if baked.image is not None and mesh.colors is not None:
        (folder / "textures").mkdir(exist_ok=True)
        png = "textures/" + write_image(baked.image, folder / "textures" / f"{link.name}.png")
        uv = Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(baked.uv, dtype=np.float32))
        _primvar(api, "st", Sdf.ValueTypeNames.TexCoord2fArray, uv)
        linear = _points(np.round((mesh.colors / 255.0) ** 2.2, 4))
        _primvar(api, "displayColor", Sdf.ValueTypeNames.Color3fArray, linear, UsdGeom.Tokens.vertex)
    _group(shape.GetPrim(), "MjcImageableAPI", 2)
    UsdShade.MaterialBindingAPI.Apply(shape.GetPrim()).Bind(_look(stage, look, mesh, png))


def _primvar(
    api: UsdGeom.PrimvarsAPI, name: str, kind: Sdf.ValueTypeName, value: object, where: str = "faceVarying"
) -> None:
    api.CreatePrimvar(name, kind, where).Set(value)


def _group(prim: Usd.Prim, schema: str, group: int) -> None:
    """MuJoCo's group: 2 is shown, 3 is for collision shapes."""
    prim.AddAppliedSchema(schema)
    prim.CreateAttribute("mjc:group", Sdf.ValueTypeNames.Int, False, Sdf.VariabilityUniform).Set(group)


def _hull(stage: Usd.Stage, path: str, mesh: Mesh) -> Usd.Prim:
    prim = _mesh(stage, path, mesh).GetPrim()
    UsdPhysics.MeshCollisionAPI.Apply(prim).CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
    return prim


def _mesh(stage: Usd.Stage, path: str, mesh: Mesh) -> UsdGeom.Mesh:
    shape = UsdGeom.Mesh.Define(stage, path)
    shape.CreatePointsAttr(_points(mesh.vertices))
    shape.CreateFaceVertexCountsAttr(_ints(np.full(len(mesh.faces), 3)))
    shape.CreateFaceVertexIndicesAttr(_ints(mesh.faces.ravel()))
    shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    shape.CreateExtentAttr(_points(np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])))
    return shape


def _look(stage: Usd.Stage, path: str, mesh: Mesh, png: str) -> UsdShade.Material:
    """A rough surface with the texture `png` (readers multiply it with the colour: white), else with the mean colour."""
    material, surface = _surface(stage, path, (1.0, 1.0, 1.0) if png else mean_color(mesh))
    if png:
        reader = UsdShade.Shader.Define(stage, f"{path}/coordinates")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        texture = UsdShade.Shader.Define(stage, f"{path}/texture")
        texture.CreateIdAttr("UsdUVTexture")
        texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./{png}")
        texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
        texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(
            reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        )
        color = surface.GetInput("diffuseColor")
        color.ConnectToSource(texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))
    return material


def _surface(
    stage: Usd.Stage, path: str, color: tuple[float, float, float]
) -> tuple[UsdShade.Material, UsdShade.Shader]:
    material = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*(c**2.2 for c in color)))
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.7)
    surface.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)  # MuJoCo warns when it is not authored
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    return material, surface


def _touch(stage: Usd.Stage, path: str, friction: float) -> UsdShade.Material:
    """Contact friction; with a surface, which MuJoCo asks of every material. Restitution is left out: MuJoCo has none."""
    material, _ = _surface(stage, path, (0.6, 0.3, 0.3))
    api = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    api.CreateStaticFrictionAttr(float(friction))
    api.CreateDynamicFrictionAttr(float(friction))
    return material


def _place(shape: UsdGeom.Xformable, pose: Array) -> None:
    shape.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, pose[:3, 3])))
    w, x, y, z = map(float, geo.quat_wxyz_from_matrix(pose[:3, :3]))
    shape.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, x, y, z))


def _quat(rotation: Array) -> Gf.Quatf:
    w, x, y, z = map(float, geo.quat_wxyz_from_matrix(rotation))
    return Gf.Quatf(w, x, y, z)


def _points(values: Array) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values + 0.0, dtype=np.float32))


def _ints(values: NDArray[np.integer]) -> Vt.IntArray:
    return Vt.IntArray.FromNumpy(np.ascontiguousarray(values, dtype=np.int32))

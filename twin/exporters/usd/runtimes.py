"""What only one physics runtime understands, each in a payload of its own so that no other reads it.

Resistance of joints is written in the runtime's own units: PhysX and Newton per degree, MuJoCo per radian.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from twin.exporters.tree import Link, Tree, TreeJoint
from twin.exporters.usd.layers import (
    group_path,
    instance_group,
    joint_path,
    link_path,
    new_layer,
    points,
    scope_path,
)
from twin.exporters.usd.physics import degrees_per
from twin.physics.simulation import HOLDING_IMPEDANCE
from twin.scene import Mesh

RUNTIMES = {"PhysX": "physx", "Newton": "newton", "MuJoCo": "mujoco"}  # variant set -> file stem
MUJOCO_MODEL = "runnables/mujoco/model.usda"
_DOC = "what it needs beyond UsdPhysics"
_FLOAT, _DOUBLE = Sdf.ValueTypeNames.Float, Sdf.ValueTypeNames.Double
_BEYOND = 0.02  # m: how far a grasp line reaches past what is held, on each side


def write_runtimes(tree: Tree, folder: Path) -> None:
    """Write physics/physx.usda, newton.usda and mujoco.usda, and mujoco/model.usda into `folder`."""
    with new_layer(folder / "mujoco" / "model.usda", tree.name, "MuJoCo: groups, sites, keyframes") as stage:
        stage.OverridePrim(f"/{tree.name}")
        _mujoco_model(stage, tree)
    writers = {"PhysX": _physx, "Newton": _newton, "MuJoCo": _mujoco_joints}
    for runtime, stem in RUNTIMES.items():
        with new_layer(folder / "physics" / f"{stem}.usda", tree.name, f"{runtime}: {_DOC}") as stage:
            stage.OverridePrim(f"/{tree.name}")
            writers[runtime](stage, tree)
            if runtime == "MuJoCo":
                stage.GetRootLayer().subLayerPaths.append("../mujoco/model.usda")


def _physx(stage: Usd.Stage, tree: Tree) -> None:
    """A drive without stiffness is a passive damper. The articulation starts at the asset's root: where it
    starts at a body, PhysX takes that for a floating base, which a further constraint then holds."""
    base = stage.OverridePrim(link_path(tree, tree.root.name))
    base.SetMetadata("apiSchemas", Sdf.TokenListOp.Create(deletedItems=["PhysicsArticulationRootAPI"]))
    UsdPhysics.ArticulationRootAPI.Apply(stage.OverridePrim(f"/{tree.name}"))
    for _, j in _joints(tree):
        prim = stage.OverridePrim(joint_path(tree, j.name))
        axis = "angular" if j.kind == "revolute" else "linear"
        drive = UsdPhysics.DriveAPI.Apply(prim, axis)
        drive.CreateTypeAttr(UsdPhysics.Tokens.force)
        drive.CreateStiffnessAttr(0.0)
        drive.CreateDampingAttr(float(j.damping / degrees_per(j.kind)))
        drive.CreateTargetVelocityAttr(0.0)
        prim.AddAppliedSchema(f"PhysxJointAxisAPI:{axis}")
        for name, value in (
            ("armature", j.armature),
            ("staticFrictionEffort", j.frictionloss),
            ("dynamicFrictionEffort", j.frictionloss),
        ):
            _author(prim, f"physxJointAxis:{axis}:{name}", _FLOAT, value)


def _newton(stage: Usd.Stage, tree: Tree) -> None:
    for link in tree.links:
        meshes = [name for name, piece in link.shapes.items() if isinstance(piece, Mesh)]
        for name in meshes:
            shape = stage.OverridePrim(f"{group_path(tree, link.name, 'colliders')}/{name}")
            shape.AddAppliedSchema("NewtonMeshCollisionAPI")
        if meshes:
            instance_group(stage, tree, link.name, "colliders")
    for _, j in _joints(tree):
        prim = stage.OverridePrim(joint_path(tree, j.name))
        prim.AddAppliedSchema("NewtonJointAPI")
        _author(prim, "newton:damping", _FLOAT, j.damping / degrees_per(j.kind))
        _author(prim, "newton:friction", _FLOAT, j.frictionloss)
        _author(prim, "newton:armature", _FLOAT, j.armature)


def _mujoco_joints(stage: Usd.Stage, tree: Tree) -> None:
    """MuJoCo 4 prefers newton:* and warns of these, but a runtime's payload holds only its own (RV.011)."""
    for _, j in _joints(tree):
        prim = stage.OverridePrim(joint_path(tree, j.name))
        prim.AddAppliedSchema("MjcJointAPI")
        _author(prim, "mjc:damping", _DOUBLE, j.damping, uniform=True)
        _author(prim, "mjc:frictionloss", _DOUBLE, j.frictionloss, uniform=True)
        _author(prim, "mjc:armature", _DOUBLE, j.armature, uniform=True)


def _mujoco_model(stage: Usd.Stage, tree: Tree) -> None:
    """Groups (2 shown, 3 collision shapes, 4 sites), friction without creep, grasp sites and keyframes."""
    for _, j in _joints(tree):
        if j.holds:
            prim = stage.OverridePrim(joint_path(tree, j.name))
            prim.AddAppliedSchema("MjcJointAPI")
            # and MuJoCo's own width, midpoint, power
            impedance = [HOLDING_IMPEDANCE, HOLDING_IMPEDANCE, 0.001, 0.5, 2.0]
            _author(prim, "mjc:solimpfriction", Sdf.ValueTypeNames.DoubleArray, impedance, uniform=True)
    for link in tree.links:
        path = link_path(tree, link.name)
        _mujoco_groups(stage, tree, link)
        if link.grasp is not None:
            site = UsdGeom.Sphere.Define(stage, f"{path}/{link.name}_grasp/{link.name}_grasp_site")
            site.CreateRadiusAttr(0.008)
            site.CreateExtentAttr(points(np.array([[-0.008] * 3, [0.008] * 3])))
            site.CreatePurposeAttr(UsdGeom.Tokens.guide)
            _group(site.GetPrim(), "MjcSiteAPI", 4)
    joints = [j for _, j in _joints(tree)]
    if not joints:
        return
    keys = UsdGeom.Scope.Define(stage, scope_path(tree, "Keyframes")).GetPath()
    for name, state in (("closed", [0.0] * len(joints)), ("open", [j.upper for j in joints])):
        key = stage.DefinePrim(keys.AppendChild(name), "MjcKeyframe")
        key.CreateAttribute("mjc:qpos", Sdf.ValueTypeNames.DoubleArray, custom=False).Set(state)


def _mujoco_groups(stage: Usd.Stage, tree: Tree, link: Link) -> None:
    for shown in link.visuals:
        shape = stage.OverridePrim(f"{group_path(tree, link.name, 'visuals')}/{shown.name}")
        _group(shape, "MjcImageableAPI", 2)
    for name in link.shapes:
        shape = stage.OverridePrim(f"{group_path(tree, link.name, 'colliders')}/{name}")
        _group(shape, "MjcCollisionAPI", 3)
    if link.visuals:
        instance_group(stage, tree, link.name, "visuals")
    if link.shapes:
        instance_group(stage, tree, link.name, "colliders")


def _joints(tree: Tree) -> list[tuple[Link, TreeJoint]]:
    return [(k, k.joint) for k in tree.links if k.joint is not None]


def _author(
    prim: Usd.Prim, name: str, kind: Sdf.ValueTypeName, value: float | list[float], uniform: bool = False
) -> None:
    variability = Sdf.VariabilityUniform if uniform else Sdf.VariabilityVarying
    prim.CreateAttribute(name, kind, False, variability).Set(value)


def _group(prim: Usd.Prim, schema: str, group: int) -> None:
    prim.AddAppliedSchema(schema)
    _author(prim, "mjc:group", Sdf.ValueTypeNames.Int, group, uniform=True)


def write_grasps(tree: Tree, folder: Path) -> None:
    """Write grasps.usda: per grasp a line between the two fingers, through what is held.

    Named as SimReady looks for them (requirement GSP.001); kept apart because MuJoCo can't compile curves.
    """
    held = [k for k in tree.links if k.grasp is not None]
    if not held:
        return
    folder.mkdir()
    with new_layer(folder / "grasps.usda", tree.name, "Grasp lines: from finger to finger") as stage:
        stage.OverridePrim(f"/{tree.name}")
        for link in held:
            half = link.grasp_width / 2 + _BEYOND
            line = np.array([[-half, 0.0, 0.0], [half, 0.0, 0.0]])
            frame = f"{link_path(tree, link.name)}/{link.name}_grasp"
            curve = UsdGeom.BasisCurves.Define(stage, f"{frame}/grasp_identifier_{link.name}")
            curve.CreateTypeAttr(UsdGeom.Tokens.linear)
            curve.CreateCurveVertexCountsAttr([2])
            curve.CreatePointsAttr(points(line))
            curve.CreateWidthsAttr([0.002])
            curve.SetWidthsInterpolation(UsdGeom.Tokens.constant)
            curve.CreateExtentAttr(UsdGeom.Boundable.ComputeExtentFromPlugins(curve, Usd.TimeCode.Default()))
            curve.CreatePurposeAttr(UsdGeom.Tokens.guide)
            curve.CreateDisplayColorAttr([Gf.Vec3f(0.1, 0.8, 0.2)])

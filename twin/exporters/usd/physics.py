"""Physics that every reader understands: plain UsdPhysics, nothing of a runtime."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade

from twin import geometry as geo
from twin.exporters.tree import Link, Tree
from twin.exporters.usd.layers import (
    group_path,
    joint_path,
    link_path,
    new_layer,
    quat,
    scope_path,
    shape_materials,
    vec,
)
from twin.exporters.usd.looks import define_surface
from twin.geometry import Array
from twin.scene import Mesh


def write_physics(tree: Tree, payload: Path) -> None:
    """Write Physics.usda into `payload`: bodies, masses, joints (limits in degrees or metres), materials."""
    with new_layer(payload / "Physics.usda", tree.name, "Bodies, joints, contact (UsdPhysics)") as stage:
        stage.OverridePrim(f"/{tree.name}")
        for link in tree.links:
            _body(stage, tree, link)
        UsdGeom.Scope.Define(stage, scope_path(tree, "Joints"))
        for link in tree.links:
            _joint(stage, tree, link)


def degrees_per(kind: str) -> float:
    """UsdPhysics measures angles in degrees: this many of its units make one of ours (rad or m)."""
    return float(np.rad2deg(1.0)) if kind == "revolute" else 1.0


def _body(stage: Usd.Stage, tree: Tree, link: Link) -> None:
    path = link_path(tree, link.name)
    body = stage.OverridePrim(path)
    UsdPhysics.RigidBodyAPI.Apply(body)
    if link is tree.root:  # MuJoCo takes whatever is the root for a body
        UsdPhysics.ArticulationRootAPI.Apply(body)
    others = [first for first, second in tree.filtered if second == link.name]
    if others:
        pairs = UsdPhysics.FilteredPairsAPI.Apply(body).CreateFilteredPairsRel()
        for other in others:
            pairs.AddTarget(link_path(tree, other))
    _mass(body, link)
    if tree.whole and not link.shapes:
        return  # no prototype that could hold its material
    kept = shape_materials(stage, tree, link.name, "colliders")
    touch = _touch(stage, f"{kept}/{link.name}_contact", link.friction)
    for name, piece in link.shapes.items():
        shape = stage.OverridePrim(f"{group_path(tree, link.name, 'colliders')}/{name}")
        UsdPhysics.CollisionAPI.Apply(shape)
        if isinstance(piece, Mesh):
            UsdPhysics.MeshCollisionAPI.Apply(shape).CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
        binding = UsdShade.MaterialBindingAPI.Apply(shape)
        # some readers look only at the all-purpose binding, MuJoCo only at the physics one
        binding.Bind(touch)
        binding.Bind(touch, UsdShade.Tokens.weakerThanDescendants, "physics")


def _mass(body: Usd.Prim, link: Link) -> None:
    """Mass, centre, principal moments and axes together: with mass alone, readers fall back to a density."""
    moments, axes = np.linalg.eigh(link.inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    api = UsdPhysics.MassAPI.Apply(body)
    api.CreateMassAttr(float(link.mass))
    api.CreateCenterOfMassAttr(vec(link.com))
    api.CreateDiagonalInertiaAttr(vec(moments))
    api.CreatePrincipalAxesAttr(quat(axes))


def _touch(stage: Usd.Stage, path: str, friction: float) -> UsdShade.Material:
    """Contact friction, with the surface that MuJoCo asks for. No restitution: MuJoCo has none."""
    material = UsdShade.Material(define_surface(stage, path, (0.6, 0.3, 0.3)).GetPrim().GetParent())
    api = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    api.CreateStaticFrictionAttr(float(friction))
    api.CreateDynamicFrictionAttr(float(friction))
    return material


def _joint(stage: Usd.Stage, tree: Tree, link: Link) -> None:
    own = link_path(tree, link.name)
    if link.joint is None:
        fixed = UsdPhysics.FixedJoint.Define(stage, joint_path(tree, f"{link.name}_to_world"))
        fixed.CreateBody1Rel().SetTargets([own])
        _frames(fixed, np.zeros(3), np.eye(3))
        return
    j = link.joint
    kind = UsdPhysics.RevoluteJoint if j.kind == "revolute" else UsdPhysics.PrismaticJoint
    joint = kind.Define(stage, joint_path(tree, j.name))
    joint.CreateBody0Rel().SetTargets([link_path(tree, str(link.parent))])
    joint.CreateBody1Rel().SetTargets([own])
    joint.CreateAxisAttr(UsdPhysics.Tokens.x)
    _frames(joint, link.offset, geo.rotation_between([1.0, 0.0, 0.0], j.axis))
    joint.CreateLowerLimitAttr(float(j.lower * degrees_per(j.kind)))
    joint.CreateUpperLimitAttr(float(j.upper * degrees_per(j.kind)))
    if j.catch is not None:
        told = {"force": j.catch.force, "width": j.catch.width, "source": j.catch.sources[0]}
        joint.GetPrim().SetCustomDataByKey("catch", told)  # in our units; no schema has a word for it


def _frames(joint: UsdPhysics.Joint, position: Array, rotation: Array) -> None:
    """The joint's frame in both bodies: at `position` (3,) in the parent, at the origin of the child."""
    joint.CreateLocalPos0Attr(vec(position))
    joint.CreateLocalRot0Attr(quat(rotation))
    joint.CreateLocalPos1Attr(vec(np.zeros(3)))
    joint.CreateLocalRot1Attr(quat(rotation))

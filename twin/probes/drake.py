"""Drake reads URDF and MJCF."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, GeometrySet
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import JointActuatorIndex
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from .common import around, bounds, keep, pose, tensor

VERSION = version("drake")
ACCURACY = 1e-7  # relative, of its error-controlled integrator


def read(path: Path, fmt: str, job: dict[str, Any]) -> dict[str, Any]:
    """Measure every part of the model in `path`, as a continuous plant: joint limits play no role in it."""
    del fmt
    parts = job["parts"]
    builder = DiagramBuilder()
    plant, scene = AddMultibodyPlantSceneGraph(builder, 0.0)
    Parser(builder).AddModels(str(path))
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    context = plant.GetMyMutableContextFromRoot(root)
    joints = {n: plant.GetJointByName(f"{n}_joint") for n in parts}
    index = [joints[n].position_start() for n in parts]
    plant.SetPositions(context, np.zeros(plant.num_positions()))
    out = {n: _part(plant, scene, context, joints[n], n) for n in parts}
    rest = {n: _place(plant, context, n) for n in parts}
    for row in job["states"]:
        q = np.zeros(plant.num_positions())
        q[index] = row
        plant.SetPositions(context, q)
        for n in parts:
            out[n]["motion"].append((_place(plant, context, n) @ np.linalg.inv(rest[n])).tolist())
    q = np.zeros(plant.num_positions())
    q[index] = job["state"]
    plant.SetPositions(context, q)
    keep(out, "mass_diagonal", np.diag(plant.CalcMassMatrix(context))[index], parts)
    everything = GeometrySet(scene.model_inspector().GetAllGeometryIds())
    scene.collision_filter_manager(scene.GetMyMutableContextFromRoot(root)).Apply(
        CollisionFilterDeclaration().ExcludeWithin(everything)
    )
    simulator = Simulator(diagram, root)
    simulator.get_mutable_integrator().set_target_accuracy(ACCURACY)
    speed = np.zeros(plant.num_velocities())
    q[index], speed[[joints[n].velocity_start() for n in parts]] = job["position"], job["velocity"]
    plant.SetPositions(context, q)
    plant.SetVelocities(context, speed)
    course = []
    for until in job["times"]:
        simulator.AdvanceTo(until)
        course.append(plant.GetPositions(context)[index])
    keep(out, "rollout", np.array(course), parts)
    return out


def _place(plant: Any, context: Any, name: str) -> Any:
    return plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(name)).GetAsMatrix4()


def _part(plant: Any, scene: Any, context: Any, joint: Any, name: str) -> dict[str, Any]:
    frame = joint.frame_on_parent().CalcPoseInWorld(context)
    kind = joint.type_name()
    axis = joint.revolute_axis() if kind == "revolute" else joint.translation_axis()
    body = plant.GetBodyByName(name)
    place = plant.EvalBodyPoseInWorld(context, body)
    inertia = body.CalcSpatialInertiaInBodyFrame(context)
    about_com = inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    actuators = [plant.get_joint_actuator(JointActuatorIndex(i)) for i in range(plant.num_actuators())]
    mine = [a for a in actuators if a.joint().index() == joint.index()]
    inspector = scene.model_inspector()
    shapes = [
        g
        for g in inspector.GetAllGeometryIds()
        if plant.GetBodyFromFrameId(inspector.GetFrameId(g)) is not None
        and plant.GetBodyFromFrameId(inspector.GetFrameId(g)).index() == body.index()
    ]
    out: dict[str, Any] = {
        "parent": joint.parent_body().name(),
        "type": kind,
        "axis": (frame.rotation().matrix() @ axis).tolist(),
        "pivot": frame.translation().tolist(),
        "lower": float(joint.position_lower_limits()[0]),
        "upper": float(joint.position_upper_limits()[0]),
        "damping": float(joint.default_damping_vector()[0]),
        # Drake knows the inertia of a rotor behind a gear, which belongs to an actuator
        "armature": float(sum(a.default_reflected_inertia() for a in mine)),
        "mass": float(inertia.get_mass()),
        "com": (place @ inertia.get_com()).tolist(),
        "inertia": tensor(place.rotation().matrix(), about_com),
        "motion": [],
    }
    touch = [inspector.GetProximityProperties(g) for g in shapes]
    friction = [
        p.GetProperty("material", "coulomb_friction").dynamic_friction()
        for p in touch
        if p is not None and p.HasProperty("material", "coulomb_friction")
    ]
    out["friction"] = [min(friction), max(friction)] if friction else None
    found = []
    for g in shapes:
        hull = inspector.GetConvexHull(g)
        if inspector.GetIllustrationProperties(g) is not None and hull is not None:
            corners = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
            in_world = place.GetAsMatrix4() @ inspector.GetPoseInFrame(g).GetAsMatrix4()
            found.append(bounds(corners, pose(in_world[:3, :3], in_world[:3, 3])))
    if found:
        out["bounds"] = around(found)
    return out

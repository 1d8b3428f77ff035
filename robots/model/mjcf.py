"""The MuJoCo model of a robot: the file as it is, plus what a robot file adds to it.

A URDF has no actuators and no sites, and a published MJCF may press with a gripper too weak to open anything.
So a robot file may give the tool point and the servos' stiffness; these joints' actuators are then replaced.
"""

from __future__ import annotations

import mujoco

from robots.model.spec import RobotSpec
from twin.errors import InputError
from twin.lint.xml import read_xml

_OVER = 0.01  # m of squeeze at which the gripper presses with its full force


def robot_model(spec: RobotSpec) -> mujoco.MjSpec:
    """A fresh, editable model of the robot alone.

    Raises InputError when the file is no XML or declares a document type (robot files may come from
    anywhere), MuJoCo can't read it, or it lacks a body or joint that the robot file names.
    """
    read_xml(spec.model)
    try:
        model = mujoco.MjSpec.from_file(str(spec.model))
    except (ValueError, OSError) as e:
        raise InputError(
            f"robot model {spec.model} can't be read: {' '.join(str(e).split())}",
            "give an MJCF or URDF file that MuJoCo loads",
        ) from e
    model.compiler.fusestatic = False
    if spec.tool_body:
        body = model.body(spec.tool_body)
        if body is None:
            raise InputError(f"robot {spec.name!r} names the body {spec.tool_body!r}, which its model lacks")
        body.add_site(name=spec.tool, pos=spec.tool_position, quat=spec.tool_quat_wxyz)
    if len(spec.stiffness):
        _drive(model, spec)
    return model


def compiled(spec: RobotSpec) -> mujoco.MjModel:
    """The robot alone, ready to be computed with. Raises InputError like `robot_model`."""
    model = robot_model(spec)
    try:
        return model.compile()
    except ValueError as e:
        raise InputError(f"MuJoCo refuses the robot model {spec.model}: {' '.join(str(e).split())}") from e


def _drive(model: mujoco.MjSpec, spec: RobotSpec) -> None:
    """Servos force = kp (ctrl - q) - kd qd, gravity compensated, for the arm, and a force-limited gripper."""
    for actuator in list(model.actuators):
        model.delete(actuator)
    for body in model.bodies[1:]:
        body.gravcomp = 1.0
    for k, name in enumerate(spec.arm_joints):
        joint = _joint(model, name, spec)
        joint.actgravcomp = True
        joint.actfrclimited, joint.actfrcrange = 1, [-spec.effort[k], spec.effort[k]]
        joint.armature = max(float(joint.armature), 0.05)
        servo = _servo(model, spec.arm_actuators[k], spec.stiffness[k], spec.damping[k], spec.effort[k])
        servo.trntype, servo.target = mujoco.mjtTrn.mjTRN_JOINT, name
        servo.ctrllimited, servo.ctrlrange = 1, joint.range
    first, *others = spec.gripper_joints
    tendon = model.add_tendon(name=f"{spec.gripper_actuator}_opening")
    for name in spec.gripper_joints:
        # a reflected inertia of about 1 kg, without which soft contacts give way under the grip
        joint = _joint(model, name, spec)
        joint.armature, joint.damping = 1.0, [1200.0, 0.0, 0.0]
        tendon.wrap_joint(name, 1.0)
    for name in others:
        model.add_equality(
            type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT, name1=first, name2=name,
            data=[0.0, 1.0, *[0.0] * 10],
        )  # fmt: skip
    servo = _servo(model, spec.gripper_actuator, spec.force / _OVER, 120.0, spec.force)
    servo.trntype, servo.target = mujoco.mjtTrn.mjTRN_TENDON, tendon.name


def _servo(model: mujoco.MjSpec, name: str, kp: float, kd: float, limit: float) -> mujoco.MjsActuator:
    servo = model.add_actuator(
        name=name, gaintype=mujoco.mjtGain.mjGAIN_FIXED, biastype=mujoco.mjtBias.mjBIAS_AFFINE
    )
    servo.gainprm = [kp, *[0.0] * 9]
    servo.biasprm = [0.0, -kp, -kd, *[0.0] * 7]
    servo.forcelimited, servo.forcerange = 1, [-limit, limit]
    return servo


def _joint(model: mujoco.MjSpec, name: str, spec: RobotSpec) -> mujoco.MjsJoint:
    joint = model.joint(name)
    if joint is None:
        raise InputError(
            f"robot {spec.name!r} names {name!r}, which its model {spec.model.name} does not have",
            f"its joints are: {', '.join(j.name for j in model.joints)}",
        )
    return joint

"""The MuJoCo scene of a replay: a twin's collision geometry, its joints, and a robot on its pedestal.

Collision groups: robot 1, parts 2, static 4. The robot meets everything, itself included; parts and static scene don't
meet each other, because their reconstructed surfaces touch at the seams.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.model.mjcf import robot_model
from robots.model.spec import RobotSpec
from robots.part_physics import frictionloss, inertial_of, joint_damping, part_friction
from robots.scene.paint import painted
from twin import geometry as geo
from twin.errors import PlanningError
from twin.geometry import Array
from twin.physics import armature, static_friction, with_physics
from twin.scene import Box, Collision, Mesh, Part, Revolute, Twin

AnyArray = NDArray[Any]
ROBOT, PART, STATIC = 1, 2, 4
PREFIX = "robot_"
_MOUNT = "robot_mount"
PEDESTAL = "robot_pedestal"
TIMESTEP = 0.002  # s; 4 ms still works, 2 ms leaves room for stiff contacts

_MADE: WeakKeyDictionary[Twin, Twin] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class World:
    """A compiled scene and where its pieces are.

    part_qpos, part_dof: address of each part id's joint. arm_qpos, arm_dof (n,), gripper_qpos (k,): addresses.
    arm_ctrl (n,), gripper_ctrl: actuators. tool: site id. owner: (ngeom,) 0 nothing, else ROBOT, PART or STATIC.
    finger: (ngeom,) True on the fingers. geom_part: (ngeom,) part id or 0.
    """

    model: mujoco.MjModel
    spec: RobotSpec
    part_qpos: dict[int, int]
    part_dof: dict[int, int]
    arm_qpos: AnyArray
    arm_dof: AnyArray
    arm_ctrl: AnyArray
    gripper_qpos: AnyArray
    gripper_ctrl: int
    tool: int
    mount: int
    owner: AnyArray
    finger: AnyArray
    geom_part: AnyArray

    def move_base(self, T_world_base: Array) -> None:
        """Set the robot's base pose (4, 4)."""
        self.model.body_pos[self.mount] = T_world_base[:3, 3]
        self.model.body_quat[self.mount] = geo.quat_wxyz_from_matrix(T_world_base[:3, :3])

    def set_stiffness(self, share: float) -> None:
        """Scale the arm's servos: stiffness by `share`, damping by its square root, so that the damping ratio stays."""
        self.model.actuator_gainprm[self.arm_ctrl, 0] *= share
        self.model.actuator_biasprm[self.arm_ctrl, 1] *= share
        self.model.actuator_biasprm[self.arm_ctrl, 2] *= np.sqrt(share)


def with_collision(twin: Twin) -> Twin:
    """The twin with collision geometry for its static part and every part, masses and friction; made when missing.

    Remembered as long as the twin lives, so that a plan and its replay make it once and get the same.
    """
    shaped = bool(twin.static.collision) and all(p.collision for p in twin.parts)
    if shaped and all(p.inertial is not None and p.physics is not None for p in twin.parts):
        return twin
    if twin not in _MADE:
        if shaped:  # a stated shape may be anything; masses need no more than the surface
            _MADE[twin] = with_physics(twin)
        else:
            from twin.exporters import complete

            _MADE[twin] = complete(twin)
    return _MADE[twin]


def build_world(
    twin: Twin, spec: RobotSpec, T_world_base: Array, pedestal: float, *, visual: bool = False
) -> World:
    """Compile the scene.

    Args:
        twin: its static part and parts need collision geometry, its parts mass and friction (see `with_collision`).
        T_world_base: base pose (4, 4).
        pedestal: height in metres of the column under the base (0: none).
        visual: add the coloured meshes that a video shows.

    Raises:
        PlanningError: a part has no collision geometry, or MuJoCo refuses the scene.
    """
    scene = mujoco.MjSpec()
    scene.modelname = twin.name
    scene.compiler.degree = False
    scene.option.timestep = TIMESTEP
    scene.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    scene.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    scene.option.impratio = 10.0
    scene.visual.headlight.ambient = [0.45, 0.45, 0.45]
    scene.visual.headlight.diffuse = [0.5, 0.5, 0.5]
    if visual:
        _add_sky(scene)
    _add_static(scene, twin, visual)
    bodies: dict[int, mujoco.MjsBody] = {}
    for part in _parents_first(twin):
        parent = scene.worldbody if part.parent is None else bodies[part.parent]
        bodies[part.id] = _add_part(scene, parent, part, visual)
    _add_robot(scene, spec, T_world_base, pedestal)
    try:
        model = scene.compile()
    except ValueError as e:
        raise PlanningError(f"MuJoCo refuses the scene of twin {twin.name!r}: {e}", "run `twin check`") from e
    return _index(model, twin, spec)


def _add_sky(scene: mujoco.MjSpec) -> None:
    scene.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.86, 0.89, 0.93],
        rgb2=[0.55, 0.58, 0.62],
        width=256,
        height=1536,
    )


def _parents_first(twin: Twin) -> list[Part]:
    ordered: list[Part] = []
    while len(ordered) < len(twin.parts):
        done = {p.id for p in ordered}
        ordered += [p for p in twin.parts if p.id not in done and (p.parent is None or p.parent in done)]
    return ordered


def _add_static(scene: mujoco.MjSpec, twin: Twin, visual: bool) -> None:
    body, friction = scene.worldbody.add_body(name=f"static_{twin.static.name}"), static_friction(twin)
    for k, shape in enumerate(twin.static.collision):
        _add_shape(scene, body, shape, f"static_{k}", STATIC, friction)
    if visual:
        _add_paint(scene, body, twin.static.mesh, "static", 24, 40_000)


def _add_part(scene: mujoco.MjSpec, parent: mujoco.MjsBody, part: Part, visual: bool) -> mujoco.MjsBody:
    if not part.collision:
        raise PlanningError(
            f"part {part.name!r} has no collision geometry", "make it with twin.collision.with_collision"
        )
    body = parent.add_body(name=f"part_{part.id}")
    joint, own = part.joint, inertial_of(part)
    kind = mujoco.mjtJoint.mjJNT_HINGE if isinstance(joint, Revolute) else mujoco.mjtJoint.mjJNT_SLIDE
    body.add_joint(
        name=f"part_{part.id}",
        type=kind,
        axis=joint.axis,
        pos=joint.pivot if isinstance(joint, Revolute) else [0, 0, 0],
        limited=True,
        range=[joint.lower, joint.upper],
        damping=joint_damping(part),
        frictionloss=frictionloss(part),
        armature=armature(joint, own),
    )
    t = own.inertia
    body.explicitinertial = True
    body.mass, body.ipos = own.mass.value, own.com
    body.fullinertia = [t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2]]
    for k, shape in enumerate(part.collision):
        _add_shape(scene, body, shape, f"part_{part.id}_{k}", PART, part_friction(part))
    if visual:
        _add_paint(scene, body, part.mesh, f"part_{part.id}", 12, 20_000)
    return body


def _add_shape(
    scene: mujoco.MjSpec, body: mujoco.MjsBody, shape: Collision, name: str, group: int, friction: float
) -> None:
    common = {
        "name": name,
        "contype": group,
        "conaffinity": ROBOT,
        "group": 5,
        "mass": 0.0,
        "friction": [friction, 0.005, 0.0001],
    }
    if isinstance(shape, Box):
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=shape.size / 2,
            pos=shape.T_world_box[:3, 3],
            quat=geo.quat_wxyz_from_matrix(shape.T_world_box[:3, :3]),
            **common,
        )
        return
    scene.add_mesh(
        name=name,
        uservert=shape.vertices.ravel(),
        userface=shape.faces.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
    )
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **common)


def _add_paint(
    scene: mujoco.MjSpec, body: mujoco.MjsBody, mesh: Mesh, name: str, colours: int, faces: int
) -> None:
    for k, (piece, rgb) in enumerate(painted(mesh, colours, faces)):
        scene.add_mesh(
            name=f"{name}_paint_{k}",
            uservert=piece.vertices.ravel(),
            userface=piece.faces.ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=f"{name}_paint_{k}",
            contype=0,
            conaffinity=0,
            group=2,
            mass=0.0,
            rgba=[*rgb, 1.0],
        )


def _add_robot(scene: mujoco.MjSpec, spec: RobotSpec, T_world_base: Array, pedestal: float) -> None:
    mount = scene.worldbody.add_body(
        name=_MOUNT, pos=T_world_base[:3, 3], quat=geo.quat_wxyz_from_matrix(T_world_base[:3, :3])
    )
    if pedestal > 0.02:
        mount.add_geom(
            name=PEDESTAL,
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[spec.footprint, pedestal / 2 - 0.005, 0],
            pos=[-0.04, 0, -pedestal / 2],
            contype=ROBOT,
            conaffinity=0,
            group=3,
            rgba=[0.45, 0.47, 0.5, 1],
        )
    child = robot_model(spec)
    for geom in child.geoms:
        if geom.contype or geom.conaffinity:
            geom.contype, geom.conaffinity = ROBOT, ROBOT | PART | STATIC
    for name in spec.arm_actuators:  # commands carry velocity and torque too; the force stays limited
        child.actuator(name).ctrllimited = 0
    scene.attach(child, prefix=PREFIX, frame=mount.add_frame())


def _index(model: mujoco.MjModel, twin: Twin, spec: RobotSpec) -> World:
    def qpos(name: str) -> int:
        return int(model.jnt_qposadr[model.joint(name).id])

    def dof(name: str) -> int:
        return int(model.jnt_dofadr[model.joint(name).id])

    part_of_body = {model.body(f"part_{p.id}").id: p.id for p in twin.parts}
    fingers = {model.body(PREFIX + b).id for b in spec.finger_bodies}
    robot_root = model.body(_MOUNT).id
    owner, geom_part = np.zeros(model.ngeom, dtype=int), np.zeros(model.ngeom, dtype=int)
    for g in range(model.ngeom):
        body = int(model.geom_bodyid[g])
        geom_part[g] = part_of_body.get(body, 0)
        owner[g] = PART if body in part_of_body else ROBOT if _inside(model, body, robot_root) else STATIC
    arm = [PREFIX + j for j in spec.arm_joints]
    return World(
        model=model,
        spec=spec,
        part_qpos={p.id: qpos(f"part_{p.id}") for p in twin.parts},
        part_dof={p.id: dof(f"part_{p.id}") for p in twin.parts},
        arm_qpos=np.array([qpos(j) for j in arm]),
        arm_dof=np.array([dof(j) for j in arm]),
        arm_ctrl=np.array([model.actuator(PREFIX + a).id for a in spec.arm_actuators]),
        gripper_qpos=np.array([qpos(PREFIX + j) for j in spec.gripper_joints]),
        gripper_ctrl=int(model.actuator(PREFIX + spec.gripper_actuator).id),
        tool=int(model.site(PREFIX + spec.tool).id),
        mount=int(robot_root),
        owner=owner,
        finger=np.isin(model.geom_bodyid, list(fingers)),
        geom_part=geom_part,
    )


def _inside(model: mujoco.MjModel, body: int, root: int) -> bool:
    while body > 0:
        if body == root:
            return True
        body = int(model.body_parentid[body])
    return False

"""The MuJoCo scene of a replay: the twin's exported MJCF, with a robot on its pedestal attached to it.

What a part weighs, how it resists, its shapes, the time step and the solver are the export's, so that the
check of the exported asset holds for the replay. This file adds the robot, and says who meets whom.
"""

from __future__ import annotations

import warnings
from collections.abc import Set
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.model.mjcf import robot_model
from robots.model.skin import Skin
from robots.model.spec import RobotSpec
from robots.model.wear import wear
from twin import geometry as geo
from twin.completion import has_completion
from twin.completion.asset import is_reconstructed
from twin.errors import PlanningError
from twin.exporters import complete
from twin.exporters.mjcf import document
from twin.exporters.tree import build_tree, joint_name
from twin.files.paths import AnyPath
from twin.geometry import Array
from twin.physics import with_physics
from twin.scene import Twin

AnyArray = NDArray[Any]
# Bits of MuJoCo's contact masks. The robot meets everything, itself included. Parts and static scene do not
# meet each other: their surfaces touch at seams, where a contact would brake what the hand moves.
ROBOT, PART, STATIC = 1, 2, 4
# Twins' names hold no slash, so none of theirs is ever one of these.
PREFIX = "robot/"
PEDESTAL = "stand/pedestal"
# geom group that the film leaves out; the robot's own shapes are in the export's group of collision shapes
_HIDDEN = 5


@dataclass(frozen=True, eq=False)
class World:
    """A compiled scene and where its pieces are.

    part_qpos, part_dof: address of each part id's joint. arm_qpos, arm_dof (n,), gripper_qpos (k,):
    addresses. arm_ctrl (n,), gripper_ctrl: actuators. tool: site id. owner: (ngeom,) 0 nothing, else ROBOT,
    PART or STATIC. finger: (ngeom,) True on the fingers. geom_part: (ngeom,) part id or 0.
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

    def body_of(self, geom: int) -> str:
        """Name of a geom's body in the twin or the robot's own model, with an inferred piece's own."""
        body = str(self.model.body(self.model.geom_bodyid[geom]).name).rpartition("/")[2]
        if self.owner[geom] not in (PART, STATIC):
            return body
        name = str(self.model.geom(geom).name).removeprefix(f"{body}_")
        piece = name.rpartition("_collision_")[0]
        return f"{body}: inferred {piece}" if piece else body

    def set_stiffness(self, share: float) -> None:
        """Scale the arm's servos: stiffness by `share`, damping by its root, for one damping ratio."""
        self.model.actuator_gainprm[self.arm_ctrl, 0] *= share
        self.model.actuator_biasprm[self.arm_ctrl, 1] *= share
        self.model.actuator_biasprm[self.arm_ctrl, 2] *= np.sqrt(share)


def completed(twin: Twin, cache_dir: AnyPath | None = None) -> Twin:
    """The twin with collision shapes for static scene and parts, masses and friction: itself if it has all.

    Who plans and replays makes it once and passes it on. cache_dir: where shapes are kept between runs.
    """
    if is_complete(twin):
        return twin
    if not _is_shaped(twin):
        return complete(twin, cache_dir)
    return with_physics(twin)  # a stated shape may be anything; masses need no more than the surface


def is_complete(twin: Twin) -> bool:
    """Whether the twin has all that `completed` gives."""
    return _is_shaped(twin) and all(p.inertial is not None and p.physics is not None for p in twin.parts)


def _is_shaped(twin: Twin) -> bool:
    if is_reconstructed(twin) and twin.parts:
        return has_completion(twin)
    return bool(twin.static.collision) and all(p.collision for p in twin.parts)


def build_world(
    twin: Twin,
    spec: RobotSpec,
    T_world_base: Array,
    pedestal: float,
    *,
    visual: bool = False,
    skin: Skin | None = None,
) -> World:
    """Compile the scene.

    Args:
        twin: its parts need mass and friction (see `completed`); nothing touches what has no collision
            shapes.
        T_world_base: base pose (4, 4).
        pedestal: height in metres of the column under the base (0: none).
        visual: with what is drawn, for a video.
        skin: what the robot wears in place of its own shapes, which then touch as before, but are not drawn.

    Raises:
        SceneError: a part that can't be exported. PlanningError: MuJoCo refuses the scene.
    """
    return compiled_world(
        editable_scene(twin, spec, T_world_base, pedestal, visual=visual, skin=skin), twin, spec
    )


def editable_scene(
    twin: Twin,
    spec: RobotSpec,
    T_world_base: Array,
    pedestal: float,
    *,
    visual: bool = False,
    skin: Skin | None = None,
) -> mujoco.MjSpec:
    """The scene before it is compiled; arguments and errors as of `build_world`."""
    try:
        tree = build_tree(twin, visual)
        scene = document(tree).spec()
        _set_masks(scene, {k.name for k in tree.standing})
        if visual:
            _light(scene)
        _add_robot(scene, spec, T_world_base, pedestal, skin)
    except ValueError as e:
        raise _refused(twin, e) from e
    return scene


def compiled_world(scene: mujoco.MjSpec, twin: Twin, spec: RobotSpec) -> World:
    """A scene compiled, with the places of its pieces. Raises PlanningError where MuJoCo refuses it."""
    try:
        return _index(scene.compile(), twin, spec)
    except ValueError as e:
        raise _refused(twin, e) from e


def _refused(twin: Twin, error: ValueError) -> PlanningError:
    return PlanningError(f"MuJoCo refuses the scene of twin {twin.name!r}: {error}", "run `twin check`")


def _set_masks(scene: mujoco.MjSpec, standing: Set[str]) -> None:
    for geom in scene.geoms:
        if geom.contype:
            geom.contype, geom.conaffinity = STATIC if geom.parent.name in standing else PART, ROBOT
            geom.group = _HIDDEN


def _light(scene: mujoco.MjSpec) -> None:
    """Sky and light of a video."""
    scene.visual.headlight.ambient = [0.45, 0.45, 0.45]
    scene.visual.headlight.diffuse = [0.5, 0.5, 0.5]
    scene.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.86, 0.89, 0.93],
        rgb2=[0.55, 0.58, 0.62],
        width=256,
        height=1536,
    )


def _add_robot(
    scene: mujoco.MjSpec, spec: RobotSpec, T_world_base: Array, pedestal: float, skin: Skin | None
) -> None:
    mount = scene.worldbody.add_body(
        name=PEDESTAL, pos=T_world_base[:3, 3], quat=geo.quat_wxyz_from_matrix(T_world_base[:3, :3])
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
    if skin is not None:
        wear(child, skin, _HIDDEN)
    for geom in child.geoms:
        if geom.contype or geom.conaffinity:
            geom.contype, geom.conaffinity = ROBOT, ROBOT | PART | STATIC
    for name in spec.arm_actuators:  # commands carry velocity and torque too; the force stays limited
        child.actuator(name).ctrllimited = 0
    with warnings.catch_warnings():
        # the scene is attached to nothing: the robot's mesh files are read in place, a skin's from memory
        warnings.filterwarnings("ignore", "Attaching a child without asset dict")
        scene.attach(child, prefix=PREFIX, frame=mount.add_frame())


def _index(model: mujoco.MjModel, twin: Twin, spec: RobotSpec) -> World:
    def qpos(name: str) -> int:
        return int(model.jnt_qposadr[model.joint(name).id])

    def dof(name: str) -> int:
        return int(model.jnt_dofadr[model.joint(name).id])

    part_of_body = {model.body(p.name).id: p.id for p in twin.parts}
    fingers = {model.body(PREFIX + b).id for b in spec.finger_bodies}
    robot_root = model.body(PEDESTAL).id
    owner, geom_part = np.zeros(model.ngeom, dtype=int), np.zeros(model.ngeom, dtype=int)
    for g in range(model.ngeom):
        body = int(model.geom_bodyid[g])
        geom_part[g] = part_of_body.get(body, 0)
        owner[g] = PART if body in part_of_body else ROBOT if _inside(model, body, robot_root) else STATIC
    arm = [PREFIX + j for j in spec.arm_joints]
    return World(
        model=model,
        spec=spec,
        part_qpos={p.id: qpos(joint_name(p)) for p in twin.parts},
        part_dof={p.id: dof(joint_name(p)) for p in twin.parts},
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

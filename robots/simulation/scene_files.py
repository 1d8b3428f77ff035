"""A replay's scene as files: robot, twin and keyframes in one MJCF for plain MuJoCo, complete there."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco

from robots.model.mjcf import robot_model
from robots.model.skin import SHOWN
from robots.model.spec import RobotSpec
from robots.scene.world import PEDESTAL, PREFIX, World, compiled_world, editable_scene
from robots.trajectory import RobotTrajectory
from twin.exporters.tree import EFFORT_LIMIT, joint_name
from twin.scene import Twin

SCENE = "scene.xml"
_ASSETS = "assets"
_FLOOR = "replay_floor"
# The last sample of each phase is a keyframe of this name; the first sample is "start".
_KEYS = {"close": "grasp", "hold": "goal"}


def write_scene(folder: Path, twin: Twin, spec: RobotSpec, trajectory: RobotTrajectory) -> Path:
    """Write scene.xml and all files that it names, under assets/; returns its path.

    The simulated scene, to MuJoCo's six digits, and what a replay does not need: a motor for each joint of
    the twin, which does nothing while its control is 0; keyframes "start", "grasp" and "goal" with the
    controls that hold them; a floor to look at, and the robot's shapes where a viewer shows them.

    Raises PlanningError: MuJoCo refuses the scene.
    """
    scene = editable_scene(twin, spec, trajectory.T_world_base, trajectory.pedestal, visual=True)
    _add_motors(scene, twin)
    _show(scene, trajectory)
    for key in list(scene.keys):
        scene.delete(key)
    _add_keyframes(scene, compiled_world(scene, twin, spec), trajectory)
    scene.compile()
    text, assets = _with_own_files(scene.to_xml(), spec)
    assets = {name: bytes(content) for name, content in scene.assets.items()} | assets
    (folder / _ASSETS).mkdir(exist_ok=True)
    for name, content in assets.items():
        (folder / _ASSETS / name).write_bytes(content)
    path = folder / SCENE
    path.write_text(text, encoding="utf-8", newline="\n")
    return path


def _add_motors(scene: mujoco.MjSpec, twin: Twin) -> None:
    """A motor for each joint of the twin, in N m or N: without a command the joint stays passive."""
    for part in twin.parts:
        motor = scene.add_actuator(
            name=joint_name(part), target=joint_name(part), trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        motor.set_to_motor()
        limit = EFFORT_LIMIT[part.joint.kind]
        motor.ctrllimited, motor.ctrlrange = 1, [-limit, limit]


def _show(scene: mujoco.MjSpec, trajectory: RobotTrajectory) -> None:
    """A floor to look at, and, of a robot that draws nothing of its own, the shapes that touch."""
    if trajectory.floor is not None:
        scene.worldbody.add_geom(
            name=_FLOOR, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05], pos=[0, 0, trajectory.floor.height],
            contype=0, conaffinity=0, group=SHOWN, rgba=[0.7, 0.7, 0.68, 1],
        )  # fmt: skip
    own = [g for g in scene.geoms if g.parent.name == PEDESTAL or g.parent.name.startswith(PREFIX)]
    if not any(g.type == mujoco.mjtGeom.mjGEOM_MESH and g.group <= SHOWN for g in own):
        for geom in own:
            geom.group = min(geom.group, SHOWN)


def _add_keyframes(scene: mujoco.MjSpec, world: World, trajectory: RobotTrajectory) -> None:
    moments = {"start": 0}
    for phase, name in _KEYS.items():
        at = [k for k, p in enumerate(trajectory.phases) if p == phase]
        moments |= {name: at[-1]} if at else {}
    for name, k in moments.items():
        qpos, ctrl = world.model.qpos0.copy(), [0.0] * world.model.nu
        qpos[world.arm_qpos] = trajectory.q[k]
        qpos[world.gripper_qpos] = world.spec.jaws(float(trajectory.gripper[k]))
        qpos[world.part_qpos[trajectory.part_id]] = trajectory.part_state[k]
        for address, value in zip(world.arm_ctrl, trajectory.q[k], strict=True):
            ctrl[address] = float(value)
        ctrl[world.gripper_ctrl] = float(world.spec.gripper_command(trajectory.gripper[k]))
        scene.add_key(name=name, qpos=qpos, ctrl=ctrl)


def _with_own_files(text: str, spec: RobotSpec) -> tuple[str, dict[str, bytes]]:
    """The XML with the robot's own meshes and textures beside the twin's, and their content by name."""
    model = robot_model(spec)
    places = {"mesh": model.meshdir, "hfield": model.meshdir, "texture": model.texturedir}
    root = ET.fromstring(text)  # noqa: S314 - written by MuJoCo above
    files: dict[str, bytes] = {}
    known: dict[Path, str] = {}
    for kind, place in places.items():
        for element in root.iter(kind):
            file = element.get("file")
            if file is None or not str(element.get("name")).startswith(PREFIX):
                continue
            path = (Path(model.modelfiledir) / place / file).resolve()
            if path not in known:
                known[path] = f"robot_{len(known)}_{path.name}"
                files[known[path]] = path.read_bytes()
            element.set("file", known[path])
    for text_field in root.iter(
        "text"
    ):  # MuJoCo 4 writes one with an apostrophe as content, which it can't read
        if text_field.text:
            text_field.set("data", text_field.text)
            text_field.text = None
    return ET.tostring(root, encoding="unicode") + "\n", files

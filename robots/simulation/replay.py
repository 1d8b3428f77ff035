"""Plays a trajectory back in MuJoCo: the arm's own servos, contact and friction, nothing else."""

from __future__ import annotations

import copy
import logging
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from robots.config import SETTLE, ReplayConfig
from robots.demonstration import Demonstration
from robots.formats import native
from robots.model.catalog import resolve
from robots.model.kinematics import read_chain
from robots.model.mjcf import compiled
from robots.model.skin import skin_of
from robots.model.spec import RobotSpec
from robots.scene.as_handled import as_handled
from robots.scene.world import PART, ROBOT, STATIC, World, build_world, completed
from robots.simulation.impedance import EVERY, Impedance
from robots.simulation.record import Contact, Record
from robots.simulation.report import ReplayReport, measure
from robots.simulation.scene_files import write_scene
from robots.simulation.shown import Moments, write_shown
from robots.trajectory import PHASES, RobotTrajectory
from twin import geometry as geo
from twin.errors import InputError, PlanningError
from twin.files.atomic import contents, put, staging
from twin.files.paths import AnyPath
from twin.files.text import write_json
from twin.geometry import Array
from twin.runs.progress import shows_bar
from twin.scene import Part, Twin

_LOG = logging.getLogger(__name__)
FILM = "replay.mp4"
_RECORD_EVERY = 5  # simulation steps between samples: 10 ms


@shows_bar("replay")
def replay(
    twin: Twin,
    trajectory: RobotTrajectory,
    out: AnyPath | None = None,
    *,
    robot: AnyPath | None = None,
    video: bool = True,
    config: ReplayConfig | None = None,
    demonstration: Demonstration | None = None,
) -> ReplayReport:
    """Replay a trajectory and measure what happened. Deterministic.

    Args:
        twin: the one that was planned for.
        out: folder for trajectory.json, trajectory.npz, report.json, replay.mp4, scene.xml with assets/, and
            motion.json and robot.glb for the page (usually RUN/replay/<robot>/<part>), which change at once;
            nothing is written without it.
        robot: name or robot file when it is not the trajectory's own name.
        video: write replay.mp4.
        demonstration: the recording's frames; the film shows the person beside the robot, at the same state.

    Raises:
        SceneError: the twin has no such part. InputError: no such robot, another arm, unwritable folder.
        PlanningError: MuJoCo refuses the scene.
    """
    config = config or ReplayConfig()
    out = None if out is None else Path(out).resolve()
    found = twin
    twin, part = as_handled(twin, trajectory.part_id)
    spec = resolve(robot or trajectory.robot)
    if spec.arm_joints != trajectory.joint_names:
        raise InputError(
            f"the trajectory moves {trajectory.joint_names}, robot {spec.name!r} has {spec.arm_joints}",
            "replay it with the robot it was planned for",
        )
    twin = completed(twin)
    started = time.perf_counter()
    world = build_world(
        twin, spec, trajectory.T_world_base, trajectory.pedestal, visual=video and out is not None
    )
    moments = Moments()
    record, frames = simulate(world, trajectory, config, moments.see)
    wall = time.perf_counter() - started
    if out is None:
        return measure(record, trajectory, part, spec, wall, None)
    try:
        with staging(out) as staged:
            (staged / "trajectory.json").write_bytes(native.json_bytes(trajectory, part))
            (staged / "trajectory.npz").write_bytes(native.npz_bytes(trajectory, part))
            write_scene(staged, twin, spec, trajectory)
            film = staged / FILM
            shot = video and _filmed(film, (world, twin, part), trajectory, frames, config, demonstration)
            report = measure(record, trajectory, part, spec, wall, film.name if shot else None)
            write_json(staged / "report.json", report.to_json())
            write_shown(staged, world, (found, twin), moments, report)
            put(staged, out, contents(staged))
    except OSError as e:
        raise InputError(f"{out} can't be written ({e.strerror})", "choose another output folder") from e
    return report


def _filmed(
    path: Path,
    scene: tuple[World, Twin, Part],
    trajectory: RobotTrajectory,
    frames: Array,
    config: ReplayConfig,
    demonstration: Demonstration | None,
) -> bool:
    """Write the film of a scene: its world, twin and the part that moves; False where nothing can draw."""
    from robots.film.video import write_video

    world, twin, part = scene
    seen = _film_world(world, twin, trajectory)
    return write_video(path, seen, trajectory, part, frames, config, demonstration)


def _film_world(world: World, twin: Twin, trajectory: RobotTrajectory) -> World:
    """The scene for the film: with the real robot's visuals if on this machine, else the simulated one.

    It is another scene, so that a skin can't change the simulation; their joint positions are the same.
    """
    skin = skin_of(world.spec)
    if skin is None:
        return world
    try:
        return build_world(
            twin, world.spec, trajectory.T_world_base, trajectory.pedestal, visual=True, skin=skin
        )
    except PlanningError as e:  # the scene without the skin was compiled before
        _LOG.warning("%s is drawn with its own shapes: %s: %s", world.spec.name, skin.source, e.problem)
        return world


def simulate(
    world: World,
    trajectory: RobotTrajectory,
    config: ReplayConfig,
    observe: Callable[[mujoco.MjData], None] | None = None,
) -> tuple[Record, Array]:
    """Run the scene; returns the record and the joint positions (f, nq) of up to config.video_frames moments.

    The scene is left as it is: how the arm is driven is set on a copy. observe: called with the simulation
    before each step, its commands set; it must leave the simulation as it is.
    """
    world = replace(world, model=copy.copy(world.model))
    model, spec = world.model, world.spec
    if config.control == "position":
        world.set_stiffness(config.stiffness)
    data = mujoco.MjData(model)
    steps = int(np.ceil((trajectory.duration + SETTLE) / model.opt.timestep))
    times = np.arange(steps) * model.opt.timestep
    ctrl = _commands(world, trajectory, times)
    phase_at = np.searchsorted(trajectory.times, times).clip(0, len(trajectory.times) - 1)
    phases = np.array([PHASES.index(p) for p in trajectory.phases])[phase_at]
    phases[times > trajectory.times[-1]] = -1
    data.qpos[world.arm_qpos] = trajectory.q[0]
    data.qpos[world.part_qpos[trajectory.part_id]] = trajectory.start
    data.qpos[world.gripper_qpos] = spec.jaws(float(trajectory.gripper[0]))
    mujoco.mj_forward(model, data)
    recorder = _Recorder(world, trajectory.part_id, spec)
    # A trajectory without approach begins with the part in the hand: held still until fingers close.
    gripped = times[phases == PHASES.index("close")][-1] if trajectory.phases[0] == "close" else -1.0
    frame_at = set(np.linspace(0, steps - 1, config.video_frames).astype(int).tolist())
    frames = []
    impedance = None
    if config.control == "impedance":
        chain = read_chain(compiled(spec), spec)
        impedance = Impedance(world, trajectory, chain, times, config.stiffness)
    for k in range(steps):
        if impedance is None:
            data.ctrl[:] = ctrl[k]
        elif k % EVERY == 0:
            data.ctrl[:] = ctrl[k]
            impedance.command(data, k)
        if times[k] <= gripped:
            data.qpos[world.part_qpos[trajectory.part_id]] = trajectory.start
            data.qvel[world.part_dof[trajectory.part_id]] = 0.0
        if observe:
            observe(data)
        mujoco.mj_step(model, data)
        if k % _RECORD_EVERY == _RECORD_EVERY - 1 or k == steps - 1:
            recorder.take(data, int(phases[k]))
        if k in frame_at:
            frames.append(data.qpos.copy())
    return recorder.done(), np.array(frames)


def _commands(world: World, trajectory: RobotTrajectory, times: Array) -> Array:
    """Actuator commands (steps, nu): q + kd/kp qd feeds the velocity forward through the servo's own damping,
    effort / kp the torque that the motion is known to take through its stiffness."""
    model = world.model
    q, qd, gripper = trajectory.at(times)
    effort = trajectory.effort_at(times)
    kp = model.actuator_gainprm[world.arm_ctrl, 0]
    kd = -model.actuator_biasprm[world.arm_ctrl, 2]
    ctrl = np.zeros((len(times), model.nu))
    ctrl[:, world.arm_ctrl] = q + (kd * qd + effort) / kp
    ctrl[:, world.gripper_ctrl] = world.spec.gripper_command(gripper)
    return ctrl


class _Recorder:
    """Collects samples of a running simulation."""

    def __init__(self, world: World, part: int, spec: RobotSpec) -> None:
        self._w, self._part, self._spec = world, part, spec
        self._rows: list[tuple[float, int, float, float, Array, Array, Array, float, int]] = []
        self._contacts: list[Contact] = []

    def take(self, data: mujoco.MjData, phase: int) -> None:
        """Add the present state."""
        w = self._w
        tool = geo.make_pose(data.site_xmat[w.tool].reshape(3, 3), data.site_xpos[w.tool])
        touching = self._read_contacts(data)
        self._rows.append(
            (
                float(data.time),
                phase,
                float(data.qpos[w.part_qpos[self._part]]),
                float(data.qvel[w.part_dof[self._part]]),
                data.qpos[w.arm_qpos].copy(),
                data.qfrc_actuator[w.arm_dof].copy(),
                tool,
                float(data.actuator_force[w.gripper_ctrl]) / self._spec.lever,
                touching,
            )
        )

    def _read_contacts(self, data: mujoco.MjData) -> int:
        """Fingers that touch the part; everything else that touches the robot is noted as unintended."""
        w, m = self._w, self._w.model
        fingers = set()
        for (g1, g2), distance in zip(data.contact.geom.tolist(), data.contact.dist.tolist(), strict=True):
            if distance > 0:
                continue
            if w.owner[g1] != ROBOT and w.owner[g2] != ROBOT:
                continue
            f, other = (g1, g2) if w.finger[g1] else (g2, g1)
            if w.finger[f] and w.owner[other] == PART and w.geom_part[other] == self._part:
                fingers.add(int(m.geom_bodyid[f]))
                continue
            own, other = sorted((g1, g2), key=lambda g: (w.owner[g] != ROBOT, g))
            names, depth = (w.body_of(own), w.body_of(other)), -distance
            self._contacts.append(Contact(float(data.time), names, depth, bool(w.owner[other] == STATIC)))
        return len(fingers)

    def done(self) -> Record:
        """The record."""
        times, phase, state, speed, q, torque, tool, grip, touching = (
            np.array(c, dtype=np.float64) for c in zip(*self._rows, strict=True)
        )
        return Record(times, phase, state, speed, q, torque, tool, grip, touching, tuple(self._contacts))

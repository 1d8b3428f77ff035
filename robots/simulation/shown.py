"""What the page shows of a replay: the robot's links as meshes, and where links and parts were over time.

The shapes are those of the robot's own model, as in scene.xml: a skin stays out of every file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from robots.model.skin import DRAWABLE, SCALAR, SHOWN
from robots.scene.world import PEDESTAL, PREFIX, ROBOT, World
from robots.simulation.report import ReplayReport
from twin import geometry as geo
from twin.exporters.glb_buffer import GlbBuffer
from twin.exporters.glb_mesh import add_mesh
from twin.exporters.links import Visual
from twin.geometry import Array
from twin.importers.mjcf_look import mean_color, rgba, surface_of
from twin.mesh import decimated
from twin.report.replayed import LINKS, Replayed, furniture
from twin.scene import Mesh, Twin

_EVERY = 20  # simulation steps between samples: 40 ms, between which links go straight; chosen by us
_FACES = 12_000  # of all meshes of a robot: 1.3 MB in the page if no two corners are one; chosen by us
_LAST_GROUP = 3  # of the robot's own shapes: what touches, drawn where a robot has no meshes to show


class Moments:
    """Joint positions over a simulation; its `see` goes into `simulate` as `observe`."""

    def __init__(self) -> None:
        self._steps, self._rows = 0, list[tuple[float, Array]]()

    def see(self, data: mujoco.MjData) -> None:
        """Keep the state before a step, each `_EVERY` of them."""
        if self._steps % _EVERY == 0:
            self._rows.append((float(data.time), data.qpos.copy()))
        self._steps += 1

    @property
    def times(self) -> Array:
        return np.array([t for t, _ in self._rows])

    @property
    def qpos(self) -> Array:
        return np.array([q for _, q in self._rows])


def write_shown(
    folder: Path, world: World, twins: tuple[Twin, Twin], moments: Moments, report: ReplayReport
) -> None:
    """Write motion.json and robot.glb.

    twins: as the run has it, in whose states all is told, and as it was played with, whose states count from
    where a carrier stood.
    """
    twin, stood = twins
    drawn = _drawn(world)
    zero = {p.name: p.joint.lower - stood.part(p.id).joint.lower for p in twin.parts}
    qpos = moments.qpos
    states = {p.name: qpos[:, world.part_qpos[p.id]] + zero[p.name] for p in twin.parts}
    model = world.model
    joints = {
        model.joint(j).name: qpos[:, model.jnt_qposadr[j]]
        for j in range(model.njnt)
        if int(model.jnt_type[j]) in SCALAR
    }
    moved = twin.part(report.part)
    Replayed(
        robot=report.robot,
        part=report.part,
        start=report.start + zero[moved.name],
        goal=report.goal + zero[moved.name],
        ok=report.ok,
        times=moments.times,
        states=states,
        joints=joints,
        links=_poses(world, sorted({PEDESTAL, *drawn}), qpos),
        column=_column(model),
        furniture=furniture(twin),
    ).save(folder)
    (folder / LINKS).write_bytes(_glb(model, drawn))


def _drawn(world: World) -> dict[str, list[int]]:
    """Geoms of each of the robot's bodies that are drawn: what the model shows, or, where that holds no mesh,
    the shapes that touch as well."""
    model = world.model
    own = [
        g for g in np.flatnonzero(world.owner == ROBOT).tolist()
        if str(model.body(model.geom_bodyid[g]).name).startswith(PREFIX)
        and model.geom_type[g] in DRAWABLE and rgba(model, g)[3] > 0
    ]  # fmt: skip
    is_mesh = int(mujoco.mjtGeom.mjGEOM_MESH)
    dressed = any(model.geom_type[g] == is_mesh and model.geom_group[g] <= SHOWN for g in own)
    found: dict[str, list[int]] = {}
    for g in own:
        if model.geom_group[g] <= (SHOWN if dressed else _LAST_GROUP):
            found.setdefault(str(model.body(model.geom_bodyid[g]).name), []).append(g)
    return found


def _poses(world: World, names: list[str], qpos: Array) -> dict[str, tuple[Array, Array]]:
    """Positions (n, 3) and quaternions (n, 4) xyzw of bodies, by MuJoCo's forward kinematics."""
    data = mujoco.MjData(world.model)
    ids = [world.model.body(n).id for n in names]
    at, turn = np.zeros((len(qpos), len(ids), 3)), np.zeros((len(qpos), len(ids), 4))
    for k, q in enumerate(qpos):
        data.qpos[:] = q
        mujoco.mj_kinematics(world.model, data)
        at[k], turn[k] = data.xpos[ids], np.roll(data.xquat[ids], -1, axis=1)
    return {n: (at[:, k], turn[:, k]) for k, n in enumerate(names)}


def _column(model: mujoco.MjModel) -> tuple[float, ...] | None:
    """Radius, length and middle of the pedestal's column; None where the base stands on the floor."""
    g = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, PEDESTAL)
    if g < 0:
        return None
    radius, half, _ = model.geom_size[g].tolist()
    return (radius, 2.0 * half, *model.geom_pos[g].tolist())


def _glb(model: mujoco.MjModel, drawn: dict[str, list[int]]) -> bytes:
    """The links' meshes, a node a link, each in its link's frame."""
    buffer = GlbBuffer()
    nodes: list[dict[str, Any]] = []
    links: list[int] = []
    shapes = {
        name: [(_shape(model, g), mean_color(model, g)) for g in geoms] for name, geoms in drawn.items()
    }
    share = min(1.0, _FACES / max(sum(len(mesh.faces) for own in shapes.values() for mesh, _ in own), 1))
    for name, own in shapes.items():
        children = range(len(nodes), len(nodes) + len(own))
        for mesh, color in own:
            r, g, b, _ = color.tolist()
            shown = Visual(name, _fewer(mesh, share), role="robot", color=(r, g, b))
            nodes.append({"mesh": add_mesh(buffer, shown)})
        links.append(len(nodes))
        nodes.append({"name": name, "extras": {"link": name}, "children": list(children)})
    asset = {"version": "2.0", "generator": "Funtwin"}
    return buffer.file({"asset": asset, "scene": 0, "scenes": [{"nodes": links}], "nodes": nodes})


def _fewer(mesh: Mesh, share: float) -> Mesh:
    """The mesh with this share of its faces."""
    if share >= 1.0:
        return mesh
    size = max(float(np.ptp(mesh.vertices, axis=0).max()), 1e-9)
    vertices, faces = decimated(mesh.vertices / size, mesh.faces, max(int(share * len(mesh.faces)), 4))
    return Mesh(vertices * size, faces)


def _shape(model: mujoco.MjModel, geom: int) -> Mesh:
    """A geom as triangles in its body's frame."""
    surface = surface_of(model, geom, coarse=True)
    assert surface is not None  # as all of `DRAWABLE` have one
    return surface.transformed(
        geo.make_pose(geo.matrix_from_quat_wxyz(model.geom_quat[geom]), model.geom_pos[geom])
    )

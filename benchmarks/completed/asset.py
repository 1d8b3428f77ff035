"""An exported MJCF as MuJoCo reads it: the meshes of every body, in the world of the truth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from recon.evaluation.metrics import DistanceField
from recon.simulate.geoms import geom_mesh
from twin import geometry as geo
from twin.completion.asset import asset_pose
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Mesh, Twin

VISUAL, COLLISION = 2, 3  # groups of the export's geoms
ROOM = "room"  # the body of what is no furniture
STATIC = ""  # owner of what belongs to no moving part
_SAME = 0.003  # m, chosen by us: writers round by less, another origin is further away
_SOME = 1000  # vertices of a mesh that tell where it lies


@dataclass(frozen=True, eq=False)
class Geom:
    """A geom at state 0 in the truth's world.

    Attributes:
        name: as in the file.
        owner: name of the part that carries it; STATIC.
        room: whether it belongs to the room.
        visual: whether it is drawn; else it collides.
        inferred: name of the inferred piece that it shows, None of what was seen.
        mesh: its triangles.
    """

    name: str
    owner: str
    room: bool
    visual: bool
    inferred: str | None
    mesh: Mesh


@dataclass(frozen=True, eq=False)
class Asset:
    """An exported model.

    Attributes:
        path: of its MJCF.
        model: as MuJoCo compiles it.
        T_truth_asset: pose (4, 4) of its world in the truth's.
        geoms: all that is drawn or collides.
    """

    path: Path
    model: mujoco.MjModel
    T_truth_asset: Array
    geoms: tuple[Geom, ...]

    def visuals(self, owner: str) -> list[Geom]:
        """What is drawn of a part, or of STATIC without the room."""
        return [g for g in self.geoms if g.owner == owner and g.visual and not g.room]

    def colliders(self, owner: str) -> list[Geom]:
        """What collides of a part, or of STATIC without the room."""
        return [g for g in self.geoms if g.owner == owner and not g.visual and not g.room]

    def joint(self, part: str) -> int:
        """Index of a part's joint. Raises InputError when its body has none."""
        body = self.model.body(part)
        if int(body.jntnum[0]) != 1:
            raise InputError(
                f"body {part!r} of {self.path} has {int(body.jntnum[0])} joints", "export the twin again"
            )
        return int(body.jntadr[0])

    def upper(self, part: str) -> float:
        """Upper limit of a part's joint, m or rad."""
        return float(self.model.jnt_range[self.joint(part), 1])

    def moved(self, part: str, state: float) -> Array:
        """Pose (4, 4) in the truth's world that takes the meshes of a part from state 0 to `state`, all else
        at 0."""
        data, body = mujoco.MjData(self.model), self.model.body(part).id
        data.qpos[self.model.jnt_qposadr[self.joint(part)]] = state
        mujoco.mj_kinematics(self.model, data)
        here = geo.make_pose(data.xmat[body].reshape(3, 3), data.xpos[body])
        change = here @ geo.invert_pose(self._resting[body])
        return self.T_truth_asset @ change @ geo.invert_pose(self.T_truth_asset)

    @cached_property
    def _resting(self) -> Array:
        """Poses (bodies, 4, 4) at state 0."""
        data = at_rest(self.model)
        return np.stack(
            [
                geo.make_pose(r.reshape(3, 3), t)
                for r, t in zip(data.xmat.copy(), data.xpos.copy(), strict=True)
            ]
        )


def load_asset(run: Path, twin: Twin, T_truth_twin: Array) -> Asset:
    """The exported MJCF of a run in the truth's world.

    Raises InputError when there is none, MuJoCo refuses it, it lacks a body of the twin's, or lies where no
    known origin puts it.
    """
    path = run / "export" / "mjcf" / f"{twin.name}.xml"
    if not path.is_file():
        raise InputError(f"{path} is missing", "run `twin export` on the run first")
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as e:
        raise InputError(f"{path} can't be read by MuJoCo: {e}", "export the twin again") from None
    bodies = {model.body(b).name for b in range(model.nbody)}
    for part in twin.parts:
        if part.name not in bodies:
            raise InputError(f"{path} has no body {part.name!r}", "export the twin of this run again")
    own = _geoms(model, {p.name for p in twin.parts})
    T = T_truth_twin @ _twin_from_asset(twin, own, path)
    geoms = tuple(
        Geom(g.name, g.owner, g.room, g.visual, g.inferred, g.mesh.transformed(T))
        for g in own
        if len(g.mesh.faces)
    )
    return Asset(path, model, T, geoms)


def at_rest(model: mujoco.MjModel) -> mujoco.MjData:
    """All joints at state 0, with the poses that follow."""
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    return data


def merged(meshes: Iterable[Mesh]) -> Mesh:
    """All of them as one mesh without colours; one without faces for none."""
    every = list(meshes)
    if not every:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    base = np.cumsum([0, *(len(m.vertices) for m in every[:-1])])
    faces = np.concatenate([m.faces + b for m, b in zip(every, base, strict=True)])
    return Mesh(np.concatenate([m.vertices for m in every]), faces.astype(np.int32))


def _geoms(model: mujoco.MjModel, parts: set[str]) -> list[Geom]:
    data, found = at_rest(model), []
    for g in range(model.ngeom):
        group = int(model.geom_group[g])
        if group not in (VISUAL, COLLISION):
            continue
        lineage = _lineage(model, int(model.geom_bodyid[g]))
        owner = next((n for n in lineage if n in parts), STATIC)
        name = model.geom(g).name
        vertices, faces = geom_mesh(model, g)
        T = geo.make_pose(data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g])
        mesh = Mesh(geo.transform(T, vertices), faces.astype(np.int32))
        shown = name.partition("_inferred_")[2] if "_inferred_" in name and group == VISUAL else None
        found.append(Geom(name, owner, ROOM in lineage, group == VISUAL, shown, mesh))
    return found


def _lineage(model: mujoco.MjModel, body: int) -> list[str]:
    """Names of a body and of all that carry it, the nearest first."""
    names = []
    while body > 0:
        names.append(model.body(body).name)
        body = int(model.body_parentid[body])
    return names


def _twin_from_asset(twin: Twin, geoms: list[Geom], path: Path) -> Array:
    """T_twin_asset (4, 4): of the origins that an export may have, the one that puts what was seen of the
    parts where the twin has it."""
    candidates = [np.eye(4)]
    candidates.append(geo.invert_pose(asset_pose(twin)))
    named = {STATIC: twin.static.mesh, **{p.name: p.mesh for p in twin.parts}}
    surfaces = {name: DistanceField(mesh) for name, mesh in named.items()}
    seen = [g for g in geoms if g.visual and g.inferred is None and len(g.mesh.faces)]
    if not seen:
        raise InputError(
            f"{path} shows nothing that was seen, so that its origin is not known", "export again"
        )

    def off(T: Array) -> float:
        """Middle distance (m) of what is shown from where the twin has it: whatever was left out, the rest
        lies there."""
        apart = [surfaces[g.owner].distance(geo.transform(T, _some(g.mesh))) for g in seen]
        return float(np.median(np.concatenate(apart)))

    best = min(candidates, key=off)
    if off(best) > _SAME:
        raise InputError(
            f"what {path} shows lies {1e3 * off(best):.0f} mm from where its twin has it",
            "export the twin again",
        )
    return best


def _some(mesh: Mesh) -> Array:
    """Vertices (n, 3) of a mesh, some thousand of many."""
    return mesh.vertices[:: max(1, len(mesh.vertices) // _SOME)]

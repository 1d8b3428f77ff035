"""Reads MJCF: MuJoCo compiles it, so that defaults, includes, primitives and masses are MuJoCo's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import mujoco
import numpy as np

from twin import geometry as geo
from twin.errors import InputError, SceneError
from twin.geometry import Array
from twin.importers.contact_pairs import bodies_never_touching, touching_geoms
from twin.importers.geom_groups import seen_geoms
from twin.importers.keyframes import ends
from twin.importers.look import Lost, welded
from twin.importers.mjcf_look import looking, surface_of
from twin.importers.refused import refusal
from twin.importers.shapes import (
    convex,
)
from twin.importers.source import Source, SourceBody, SourceJoint, SourceMass
from twin.lint.xml import read_xml
from twin.scene import Box, Collision, Mesh

# kg/m^3 and friction that MuJoCo takes where a file says nothing: a file that says the same can't be told
# from a silent one.
_DENSITY = 1000.0
_FRICTION = 1.0
_UNNAMED = "MuJoCo Model"
_KINDS: dict[int, Literal["revolute", "prismatic"]] = {
    int(mujoco.mjtJoint.mjJNT_HINGE): "revolute",
    int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
}
_GEOM = mujoco.mjtGeom


def read(path: Path, visual_groups: Sequence[int] = ()) -> Source:
    """Read an MJCF file. Raises InputError, with MuJoCo's own reason where it refuses the file.

    visual_groups: groups of geoms that are seen; empty where the model's own groups shall say.
    """
    for _ in _included(path, set()):
        pass  # each is refused if it declares a document type
    try:
        spec = mujoco.MjSpec.from_file(str(path.resolve()))
        spec.compiler.discardvisual = False
        spec.compiler.fusestatic = False
        model = spec.compile()
    except ValueError as e:
        raise refusal(path, e) from e
    down = np.asarray(model.opt.gravity)
    if np.linalg.norm(down) > 0 and geo.angle_between(down, [0.0, 0.0, -1.0]) > 1e-6:
        raise InputError(f"{path}: gravity is {down.tolist()}", "turn the scene: a twin's z points up")
    scene = _Scene(spec, model, path, visual_groups)
    try:
        bodies = tuple(scene.body(b) for b in range(model.nbody))
    except SceneError as e:
        raise InputError(f"{path}: {e.problem}", e.remedy) from e
    name = path.stem if spec.modelname in ("", _UNNAMED) else spec.modelname
    never_touching = frozenset(frozenset(map(scene.name, pair)) for pair in bodies_never_touching(model))
    notes = (*scene.notes, *scene.lost.notes(), *_not_carried(model))
    return Source(path, name, bodies, notes, never_touching)


def _included(path: Path, seen: set[Path]) -> Iterator[Path]:
    """The file and all that it includes, each read once."""
    seen.add(path.resolve())
    yield path
    for element in read_xml(path)[0].iter("include"):
        inner = path.parent / element.get("file", "")
        if inner.is_file() and inner.resolve() not in seen:  # MuJoCo says what is not there
            yield from _included(inner, seen)


def _not_carried(model: Any) -> list[str]:
    """What a twin has no place for."""
    notes = [f"equality {_equality(model, k)} is not carried" for k in range(model.neq)]
    springs = [model.joint(j).name or j for j in range(model.njnt) if float(model.jnt_stiffness[j]) != 0.0]
    notes += [f"the spring of joint {name!r} is not carried" for name in springs]
    if model.nu:
        notes.append(
            f"{model.nu} actuators are not carried: what they move becomes parts unless its bodies are excluded"
        )
    if float(np.max(model.dof_armature, initial=0.0)) > 0:
        notes.append("armature of joints is not carried: exports choose their own")
    for count, what in ((model.ntendon, "tendons"), (model.nflex, "flexible bodies"), (model.nskin, "skins")):
        if count:
            notes.append(f"{count} {what} are not carried")
    return notes


def _equality(model: Any, k: int) -> str:
    """An equality by its name or kind, and the joints that it couples."""
    kind = mujoco.mjtEq(int(model.eq_type[k]))
    what = str(model.eq(k).name) or kind.name.removeprefix("mjEQ_").lower()
    if kind != mujoco.mjtEq.mjEQ_JOINT:
        return repr(what)
    ends = [int(j) for j in (model.eq_obj1id[k], model.eq_obj2id[k]) if j >= 0]
    return f"{what!r} of joints {', '.join(repr(str(model.joint(j).name)) for j in ends)}"


class _Scene:
    """A compiled model at rest."""

    def __init__(self, spec: Any, model: Any, path: Path, visual_groups: Sequence[int]) -> None:
        self.spec, self.model, self.path = spec, model, path
        self.data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, self.data)
        mujoco.mj_comPos(model, self.data)
        self._touching = touching_geoms(model)
        self._seen, self.notes = seen_geoms(model, self.data, self._touching, visual_groups)
        self.lost = Lost()
        self._stated = {int(b.id): _states_mass(b) for b in spec.bodies}

    def name(self, body: int) -> str:
        """The body's name; one without is named after what it carries."""
        known = str(self.model.body(body).name)
        if known:
            return known
        joint = int(self.model.body_jntadr[body])
        named = str(self.model.joint(joint).name) if joint >= 0 else ""
        return f"{named or 'body'}#{body}"  # no body's own name: they are looked up by it

    def body(self, body: int) -> SourceBody:
        """One body; the world itself is the first."""
        m = self.model
        joint, refused, loose = self._motion(body)
        visual: list[Mesh] = []
        collision: list[Collision] = []
        friction: list[float] = []
        first = int(m.body_geomadr[body])
        for g in range(first, first + int(m.body_geomnum[body])):
            surface = self._surface(g)
            if surface is None:
                continue
            if self._seen[g]:
                visual.append(looking(m, g, surface, self.lost).transformed(self._pose(g)))
            if self._touching[g]:
                collision += self._shape(g, surface)
                friction.append(float(m.geom_friction[g, 0]))
        return SourceBody(
            self.name(body),
            None if body == 0 else self.name(int(m.body_parentid[body])),
            joint,
            tuple(visual),
            tuple(collision),
            self._mass(body),
            stated=self._stated.get(body, False),
            friction=tuple(f for f in friction if f != _FRICTION),
            refused=refused,
            loose=loose,
        )

    def _motion(self, body: int) -> tuple[SourceJoint | None, str, bool]:
        """The joint of a body, or why it can't be one of a twin, or that it floats."""
        m, count, j = self.model, int(self.model.body_jntnum[body]), int(self.model.body_jntadr[body])
        if count == 0:
            return None, "", False
        if int(m.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_FREE):
            return None, "", True
        name = str(m.joint(j).name) or self.name(body)
        if count > 1:
            names = ", ".join(repr(str(m.joint(k).name)) for k in range(j, j + count))
            return None, f"it has {count} joints ({names})", False
        kind = _KINDS.get(int(m.jnt_type[j]))
        if kind is None:
            return None, f"joint {name!r} is a ball joint", False
        dof = int(m.jnt_dofadr[j])
        bounded = bool(m.jnt_limited[j])
        closed, opened = ends(m, j, (name, self.name(body)))
        damping, frictionloss = float(np.ravel(m.dof_damping[dof])[0]), float(m.dof_frictionloss[dof])
        return (
            SourceJoint(
                name,
                kind,
                geo.unit(self.data.xaxis[j]),
                self.data.xanchor[j].copy(),
                float(m.qpos0[m.jnt_qposadr[j]]),
                float(m.jnt_range[j, 0]) if bounded else None,
                float(m.jnt_range[j, 1]) if bounded else None,
                closed,
                opened,
                damping or None,  # MuJoCo's own value is 0: what is not written
                frictionloss or None,
            ),
            "",
            False,
        )

    def _mass(self, body: int) -> SourceMass | None:
        m, d = self.model, self.data
        if body == 0 or float(m.body_mass[body]) <= 0:
            return None
        axes = d.ximat[body].reshape(3, 3)
        tensor = axes @ np.diag(m.body_inertia[body]) @ axes.T
        return SourceMass(float(m.body_mass[body]), d.xipos[body].copy(), (tensor + tensor.T) / 2)

    def _pose(self, g: int) -> Array:
        return geo.make_pose(self.data.geom_xmat[g].reshape(3, 3), self.data.geom_xpos[g])

    def _surface(self, g: int) -> Mesh | None:
        """A geom in its own frame; None, with a note, where it has no surface that could be kept."""
        kind, surface = int(self.model.geom_type[g]), surface_of(self.model, g)
        if surface is not None:
            is_mesh = kind == _GEOM.mjGEOM_MESH
            return welded(surface.vertices, surface.faces, None) if is_mesh else surface
        what = _GEOM(kind).name.removeprefix("mjGEOM_").lower()
        label = repr(str(self.model.geom(g).name)) if self.model.geom(g).name else f"{g}"
        self.notes.append(
            f"geom {label} ({'infinite ' if kind == _GEOM.mjGEOM_PLANE else ''}{what}) is left out"
        )
        return None

    def _shape(self, g: int, surface: Mesh) -> list[Collision]:
        """What touches: boxes, and hulls, which MuJoCo takes of every mesh."""
        if int(self.model.geom_type[g]) == _GEOM.mjGEOM_BOX:
            return [Box(self._pose(g), 2 * np.asarray(self.model.geom_size[g], np.float64))]
        hull = convex(surface)
        return [] if hull is None else [hull.transformed(self._pose(g))]


def _states_mass(body: Any) -> bool:
    """Whether the file itself says what a body weighs: an <inertial>, or a mass or density of a geom."""
    said = any(not np.isnan(g.mass) or g.density not in (_DENSITY, 0.0) for g in body.geoms)
    return bool(body.explicitinertial) or said

"""A robot as it looks: the visuals of another model of it, worn by our own bodies.

The other model is MuJoCo Menagerie's where that is on the machine. Only what is drawn comes from there:
meshes, primitives and their materials. Bodies, joints, masses, shapes that touch and servos stay ours.
Everything is taken from the compiled model, in which MuJoCo has resolved default classes, includes, scales
and file names, so a dressed model needs none of its files any more.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from robots.model.joint_frames import Mover, Pair
from robots.model.looks import Looks
from robots.model.mjcf import compiled
from robots.model.model_files import MENAGERIE, find
from robots.model.spec import RobotSpec
from twin import geometry as geo
from twin.errors import InputError, nearest_name
from twin.geometry import Array
from twin.lint.xml import read_xml

_LOG = logging.getLogger(__name__)
SHOWN = 2  # geom groups up to this one are drawn by default; published models keep what touches in group 3
# kinds of geoms that links are drawn by
DRAWABLE = {
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{k}"))
    for k in ("MESH", "SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX")
}
SCALAR = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
_ROOM = 0.1  # m, to either side of its zero: of a slide without limits


@dataclass(frozen=True, eq=False)
class Piece:
    """A visual geom: our body that wears it, its id in the other model, its pose (4, 4) in our body."""

    body: str
    geom: int
    T_body_geom: Array


@dataclass(frozen=True, eq=False)
class Skin:
    """What a robot wears: its file, its compiled model, pieces, and our bodies whose shapes are hidden."""

    source: Path
    model: mujoco.MjModel
    pieces: tuple[Piece, ...]
    bodies: tuple[str, ...]


def skin_of(spec: RobotSpec) -> Skin | None:
    """What the robot wears; None, its own shapes, without such a model, or, after one warning, with an
    unusable one: incomplete, malformed, or with other joints. What was taken is logged."""
    try:
        skin = find_skin(spec)
    except InputError as e:
        _LOG.warning("%s is drawn with its own shapes: %s", spec.name, e)
        return None
    if skin is not None:
        _LOG.info("visuals of %s from %s", spec.name, skin.source.parent)
    elif spec.looks is not None:
        _LOG.info("%s is drawn with its own shapes: %s is not on this machine", spec.name, spec.looks.model)
    return skin


def find_skin(spec: RobotSpec) -> Skin | None:
    """What the robot wears, None where it asks for nothing or no folder has the model.

    Raises:
        InputError: the model or one of its meshes can't be read, lacks a body or joint that [looks] names,
            has visuals that nobody wears, or does not move as ours does.
    """
    looks = spec.looks
    source = None if looks is None else find(looks.model, looks.folder)
    if looks is None or source is None:
        return None
    try:
        theirs = _read(source)
        pair = _pair(compiled(spec), theirs, spec, looks)
        visuals = _visuals(theirs, looks)
        frames = pair.frames()
    except InputError as e:
        raise InputError(
            f"{source}: {e.problem}", e.remedy or f"correct [looks] of the robot file, or {MENAGERIE}"
        ) from e
    pieces = [
        Piece(mine, g, T @ geo.make_pose(geo.matrix_from_quat_wxyz(theirs.geom_quat[g]), theirs.geom_pos[g]))
        for (mine, other), T in zip(pair.body_names, frames, strict=True)
        for g in visuals.get(other, [])
    ]
    return Skin(source, theirs, tuple(pieces), tuple(looks.bodies))


def _read(source: Path) -> mujoco.MjModel:
    read_xml(source)
    try:
        return mujoco.MjModel.from_xml_path(str(source))
    except (ValueError, OSError) as e:
        raise InputError(
            f"MuJoCo can't read it: {' '.join(str(e).split())}", "complete the checkout, or fetch it anew"
        ) from e


def _visuals(model: mujoco.MjModel, looks: Looks) -> dict[str, list[int]]:
    """Their bodies that are worn -> geoms that are drawn and touch nothing."""
    worn = {b for names in looks.bodies.values() for b in names}
    drawn = (model.geom_contype == 0) & (model.geom_conaffinity == 0) & (model.geom_group <= SHOWN)
    found: dict[str, list[int]] = {}
    for g in np.flatnonzero(drawn).tolist():
        body = model.body(model.geom_bodyid[g]).name
        if model.geom_bodyid[g] == 0 or body in looks.left_out:
            continue
        if body not in worn:
            raise InputError(
                f"its body {body!r} has visuals, and [looks] does not say who wears them",
                "name it in looks.bodies or in looks.left_out",
            )
        if model.geom_type[g] not in DRAWABLE:
            kind = mujoco.mjtGeom(int(model.geom_type[g])).name.removeprefix("mjGEOM_").lower()
            raise InputError(f"its body {body!r} is drawn by a {kind}, which can't be worn")
        found.setdefault(body, []).append(g)
    if not found:
        raise InputError("none of the bodies that [looks] names has visuals")
    return found


def _pair(ours: mujoco.MjModel, theirs: mujoco.MjModel, spec: RobotSpec, looks: Looks) -> Pair:
    """Both models, ready to be compared."""
    names = [(mine, other) for mine, others in looks.bodies.items() for other in others]
    mine = [_id(ours, mujoco.mjtObj.mjOBJ_BODY, m, "our model") for m, _ in names]
    other = [_id(theirs, mujoco.mjtObj.mjOBJ_BODY, o, "it") for _, o in names]
    for body in looks.bodies:
        _id(ours, mujoco.mjtObj.mjOBJ_BODY, body, "our model")
    anchor = min(mine)
    their_anchor = min(o for m, o in zip(mine, other, strict=True) if m == anchor)
    shared = _shared_joints(ours, theirs, looks)
    hold = {_id(theirs, mujoco.mjtObj.mjOBJ_JOINT, k, "it"): v for k, v in looks.hold.items()}
    for joint in sorted(set(hold) & set(shared.values())):
        raise InputError(
            f"looks.hold names {theirs.joint(joint).name!r}, which moves with ours", "leave it out there"
        )
    _require_known(theirs, other, their_anchor, {*shared.values(), *hold})
    scalar = [j for j in range(ours.njnt) if ours.jnt_type[j] in SCALAR]
    joints = [*shared, *(j for j in scalar if j not in shared)]
    home = ours.qpos0[ours.jnt_qposadr[joints]].copy()
    for name, state in zip(spec.arm_joints, spec.home, strict=True):
        home[joints.index(ours.joint(name).id)] = state
    turns = ours.jnt_type[joints] == int(mujoco.mjtJoint.mjJNT_HINGE)
    free = ours.jnt_limited[joints] == 0
    room = np.where(turns, np.pi, _ROOM)
    return Pair(
        ours=Mover(ours, anchor, mine, joints, {}),
        theirs=Mover(theirs, their_anchor, other, list(shared.values()), hold),
        body_names=names,
        joint_names=[theirs.joint(j).name for j in shared.values()],
        hinges=turns[: len(shared)],
        home=home,
        lower=np.where(free, -room, ours.jnt_range[joints, 0]),
        upper=np.where(free, room, ours.jnt_range[joints, 1]),
    )


def _shared_joints(ours: mujoco.MjModel, theirs: mujoco.MjModel, looks: Looks) -> dict[int, int]:
    """Our joint -> theirs, of those that both models have."""
    for name in looks.joints:
        _id(ours, mujoco.mjtObj.mjOBJ_JOINT, name, "our model")
    shared = {}
    for j in range(ours.njnt):
        name = ours.joint(j).name
        if name in looks.joints:
            k = _id(theirs, mujoco.mjtObj.mjOBJ_JOINT, looks.joints[name], "it")
        else:
            k = mujoco.mj_name2id(theirs, mujoco.mjtObj.mjOBJ_JOINT, name)
        if k < 0 or ours.jnt_type[j] not in SCALAR:
            continue
        if ours.jnt_type[j] != theirs.jnt_type[k]:
            raise InputError(
                f"its joint {theirs.joint(k).name!r} turns where ours slides, or slides where ours turns"
            )
        shared[j] = k
    return shared


def _require_known(model: mujoco.MjModel, worn: list[int], anchor: int, known: set[int]) -> None:
    """Refuse a joint of theirs between the anchor and a worn body that nobody gives a state."""
    below = {b for body in worn for b in _up(model, body)} - set(_up(model, anchor))
    for j in range(model.njnt):
        if model.jnt_bodyid[j] in below and model.jnt_type[j] in SCALAR and j not in known:
            name = model.joint(j).name
            raise InputError(
                f"its joint {name!r} is none of ours", f"say where it stands, such as looks.hold.{name} = 0.0"
            )


def _up(model: mujoco.MjModel, body: int) -> list[int]:
    """The body and all that carry it."""
    chain = []
    while body:
        chain.append(body)
        body = int(model.body_parentid[body])
    return chain


def _id(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str, whose: str) -> int:
    found = mujoco.mj_name2id(model, kind, name)
    if found >= 0:
        return int(found)
    count, get = (model.nbody, model.body) if kind == mujoco.mjtObj.mjOBJ_BODY else (model.njnt, model.joint)
    near = nearest_name(name, [get(k).name for k in range(count)])
    what = kind.name.removeprefix("mjOBJ_").lower()
    raise InputError(
        f"[looks] names the {what} {name!r}, which {whose} lacks", f"did you mean {near!r}?" if near else ""
    )

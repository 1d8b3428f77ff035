"""Reading an articulated MJCF scene: the moving part of one joint, and everything else, as surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from recon.simulate.geoms import geom_mesh
from recon.simulate.joints import JOINT_TYPES, find_joint
from recon.simulate.surfaces import Surface
from recon.simulate.textures import Material, material_for
from twin.errors import InputError
from twin.geometry import Array, exp_so3, invert_pose, make_pose

VISUAL_GROUPS = 3  # groups 0 to 2 are those that MuJoCo's own viewer shows
# a tuple of this name behind the joint's lists the bodies of the part's furniture, where no tree tells them
FURNITURE = "_furniture"
DEFAULT_HINGE = 1.2  # rad, chosen by us
DEFAULT_SLIDE = 0.3  # m, chosen by us
OPENING_SHARE = 0.8  # of a joint's range, chosen by us


@dataclass(frozen=True)
class Articulation:
    """One joint of a scene, seen from its closed state (0); opening is positive.

    Attributes:
        name: the joint's name.
        kind: "revolute" or "prismatic".
        axis: unit axis (3,) in the world, signed so that opening is positive.
        pivot: a point (3,) on it, metres.
        span: travel from the closed end to the other end, radians or metres.
        static: surface of what stands still, in the world frame at state 0.
        part: surface of the part, in the world frame at state 0.
        mass: of the part, kg.
        com: centre of mass (3,), metres, at state 0.
        inertia: (6,) kg m^2 = xx yy zz xy xz yz about the centre of mass, in world axes at state 0.
        lower: smallest corner of the scene (3,), without infinite planes.
        upper: largest corner (3,).
        has_floor: whether the scene has a plane of its own.
        sites: world positions of the named sites that the part carries.
        furniture: what stands still of the furniture that the part belongs to, as `static`; empty where the
            scene doesn't tell.
    """

    name: str
    kind: str
    axis: Array
    pivot: Array
    span: float
    static: tuple[Surface, ...]
    part: tuple[Surface, ...]
    mass: float
    com: Array
    inertia: Array
    lower: Array
    upper: Array
    has_floor: bool
    sites: dict[str, Array]
    furniture: tuple[Surface, ...] = ()

    def pose(self, state: float) -> Array:
        """T_world_part (4, 4) at `state`, the identity at 0."""
        if self.kind == "prismatic":
            return make_pose(None, self.axis * state)
        turn = exp_so3(self.axis * state)
        return make_pose(turn, self.pivot - turn @ self.pivot)


def articulations(
    model: mujoco.MjModel,
    scene: str,
    joints: Sequence[str],
    exclude: tuple[str, ...],
    contrast: float,
    rng: np.random.Generator,
) -> tuple[Articulation, ...]:
    """The parts of `joints` of one scene, which share what stands still beside them.

    The closed end of each is taken with the others closed; a part doesn't carry another one.

    Raises InputError where the model has no such hinge or slide joint (the message names those that exist),
    or a joint moves nothing that can be seen.
    """
    found = [find_joint(model, joint) for joint in joints]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ends = []
    for index in found:
        ends.append(_closed_end(model, index, JOINT_TYPES[int(model.jnt_type[index])]))
        data.qpos[model.jnt_qposadr[index]] = ends[-1][0]
    mujoco.mj_forward(model, data)
    dropped = _subtrees(model, [b for b in range(1, model.nbody) if _matches(model.body(b).name, exclude)])
    moving = [_subtrees(model, [int(model.jnt_bodyid[index])]) - dropped for index in found]
    own = [_furniture(model, index) for index in found]
    static: list[Surface] = []
    furniture: list[list[Surface]] = [[] for _ in joints]
    parts: list[list[Surface]] = [[] for _ in joints]
    infinite = False
    materials: dict[tuple[str, str], Material] = {}
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if body in dropped or not _is_visual(model, geom):
            continue
        infinite |= int(model.geom_type[geom]) == int(mujoco.mjtGeom.mjGEOM_PLANE)
        surface = _surface(model, data, geom, materials, contrast, rng)
        owner = next((part for part, bodies in zip(parts, moving, strict=True) if body in bodies), static)
        owner.append(surface)
        if owner is static:
            for bodies, shown in zip(own, furniture, strict=True):
                shown += [surface] if body in bodies else []
    for joint, part in zip(joints, parts, strict=True):
        if not part:
            raise InputError(f"joint {joint!r} of {scene} moves no visible geometry", "choose another joint")
    every = [s for part in (static, *parts) for s in part]
    corners = np.concatenate([s.vertices for s in every if not s.name.startswith("plane:")])
    shells = [
        _articulation(model, data, k, joint, end, bodies, static, part, corners, infinite)
        for k, joint, end, bodies, part in zip(found, joints, ends, moving, parts, strict=True)
    ]
    return tuple(replace(a, furniture=tuple(f)) for a, f in zip(shells, furniture, strict=True))


def _articulation(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    index: int,
    joint: str,
    end: tuple[float, float, float],
    bodies: set[int],
    static: Sequence[Surface],
    part: Sequence[Surface],
    corners: Array,
    infinite: bool,
) -> Articulation:
    mass, com, inertia = _mass(model, data, bodies)
    _, sign, span = end
    return Articulation(
        name=joint,
        kind=JOINT_TYPES[int(model.jnt_type[index])],
        axis=sign * data.xaxis[index].copy(),
        pivot=data.xanchor[index].copy(),
        span=span,
        static=tuple(static),
        part=tuple(part),
        mass=mass,
        com=com,
        inertia=inertia,
        lower=corners.min(axis=0),
        upper=corners.max(axis=0),
        has_floor=infinite,
        sites={
            model.site(i).name: data.site_xpos[i].copy()
            for i in range(model.nsite)
            if int(model.site_bodyid[i]) in bodies
        },
    )


def travel(model: mujoco.MjModel, joint: str) -> tuple[str, float]:
    """Kind of a joint, "revolute" or "prismatic", and its travel from the closed end, rad or m."""
    index = find_joint(model, joint)
    kind = JOINT_TYPES[int(model.jnt_type[index])]
    return kind, _closed_end(model, index, kind)[2]


def _closed_end(model: mujoco.MjModel, index: int, kind: str) -> tuple[float, float, float]:
    """The joint coordinate of the closed end, the sign of opening, and the travel to the other end.

    Closed is the end of the range nearest to the model's reference pose (qpos0).
    """
    rest = float(model.qpos0[model.jnt_qposadr[index]])
    if not model.jnt_limited[index]:
        return (
            rest,
            1.0,
            DEFAULT_HINGE / OPENING_SHARE if kind == "revolute" else DEFAULT_SLIDE / OPENING_SHARE,
        )
    low, high = (float(v) for v in model.jnt_range[index])
    if abs(rest - low) <= abs(rest - high):
        return low, 1.0, high - low
    return high, -1.0, high - low


def _furniture(model: mujoco.MjModel, joint: int) -> set[int]:
    """The bodies of a joint's furniture: the whole tree on the world, or those a tuple lists."""
    listed = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TUPLE, model.joint(joint).name + FURNITURE)
    if listed >= 0:
        start = int(model.tuple_adr[listed])
        entries = slice(start, start + int(model.tuple_size[listed]))
        bodies = model.tuple_objtype[entries] == int(mujoco.mjtObj.mjOBJ_BODY)
        return _subtrees(model, [int(b) for b in model.tuple_objid[entries][bodies]])
    return _subtrees(model, [int(model.body_rootid[model.jnt_bodyid[joint]])])


def _subtrees(model: mujoco.MjModel, roots: list[int]) -> set[int]:
    found = set(roots)
    for body in range(1, model.nbody):  # parents come before their children
        if int(model.body_parentid[body]) in found:
            found.add(body)
    return found


def _matches(name: str, words: tuple[str, ...]) -> bool:
    return any(word and word.lower() in name.lower() for word in words)


def _is_visual(model: mujoco.MjModel, geom: int) -> bool:
    material = int(model.geom_matid[geom])
    alpha = model.mat_rgba[material][3] if material >= 0 else model.geom_rgba[geom][3]
    return int(model.geom_group[geom]) < VISUAL_GROUPS and float(alpha) > 0.05


def _surface(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geom: int,
    materials: dict[tuple[str, str], Material],
    contrast: float,
    rng: np.random.Generator,
) -> Surface:
    vertices, faces = geom_mesh(model, geom)
    T_world_geom = make_pose(data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom])
    body = int(model.geom_bodyid[geom])
    T_world_body = make_pose(data.xmat[body].reshape(3, 3), data.xpos[body])
    offset = make_pose(None, rng.uniform(-1.0, 1.0, 3))
    plane = int(model.geom_type[geom]) == int(mujoco.mjtGeom.mjGEOM_PLANE)
    name = model.geom(geom).name or f"geom{geom}"
    return Surface(
        name=f"plane:{name}" if plane else name,
        vertices=vertices @ T_world_geom[:3, :3].T + T_world_geom[:3, 3],
        faces=faces,
        material=_geom_material(model, geom, plane, materials, contrast, rng),
        T_texture_object=offset @ invert_pose(T_world_body),
    )


def _geom_material(
    model: mujoco.MjModel,
    geom: int,
    plane: bool,
    materials: dict[tuple[str, str], Material],
    contrast: float,
    rng: np.random.Generator,
) -> Material:
    """One material for all geoms of the same MJCF material under the same top-level body."""
    index = int(model.geom_matid[geom])
    name = model.mat(index).name if index >= 0 else ("floor" if plane else "")
    rgba = model.mat_rgba[index] if index >= 0 else model.geom_rgba[geom]
    root = int(model.geom_bodyid[geom])
    while int(model.body_parentid[root]) > 0:
        root = int(model.body_parentid[root])
    key = (name, model.body(root).name)
    if key not in materials:
        materials[key] = material_for(name, np.asarray(rgba[:3], dtype=np.float64), contrast, rng)
    return materials[key]


def _mass(model: mujoco.MjModel, data: mujoco.MjData, bodies: set[int]) -> tuple[float, Array, Array]:
    """Mass, centre of mass and inertia (xx yy zz xy xz yz, about it, world axes) of joined bodies."""
    index = sorted(bodies)
    masses = np.asarray(model.body_mass[index], dtype=np.float64)
    mass = float(masses.sum())
    if mass <= 0.0:
        raise InputError("the moving part has no mass", "give its geoms a mass or a density")
    com = masses @ np.asarray(data.xipos[index], dtype=np.float64) / mass
    total = np.zeros((3, 3))
    for body, m in zip(index, masses, strict=True):
        principal = np.diag(np.asarray(model.body_inertia[body], dtype=np.float64))
        axes = data.ximat[body].reshape(3, 3)
        arm = np.asarray(data.xipos[body], dtype=np.float64) - com
        total += axes @ principal @ axes.T + m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return mass, com, np.array([total[0, 0], total[1, 1], total[2, 2], total[0, 1], total[0, 2], total[1, 2]])

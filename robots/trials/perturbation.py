"""What the real part may be like if its twin is inexact: sizes of errors, draws from them, their scene."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from robots.scene.world import World
from twin import geometry as geo
from twin.errors import ConfigError
from twin.geometry import Array
from twin.physics import armature, inertial_of, physics_of
from twin.physics.simulation import GRAVITY
from twin.quantities import Inertial, Quantity
from twin.scene import Joint, Part, Revolute

# Used where the twin says nothing; all chosen by us. Contact: half the thickness of a bar. Axis and pivot:
# several times what reconstructed twins state.
CONTACT_SIGMA = 0.005  # m, along each axis
AXIS_SIGMA = np.deg2rad(1.0)
PIVOT_SIGMA = 0.005  # m

_QUANTITIES = ("mass", "friction", "damping", "frictionloss")


@dataclass(frozen=True)
class ErrorSizes:
    """Lengths of the errors of one row of a table: axis (rad), pivot (m), contact (m).

    Directions are random, lengths are exact. A slide has no pivot: that error is left out.
    """

    axis: float = 0.0
    pivot: float = 0.0
    contact: float = 0.0

    def __post_init__(self) -> None:
        values = (self.axis, self.pivot, self.contact)
        if not all(np.isfinite(v) and v >= 0 for v in values):
            raise ConfigError(f"error sizes must be finite and not negative, got {values}")

    @property
    def text(self) -> str:
        """In words; "none" for no error at all."""
        said = [
            f"axis {np.rad2deg(self.axis):g}°" if self.axis else "",
            f"pivot {1000 * self.pivot:g} mm" if self.pivot else "",
            f"contact {1000 * self.contact:g} mm" if self.contact else "",
        ]
        return " + ".join(s for s in said if s) or "none"


@dataclass(frozen=True, eq=False)
class Spread:
    """How uncertain one part is. joint: (4, 4) covariance of axis tilts (rad) and shifts (m) in the basis of
    `Joint.covariance`, rows and columns of the shifts zero for a slide; contact: m, one sigma along each
    axis; mass (kg), friction, damping, frictionloss: (low, high). missing: a line each."""

    joint: Array
    contact: float
    mass: tuple[float, float]
    friction: tuple[float, float]
    damping: tuple[float, float]
    frictionloss: tuple[float, float]
    missing: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Draw:
    """One real part: its joint, its geometry's shift (3,) m off the twin's, mass (kg) and joint physics."""

    joint: Joint
    contact: Array
    mass: float
    friction: float
    damping: float
    frictionloss: float


def spread_of(part: Part) -> Spread:
    """The uncertainty that a part with physics states, and what stands in for what it does not state."""
    missing: list[str] = []
    covariance = _joint_covariance(part, missing)
    missing.append(
        f"{part.name}: contact states no uncertainty; used {1000 * CONTACT_SIGMA:g} mm along each axis"
    )
    physics = physics_of(part)
    return Spread(
        covariance,
        CONTACT_SIGMA,
        inertial_of(part).mass.interval,
        physics.friction.interval,
        physics.damping.interval,
        physics.frictionloss.interval,
        missing=tuple(missing),
    )


def _joint_covariance(part: Part, missing: list[str]) -> Array:
    joint = part.joint
    out = np.zeros((4, 4))
    if joint.covariance is not None:
        n = len(joint.covariance)
        out[:n, :n] = joint.covariance
        return out
    axis, pivot = AXIS_SIGMA, PIVOT_SIGMA
    source = "the default"
    if joint.sigma is not None:
        axis, source = joint.sigma.axis, "its sigma"
        pivot = joint.sigma.pivot if joint.sigma.pivot is not None else PIVOT_SIGMA
    said = f"axis {np.rad2deg(axis):.2g}°"
    out[:2, :2] = np.eye(2) * axis**2
    if isinstance(joint, Revolute):
        out[2:, 2:] = np.eye(2) * pivot**2
        said += f", pivot {1000 * pivot:.2g} mm"
    missing.append(f"{part.name}: joint states no covariance; used {source} in every direction ({said})")
    return out


def draw(part: Part, spread: Spread, sizes: ErrorSizes | None, seed: int, trial: int) -> Draw:
    """One real part; equal for equal arguments.

    Axis and pivot are normal with the joint's covariance, the contact normal along each axis, the rest
    uniform in its interval. With `sizes` the first three have exactly these lengths and a uniform direction.
    A trial's directions and physics are the same in every row, so rows differ by sizes of errors alone.
    """
    rng = np.random.default_rng([seed, trial])
    z, c, u = rng.normal(size=4), rng.normal(size=3), rng.uniform(size=4)
    if sizes is None:
        shift = _root(spread.joint) @ z
        contact = spread.contact * c
    else:
        shift = np.concatenate([sizes.axis * geo.unit(z[:2]), sizes.pivot * geo.unit(z[2:])])
        contact = sizes.contact * geo.unit(c)
    low, high = np.array([getattr(spread, key) for key in _QUANTITIES]).T
    mass, friction, damping, loss = (low + u * (high - low)).tolist()
    return Draw(part.joint.plus(shift), contact, mass, friction, damping, loss)


def _root(covariance: Array) -> Array:
    """Matrix A with A A^T = covariance, also of a singular one."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def perturbed(world: World, part: Part, drawn: Draw) -> World:
    """A copy of the scene in which one part is the drawn one; the robot and everything else stay.

    The part's shapes keep their place at state 0 but for the contact's shift, whatever the joint: an axis
    error shows only once the part moves. It is the scene that `build_world` makes of the drawn part, without
    building it again, over half as long as the replay (0.05 of 0.09 s, a reconstructed drawer).
    """
    model = copy.copy(world.model)
    dof, own = world.part_dof[part.id], inertial_of(part)
    body, joint = model.dof_bodyid[dof], model.dof_jntid[dof]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    to_body = data.xmat[body].reshape(3, 3).T
    model.jnt_axis[joint] = to_body @ drawn.joint.axis
    if isinstance(drawn.joint, Revolute):
        # Not by the difference of pivots: the exported joint may lie anywhere on the axis; tilts move points.
        anchor = data.xanchor[joint]
        drawn_anchor = geo.nearest_point_on_line(anchor, drawn.joint.pivot, drawn.joint.axis)
        model.jnt_pos[joint] += to_body @ (drawn_anchor - anchor)
    model.body_mass[body] = drawn.mass
    model.body_inertia[body] *= drawn.mass / own.mass.value
    model.dof_damping[dof] = drawn.damping
    model.dof_frictionloss[dof] = drawn.frictionloss
    model.dof_armature[dof] = armature(drawn.joint, _drawn_inertial(part, drawn))
    geoms = world.geom_part == part.id
    # MuJoCo takes a pair's larger friction, the finger pads': a slippery part must be slippery at these.
    model.geom_friction[geoms | world.finger, 0] *= drawn.friction / physics_of(part).friction.value
    if np.any(drawn.contact):
        # Shapes and centre of mass together: MuJoCo's bounding volumes are relative to the latter.
        magnets = [*model.pair_geom1, *model.pair_geom2]  # the catch stays where it holds
        shifted = geoms & ~np.isin(np.arange(model.ngeom), magnets)
        model.geom_pos[shifted] += to_body @ drawn.contact
        model.body_ipos[body] += to_body @ drawn.contact
        model.geom_sameframe[geoms] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        model.body_sameframe[body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return replace(world, model=model)


def _drawn_inertial(part: Part, drawn: Draw) -> Inertial:
    own = inertial_of(part)
    heavier = own.with_mass(Quantity(drawn.mass, own.mass.source, (drawn.mass, drawn.mass)))
    return replace(heavier, com=own.com + drawn.contact, com_interval=None)


def path_error(part: Part, drawn: Draw, point: Array, goal: float) -> float:
    """Largest distance (m) between where the robot expects the held point (3,) of the part and where it is,
    from state 0 to the goal: axis, pivot and contact error in one length."""
    states = np.linspace(0.0, goal, 33)
    expected = geo.transform(part.joint.poses(states), point[None])[:, 0]
    real = geo.transform(drawn.joint.poses(states), (point + drawn.contact)[None])[:, 0]
    return float(np.linalg.norm(real - expected, axis=1).max())


def closes_itself(part: Part, drawn: Draw, state: float) -> bool:
    """True when the drawn part's weight, or a catch, overcomes dry friction at `state` and pulls it shut."""
    com = inertial_of(part).com + drawn.contact
    lift = float(drawn.joint.velocity(state, com)[2])  # height gained per unit of state
    return drawn.mass * GRAVITY * lift + physics_of(part).caught(state) > drawn.frictionloss

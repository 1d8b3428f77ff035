"""What a part weighs and how it resists: its own values, which `twin.physics` fills in where nobody stated them."""

from __future__ import annotations

from twin.errors import SceneError
from twin.geometry import Array
from twin.physics.joints import GRAVITY
from twin.quantities import Inertial, PartPhysics
from twin.scene import Part


def inertial_of(part: Part) -> Inertial:
    """Mass, centre and tensor. Raises SceneError where the part has none."""
    if part.inertial is None:
        raise SceneError(f"part {part.name!r} has no mass", "call twin.physics.with_physics first")
    return part.inertial


def physics_of(part: Part) -> PartPhysics:
    """Friction and resistance. Raises SceneError where the part has none."""
    if part.physics is None:
        raise SceneError(f"part {part.name!r} has no friction", "call twin.physics.with_physics first")
    return part.physics


def frictionloss(part: Part) -> float:
    """Dry friction of the joint in N or N m."""
    return physics_of(part).frictionloss.value


def joint_damping(part: Part) -> float:
    """Viscous damping of the joint in N s/m or N m s/rad."""
    return physics_of(part).damping.value


def part_friction(part: Part) -> float:
    """Sliding friction of the part's surface."""
    return physics_of(part).friction.value


def weight_load(part: Part, state: float) -> float:
    """Force along the joint (N or N m) that the part's weight asks for at a state; > 0 where opening lifts it."""
    mass, com = mass_and_com(part)
    return mass * GRAVITY * float(part.joint.velocity(state, com)[2])


def mass_and_com(part: Part) -> tuple[float, Array]:
    """Mass (kg) and centre of mass (3,)."""
    own = inertial_of(part)
    return own.mass.value, own.com


def inertia(part: Part) -> Array:
    """Inertia tensor (3, 3) kg m^2 about the centre of mass."""
    return inertial_of(part).inertia

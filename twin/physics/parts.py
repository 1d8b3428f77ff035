"""What a part weighs and how it resists: its own values, or those that `with_physics` fills in."""

from __future__ import annotations

from twin.errors import SceneError
from twin.physics.simulation import GRAVITY
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


def weight_load(part: Part, state: float) -> float:
    """Force along the joint (N or N m) that the part's weight asks for at a state; > 0 if opening lifts."""
    own = inertial_of(part)
    return own.mass.value * GRAVITY * float(part.joint.velocity(state, own.com)[2])

"""What a part weighs and how it resists: its own values, else stand-ins that are stated here."""

from __future__ import annotations

import numpy as np

from twin.geometry import Array
from twin.scene import Part

# Used where a part carries no physics of its own: a light kitchen door or drawer with a tired catch (chosen by us from
# the 7-14 N that logged doors take after the catch).
DEFAULT_FRICTION = 0.6
_DEFAULT_DAMPING = {"prismatic": 5.0, "revolute": 0.5}  # N s/m, N m s/rad
_DEFAULT_FRICTIONLOSS = {"prismatic": 4.0, "revolute": 0.8}  # N, N m
GRAVITY = 9.81  # m/s^2, as in MuJoCo
_PANEL_MASS = 6.0  # kg per m^2 of surface: both faces of a 16 mm board of 750 kg/m^3


def frictionloss(part: Part) -> float:
    """Dry friction of the joint in N or N m: the part's own, else a default."""
    return part.physics.frictionloss.value if part.physics else _DEFAULT_FRICTIONLOSS[part.joint.kind]


def joint_damping(part: Part) -> float:
    """Viscous damping of the joint in N s/m or N m s/rad: the part's own, else a default."""
    return part.physics.damping.value if part.physics else _DEFAULT_DAMPING[part.joint.kind]


def part_friction(part: Part) -> float:
    """Sliding friction of the part's surface: the part's own, else a default."""
    return part.physics.friction.value if part.physics else DEFAULT_FRICTION


def weight_load(part: Part, state: float) -> float:
    """Force along the joint (N or N m) that the part's weight asks for at a state; > 0 where opening lifts it."""
    mass, com = mass_and_com(part)
    return mass * GRAVITY * float(part.joint.velocity(state, com)[2])


def mass_and_com(part: Part) -> tuple[float, Array]:
    """Mass (kg) and centre of mass (3,): the part's own, else boards as large as its mesh."""
    if part.inertial is not None:
        return part.inertial.mass.value, part.inertial.com
    return max(_PANEL_MASS * part.mesh.area, 0.1), part.mesh.area_centroid


def inertia(part: Part) -> Array:
    """Inertia tensor (3, 3) kg m^2 about the centre of mass: the part's own, else that of a block as large as its mesh."""
    if part.inertial is not None:
        return part.inertial.inertia
    size = np.maximum(np.ptp(part.mesh.vertices, axis=0), 0.01)
    return np.diag(mass_and_com(part)[0] / 12 * (np.sum(size**2) - size**2))

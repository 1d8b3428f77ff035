"""What a joint adds to its part: armature, damping and dry friction, in proportion to its weight.

With I the inertia about the joint (kg m^2, or kg of a slide) and m the mass, the radius of gyration r =
sqrt(I / m) is the lever at which the whole mass would turn alike. Then armature = I / 100, damping = I /
decay time and friction loss = share x m g r, of a slide share x m g. So a lid of 3 cm and a wardrobe door
slow down alike. The part's payload is not counted: finding another part changes nothing here.
"""

from __future__ import annotations

import numpy as np

from twin.physics.materials import JointLaw
from twin.physics.simulation import ARMATURE_SHARE, GRAVITY
from twin.quantities import Inertial, Quantity
from twin.scene import Joint, Revolute


def inertia_about(joint: Joint, inertial: Inertial) -> float:
    """What a part opposes to being moved along its joint: kg m^2 about a hinge (Steiner), kg on a slide."""
    mass = inertial.mass.value
    if not isinstance(joint, Revolute):
        return mass
    arm = np.cross(joint.axis, inertial.com - joint.pivot)
    return float(joint.axis @ inertial.inertia @ joint.axis + mass * arm @ arm)


def armature(joint: Joint, inertial: Inertial) -> float:
    """Added inertia of the joint in exports and replays: a hundredth of the part's own (kg m^2 or kg)."""
    return ARMATURE_SHARE * inertia_about(joint, inertial)


def weight_on_lever(joint: Joint, inertial: Inertial) -> float:
    """m g r with the radius of gyration r about a hinge (N m), m g of a slide (N): friction's unit."""
    return GRAVITY * float(np.sqrt(inertia_about(joint, inertial) * inertial.mass.value))


def resistance(joint: Joint, inertial: Inertial, law: JointLaw) -> dict[str, Quantity]:
    """damping (N m s/rad or N s/m) and frictionloss (N m or N) of a part.

    Intervals hold for any mass, decay time or share in theirs; the spread of mass counts for little here.
    """
    turning = isinstance(joint, Revolute)
    inertia, load, mass = inertia_about(joint, inertial), weight_on_lever(joint, inertial), inertial.mass
    low, high = (m / mass.value for m in mass.interval)
    share, decay = law.friction, law.decay
    against = "inertia about the hinge" if turning else "mass"
    lever = "weight x radius of gyration about the hinge" if turning else "weight"
    return {
        "damping": Quantity(
            inertia / decay.value,
            _said(f"{against} / {decay.value:g} s", decay),
            (inertia * low / decay.interval[1], inertia * high / decay.interval[0]),
        ),
        "frictionloss": Quantity(
            load * share.value,
            _said(f"{share.value:g} x {lever}", share),
            (load * low * share.interval[0], load * high * share.interval[1]),
        ),
    }


def _said(formula: str, number: Quantity) -> str:
    """The source of a table number after a formula: its word, the formula, the number's own source."""
    word, _, detail = number.source.partition(": ")
    return f"{word}: {formula}; {detail}"

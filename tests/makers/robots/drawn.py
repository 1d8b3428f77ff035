"""Parts as a trial draws them."""

from __future__ import annotations

import numpy as np

from robots.trials.perturbation import Draw
from twin.physics import inertial_of, physics_of
from twin.scene import Part


def nominal(part: Part) -> Draw:
    """The part as its twin says."""
    own = physics_of(part)
    values = (q.value for q in (inertial_of(part).mass, own.friction, own.damping, own.frictionloss))
    return Draw(part.joint, np.zeros(3), *values)

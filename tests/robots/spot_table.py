"""Spot's arm as its manufacturer publishes it, apart from our model."""

from __future__ import annotations

import numpy as np

# joint, type, origin in the frame before it, lower, upper, torque: the manufacturer's robot description
ARM = [
    ("arm_sh0", "RZ", (0.292, 0.0, 0.188), -2.61799, 3.14159, 90.9),
    ("arm_sh1", "RY", (0.0, 0.0, 0.0), -3.14159, 0.523599, 181.8),
    ("arm_el0", "RY", (0.3385, 0.0, 0.0), 0.0, 3.14159, 90.9),
    ("arm_el1", "RX", (0.4033, 0.0, 0.075), -2.79253, 2.79253, 30.3),
    ("arm_wr0", "RY", (0.0, 0.0, 0.0), -1.8326, 1.8326, 30.3),
    ("arm_wr1", "RX", (0.0, 0.0, 0.0), -2.87979, 2.87979, 30.3),
]
HAND = (0.19557, 0.0, 0.0)  # of the hand frame in the last link

# tool axes in the hand's: z is the hand's x (out), y its z (the claw closes downwards), x its y
TOOL_AXES = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])

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

# link of our model, mass, centre, principal moments and the roll, pitch, yaw of their axes: spot_description
# of the ROS 2 driver
INERTIALS = [
    ("shoulder", 2.3364, (-0.01237, -0.00005, -0.02103), (0.009014, 0.005835, 0.007787), (0.001, -0.1543, 0.007)),
    ("upper_arm", 0.2596, (0.00002, 0.0, -0.00001), (0.000203, 0.000171, 0.000204), (0.010, -0.5123, 0.002)),
    ("elbow", 0.725, (0.05537, 0.00024, 0.04827), (0.000822, 0.002005, 0.001972), (-0.004, -0.6136, 0.0)),
    ("forearm", 0.725, (-0.12578, -0.01368, 0.0001), (0.000625, 0.004402, 0.004516), (-0.150, -0.0008, 0.004)),
    ("wrist", 0.98, (0.00821, -0.01205, 0.00003), (0.000985, 0.000892, 0.001235), (-0.495, 0.0034, 0.020)),
    ("hand", 0.785, (0.12517, 0.0001, -0.014), (0.000767, 0.001763, 0.001682), (0.006, 0.2929, -0.023)),
    ("upper_jaw", 0.2, (0.04788, -0.00021, -0.01629), (0.000144, 0.000301, 0.000391), (0.0, 0.3752, -0.004)),
]  # fmt: skip

# tool axes in the hand's: z is the hand's x (out), y its z (the claw closes downwards), x its y
TOOL_AXES = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])

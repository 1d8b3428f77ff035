"""How a twin is simulated: the one table of what exports state and replays run with.

What is not here is MuJoCo's own in both: no softness of contacts or limits (solref, solimp) is written,
because a reader other than MuJoCo takes such a number for something else. Damping, friction and sliding
friction belong to each part (`twin.physics`).
"""

from __future__ import annotations

GRAVITY = 9.81  # m/s^2, as in MuJoCo
TIMESTEP = 0.002  # s, MuJoCo's own; 4 ms still works, 2 ms leaves room for stiff contacts
# Semi-implicit in the velocities: what is damped or driven by a servo stays stable at this step.
INTEGRATOR = "implicitfast"
# A fingertip that holds by friction creeps with MuJoCo's own (pyramidal, 1): 36 of 72 replays on parts that
# differ from their twins were clean, and 60 with these.
CONE = "elliptic"
IMPRATIO = 10.0
# m, torsional friction beside a surface's sliding friction: MuJoCo's own.
TORSIONAL = 0.005
# m, rolling friction: MuJoCo's own.
ROLLING = 0.0001
# Inertia that simulators add to a joint, as a share of the part's; chosen by us: not felt, never nothing.
ARMATURE_SHARE = 0.01
# MuJoCo's dry friction is soft and yields to a steady pull: of 3.7 N m a lid lets go 11 degrees in 10 s, and
# 0.015 with this impedance (its largest). Only joints that hold a part where it rested in the recording have
# it; in URDF, which has no place for it, one iteration of the solver that forgets all softness of friction
# stands for it in the whole model.
HOLDING_IMPEDANCE = 0.9999
HOLDING_ITERATIONS = 1

"""A twin in PyBullet: python examples/pybullet_load.py RUN/export/urdf/NAME.urdf"""

import sys

import pybullet as p

p.connect(p.DIRECT)  # p.GUI shows it
p.setGravity(0, 0, -9.81)
# The line that matters: without the flag Bullet replaces the inertia of every part.
twin = p.loadURDF(sys.argv[1], useFixedBase=True, flags=p.URDF_USE_INERTIA_FROM_FILE)
joints = {}
for j in range(p.getNumJoints(twin)):
    info = p.getJointInfo(twin, j)
    if info[2] != p.JOINT_FIXED:
        joints[info[1].decode()] = j
        # Bullet holds every joint with a motor of its own; as strong as the joint's friction it is that
        # friction.
        p.setJointMotorControl2(twin, j, p.VELOCITY_CONTROL, force=info[7])
for j in joints.values():
    p.resetJointState(twin, j, p.getJointInfo(twin, j)[9])  # open; 0 is closed
for _ in range(240):
    p.stepSimulation()
for name, j in joints.items():
    print(f"{name} stays open at {p.getJointState(twin, j)[0]:.3f}")

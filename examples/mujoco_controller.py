"""A controller of your own in the scene of a replay: python examples/mujoco_controller.py
RUN/replay/franka/drawer

`twin replay RUN` writes that folder. Its scene.xml holds robot, twin, keyframes and one actuator for each
joint, and needs nothing but MuJoCo. Here the arm follows the planned joints with a feed-forward of your own
making; replace `command`.
"""

import json
import sys
from pathlib import Path

import mujoco
import numpy as np

folder = Path(sys.argv[1])
model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))  # the line that matters
data = mujoco.MjData(model)
plan = np.load(folder / "trajectory.npz")
told = json.loads((folder / "trajectory.json").read_text())

# The robot's names begin with "robot/"; a part's joint and its motor are called <part>_joint.
arm = [model.actuator(k).id for k in range(model.nu) if model.actuator(k).name.startswith("robot/")]
arm, gripper = arm[: len(told["joint_names"])], arm[-1]
part = model.joint(f"{told['part']}_joint").qposadr[0]
kp, kd = model.actuator_gainprm[arm, 0], -model.actuator_biasprm[arm, 2]
opened, closed = (model.key(name).ctrl[gripper] for name in ("start", "grasp"))


def command(t: float) -> None:
    """Set the controls for time t (s): joint positions, with the velocity and the effort of the plan fed
    forward."""
    q, qd, effort = (
        np.array([np.interp(t, plan["times"], row) for row in plan[name].T]) for name in ("q", "qd", "effort")
    )
    data.ctrl[arm] = q + (kd * qd + effort) / kp
    shut = np.interp(t, plan["times"], plan["gripper"]) < plan["gripper"][0] / 2
    data.ctrl[gripper] = closed if shut else opened


mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
while data.time < plan["times"][-1] + 0.5:
    command(data.time)
    mujoco.mj_step(model, data, nstep=5)  # a controller at 100 Hz
print(f"{told['part']} ends at {data.qpos[part]:.3f}, its goal is {told['goal']:.3f}")

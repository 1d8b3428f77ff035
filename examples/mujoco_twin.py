"""A twin alone in MuJoCo, opened by a force at its handle: python examples/mujoco_twin.py
RUN/export/mjcf/scene.xml drawer 15"""

import sys

import mujoco
import numpy as np

path, part, force = sys.argv[1], sys.argv[2], float(sys.argv[3])
model = mujoco.MjModel.from_xml_path(
    path
)  # the line that matters: floor, light, time step and solver are in it
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, model.key("closed").id)
joint = model.joint(f"{part}_joint")
body, revolute = model.body(part).id, joint.type[0] == mujoco.mjtJoint.mjJNT_HINGE
while data.time < 2.0:
    mujoco.mj_forward(model, data)
    axis, anchor = data.xaxis[joint.id], data.xanchor[joint.id]
    handle = data.xipos[body]  # or the site <part>_grasp of a twin that was recorded
    way = np.cross(axis, handle - anchor) if revolute else axis
    data.qfrc_applied[:] = 0.0
    mujoco.mj_applyFT(
        model, data, force * way / np.linalg.norm(way), np.zeros(3), handle, body, data.qfrc_applied
    )
    mujoco.mj_step(model, data)
print(f"{part} is open by {data.qpos[joint.qposadr[0]]:.3f} of {joint.range[1]:.3f} after 2 s at {force:g} N")

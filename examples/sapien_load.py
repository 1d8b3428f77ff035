"""A twin in SAPIEN (or ManiSkill, whose scenes are SAPIEN's): python examples/sapien_load.py
RUN/export/urdf/NAME.urdf"""

import sys
from xml.etree import ElementTree

import sapien

system = sapien.physx.PhysxCpuSystem()
scene = sapien.Scene([system])  # with a graphics card add sapien.render.RenderSystem() and it is drawn
loader = scene.create_urdf_loader()
loader.fix_root_link = True
twin = loader.load(sys.argv[1])
# The line that matters: SAPIEN's loader drops the joints' friction, so it is read from the file.
friction = {
    j.get("name"): float(j.find("dynamics").get("friction"))
    for j in ElementTree.parse(sys.argv[1]).getroot().iter("joint")
    if j.find("dynamics") is not None
}
for joint in twin.active_joints:
    joint.set_friction(friction[joint.name])
twin.set_qpos([joint.get_limits()[0][1] for joint in twin.active_joints])  # open; 0 is closed
for _ in range(240):
    scene.step()
for joint, q in zip(twin.active_joints, twin.get_qpos(), strict=True):
    print(f"{joint.name} stays open at {q:.3f}")

"""A twin in Isaac Sim: ./python.sh examples/isaac_sim.py RUN/export/usd/NAME_physx.usda"""

import sys

from isaacsim import SimulationApp

app = SimulationApp({"headless": True})  # before any other import of Isaac Sim

from isaacsim.core.api import World
from isaacsim.core.prims import SingleArticulation
from isaacsim.core.utils.stage import add_reference_to_stage

world = World(stage_units_in_meters=1.0)
world.scene.add_default_ground_plane()
# The line that matters: NAME_physx.usda turns on the asset's variant PhysX, in which joints are passive. The
# importer for URDF makes each joint a position servo instead, which holds a door shut.
add_reference_to_stage(sys.argv[1], "/World/twin")
twin = world.scene.add(SingleArticulation("/World/twin", name="twin"))
world.reset()
for _ in range(240):
    world.step(render=False)
print(dict(zip(twin.dof_names, twin.get_joint_positions(), strict=True)))
app.close()

"""USD writer: an asset of interface, payload and libraries, and stages that are ready to simulate.

    <name>.usda                  ready stage for MuJoCo and Newton: the asset with their physics on
    <name>_physx.usda            ready stage for Isaac Sim and other users of PhysX
    <name>/simready_usd/         the asset
        <name>.usda              interface: kind, extents, labels, metadata, variants; others refer to it
        Payload/Contents.usda    sublayers Physics, Materials and Geometry, with libraries
        Textures/                one image per coloured part
        runnables/physics/       payloads of PhysX, Newton and MuJoCo alone, off by default
        runnables/mujoco/        groups, sites and keyframes for MuJoCo, without physics
        runnables/grasps/        grasp lines, off by default

The physics of the payload is plain UsdPhysics, so any reader understands it. UsdPhysics has no passive
damping or friction of joints: these live in the runtime payloads, because readers would add up what several
of them say. Folder and metadata follow NVIDIA's SimReady profile Robotics-Prop 4.0.0. Bodies are siblings
(rigid bodies must not nest); the joints carry the tree.

With the inferred layer, what is drawn of a body is in its instance `visuals` and what collides in
`collisions`, as Isaac Sim's importer has them, so that the copies of an asset in a scene share them. Their
prototypes /visuals/<body> and /colliders/<body> are classes beside the asset's prim in the payload's layers;
materials, labels, custom data and physics of shapes are inside, since USD ignores what is said from outside
of a prim in an instance. Without that layer shapes are children of their bodies, as ever.
"""

from __future__ import annotations

from pathlib import Path

from twin.exporters.asset import AssetInfo
from twin.exporters.tree import Tree, catches_lost
from twin.exporters.usd.geometry import write_geometry
from twin.exporters.usd.interface import write_contents, write_interface, write_stage
from twin.exporters.usd.looks import write_looks
from twin.exporters.usd.physics import write_physics
from twin.exporters.usd.runtimes import MUJOCO_MODEL, write_grasps, write_runtimes
from twin.exporters.usd.thumbnail import write_thumbnail


def write(tree: Tree, folder: Path, info: AssetInfo) -> tuple[Path, list[str]]:
    """Write the asset and its ready stages; returns that for MuJoCo and Newton and what USD can't carry."""
    asset = folder / tree.name / "simready_usd"
    payload, runnables = asset / "Payload", asset / "runnables"
    for place in (payload, runnables / "physics", runnables / "mujoco"):
        place.mkdir(parents=True)
    write_geometry(tree, payload)
    write_looks(tree, payload, asset / "Textures")
    write_physics(tree, payload)
    write_contents(tree, payload)
    write_runtimes(tree, runnables)
    write_grasps(tree, runnables / "grasps")
    interface = asset / f"{tree.name}.usda"
    write_interface(tree, interface, info)
    write_thumbnail(tree, asset / ".thumbs" / "256x256" / f"{interface.name}.png")
    path = folder / f"{tree.name}.usda"
    write_stage(tree, path, "Newton", MUJOCO_MODEL)
    write_stage(tree, folder / f"{tree.name}_physx.usda", "PhysX")
    return path, _not_carried(tree)


def _not_carried(tree: Tree) -> list[str]:
    lost = ["usd: the keyframes closed and open are carried for MuJoCo only (UsdPhysics has none)"]
    if any(k.grasp is not None for k in tree.links):
        lost.append("usd: grasp frames are plain Xforms <part>/<part>_grasp without a physics meaning")
    lost += [f"usd: {text} (no schema has it)" for text in catches_lost(tree)]
    return lost

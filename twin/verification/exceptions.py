"""What each engine is known to lose of a format: a table of `twin check` and of benchmarks/engines.md.

A field of the table is compared all the same wherever the engine yields something for it. When that agrees
after all, the check reports an unexpected pass: the engine has learnt it, and the entry can go. Every entry
was seen with the version pinned in twin/engines/ or constraints.txt.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

ANY = "any"


@dataclass(frozen=True)
class Unsupported:
    """`field` of `format` that `engine` (or any) does not take, and why.

    instead: the value that the engine uses, where it is a number; a twin that has it can't tell. says:
    pattern of the lines with which the engine's loader says so.
    """

    engine: str
    format: str
    field: str
    reason: str
    instead: float | None = None
    says: str = ""


# fmt: off
TABLE: tuple[Unsupported, ...] = (
    Unsupported(ANY, "urdf", "armature", "URDF has no armature", instead=0.0),
    Unsupported(ANY, "urdf", "friction", "URDF has no contact friction; set it in the simulator", instead=1.0),
    Unsupported(ANY, "urdf", "contact exclusion", "URDF has no pairs that must not collide; the shapes keep clear instead"),
    Unsupported("mujoco", "usd", "parent frame", "MuJoCo takes a joint from its frame in the child and the closed poses; a "
                "contradicting frame in the parent goes unnoticed (Newton sees it)"),
    Unsupported("pinocchio", "mjcf", "friction", "Pinocchio has no contact friction"),
    Unsupported("yourdfpy", "urdf", "mass_diagonal", "yourdfpy has no dynamics"),
    Unsupported("yourdfpy", "urdf", "rollout", "yourdfpy has no dynamics"),
    Unsupported("drake", "urdf", "frictionloss", "MultibodyPlant has no dry friction of joints",
                says="non-zero value for the 'friction' attribute of a joint/dynamics tag"),
    Unsupported("drake", "mjcf", "frictionloss", "MultibodyPlant has no dry friction of joints",
                says="'frictionloss' found in a 'joint' tag"),
    Unsupported("drake", "mjcf", "armature", "Drake keeps it for joints that have an actuator; ours have none", instead=0.0),
    Unsupported("drake", "mjcf", "rolling friction", "Drake's contact has no torsional or rolling friction",
                says="torsional and rolling friction"),
    Unsupported("drake", "mjcf", "texture", "not read from MJCF", says="'texturedir'|texture element"),
    Unsupported("drake", "mjcf", "grasp site", "sites are not read", says="tag 'site'"),
    Unsupported("drake", "mjcf", "keyframe", "keyframes are not read", says="tag 'keyframe'"),
    Unsupported("drake", "mjcf", "joint sensor", "sensors are not read", says="tag 'sensor'"),
    Unsupported("drake", "mjcf", "catch", "pairs of geoms that collide with nothing else are not read", says="contact pair specified unknown"),
    Unsupported("drake", "mjcf", "time step, solver", "Drake has its own", says="found in a 'option' tag"),
    Unsupported("drake", "mjcf", "reason of a piece", "texts are not read", says="tag 'custom'"),
    *(
        Unsupported("newton", fmt, "flat body", "a sheet's moments meet the triangle inequality as an equation, which single precision "
                    "can miss by a digit; Newton says that it mends it", says="Inertia validation corrected")
        for fmt in ("urdf", "mjcf", "usd")
    ),
    Unsupported("physx", "usd", "mesh_bounds_m", "PhysX loads no visuals"),
    Unsupported("physx", "usd", "friction", "its tensors tell the friction of shapes, not whose they are"),
    Unsupported("physx", "usd", "GPU", "the probe computes on the CPU", says="GPU broadphase requires"),
    Unsupported("pybullet", "urdf", "mesh_bounds_m", "it tells the file of a visual shape, not its vertices"),
    Unsupported("pybullet", "urdf", "unit axis", "it warns of an axis whose length is off by rounding", says="not a unit axis"),
    Unsupported("sapien", "urdf", "mesh_bounds_m", "SAPIEN loads visuals only on a GPU"),
    Unsupported("sapien", "urdf", "frictionloss", "its loader drops the joint's friction and leaves PhysX's default", instead=0.05),
    Unsupported("sapien", "urdf", "massless link", "a link without mass gets 1e-6 kg and 1e-6 kg m2; the probe takes them away"),
)
# fmt: on


def unsupported(engine: str, fmt: str, field: str) -> Unsupported | None:
    """The entry for a field, None when the engine takes it."""
    for e in TABLE:
        if e.engine in (engine, ANY) and e.format == fmt and e.field == field:
            return e
    return None


def expected_to_say(engine: str, fmt: str, line: str) -> bool:
    """True when a loader's line is about something in the table."""
    return any(
        e.says and e.engine in (engine, ANY) and e.format == fmt and re.search(e.says, line) for e in TABLE
    )

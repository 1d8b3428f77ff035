"""The rules: name -> what it finds, what it catches and why that matters."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from twin.lint.model import Fault, LintModel
from twin.lint.rules import files, joints, masses, motion, shapes, sizes, structure, units


@dataclass(frozen=True)
class Rule:
    """`find` yields the faults of a file. `simulates`: it needs the file to have been run in MuJoCo. `stops`:
    with this error in it, running the file would only tell the same again in other words."""

    find: Callable[[LintModel], Iterator[Fault]]
    catches: str
    matters: str
    simulates: bool = False
    stops: bool = True


RULES: Mapping[str, Rule] = {
    "units-kilograms": Rule(
        units.kilograms,
        "a USD stage with physics that does not state kilogramsPerUnit",
        "a reader that composes it into a stage with other units scales masses wrongly, or not at all",
        stops=False,
    ),
    "units-metres": Rule(
        units.metres,
        "a USD stage with physics whose metersPerUnit is missing or not 1",
        "USD's fallback is 0.01, and MuJoCo ignores the value: the twin comes out a hundred times too large or small",
    ),
    "up-axis": Rule(
        units.up_axis,
        "a USD stage with physics whose upAxis is missing or not Z",
        "USD's fallback is Y, and MuJoCo ignores the value: gravity pulls sideways",
    ),
    "number-unreadable": Rule(
        units.unreadable, "a value that is no number, or not as many as belong there", "readers stop, or take zero"
    ),
    "mass-missing": Rule(
        masses.missing,
        "a moving body that nothing gives a mass, or only a reader's default density",
        "URDF readers take zero and fail; MuJoCo and USD take 1000 kg/m³, ten times a hollow door",
    ),
    "mass-value": Rule(
        masses.value, "a mass that is zero, negative or not finite", "the body can't be simulated, or flies off"
    ),
    "inertia-missing": Rule(
        masses.inertia_missing,
        "a mass without an inertia",
        "MuJoCo then ignores a USD mass and takes 1000 kg/m³; URDF readers take zero inertia",
    ),
    "inertia-positive": Rule(
        masses.inertia_positive,
        "an inertia tensor that is not positive definite or not finite",
        "the equations of motion have no solution",
    ),
    "inertia-triangle": Rule(
        masses.inertia_triangle,
        "principal moments of which one is larger than the other two together",
        "no body has such an inertia: a sign of swapped elements or of a wrong frame",
    ),
    "body-scale": Rule(
        shapes.scale,
        "a rigid body, or a round collider, that is scaled differently along its axes",
        "simulators keep one size of a body: they drop or misread the scale, and shapes no longer fit",
    ),
    "limits-order": Rule(joints.order, "a lower limit above the upper one", "readers refuse it, swap it or lock the joint"),
    "limits-empty": Rule(joints.empty, "limits that leave no room, or are not finite", "the part can't be opened"),
    "limits-missing": Rule(
        joints.missing,
        "a URDF joint without lower, upper, effort or velocity",
        "readers take zero: the joint is locked, or has no strength",
    ),
    "limits-unit": Rule(
        joints.unit,
        "limits that look like radians where the file counts in degrees, or the other way round",
        "a door that opens by 1.4 degrees, or through itself",
    ),
    "limits-small": Rule(
        sizes.way,
        "a hinge in radians that turns by less than 2 degrees, or a slide of less than 1 mm",
        "the part looks fixed: its limits were converted twice, or stand in other units",
    ),
    "axis": Rule(joints.axis, "a joint axis that is zero, not finite or not of length one", "readers refuse it or scale the motion"),
    "joint-frames": Rule(
        joints.frames,
        "a USD joint whose two bodies disagree about where it is",
        "the part jumps when the simulation starts",
    ),
    "pivot-off-part": Rule(
        joints.pivot,
        "a hinge whose axis passes beside the part that it carries",
        "the part swings about a point in the air; no other program notices",
    ),
    "joint-target": Rule(joints.target, "a joint that names a body that is not there", "the part is lost or refused"),
    "tree-cycle": Rule(structure.cycle, "bodies that carry each other in a circle, or have two parents", "there is no order in which to build the model"),
    "tree-roots": Rule(structure.roots, "a URDF with no root link, or with several", "readers refuse it or drop all but one"),
    "name-duplicate": Rule(structure.duplicate, "two elements of one kind with the same name", "one of them replaces the other"),
    "name-illegal": Rule(
        structure.illegal,
        "names that are empty or not [A-Za-z][A-Za-z0-9_]*",
        "converters rename them, and scripts no longer find their part",
    ),
    "collider-missing": Rule(
        shapes.missing, "a moving part that is drawn but has no collision shape", "the robot's hand passes through it",
        stops=False,
    ),
    "collider-approximation": Rule(
        shapes.approximation,
        "a USD collision mesh on a moving body with no approximation",
        "simulators don't move triangle meshes: the collider is dropped or replaced",
        stops=False,
    ),
    "part-size": Rule(
        sizes.part,
        "a moving part of more than 5 m or less than 5 mm (an error from ten times that)",
        "lengths in millimetres taken for metres: a door of 400 m, or of 0.4 mm",
        stops=False,
    ),
    "collider-elsewhere": Rule(
        sizes.collider,
        "a body that is drawn across its collider, beside it, or in another size",
        "what is seen is not what is touched: a door stands that lies in every picture",
        stops=False,
    ),
    "shape-unknown": Rule(
        shapes.unknown,
        "a URDF geometry that is no box, cylinder, sphere or mesh",
        "readers leave the shape out without a word; a <capsule> is read by few",
        stops=False,
    ),
    "mesh-unusable": Rule(
        shapes.unusable, "a mesh file that can't be read, or holds no surface", "the shape is missing or the import fails"
    ),
    "mesh-open": Rule(
        shapes.open_surface,
        "a collision mesh that is not closed",
        "volume, mass and inside are not defined: readers differ",
    ),
    "mesh-self-intersecting": Rule(
        shapes.self_intersecting,
        "a collision mesh whose triangles cut each other",
        "convex decomposition and signed distance give wrong shapes",
    ),
    "path-absolute": Rule(files.absolute, "a file named by an absolute path", "it is found on the machine it was made on alone"),
    "path-missing": Rule(files.missing, "a file that is named but not there", "meshes, colours or whole layers are missing"),
    "path-outside": Rule(
        files.outside,
        "a file outside of the description's folder, or at an address",
        "the folder can't be moved or sent on its own",
        stops=False,
    ),
    "refused": Rule(motion.refused, "a file that MuJoCo does not load", "so will others", simulates=True),
    "overlap-at-rest": Rule(
        motion.overlap,
        "collision shapes of a part that reach more than 1 mm into others while everything is at rest",
        "the part is pushed open, sticks or jitters",
        simulates=True,
    ),
    "limit-unreachable": Rule(
        motion.stuck,
        "a joint without a motor that 10 N or 2 N·m do not bring to both of its limits",
        "something blocks or brakes the part: a robot can't open it",
        simulates=True,
    ),
    "drift-at-rest": Rule(
        motion.drift,
        "a part that nobody touches and that moves by more than 1 mm in 10 s",
        "the twin does not stay as it was recorded",
        simulates=True,
    ),
}  # fmt: skip

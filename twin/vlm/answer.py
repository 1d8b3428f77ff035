"""What a model is asked about a part's mass, and its answer read against the schema that it was given."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from twin.errors import ServiceError
from twin.geometry import Array
from twin.physics.materials import MaterialTable
from twin.scene import Part

INSTRUCTIONS = """\
You estimate what household parts weigh, for a physics simulator. You see one picture and read a description of one part; the
part is outlined or tinted in the picture as the description says. Judge what it is, of which materials such parts are usually
built and how thick their walls are. Doors, drawers and housings are hollow or made of boards and sheets: count the boards and
sheets, never the enclosed space. Mass must follow from your own geometry and density, the inertia tensor from your mass and
geometry about the centre of mass. Use SI units only: metres, kilograms, kilograms per cubic metre. Answer with one JSON object
and nothing else, with these fields:
{"object_name": text,
 "assumed_geometry": {"shape": text, "dimensions_m": {"<name of a length>": number, ...}},
 "assumed_material": text, one of the listed materials where one fits, else your own word,
 "estimated_density_kg_m3": number, of the material itself,
 "estimated_mass_kg": number,
 "inertia_tensor_kg_m2": {"Ixx": number, "Iyy": number, "Izz": number, "Ixy": number, "Ixz": number, "Iyz": number},
 "notes": text, the assumptions that matter most}
"""
_MOMENTS = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")


def describe(
    part: Part, edges: Sequence[float], words: str, origin: str, mark: str, table: MaterialTable
) -> str:
    """The text beside the picture: which part, how it moves and how large its surface is.

    Args:
        edges: (3,) m, of its tightest box.
        words: the user's description.
        origin: where the picture is from.
        mark: how the part is marked in it.
    """
    moves = "turns on a hinge" if part.joint.kind == "revolute" else "slides"
    size = " x ".join(f"{v:.2f}" for v in edges)
    return (
        f"The picture is {origin}. The part is {mark}: {words or 'a moving part of furniture or of an appliance'}. "
        f"It {moves}. Its reconstructed surface fits into a box of {size} m; the sides that nobody saw are missing from it. "
        f"Materials: {', '.join(table.materials)}."
    )


@dataclass(frozen=True, eq=False)
class PhysicalAnswer:
    """A model's answer that has every field with the right type; nothing is compared with the part yet.

    dimensions: lengths (n,) m. density: kg/m^3. mass: kg. inertia: (3, 3) kg m^2.
    """

    name: str
    shape: str
    dimensions: Array
    material: str
    density: float
    mass: float
    inertia: Array
    notes: str


def read_physical(text: str) -> PhysicalAnswer:
    """Read an answer to INSTRUCTIONS. Raises ServiceError that names the field and what is wrong with it."""
    top = Fields("", json_object(text))
    geometry = top.child("assumed_geometry")
    lengths = geometry.child("dimensions_m")
    dimensions = [lengths.number(k) for k in lengths.value]
    if not dimensions or min(dimensions) <= 0:
        lengths.wrong("", "must hold positive lengths")
    mass, density = top.number("estimated_mass_kg"), top.number("estimated_density_kg_m3")
    for key, value in (("estimated_mass_kg", mass), ("estimated_density_kg_m3", density)):
        if value <= 0:
            top.wrong(key, f"must be positive, is {value:g}")
    tensor = top.child("inertia_tensor_kg_m2")
    xx, yy, zz, xy, xz, yz = (tensor.number(k) for k in _MOMENTS)
    return PhysicalAnswer(
        name=top.text("object_name"),
        shape=geometry.text("shape"),
        dimensions=np.array(dimensions),
        material=top.text("assumed_material"),
        density=density,
        mass=mass,
        inertia=np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]),
        notes=top.text("notes") if "notes" in top.value else "",
    )


def json_object(text: str) -> Mapping[str, Any]:
    """The JSON object in an answer, which may stand in a fence or between sentences.

    Raises ServiceError when there is none, or when it holds NaN or infinity.
    """
    fenced = re.search(r"```(?:json)?\s*(\{.*\})\s*```", text, re.DOTALL)
    start, end = text.find("{"), text.rfind("}")
    body = fenced[1] if fenced else text[start : end + 1] if 0 <= start < end else text

    def refuse(constant: str) -> NoReturn:
        raise ValueError(f"{constant} is no number")

    try:
        value = json.loads(body, parse_constant=refuse)
    except (ValueError, RecursionError) as e:
        raise ServiceError(f"the model's answer is not JSON: {e}", "ask again with --refresh") from None
    if not isinstance(value, dict):
        raise ServiceError("the model's answer is not a JSON object", "ask again with --refresh")
    return value


@dataclass(frozen=True)
class Fields:
    """One object of an answer and the path to it; every error names the field."""

    path: str
    value: Mapping[str, Any]

    def wrong(self, key: str, problem: str) -> NoReturn:
        where = ".".join(x for x in (self.path, key) if x)
        raise ServiceError(f"the model's answer is refused: {where} {problem}", "ask again with --refresh")

    def raw(self, key: str) -> Any:
        if key not in self.value:
            self.wrong(key, "is missing")
        return self.value[key]

    def child(self, key: str) -> Fields:
        value = self.raw(key)
        if not isinstance(value, dict):
            self.wrong(key, f"must be an object, is {value!r:.40}")
        return Fields(f"{self.path}.{key}".lstrip("."), value)

    def children(self, key: str) -> Sequence[Fields]:
        value = self.raw(key)
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            self.wrong(key, f"must be a list of objects, is {value!r:.40}")
        return [Fields(f"{self.path}.{key}[{k}]".lstrip("."), v) for k, v in enumerate(value)]

    def text(self, key: str) -> str:
        value = self.raw(key)
        if not isinstance(value, str) or not value.strip():
            self.wrong(key, f"must be a text, is {value!r:.40}")
        return "".join(c if c.isprintable() else " " for c in value).strip()[:200]

    def number(self, key: str) -> float:
        value = self.raw(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.wrong(key, f"must be a number, is {value!r:.40}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.wrong(key, "must be a finite number")
        return number

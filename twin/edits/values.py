"""What a user writes for an edit: states and lengths with units, points, directions by word or numbers."""

from __future__ import annotations

import math

import numpy as np

from twin import geometry as geo
from twin.completion.frame import front_face, viewer
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Part, Prismatic, Twin
from twin.units import ANGLES, LENGTHS, number_and_unit

SNAPS = {
    "vertical": "straight up or down",
    "horizontal": "level, otherwise as it is",
    "front": "along the normal of the part's front",
    "edge": "along the edge of the front that is nearest to it",
}


def state_of(part: Part, what: str, text: str) -> float:
    """A state in m or rad of a text such as "92deg" or "0.4". Raises InputError."""
    sizes = ANGLES if part.joint.kind == "revolute" else LENGTHS
    number, unit = number_and_unit(text)
    size = sizes.get(unit or next(iter(sizes)))
    if not math.isfinite(number) or size is None:
        remedy = f"give a number in {next(iter(sizes))}, or one with {' or '.join(sizes)} behind it"
        raise InputError(f"{what} = {text!r} is no state of part {part.name!r}", remedy)
    return number * size


def number_of(what: str, text: str) -> float:
    """A finite number. Raises InputError."""
    number, unit = number_and_unit(text)
    if not math.isfinite(number) or unit:
        raise InputError(f"{what} = {text!r} is no number", "give one such as 3.2")
    return number


def point_of(what: str, text: str) -> list[float]:
    """Three finite numbers, m. Raises InputError."""
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 3 or not all(map(math.isfinite, values)):
        raise InputError(f"{what} = {text!r} is no point", "write three numbers, such as 0.4,-0.1,0.9")
    return values


def axis_of(twin: Twin, part: Part, text: str) -> list[float]:
    """A unit direction that opens as the part's axis does, of a word of `SNAPS` or three numbers.

    Raises InputError for another text, and where the part shows no flat front to snap to.
    """
    axis = part.joint.axis
    if text == "vertical":
        snapped = np.array([0.0, 0.0, 1.0])
    elif text == "horizontal":
        snapped = np.array([axis[0], axis[1], 0.0])
    elif text in ("front", "edge"):
        snapped = _of_front(twin, part, text)
    elif text.replace("_", "").isalpha():
        raise InputError(f"axis = {text!r} is no direction", f"write three numbers, or {', '.join(SNAPS)}")
    else:
        snapped = np.array(point_of("axis", text))
    length = float(np.linalg.norm(snapped))
    if not length > 1e-9:
        raise InputError(f"axis = {text!r} has no direction here", "write three numbers, not all zero")
    snapped = snapped / length
    return [float(v) + 0.0 for v in (snapped if snapped @ axis >= 0 else -snapped)]


def _of_front(twin: Twin, part: Part, word: str) -> Array:
    """The normal of the front, or that of its edges which is nearest to the axis; by its surface alone."""
    import cv2

    face = front_face(part, viewer(twin.cameras))
    if face is None:
        raise InputError(f"{part.name} has no flat front to snap to", "write the axis as three numbers")
    if word == "front":
        return face.normal
    flat = geo.orthogonal_basis(face.normal)[:, :2]  # two directions in the front's plane
    _, _, turn = cv2.minAreaRect((face.points @ flat).astype(np.float32))
    along = np.deg2rad(turn)
    edges = [flat @ [np.cos(along), np.sin(along)], flat @ [-np.sin(along), np.cos(along)]]
    edges += [face.normal] if isinstance(part.joint, Prismatic) else []
    return np.asarray(max(edges, key=lambda e: abs(float(e @ part.joint.axis))))


def degrees_between(a: Array, b: Array) -> float:
    """Angle of two lines, degrees."""
    return float(np.rad2deg(np.arccos(min(1.0, abs(float(geo.unit(a) @ geo.unit(b)))))))

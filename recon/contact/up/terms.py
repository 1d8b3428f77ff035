"""The likelihood of what is seen if a direction is up: a log-likelihood summed over five witnesses.

The figures describe people and furniture. They are chosen by us where no source is named, before 25 open
recordings that look steeply (seeds 5000 to 5024, true parts) were looked at; these changed one, as noted.
"""

from __future__ import annotations

import math

import numpy as np

from recon.contact.up.evidence import PartShown, UpEvidence
from twin import geometry as geo
from twin.geometry import Array
from twin.level import Plane

# Degrees. Who opens furniture looks a little down, at most straight at the feet, hardly ever at the ceiling.
_PITCH = -15.0
_PITCH_SIGMA = 22.0
# Degrees. Heads and phones are kept level.
_ROLL_SIGMA = 10.0
# Share of recordings that are held in any way. With .05, a camera that lies on its side was within odds of 20
# in 4 of the first 22 of those recordings, with .02 in one of 25.
_HELD_SOMEHOW = 0.02

# How likely a square metre of a large plane, against one of a wall or of the floor, is a top: it faces up and
# is not the lowest that does,
_TOP = 0.6
# a ceiling: it is the highest that faces down,
_CEILING = 0.4
# or an underside: it faces down below that.
_UNDERSIDE = 0.15
# All planes tell as much as so many that have nothing in common, as those of one room have.
_PLANES = 3.0
# m in height within which planes are one floor or one ceiling.
_SAME_HEIGHT = 0.15
# Degrees within which a plane is level.
_LEVEL_DEG = 15.0

# m. Eyes above the floor: women 1.52 +- .06, men 1.63 +- .07 (Gordon et al. 1989), lowered and widened.
_STANDING = 1.5
_STANDING_SIGMA = 0.18
# Share of those that stand; the others kneel or sit.
_STANDS = 0.75
_KNEELING = 1.0
_KNEELING_SIGMA = 0.2
# Share of views whose lowest level plane is the floor.
_IS_FLOOR = 0.6
# m. Else it lies anywhere within so much below the eyes.
_ANY_HEIGHT = 2.5

# Moving parts by their axis and by where their front faces when they are closed; they need not add up to one.
# Most are drawers and sliding doors,
_SLIDE_LEVEL = {"upright": 0.40, "up": 0.02, "down": 0.002, "askew": 0.005}
# few go up and down.
_SLIDE_PLUMB = {"upright": 0.008, "up": 0.001, "down": 0.001, "askew": 0.001}
# Hinged are doors,
_HINGE_PLUMB = {"upright": 0.35, "up": 0.001, "down": 0.001, "askew": 0.002}
# and flaps and lids.
_HINGE_LEVEL = {"upright": 0.07, "up": 0.06, "down": 0.002, "askew": 0.005}
# No furniture has an oblique axis.
_AXIS_ASKEW = 0.001
# Degrees within which an axis and a front are level or plumb; room for sloping lids.
_AXIS_DEG = 20.0
# Share of parts that are closed in the first frames.
_STARTS_SHUT = 0.85
# What is taken for a part and is none: its axis and front mean nothing.
_NO_PART = 0.003

# The arm comes from where the picture has its ground, by a von Mises distribution of this concentration.
_ARM = 2.0
# Share of arms that do; the others come from anywhere, as over an open door.
_ARM_FROM_BELOW = 0.7


def terms(up: Array, seen: UpEvidence) -> dict[str, float]:
    """Log-likelihood (nats, up to a constant for all directions) by witness, for unit vector `up` (3,)."""
    return {
        "camera": _camera(up, seen.camera),
        "planes": _planes(up, seen),
        "floor": _floor(up, seen),
        "parts": sum(_part(up, part) for part in seen.parts),
        "arm": 0.0 if seen.arm is None else _arm(up, seen.camera, seen.arm),
    }


def log_likelihood(up: Array, seen: UpEvidence) -> float:
    """The witnesses' sum."""
    return sum(terms(up, seen).values())


def _camera(up: Array, camera: Array) -> float:
    """How the camera is held: level, and above what it looks at."""
    right, down, forward = camera.T
    pitch = math.degrees(math.asin(float(np.clip(geo.unit(forward) @ up, -1.0, 1.0))))
    roll = math.degrees(math.atan2(float(right @ up), float(-down @ up)))
    held = (1.0 - _HELD_SOMEHOW) * _normal(pitch, _PITCH, _PITCH_SIGMA) + _HELD_SOMEHOW / 180.0
    level = (1.0 - _HELD_SOMEHOW) * _normal(roll, 0.0, _ROLL_SIGMA) + _HELD_SOMEHOW / 360.0
    return math.log(held) + math.log(level)


def _planes(up: Array, seen: UpEvidence) -> float:
    """Large planes by area, outward normal and the order of their heights."""
    above, below = _level(up, seen, 1.0), _level(up, seen, -1.0)
    floor = min((h for h, _ in above), default=0.0)
    ceiling = max((h for h, _ in below), default=0.0)
    tops = sum(p.area for h, p in above if h > floor + _SAME_HEIGHT)
    ceilings = sum(p.area for h, p in below if h >= ceiling - _SAME_HEIGHT)
    undersides = sum(p.area for h, p in below if h < ceiling - _SAME_HEIGHT)
    told = tops * math.log(_TOP) + ceilings * math.log(_CEILING) + undersides * math.log(_UNDERSIDE)
    return _PLANES * told / max(sum(p.area for p in seen.planes), 1e-9)


def _level(up: Array, seen: UpEvidence, side: float) -> list[tuple[float, Plane]]:
    """Planes that face up (side 1) or down (-1), with their heights (m) above the eye."""
    limit = math.cos(math.radians(_LEVEL_DEG))
    return [
        (float((p.centre - seen.eye) @ up), p) for p in seen.planes if side * float(p.normal @ up) > limit
    ]


def _floor(up: Array, seen: UpEvidence) -> float:
    """How high the eyes are above the lowest plane that faces up; 0 without one."""
    heights = [-h for h, _ in _level(up, seen, 1.0)]
    if not heights:
        return 0.0
    h = max(heights)
    people = _STANDS * _normal(h, _STANDING, _STANDING_SIGMA) + (1.0 - _STANDS) * _normal(
        h, _KNEELING, _KNEELING_SIGMA
    )
    return math.log(_IS_FLOOR * people * _ANY_HEIGHT + 1.0 - _IS_FLOOR)


def _part(up: Array, part: PartShown) -> float:
    """A part by its axis and its front, either end of its travel being the closed one."""
    first, other = (_closed(up, part, front) for front in part.fronts)
    return math.log(_STARTS_SHUT * first + (1.0 - _STARTS_SHUT) * other + _NO_PART)


def _closed(up: Array, part: PartShown, front: Array) -> float:
    rise = abs(float(part.axis @ up))
    level, plumb = rise < math.sin(math.radians(_AXIS_DEG)), rise > math.cos(math.radians(_AXIS_DEG))
    if not (level or plumb):
        return _AXIS_ASKEW
    if part.slides:
        return (_SLIDE_LEVEL if level else _SLIDE_PLUMB)[_faces(up, front)]
    return (_HINGE_LEVEL if level else _HINGE_PLUMB)[_faces(up, front)]


def _faces(up: Array, normal: Array) -> str:
    rise = float(normal @ up)
    if abs(rise) < math.sin(math.radians(_AXIS_DEG)):
        return "upright"
    if abs(rise) > math.cos(math.radians(_AXIS_DEG)):
        return "up" if rise > 0.0 else "down"
    return "askew"


def _arm(up: Array, camera: Array, arm: Array) -> float:
    """Where the arm comes from in the picture, against where `up` has its ground."""
    right, down, _ = camera.T
    ground = np.array([-up @ right, -up @ down])
    way = np.array([arm @ right, arm @ down])
    length = float(np.linalg.norm(way))
    # times how much of the picture's plane is plumb
    cosine = float(ground @ way) / length if length > 1e-9 else 0.0
    spread = _ARM * float(np.linalg.norm(ground))
    return math.log(_ARM_FROM_BELOW * math.exp(_ARM * cosine) / float(np.i0(spread)) + 1.0 - _ARM_FROM_BELOW)


def _normal(x: float, mean: float, sigma: float) -> float:
    return math.exp(-0.5 * ((x - mean) / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))

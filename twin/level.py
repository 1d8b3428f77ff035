"""A test of the twin's up against floors, worktops, walls, the travel of drawers and the lines of hinges.

A witness is a direction. The normal of a large plane and the line of a hinge are plumb or level in
furniture that stands; the travel of a slide is level, the short one of a file from elsewhere plumb or
level: its author says which way a button or a burner goes. The up that most witnesses agree with is one of
the normals, of the cross products of pairs, or the twin's own, refined by least squares over the witnesses
that agree. Witnesses that only repeat the twin's up say nothing against it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.by_surface import by_surface
from twin.geometry import Array
from twin.mesh import sample_surface
from twin.scene import Mesh, Twin

# Key of a twin's provenance: the reconstruction's doubts about up, texts.
DOUBTED = "up_doubted"
# All limits are chosen by us. Tilt in doubt, as `twin check` has it: above errors of carpenter and axis.
TILT_DEG = 2.0
# Degrees within which a witness agrees with an up: planes of a clean scan are within .2 deg, axes within 1.
AGREE_DEG = 1.0
# Fewest witnesses against the twin's up: one may be a sloping board.
FEWEST = 2
# Points on the static mesh.
_SAMPLES = 8_000
# Planes that are tried for the next largest.
_GUESSES = 48
# Fewest points of such a plane.
_FEW = 10
# Least edge of a plane, m.
_EDGE = 0.15
# Least area of a plane, m^2: 2 mm of noise tilt the plane by less than half a degree.
_AREA = 0.1
# m from a plane within which points lie on the plane.
_OFF = 0.01
# Least cosine between their normals and the plane's.
_TURNED = math.cos(math.radians(25.0))
# m between parallel planes that count once: the two sides of a board.
_SAME = 0.05
# Least cosine between the normals of parallel planes.
_PARALLEL = math.cos(math.radians(3.0))
# Least sine between two witnesses whose cross product is a direction.
_ACROSS = math.sin(math.radians(20.0))
# m, longest travel of a button or a burner: drawers go farther. Chosen by us.
_BUTTON = 0.06
# Share of a condition: two conditions within 26 degrees are the same.
_SHARED = 0.1
# Up of every twin.
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Witness:
    """Something level or plumb on furniture: what it is, and its unit direction (3,) in the twin's world.

    level_only: the direction is level (a slide's), else level or plumb.
    """

    name: str
    direction: Array
    level_only: bool = False

    def is_level(self, up: Array) -> bool:
        """Whether the witness is nearer to level than to plumb for `up` (3,)."""
        return self.level_only or abs(float(self.direction @ up)) < math.sqrt(0.5)

    def off_deg(self, up: Array) -> float:
        """Degrees to level or plumb, whichever is nearer, for `up` (3,)."""
        rise = math.degrees(math.asin(min(1.0, abs(float(self.direction @ up)))))
        return rise if self.level_only else min(rise, 90.0 - rise)


@dataclass(frozen=True, eq=False)
class Plane:
    """A large flat piece of a surface: unit normal (3,) (either sign), centre (3,) m, and area m^2."""

    normal: Array
    centre: Array
    area: float


@dataclass(frozen=True, eq=False)
class LevelEvidence:
    """What the witnesses say of a twin's up.

    Attributes:
        witnesses: all that were found.
        up: (3,) their up: by witnesses within 2 deg of the twin's, unless more agree on another.
        tilt_deg: between that up and the twin's.
        agree: number of witnesses within 1 deg of that up.
        against: names of those among them that are more than 2 deg off the twin's own.
        spare: their conditions beyond those that fix an up; two that share no condition always agree, on the
            direction square to both.
    """

    witnesses: tuple[Witness, ...]
    up: Array
    tilt_deg: float
    agree: int
    against: tuple[str, ...]
    spare: int

    @property
    def contradicted(self) -> bool:
        """At least two witnesses agree, and not by chance, on an up over 2 deg from the twin's."""
        return self.tilt_deg > TILT_DEG and len(self.against) >= FEWEST and self.spare > 0

    @property
    def text(self) -> str:
        """One line."""
        if not self.witnesses:
            return "nothing level or plumb is large enough to tell up by"
        count = f"{self.agree} of {len(self.witnesses)} planes, slides and hinges"
        if not self.contradicted:
            return f"{count} agree on an up that is {self.tilt_deg:.1f} deg from the twin's"
        return (
            f"up is in doubt: {count} agree on an up that is {self.tilt_deg:.1f} deg from the twin's; against that speak "
            f"{', '.join(self.against)}; reconstruct again and say which way is up with --up"
        )


def level_evidence(twin: Twin) -> LevelEvidence:
    """Compare the twin's up with large static planes, travels of slides and lines of hinges, all closed."""
    return judged(witnesses(twin))


def doubts_about_up(twin: Twin) -> tuple[str, ...]:
    """What contradicts the twin's up, a line each: its reconstruction, and the planes and joints that do."""
    said = twin.provenance.get(DOUBTED, ())
    doubts = tuple(map(str, said)) if isinstance(said, list | tuple) else ()
    evidence = level_evidence(twin)
    return (*doubts, evidence.text) if evidence.contradicted else doubts


def witnesses(twin: Twin) -> tuple[Witness, ...]:
    """The large planes of the static mesh, largest first, then every part's joint on it."""
    found = [Witness(_named(p), p.normal) for p in large_planes(twin.static.mesh)]
    for part in twin.parts:
        if part.parent is None:  # a carried part is as level as its carrier stands
            slides = part.joint.kind == "prismatic"
            name = f"the {'travel' if slides else 'hinge'} of {part.name}"
            button = twin.recorded is None and part.joint.upper - part.joint.lower <= _BUTTON
            found.append(Witness(name, part.joint.axis, slides and not button))
    return tuple(found)


def judged(found: Sequence[Witness]) -> LevelEvidence:
    """The up of most witnesses, of several the nearest to the twin's own; the twin's own, give or take 2 deg,
    if fewer than two of them speak against that."""
    best = max(_candidates(found), key=lambda up: (len(_within(found, up, AGREE_DEG)), float(up @ UP)))
    other = _judged_by(found, _refined(_within(found, best, AGREE_DEG), best))
    return other if other.contradicted else _judged_by(found, _refined(_within(found, UP, TILT_DEG), UP))


def _judged_by(found: Sequence[Witness], up: Array) -> LevelEvidence:
    those = _within(found, up, AGREE_DEG)
    against = [w for w in those if w.off_deg(UP) > TILT_DEG]
    tilt = math.degrees(float(geo.angle_between(up, UP)))
    names = tuple(w.name for w in against)
    return LevelEvidence(tuple(found), up, tilt, len(those), names, _spare(against, up))


def _spare(those: Sequence[Witness], up: Array) -> int:
    """Conditions on `up` by witnesses, one if level, two if plumb, less the directions they fix."""
    form, count = np.zeros((3, 3)), 0
    for w in those:
        level = w.is_level(up)
        form += np.outer(w.direction, w.direction) if level else np.eye(3) - np.outer(up, up)
        count += 1 if level else 2
    return count - int((np.linalg.eigvalsh(form)[1:] > _SHARED).sum())


def _within(found: Sequence[Witness], up: Array, most_deg: float) -> list[Witness]:
    return [w for w in found if w.off_deg(up) <= most_deg]


def _candidates(found: Sequence[Witness]) -> list[Array]:
    """Directions (3,), in the half space of the twin's up, in which up may lie."""
    out = [UP]
    for w in found:
        level = UP - w.direction * (w.direction @ UP)  # the nearest up for which the witness is level
        out += [level] if np.linalg.norm(level) > _ACROSS else []
        out += [] if w.level_only else [w.direction]
    for a, b in combinations(found, 2):
        across = np.cross(a.direction, b.direction)
        out += [across] if np.linalg.norm(across) > _ACROSS else []
    return [geo.unit(v if v[2] >= 0 else -v) for v in out]


def _refined(those: Sequence[Witness], up: Array) -> Array:
    """The up of least squares over witnesses that agree with `up` (3,); `up` decides where they don't."""
    form = 1e-6 * (np.eye(3) - np.outer(up, up))
    for w in those:
        square = np.outer(w.direction, w.direction)
        form += square if w.is_level(up) else np.eye(3) - square
    least = np.linalg.eigh(form)[1][:, 0]
    return np.asarray(least if least @ up > 0 else -least)


@by_surface  # one command asks several times: when parts get physics, on export, in a check
def large_planes(mesh: Mesh) -> tuple[Plane, ...]:
    """Large planes of a mesh, largest first, without parallel ones next to them.

    Each is the best of some guesses (RANSAC, Fischler and Bolles 1981): least-squares planes of a free
    point's neighbours that look the same way; then refit to its own points. Open3D's search for patches
    (0.20) finds none in a cabinet of boards, whose faces are two centimetres apart.
    """
    rng = np.random.default_rng(0)
    points, normals = sample_surface(mesh, _SAMPLES, rng)
    least = max(50, round(_SAMPLES * _AREA / mesh.area)) if len(points) else 1
    kept: list[Plane] = []
    while len(points) >= least:
        guesses = (_fitted(near) for near in _neighbours(points, normals, rng))
        best = max(guesses, key=lambda g: int(_on(points, normals, g, _OFF).sum()), default=None)
        if best is None:
            break
        for _ in range(3):
            own = _on(points, normals, best, _OFF)
            best = _fitted(points[own]) if own.sum() > 3 else best
        if own.sum() < least:
            break
        normal, centre = best
        wide = np.sqrt(np.linalg.eigvalsh(np.cov(points[own].T))[1] * 12) >= _EDGE
        beside = (
            abs(normal @ p.normal) > _PARALLEL and abs(p.normal @ (centre - p.centre)) < _SAME for p in kept
        )
        if wide and not any(beside):
            kept.append(Plane(normal, centre, int(own.sum()) * mesh.area / _SAMPLES))
        rest = ~_on(points, normals, best, 2 * _OFF)
        points, normals = points[rest], normals[rest]
    return tuple(sorted(kept, key=lambda p: -p.area))


def _neighbours(points: Array, normals: Array, rng: np.random.Generator) -> Iterator[Array]:
    """Points (k, 3) m within 15 cm of some random ones that look the same way."""
    for k in rng.choice(len(points), min(_GUESSES, len(points)), replace=False):
        near = geo.every(np.abs(points - points[k]) < _EDGE) & (normals @ normals[k] > _TURNED)
        if near.sum() >= _FEW:
            yield points[near]


def _fitted(points: Array) -> tuple[Array, Array]:
    """Unit normal (3,) and centre (3,) m of the plane of points (n, 3)."""
    centre = points.mean(axis=0)
    return np.linalg.eigh((points - centre).T @ (points - centre))[1][:, 0], centre


def _on(points: Array, normals: Array, plane: tuple[Array, Array], off: float) -> NDArray[np.bool_]:
    """Which points (n,) are within `off` m of a plane (normal, centre) and look to its more frequent side."""
    normal, centre = plane
    near, facing = np.abs((points - centre) @ normal) < off, normals @ normal
    front, back = near & (facing > _TURNED), near & (facing < -_TURNED)
    return np.asarray(front if front.sum() >= back.sum() else back)


def _named(plane: Plane) -> str:
    kind = "level" if abs(plane.normal[2]) > math.sqrt(0.5) else "upright"
    at = " ".join(f"{x:.2f}" for x in plane.centre)
    return f"the {kind} plane of {plane.area:.1f} m2 at ({at}) m"

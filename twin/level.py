"""Is up really up? Floors, worktops and walls, the travel of drawers and the lines of hinges say which way
plumb is; nothing is turned here.

A witness is a direction: of a large plane its normal and of a hinge its line, which are plumb or level in
furniture that stands, and of a slide its travel, which is level. The up that most of them agree with is
looked for among the normals, the cross products of pairs and the twin's own, and is then that of least
squares over those that agree. Witnesses that only repeat the twin's up say nothing against it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.geometry import Array
from twin.mesh import sample_surface
from twin.scene import Mesh, Twin

DOUBTED = "up_doubted"  # of a twin's provenance: what the reconstruction said against its up, texts
# chosen by us, as `twin check` calls a hinge upright: more than a carpenter's error and a reconstructed axis'
TILT_DEG = 2.0
# of a witness and an up; chosen by us: planes fitted to a clean scan are within .2 deg, axes within 1
AGREE_DEG = 1.0
FEWEST = 2  # witnesses against the twin's up; chosen by us: one may be a sloping board
_SAMPLES = 8_000  # points on the static mesh
_GUESSES, _FEW = 48, 10  # planes that are tried for the next largest, and points by which one is
_EDGE = 0.15  # m, least edge of a plane, and
_AREA = 0.1  # m^2, least area; chosen by us: 2 mm of noise tilt it by less than half a degree
_OFF = 0.01  # m from a plane, and
_TURNED = math.cos(
    math.radians(25.0)
)  # of a point's normal from the plane's: still points of it; chosen by us
_SAME = 0.05  # m between parallel planes that count once, the two sides of a board; chosen by us
_PARALLEL = math.cos(math.radians(3.0))  # of their normals
_APART = math.sin(math.radians(20.0))  # of two witnesses whose cross product is a direction; chosen by us
_SHARED = 0.1  # of a condition; chosen by us: two that are less than 26 degrees apart are taken for the same
UP = np.array([0.0, 0.0, 1.0])  # of every twin


@dataclass(frozen=True, eq=False)
class Witness:
    """Something level or plumb on furniture: what it is, and its unit direction (3,) in the twin's world.

    level_only: its direction is level (a slide's); else it is level or plumb.
    """

    name: str
    direction: Array
    level_only: bool = False

    def is_level(self, up: Array) -> bool:
        """Whether it is nearer to level than to plumb where `up` (3,) is up."""
        return self.level_only or abs(float(self.direction @ up)) < math.sqrt(0.5)

    def off_deg(self, up: Array) -> float:
        """Degrees by which it is neither level nor plumb where `up` (3,) is up."""
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
        up: (3,) the up that they tell: of those within 2 deg of the twin's, unless more agree on another.
        tilt_deg: between that and the twin's.
        agree: how many are within 1 deg of it.
        against: names of those among these that are more than 2 deg off the twin's own.
        spare: how many more conditions these set than it takes to find an up that meets them; two that share
            no condition always agree, on what is square to both.
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
        told = f"{self.agree} of {len(self.witnesses)} planes, slides and hinges"
        if not self.contradicted:
            return f"{told} agree on an up that is {self.tilt_deg:.1f} deg from the twin's"
        return (
            f"up is in doubt: {told} agree on an up that is {self.tilt_deg:.1f} deg from the twin's; against that speak "
            f"{', '.join(self.against)}; reconstruct again and say which way is up with --up"
        )


def level_evidence(twin: Twin) -> LevelEvidence:
    """Compare the twin's up with large static planes, travels of slides and lines of hinges, all closed."""
    return judged(witnesses(twin))


def doubts_about_up(twin: Twin) -> tuple[str, ...]:
    """What contradicts the twin's up, a line each: its reconstruction, and the planes and joints that do."""
    said = twin.provenance.get(DOUBTED, ())
    told = tuple(map(str, said)) if isinstance(said, list | tuple) else ()
    evidence = level_evidence(twin)
    return (*told, evidence.text) if evidence.contradicted else told


def witnesses(twin: Twin) -> tuple[Witness, ...]:
    """The large planes of the static mesh, largest first, then every part's joint on it."""
    found = [Witness(_named(p), p.normal) for p in large_planes(twin.static.mesh)]
    for part in twin.parts:
        if part.parent is None:  # one that is carried is as level as what carries it stands
            slides = part.joint.kind == "prismatic"
            name = f"the {'travel' if slides else 'hinge'} of {part.name}"
            found.append(Witness(name, part.joint.axis, slides))
    return tuple(found)


def judged(found: Sequence[Witness]) -> LevelEvidence:
    """The up that most witnesses agree with, of several the one nearest to the twin's own; and the twin's
    own, give or take 2 deg, where fewer than two of them speak against that."""
    best = max(_candidates(found), key=lambda up: (len(_within(found, up, AGREE_DEG)), float(up @ UP)))
    other = _told(found, _refined(_within(found, best, AGREE_DEG), best))
    return other if other.contradicted else _told(found, _refined(_within(found, UP, TILT_DEG), UP))


def _told(found: Sequence[Witness], up: Array) -> LevelEvidence:
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
        level = UP - w.direction * (w.direction @ UP)  # the nearest up for which it is level
        out += [level] if np.linalg.norm(level) > _APART else []
        out += [] if w.level_only else [w.direction]
    for a, b in combinations(found, 2):
        across = np.cross(a.direction, b.direction)
        out += [across] if np.linalg.norm(across) > _APART else []
    return [geo.unit(v if v[2] >= 0 else -v) for v in out]


def _refined(those: Sequence[Witness], up: Array) -> Array:
    """The up of least squares over witnesses that agree with `up` (3,), which decides where they leave it
    open."""
    form = 1e-6 * (np.eye(3) - np.outer(up, up))
    for w in those:
        square = np.outer(w.direction, w.direction)
        form += square if w.is_level(up) else np.eye(3) - square
    least = np.linalg.eigh(form)[1][:, 0]
    return np.asarray(least if least @ up > 0 else -least)


@lru_cache(maxsize=4)  # one command asks several times: when parts get physics, on export, in a check
def large_planes(mesh: Mesh) -> tuple[Plane, ...]:
    """Large planes of a mesh, largest first, those that are parallel and beside each other once.

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
        near = (np.abs(points - points[k]) < _EDGE).all(axis=1) & (normals @ normals[k] > _TURNED)
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

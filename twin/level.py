"""Is up really up? Floors, worktops and walls, the travel of drawers and the lines of hinges say which way plumb is; nothing is turned here.

A witness is a direction: of a large plane its normal and of a hinge its line, which are plumb or level in furniture that stands, and of a
slide its travel, which is level. The up that most of them agree with is looked for among the normals, the cross products of pairs and
the twin's own, and is then that of least squares over those that agree. Witnesses that only repeat the twin's up say nothing against it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from twin import geometry as geo
from twin.geometry import Array
from twin.mesh import sample_surface
from twin.scene import Mesh, Twin

DOUBTED = "up_doubted"  # of a twin's provenance: what the reconstruction said against its up, texts
TILT_DEG = 2.0  # chosen by us, as `twin check` calls a hinge upright: more than a carpenter's error and a reconstructed axis'
AGREE_DEG = 1.0  # of a witness and an up; chosen by us: planes fitted to a clean scan are within .2 deg, axes within 1
FEWEST = 2  # witnesses against the twin's up; chosen by us: one may be a sloping board
_SAMPLES = 20_000  # points on the static mesh
_EDGE = 0.15  # m, least edge of a plane, and
_AREA = 0.1  # m^2, least area; chosen by us: 2 mm of noise tilt it by less than half a degree
_OFF = 0.01  # m from a plane, and
_TURNED = math.cos(
    math.radians(25.0)
)  # of a point's normal from the plane's: still points of it; chosen by us
_SAME = 0.05  # m between parallel planes that count once, the two sides of a board; chosen by us
_APART = math.sin(math.radians(20.0))  # of two witnesses whose cross product is a direction; chosen by us
UP = np.array([0.0, 0.0, 1.0])  # of every twin


@dataclass(frozen=True, eq=False)
class Witness:
    """Something that is level or plumb where furniture stands: what it is, and its unit direction (3,) in the twin's world.

    level_only: its direction is level (a slide's); else it is level or plumb.
    """

    name: str
    direction: Array
    level_only: bool = False

    def off_deg(self, up: Array) -> float:
        """Degrees by which it is neither level nor plumb where `up` (3,) is up."""
        rise = math.degrees(math.asin(min(1.0, abs(float(self.direction @ up)))))
        return rise if self.level_only else min(rise, 90.0 - rise)


@dataclass(frozen=True, eq=False)
class LevelEvidence:
    """What the witnesses say of a twin's up.

    Attributes:
        witnesses: all that were found.
        up: (3,) the up that they tell: of those within 2 deg of the twin's, unless more agree on another.
        tilt_deg: between that and the twin's.
        agree: how many are within 1 deg of it.
        against: names of those among these that are more than 2 deg off the twin's own.
    """

    witnesses: tuple[Witness, ...]
    up: Array
    tilt_deg: float
    agree: int
    against: tuple[str, ...]

    @property
    def contradicted(self) -> bool:
        """At least two witnesses agree on an up that is more than 2 deg from the twin's."""
        return self.tilt_deg > TILT_DEG and len(self.against) >= FEWEST

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
    """Compare the twin's up with its large static planes, the travel of its slides and the lines of its hinges, all closed."""
    return judged(witnesses(twin))


def doubts_about_up(twin: Twin) -> tuple[str, ...]:
    """What speaks against the twin's up, each in one line: what its reconstruction said, and the planes and joints that contradict it."""
    said = twin.provenance.get(DOUBTED, ())
    told = tuple(map(str, said)) if isinstance(said, list | tuple) else ()
    evidence = level_evidence(twin)
    return (*told, evidence.text) if evidence.contradicted else told


def witnesses(twin: Twin) -> tuple[Witness, ...]:
    """The large planes of the static mesh, largest first, then the joint of every part that is mounted on it."""
    found = _planes(twin.static.mesh)
    for part in twin.parts:
        if part.parent is None:  # one that is carried is as level as what carries it stands
            slides = part.joint.kind == "prismatic"
            name = f"the {'travel' if slides else 'hinge'} of {part.name}"
            found.append(Witness(name, part.joint.axis, slides))
    return tuple(found)


def judged(found: Sequence[Witness]) -> LevelEvidence:
    """The up that most witnesses agree with, of several the one nearest to the twin's own; and the twin's own, give or take 2 deg, where
    fewer than two of them speak against that."""
    best = max(_candidates(found), key=lambda up: (len(_within(found, up, AGREE_DEG)), float(up @ UP)))
    other = _told(found, _refined(_within(found, best, AGREE_DEG), best))
    return other if other.contradicted else _told(found, _refined(_within(found, UP, TILT_DEG), UP))


def _told(found: Sequence[Witness], up: Array) -> LevelEvidence:
    those = _within(found, up, AGREE_DEG)
    against = tuple(w.name for w in those if w.off_deg(UP) > TILT_DEG)
    tilt = math.degrees(float(geo.angle_between(up, UP)))
    return LevelEvidence(tuple(found), up, tilt, len(those), against)


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
    """The up of least squares over witnesses that agree with `up` (3,), which decides where they leave it open."""
    form = 1e-6 * (np.eye(3) - np.outer(up, up))
    for w in those:
        square = np.outer(w.direction, w.direction)
        form += square if abs(float(w.direction @ up)) < math.sqrt(0.5) else np.eye(3) - square
    least = np.linalg.eigh(form)[1][:, 0]
    return np.asarray(least if least @ up > 0 else -least)


def _planes(mesh: Mesh) -> list[Witness]:
    """Large planes of a mesh, those that are parallel and beside each other once.

    Patches are found by Araujo and Oliveira 2020 ("A robust statistics approach for plane detection in unorganized point clouds") as
    Open3D has it; the plane of each is then that of least squares.
    """
    import open3d as o3d

    points, normals = sample_surface(mesh, _SAMPLES, np.random.default_rng(0))
    if not len(points):
        return []
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    least = max(50, round(_SAMPLES * _AREA / mesh.area))
    patches = cloud.detect_planar_patches(min_plane_edge_length=_EDGE, min_num_points=least)
    fitted = []
    for patch in patches:
        inside = np.array(patch.get_point_indices_within_bounding_box(cloud.points), dtype=np.intp)
        near = inside[np.abs(normals[inside] @ np.array(patch.R)[:, 2]) > _TURNED]
        if len(near) >= least:
            fitted.append(_fitted(points[near]))
    fitted.sort(key=lambda f: -f[2])
    kept: list[tuple[Array, Array, int]] = []
    for normal, centre, count in fitted:
        beside = (
            abs(normal @ n) > math.cos(math.radians(AGREE_DEG)) and abs(n @ (centre - c)) < _SAME
            for n, c, _ in kept
        )
        if count >= least and not any(beside):
            kept.append((normal, centre, count))
    return [Witness(_named(n, c, count * mesh.area / _SAMPLES), n) for n, c, count in kept]


def _fitted(points: Array) -> tuple[Array, Array, int]:
    """Unit normal (3,) and centre (3,) m of the plane of points (n, 3), and how many of them are within 1 cm of it."""
    for _ in range(3):
        centre = points.mean(axis=0)
        normal = np.linalg.eigh((points - centre).T @ (points - centre))[1][:, 0]
        near = points[np.abs((points - centre) @ normal) < _OFF]
        if len(near) < 3:
            break
        points = near
    return np.asarray(normal), np.asarray(centre), len(points)


def _named(normal: Array, centre: Array, area: float) -> str:
    kind = "level" if abs(normal[2]) > math.sqrt(0.5) else "upright"
    at = " ".join(f"{x:.2f}" for x in centre)
    return f"the {kind} plane of {area:.1f} m2 at ({at}) m"

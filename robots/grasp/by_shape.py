"""Where a part's shape alone offers something to hold: bars and knobs on reachable faces, then rims."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robots.grasp.holds import SIDE, Hold, dominant_face, protruding, shaped_holds, widest
from robots.model.spec import RobotSpec
from twin import geometry as geo
from twin.collision.convex import triangles_of, within
from twin.errors import InputError
from twin.geometry import Array
from twin.handles import TALLEST, Face, frame_of
from twin.mesh import joined, sample_surface
from twin.scene import ContactPath, Mesh, Part, Revolute, Twin

_SAMPLES = 30_000
# share of a slider's surface that faces its way, above which it is a drawer rather than a sliding door
_FRONT = 0.05
_SAME = 0.9  # cosine between two ways out of one face
_TRIED = 4  # handles or rims of one part
_THINNEST = 0.003  # m; what protrudes and is thinner is a flake of a fused mesh, no handle
_FIST = 0.04  # m; half a fist, which is 8 cm across its knuckles
_HAND = 0.15  # m; a hand and its wrist before what it holds (chosen by us)
_SOURCE = "shape: no hand was seen"


class NothingToHold(InputError):
    """A part has no contact, and nothing on it that the gripper could hold."""


def solid_of(part: Part) -> Mesh:
    """What a part offers to hold, at state 0: inferred pieces and what is shown beside, else its seen mesh.

    A scan has ragged borders, below which fingers would close on nothing where the part ends as a board.
    """
    layer = part.completion
    return part.mesh if layer is None else joined([layer.shown, *(p.mesh for p in layer.pieces)])


@dataclass(frozen=True, eq=False)
class Side:
    """A face of a part that a hand may meet. along: (3,), where a handle is expected to run. points: (n, 3)
    m, on the whole part. standing: points of each thing that stands off the face. sure: whether the motion
    itself says that hands meet it."""

    part: Part
    face: Face
    along: Array
    points: Array
    standing: tuple[Array, ...]
    sure: bool

    def handles(self) -> Iterator[ContactPath]:
        """A contact on each thing that stands off the face and is low enough for a handle."""
        low = [g for g in self.standing if self.face.low_enough(g)]
        middles = sorted((np.median(g, axis=0) for g in low), key=lambda p: -self._leverage(p))
        for middle in middles[:_TRIED]:
            yield contact_at(middle, self.along, self.face.normal)

    def rims(self) -> Iterator[ContactPath]:
        """A contact on the middle of each border of the face, by leverage, none at the hinge."""
        flat = self.points[np.abs(self.face.height(self.points)) < self.face.skin]
        if len(flat) < 50:
            return
        normal = self.face.normal
        along = geo.unit(self.along - normal * (self.along @ normal))
        rims = []
        for way, rim in ((np.cross(along, normal), along), (along, np.cross(normal, along))):
            for sign in (1.0, -1.0):
                reach, across = flat @ way * sign, flat @ rim
                middle = np.abs(across - np.median(across)) < 0.03
                if np.any(middle):
                    edge = flat[middle][reach[middle] >= np.quantile(reach[middle], 0.98)].mean(axis=0)
                    rims.append((edge, rim, way * sign))
        rims.sort(key=lambda r: -self._leverage(r[0]))
        most = max((self._leverage(r[0]) for r in rims), default=0.0)
        for edge, rim, way in rims:
            if not isinstance(self.part.joint, Revolute) or self._leverage(edge) > 0.5 * most:
                across = np.cross(rim, way)
                yield ContactPath(edge, np.stack([across, rim, way], axis=1), 0.02, (), _SOURCE)

    def too_tall(self) -> list[str]:
        """What stands off too far for a handle, in words."""
        high = [g for g in self.standing if not self.face.low_enough(g)]
        return [f"what stands more than {1e3 * TALLEST:.0f} mm off its face" for _ in high[:1]]

    def _leverage(self, place: Array) -> float:
        """What makes a place good to pull at: distance from a hinge, or nearness to a slider's middle (m)."""
        joint = self.part.joint
        if isinstance(joint, Revolute):
            return float(np.linalg.norm(np.cross(joint.axis, place - joint.pivot)))
        return -float(np.linalg.norm(place - self.points.mean(axis=0)))


def holds_by_shape(twin: Twin, part: Part, spec: RobotSpec, seed: int) -> list[Hold]:
    """Bars and knobs on the part's faces, those with most leverage first; else its rims.

    Raises NothingToHold, which names the sizes of what was found and can't be held.
    """
    solid, around = solid_of(part), _around(twin, part)
    found_sides = sides(twin, part, seed)
    misfits = [text for side in found_sides for text in side.too_tall()]
    for kind in ("handles", "rims"):
        for side in found_sides:
            holds: list[Hold] = []
            for contact in getattr(side, kind)():
                found = shaped_holds(solid, contact, spec, seed)
                # a drawer's walls stand off its floor as bars do: there a hand must have room
                if not side.sure:
                    found = [h for h in found if _has_room(h, around)]
                misfits += [text for h in found if (text := _misfit(h, spec))]
                holds += [h for h in found if not _misfit(h, spec)][:2]
            if holds:
                return holds[:_TRIED]
    least = f"nothing stands off its faces, and no rim is thinner than {2e3 * SIDE:.0f} mm"
    raise NothingToHold(
        f"part {part.name!r} has no contact on it, and no bar, knob or rim that opens {spec.stroke:.2f} m of "
        f"gripper can hold: {', '.join(dict.fromkeys(misfits)) or least}",
        "give a point on what a hand would hold: contact=(x, y, z), or --contact X,Y,Z with --part",
    )


def _misfit(hold: Hold, spec: RobotSpec) -> str:
    """Why a gripper can't close on what the shape offers, with its size; empty where it can."""
    if hold.thickness > widest(spec):
        return f"a {hold.kind} {1e3 * hold.thickness:.0f} mm thick, where {1e3 * widest(spec):.0f} mm fit"
    if hold.thickness <= _THINNEST:
        return f"a {hold.kind} {1e3 * hold.thickness:.1f} mm thick, where more than {1e3 * _THINNEST:.0f} mm are no flake"
    return ""


def sides(twin: Twin, part: Part, seed: int = 0) -> list[Side]:
    """The faces of a part that a hand may meet, the likeliest first; none of a part without a surface.

    A hinged part and a drawer open outwards; what slides in its own plane turns its back to the static scene.
    The share of the surface that faces the motion says which is likelier. It does not decide: the edges of a
    thick sliding door and the sides of a deep bar face the motion as well as a drawer's front.
    """
    rng = np.random.default_rng(seed)
    solid = solid_of(part)
    points, normals = sample_surface(solid, _SAMPLES, rng)
    if not len(points):
        return []
    ahead = _ahead(part, points, normals)
    across = _across(twin, part, points, normals)
    ways = [] if not np.any(ahead) else [(geo.unit(normals[ahead].mean(axis=0)), True)]
    if not ways or abs(float(ways[0][0] @ across)) < _SAME:
        ways.append((across, ahead.mean() <= _FRONT))
    if ahead.mean() <= _FRONT:
        ways.reverse()
    made = []
    for out, sure in ways:
        along = _along(part, out)
        face = dominant_face(points, normals, contact_at(points.mean(axis=0), along, out))
        standing = protruding(solid, face, rng)
        made.append(Side(part, face, along, points, tuple(standing), sure))
    return made


def _ahead(part: Part, points: Array, normals: Array) -> Array:
    """Which points (n,) lie on surface that faces the way it moves when the part opens."""
    joint = part.joint
    if isinstance(joint, Revolute):
        way = np.cross(joint.axis, points - joint.pivot)
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    else:
        way = np.broadcast_to(joint.axis, points.shape)
    return np.asarray(np.einsum("ij,ij->i", normals, way) > 0.9)


def _across(twin: Twin, part: Part, points: Array, normals: Array) -> Array:
    """Unit direction (3,) across the joint's axis out of the largest face, away from the static scene."""
    _, vectors = np.linalg.eigh(normals.T @ normals)
    axis = part.joint.axis
    face = vectors[:, 2] - axis * (vectors[:, 2] @ axis)
    face = geo.unit(face if np.linalg.norm(face) > 1e-3 else geo.orthogonal_basis(axis)[:, 0])
    static, _ = sample_surface(twin.static.mesh, _SAMPLES, np.random.default_rng(0))
    middle = points.mean(axis=0)
    near = static[np.linalg.norm(static - middle, axis=1) < np.ptp(points, axis=0).max()]
    side = (middle - near.mean(axis=0)) @ face if len(near) else normals.mean(axis=0) @ face
    return np.asarray(face if side >= 0 else -face)


def _along(part: Part, out: Array) -> Array:
    """In-plane direction along which a handle is expected: the hinge's, else level."""
    for wanted in (
        part.joint.axis if isinstance(part.joint, Revolute) else np.cross([0, 0, 1.0], out),
        np.eye(3)[0],
    ):
        flat = wanted - out * (wanted @ out)
        if np.linalg.norm(flat) > 0.3:
            return geo.unit(flat)
    return np.asarray(geo.orthogonal_basis(out)[:, 0])


def contact_at(point: Array, along: Array, out: Array) -> ContactPath:
    """A contact that no hand made: at a point (3,), along a handle's direction, out of a face."""
    along = geo.unit(along - out * (along @ out))
    return ContactPath(point, frame_of(along, out), 0.02, (), _SOURCE)


def _around(twin: Twin, part: Part) -> Array:
    """Points (n, 3) m on everything else within a hand of a part, at state 0."""
    mesh = solid_of(part)
    if not len(mesh.faces):
        return np.zeros((0, 3))
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    low, high = corners.min(axis=0) - _HAND, corners.max(axis=0) + _HAND
    others = joined([twin.static.mesh, *(solid_of(p) for p in twin.parts if p.id != part.id)])
    near = within(triangles_of(others), low, high)
    surface = Mesh(near.reshape(-1, 3), np.arange(3 * len(near), dtype=np.int32).reshape(-1, 3))
    return sample_surface(surface, _SAMPLES, np.random.default_rng(0))[0]


def _has_room(hold: Hold, around: Array) -> bool:
    """Whether nothing of points (n, 3) stands where the hand would."""
    local = (around - hold.centre) @ hold.rotation
    before = (local[:, 2] > hold.depth) & (local[:, 2] < _HAND)
    return not np.any(before & geo.every(np.abs(local[:, :2]) < _FIST))

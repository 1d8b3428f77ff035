"""Where a robot may take hold of a part: as told by a user, as the hand did, or by the part's shape alone."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence

import numpy as np

from robots.grasp.holds import Hold, dominant_face, find_holds, protruding
from robots.model.spec import RobotSpec
from twin import geometry as geo
from twin.contacts import allowed, contact_off, distance_to
from twin.errors import InputError
from twin.geometry import Array
from twin.handles import frame_of
from twin.mesh import joined, sample_surface
from twin.scene import ContactPath, Mesh, Part, Revolute, Twin

_LOG = logging.getLogger(__name__)
_SAMPLES = 30_000
_FRONT = 0.05  # share of a slider's surface that must face its way for it to be a drawer's front
_ASIDE = 0.06  # m between places on the same handle that are worth trying, a finger and a half (chosen by us)
_TRIED = 4  # handles or rims of one part
_THINNEST = 0.003  # m; what protrudes and is thinner is a flake of a fused mesh, no handle
_SOURCE = "shape: no hand was seen"


class NothingToHold(InputError):
    """A part has no contact, and nothing on it that the gripper could hold."""


def solid_of(part: Part) -> Mesh:
    """What there is of a part to hold, at state 0: its inferred pieces and what is shown beside them, else its seen mesh.

    A scan has ragged borders, below which fingers would close on nothing where the part ends as a board.
    """
    layer = part.completion
    return part.mesh if layer is None else joined([layer.shown, *(p.mesh for p in layer.pieces)])


def holds_of(
    twin: Twin, part: Part, spec: RobotSpec, contact: ContactPath | Array | None, seed: int
) -> list[Hold]:
    """Ways to hold a part, best first, never empty.

    Args:
        contact: of a user, instead of the part's own: a ContactPath or a point (3,) in m on the part, world frame at
            state 0.

    Raises:
        InputError: the user's contact is off the part. NothingToHold: there is neither a contact nor anything to hold.
    """
    if contact is not None:
        told = contact if isinstance(contact, ContactPath) else _at_point(twin, part, contact)
        distance = distance_to(part.mesh, told.point)
        if distance > allowed(told):
            raise InputError(
                f"the contact {_text(told.point)} is {distance:.2f} m off part {part.name!r}",
                f"give a point on it: it spans {_text(part.mesh.vertices.min(axis=0))} to "
                f"{_text(part.mesh.vertices.max(axis=0))} m at state 0",
            )
        return find_holds(solid_of(part), told, spec, seed)
    if part.contact is not None:
        off = contact_off(part)
        if off is None:
            return find_holds(solid_of(part), part.contact, spec, seed)
        _LOG.warning("%s: its shape decides where to hold it", off.problem)
    holds = holds_by_shape(twin, part, spec, seed)
    if not holds:
        raise NothingToHold(
            f"part {part.name!r} has no contact on it, and no bar, knob or rim that opens {spec.stroke:.2f} m of "
            "gripper can hold",
            "give a point on what a hand would hold: contact=(x, y, z), or --contact X,Y,Z with --part",
        )
    return holds


def elsewhere(part: Part, holds: Sequence[Hold], spec: RobotSpec, seed: int) -> list[Hold]:
    """Other places on the same bars and rims, nearest to the given ones first; empty for a knob."""
    solid, found = solid_of(part), list[Hold]()
    for hold in (h for h in holds if h.kind in ("bar", "edge")):
        for shift in (_ASIDE, -_ASIDE, 2 * _ASIDE, -2 * _ASIDE):
            at = hold.centre + shift * hold.rotation[:, 1]
            near = ContactPath(at, hold.rotation, hold.thickness, (), "other place")
            best = find_holds(solid, near, spec, seed)[0]
            new = all(np.linalg.norm(best.centre - h.centre) > _ASIDE / 2 for h in (*holds, *found))
            if best.kind == hold.kind and new:
                found.append(best)
    return found


def holds_by_shape(twin: Twin, part: Part, spec: RobotSpec, seed: int) -> list[Hold]:
    """Bars and knobs on the part's face, those with most leverage first; else its rims; empty when there are none."""
    solid = solid_of(part)
    points, normals = sample_surface(solid, _SAMPLES, np.random.default_rng(seed))
    if len(points) < 100:
        return []
    out = outward(twin, part, points, normals)
    for contacts in (_handles, _rims):
        holds: list[Hold] = []
        for contact in contacts(part, points, normals, out):
            found = find_holds(solid, contact, spec, seed)
            holds += [h for h in found if h.refined and h.thickness > _THINNEST][:2]
        if holds:
            return holds[:_TRIED]
    return []


def outward(twin: Twin, part: Part, points: Array, normals: Array) -> Array:
    """Unit direction (3,) out of the face that a hand meets.

    A hinged part and a drawer open outwards. What slides in its own plane turns its back to the static scene.
    """
    joint = part.joint
    if isinstance(joint, Revolute):
        way = np.cross(joint.axis, points - joint.pivot)
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    else:
        way = np.broadcast_to(joint.axis, points.shape)
    ahead = np.einsum("ij,ij->i", normals, way) > 0.9
    if ahead.mean() > _FRONT:
        return geo.unit(normals[ahead].mean(axis=0))
    _, vectors = np.linalg.eigh(normals.T @ normals)
    face = vectors[:, 2] - joint.axis * (vectors[:, 2] @ joint.axis)
    face = geo.unit(face if np.linalg.norm(face) > 1e-3 else geo.orthogonal_basis(joint.axis)[:, 0])
    static, _ = sample_surface(twin.static.mesh, _SAMPLES, np.random.default_rng(0))
    middle = points.mean(axis=0)
    near = static[np.linalg.norm(static - middle, axis=1) < np.ptp(points, axis=0).max()]
    side = (middle - near.mean(axis=0)) @ face if len(near) else normals.mean(axis=0) @ face
    return np.asarray(face if side >= 0 else -face)


def _handles(part: Part, points: Array, normals: Array, out: Array) -> Iterator[ContactPath]:
    """A contact on each thing that protrudes from the face."""
    face = _contact(points.mean(axis=0), _along(part, out), out)
    front = dominant_face(points, normals, face)
    low = [g for g in protruding(points, front) if front.low_enough(g)]
    middles = sorted((np.median(g, axis=0) for g in low), key=lambda p: -_leverage(part, points, p))
    for middle in middles[:_TRIED]:
        yield _contact(middle, face.rotation[:, 1], front.normal)


def _rims(part: Part, points: Array, normals: Array, out: Array) -> Iterator[ContactPath]:
    """A contact on the middle of each border of the face, the one with most leverage first, none at the hinge."""
    along = _along(part, out)
    face = _contact(points.mean(axis=0), along, out)
    front = dominant_face(points, normals, face)
    flat = points[np.abs(front.height(points)) < front.skin]
    if len(flat) < 50:
        return
    along = geo.unit(along - front.normal * (along @ front.normal))
    rims = []
    for way, rim in ((np.cross(along, front.normal), along), (along, np.cross(front.normal, along))):
        for sign in (1.0, -1.0):
            reach, across = flat @ way * sign, flat @ rim
            middle = np.abs(across - np.median(across)) < 0.03
            if np.any(middle):
                edge = flat[middle][reach[middle] >= np.quantile(reach[middle], 0.98)].mean(axis=0)
                rims.append((edge, rim, way * sign))
    rims.sort(key=lambda r: -_leverage(part, points, r[0]))
    most = max((_leverage(part, points, r[0]) for r in rims), default=0.0)
    for edge, rim, way in rims:
        if not isinstance(part.joint, Revolute) or _leverage(part, points, edge) > 0.5 * most:
            across = np.cross(rim, way)
            yield ContactPath(edge, np.stack([across, rim, way], axis=1), 0.02, (), _SOURCE)


def _leverage(part: Part, points: Array, place: Array) -> float:
    """What makes a place good to pull at: distance from a hinge, or nearness to a slider's middle (m)."""
    joint = part.joint
    if isinstance(joint, Revolute):
        return float(np.linalg.norm(np.cross(joint.axis, place - joint.pivot)))
    return -float(np.linalg.norm(place - points.mean(axis=0)))


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


def _at_point(twin: Twin, part: Part, point: Array) -> ContactPath:
    """A contact at a user's point, its directions from the part."""
    place = np.asarray(point, dtype=np.float64)
    if place.shape != (3,) or not np.all(np.isfinite(place)):
        raise InputError(
            f"contact must be a ContactPath or a point of three finite numbers, got {np.asarray(point).tolist()}",
            "give contact=(x, y, z) in metres, world frame at state 0",
        )
    points, normals = sample_surface(solid_of(part), _SAMPLES, np.random.default_rng(0))
    out = outward(twin, part, points, normals) if len(points) else np.array([0, 0, 1.0])
    return _contact(place, _along(part, out), out)


def _contact(point: Array, along: Array, out: Array) -> ContactPath:
    along = geo.unit(along - out * (along @ out))
    return ContactPath(point, frame_of(along, out), 0.02, (), _SOURCE)


def _text(point: Array) -> str:
    return "(" + ", ".join(f"{v:.2f}" for v in point) + ")"

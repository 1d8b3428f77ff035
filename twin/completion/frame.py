"""The frame of a moving part: out of its front, up (or away from the hinge of a lid), and to the side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from twin import geometry as geo
from twin.collision.solid import spread
from twin.geometry import Array
from twin.handles import CONE, Face, outermost_face
from twin.scene import Joint, Part, Prismatic, Trajectory

Kind = Literal["drawer", "sliding_door", "door", "flap", "lid"]
# a drawer's front stands square to its way, chosen by us with room for noise
SQUARE = float(np.cos(np.radians(12.0)))
_LEVEL = float(np.cos(np.radians(40.0)))  # a lid's face looks up within
_PLUMB = float(np.cos(np.radians(30.0)))  # a door's hinge stands upright within
_POINTS = 20_000
_FACES = 0.15  # share of the surface that the front has at least
_TRIED = 100  # directions


@dataclass(frozen=True, eq=False)
class PartFrame:
    """T_world_frame (4, 4): origin on the front's plane, axes side, up, out; kind of part, noise (m)."""

    T_world_frame: Array
    kind: Kind
    noise: float


def part_frame(part: Part, eye: Array | None = None) -> PartFrame | None:
    """The frame of a part at state 0; None without a flat front. eye: where the viewer stood (3,)."""
    face = front_face(part, eye)
    if face is None:
        return None
    out = face.normal
    if isinstance(part.joint, Prismatic) and part.joint.axis @ out > SQUARE:
        out = geo.unit(part.joint.axis)  # known to a tenth of a degree from all frames, a plane's fit is not
    kind = _kind(part, out)
    up = _up(part, out, kind)
    rotation = np.stack([np.cross(up, out), up, out], axis=1)
    offset = float(np.median(face.points @ out))
    return PartFrame(geo.make_pose(rotation, offset * out), kind, face.noise)


def front_face(part: Part, eye: Array | None = None) -> Face | None:
    """The plane of a part's front at state 0, by its surface alone; None without a flat front."""
    corners = part.mesh.vertices[part.mesh.faces]
    if not len(corners) or part.mesh.area < 1e-3:
        return None
    points, normals = spread(corners, _POINTS)
    guess = _outward(part, normals, eye)
    if guess is None:
        return None
    facing = normals @ guess > CONE
    if facing.sum() < 50:
        return None
    return outermost_face(points[facing], guess, one_sided=True)


def _outward(part: Part, normals: Array, eye: Array | None) -> Array | None:
    """A first direction (3,) out of the front that much surface faces: the way of opening or to a viewer."""
    joint = part.joint
    if isinstance(joint, Prismatic) and np.mean(normals @ joint.axis > SQUARE) > _FACES:
        return geo.unit(joint.axis)
    options = list(normals[:: len(normals) // _TRIED])
    if part.contact is not None:
        options.append(part.contact.rotation[:, 2])
    middle = part.mesh.area_centroid
    best = max(options, key=lambda n: float(np.mean(np.abs(normals @ n) > CONE)))
    way = joint.velocity(0.0, middle)
    ahead = float(best @ way) / max(float(np.linalg.norm(way)), 1e-9)
    if abs(ahead) < 0.5 and eye is not None:  # it slides along its own front
        ahead = float(best @ (eye - middle))
    out = geo.unit(best) * (1.0 if ahead >= 0 else -1.0)
    return out if np.mean(normals @ out > CONE) > _FACES else None


def viewer(cameras: Trajectory | None) -> Array | None:
    """Where the person stood (3,), None without cameras."""
    return None if cameras is None else np.asarray(np.median(cameras.T_world_cam[:, :3, 3], axis=0))


def _kind(part: Part, out: Array) -> Kind:
    joint = part.joint
    if isinstance(joint, Prismatic):
        return "drawer" if abs(joint.axis @ out) > 0.7 else "sliding_door"
    kind = kind_by_joint(joint)
    return "lid" if kind == "flap" and out[2] > _LEVEL else kind


def kind_by_joint(joint: Joint) -> Kind:
    """Kind of a part without a known front: a slide is a drawer, a part on a level hinge a flap."""
    if isinstance(joint, Prismatic):
        return "drawer"
    return "door" if abs(joint.axis[2]) > _PLUMB else "flap"


def _up(part: Part, out: Array, kind: Kind) -> Array:
    """In the front's plane: along the edges, by the joint's axis if in the plane, else by plumb."""
    axis = np.asarray(part.joint.axis, dtype=np.float64)
    flat = axis - (axis @ out) * out
    if kind != "drawer" and np.linalg.norm(flat) > SQUARE:
        along = geo.unit(flat)
        other = np.cross(out, along)
        up = max((along, -along, other, -other), key=lambda d: (round(float(d[2]), 3), abs(float(d @ along))))
        if kind == "lid":  # level: away from the hinge counts as down, as on a front that hangs from it
            toward = np.asarray(getattr(part.joint, "pivot", np.zeros(3))) - part.mesh.area_centroid
            up = other if toward @ other > 0 else -other
        return geo.unit(up)
    plumb = np.array([0.0, 0.0, 1.0]) - out[2] * out
    return geo.unit(plumb) if np.linalg.norm(plumb) > 0.3 else geo.orthogonal_basis(out)[:, 0]

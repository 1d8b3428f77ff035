"""Where a robot may take hold of a part: as told by a user, as the hand did, or by the part's shape alone."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from robots.grasp.by_shape import contact_at, holds_by_shape, sides, solid_of
from robots.grasp.holds import Hold, find_holds
from robots.model.spec import RobotSpec
from twin.contacts import allowed, contact_off, distance_to
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import ContactPath, Part, Twin

_LOG = logging.getLogger(__name__)
_ASIDE = 0.06  # m between places on the same handle that are worth trying, a finger and a half (chosen by us)


def holds_of(
    twin: Twin, part: Part, spec: RobotSpec, contact: ContactPath | Array | None, seed: int
) -> list[Hold]:
    """Ways to hold a part, best first, never empty.

    Args:
        contact: of a user, instead of the part's own: a ContactPath or a point (3,) in m on the part, world
            frame at state 0.

    Raises:
        InputError: the user's contact is off the part. NothingToHold: there is neither a contact nor anything
            to hold.
    """
    if contact is not None:
        told = [contact] if isinstance(contact, ContactPath) else _at_point(twin, part, contact)
        distance = distance_to(part.mesh, told[0].point)
        if distance > allowed(told[0]):
            raise InputError(
                f"the contact {_text(told[0].point)} is {distance:.2f} m off part {part.name!r}",
                f"give a point on it: it spans {_text(part.mesh.vertices.min(axis=0))} to "
                f"{_text(part.mesh.vertices.max(axis=0))} m at state 0",
            )
        found = [find_holds(solid_of(part), c, spec, seed) for c in told]
        return next((holds for holds in found if holds[0].kind in ("bar", "knob")), found[0])
    if part.contact is not None:
        off = contact_off(part)
        if off is None:
            return find_holds(solid_of(part), part.contact, spec, seed)
        _LOG.warning("%s: its shape decides where to hold it", off.problem)
    return holds_by_shape(twin, part, spec, seed)


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


def _at_point(twin: Twin, part: Part, point: Array) -> list[ContactPath]:
    """A contact at a user's point for each face a hand may meet, likeliest first, turned by the part."""
    place = np.asarray(point, dtype=np.float64)
    if place.shape != (3,) or not np.all(np.isfinite(place)):
        raise InputError(
            f"contact must be a ContactPath or a point of three finite numbers, got {np.asarray(point).tolist()}",
            "give contact=(x, y, z) in metres, world frame at state 0",
        )
    found = [contact_at(place, side.along, side.face.normal) for side in sides(twin, part)]
    return found or [contact_at(place, np.array([1.0, 0, 0]), np.array([0, 0, 1.0]))]


def _text(point: Array) -> str:
    return "(" + ", ".join(f"{v:.2f}" for v in point) + ")"

"""Does a stated contact lie on its part? A twin with a wrong contact can be read and mended."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import ContactPath, Mesh, Part, Twin
from twin.shapes import orthonormal

# m from the surface at which a contact still speaks of the part, beside half the width of what is held there
# (a point may be its middle). Chosen by us: what a hand's lifted points err by, 3 cm, and a fist between its
# surface and what it grips, 4 cm.
_HAND = 0.07


@dataclass(frozen=True)
class ContactOff:
    """A contact farther from its part's surface than `allowed`; both in m."""

    part: str
    distance: float
    allowed: float

    @property
    def problem(self) -> str:
        return (
            f"the contact of {self.part} is {self.distance:.2f} m off the part, at most {self.allowed:.2f} m are "
            "a hand's error and half of what it holds"
        )

    @property
    def remedy(self) -> str:
        return (
            "put `contact.point` in twin.json on the part's surface (m, the twin's world at state 0), or set "
            "`contact` to null"
        )


def distance_to(mesh: Mesh, point: Array) -> float:
    """Distance in m from a point (3,) to the surface; infinite where there is none."""
    import trimesh

    if len(mesh.faces) == 0:
        return float("inf")
    corners = mesh.vertices[mesh.faces]
    nearest = trimesh.triangles.closest_point(corners, np.broadcast_to(point, (len(corners), 3)))
    return float(np.linalg.norm(nearest - point, axis=1).min())


def allowed(contact: ContactPath) -> float:
    """How far (m) a contact may be from the surface: 7 cm of hand (chosen by us), plus half its width."""
    return _HAND + contact.width / 2


def contact_off(part: Part) -> ContactOff | None:
    """What is wrong with a part's contact; None if on the part or absent. The mesh must not be empty."""
    if part.contact is None or not len(part.mesh.faces):
        return None
    distance, most = distance_to(part.mesh, part.contact.point), allowed(part.contact)
    return ContactOff(part.name, distance, most) if distance > most else None


def contacts_off(twin: Twin) -> tuple[ContactOff, ...]:
    """The contacts that are off their parts."""
    return tuple(found for part in twin.parts if (found := contact_off(part)) is not None)


def moved_contact(contact: ContactPath, T_new_old: Array) -> ContactPath:
    """A contact in a new world frame, by a pose (4, 4)."""
    rotation = orthonormal(geo.make_pose(T_new_old[:3, :3] @ contact.rotation))[:3, :3]
    return replace(contact, point=geo.transform(T_new_old, contact.point[None])[0], rotation=rotation)

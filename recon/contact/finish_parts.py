"""Finished parts: counted from their closed end, with the path along which the hand held them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.contact.closed_end import ClosedEnd, find_closed_end, rebase, rebase_mesh
from recon.contact.find_contact import ContactConfig, find_contact
from recon.fusion.fuse import FusedScene
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from twin import geometry as geo
from twin.contacts import moved_contact
from twin.geometry import Array
from twin.runs.keys import Stage
from twin.scene import ContactPath, Mesh, Trajectory

CONTACT = Stage("contact", 12, ("contact",))


@dataclass(frozen=True, eq=False)
class FinishedPart:
    """A part counted from its closed end, with all that was found about it. closed: as it was found, in the
    states before."""

    moving: MovingPart
    mesh: Mesh
    contact: ContactPath | None
    type_source: str
    closed: ClosedEnd

    def standing(self) -> FinishedPart:
        """The part of the static scene that it is while it is handled first and its carrier stands."""
        carrier = self.moving.carrier
        T = None if carrier is None else carrier.pose(self.moving.handled_first)
        return self if T is None else self._moved(T, None)

    def on(self, carrier: MovingPart) -> FinishedPart:
        """A part of the static scene as the part of a carrier that it is."""
        T = carrier.pose(self.moving.handled_first)
        return self if T is None else self._moved(geo.invert_pose(T), carrier)

    def _moved(self, T: Array, carrier: MovingPart | None) -> FinishedPart:
        moving = replace(self.moving, joint=self.moving.joint.transformed(T), carrier=carrier)
        contact = None if self.contact is None else moved_contact(self.contact, T)
        return replace(self, moving=moving, mesh=self.mesh.transformed(T), contact=contact)


def finish_parts(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    sources: Mapping[int, str],
    parts: Sequence[MovingPart],
    fused: FusedScene,
    config: ContactConfig,
) -> tuple[FinishedPart, ...]:
    """Count each part from its closed end and find where a hand held it; a part without surface is left out.

    sources: why the joint of each part, by id, has its type. parts: refined. What is carried by another part
    is looked at where that stood when it was handled.
    """
    finished: list[FinishedPart] = []
    for whole in sorted(parts, key=lambda p: p.carrier is not None):
        part = whole.standing(whole.handled_first)
        seen = fused.parts.get(part.id)
        if seen is None:
            warnings.warn(
                f"part {part.id} has no surface: too few of its pixels could be labelled", stacklevel=2
            )
            continue
        T = None if whole.carrier is None else whole.carrier.pose(whole.handled_first)
        mesh = seen if T is None else seen.transformed(T)
        closed = find_closed_end(part, mesh, fused.static, recording, cameras, labels)
        based, based_mesh = rebase(part, closed), rebase_mesh(mesh, part, closed)
        path = _contact(recording, cameras, labels, based, based_mesh, config)
        one = FinishedPart(based, based_mesh, path, sources[part.id], closed)
        carrier = [
            f.moving for f in finished if whole.carrier is not None and f.moving.id == whole.carrier.id
        ]
        finished.append(one.on(carrier[0]) if carrier else one)
    return tuple(sorted(finished, key=lambda f: f.moving.id))


def _contact(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    part: MovingPart,
    mesh: Mesh,
    config: ContactConfig,
) -> ContactPath | None:
    """Where the hand held the part, of several interactions in the first that shows it."""
    if len(part.windows) < 2:
        return find_contact(recording, cameras, labels, part, mesh, config)
    told: list[str] = []
    for first, last in part.windows:
        spans = tuple(s for s in part.motion.intervals if first <= s[0] <= last)
        if not spans:
            continue
        visit = replace(part, motion=replace(part.motion, intervals=spans))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            path = find_contact(recording, cameras, labels, visit, mesh, config)
        if path is not None:
            return path
        told = [str(w.message) for w in caught]
    for text in told:
        warnings.warn(text, stacklevel=3)
    return None

"""Finished parts: counted from their closed end, with the path along which the hand held them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.contact.closed_end import find_closed_end, rebase, rebase_mesh
from recon.contact.find_contact import ContactConfig, find_contact
from recon.fusion.fuse import FusedScene
from recon.parts.find_parts import FoundParts
from recon.parts.moving_part import MovingPart
from recon.recording import Recording
from twin.runs.keys import Stage
from twin.scene import ContactPath, Mesh, Trajectory

CONTACT = Stage("contact", 7, ("contact",))


@dataclass(frozen=True, eq=False)
class FinishedPart:
    """A part counted from its closed end, with all that was found about it.

    closed_margin, closed_probability: see `recon.contact.closed_end.ClosedEnd`.
    """

    moving: MovingPart
    mesh: Mesh
    contact: ContactPath | None
    type_source: str
    closed_source: str
    closed_margin: float
    closed_probability: float = 0.5


def finish_parts(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    found: FoundParts,
    parts: Sequence[MovingPart],
    fused: FusedScene,
    config: ContactConfig,
) -> tuple[FinishedPart, ...]:
    """Count each part from its closed end and find where a hand held it; a part without surface is left out.

    parts: those of `found`, refined.
    """
    finished = []
    for tracks, part in zip(found.of(parts), parts, strict=True):
        mesh = fused.parts.get(part.id)
        if mesh is None:
            warnings.warn(
                f"part {part.id} has no surface: too few of its pixels could be labelled", stacklevel=2
            )
            continue
        closed = find_closed_end(part, mesh, fused.static, recording, cameras, labels)
        based, based_mesh = rebase(part, closed), rebase_mesh(mesh, part, closed)
        path = find_contact(recording, cameras, labels, based, based_mesh, config)
        finished.append(
            FinishedPart(
                based, based_mesh, path, tracks.type_source, closed.source, closed.margin, closed.probability
            )
        )
    return tuple(finished)

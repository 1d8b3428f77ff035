"""Put a twin together from what the stages found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.moving_part import MovingPart
from recon.recording import Recording
from twin.names import legal_name
from twin.scene import ContactPath, Mesh, Part, Recorded, StaticPart, Trajectory, Twin


@dataclass(frozen=True, eq=False)
class FinishedPart:
    """A part counted from its closed end, with all that was found about it."""

    moving: MovingPart
    mesh: Mesh
    contact: ContactPath | None
    type_source: str
    closed_source: str


def assemble(
    recording: Recording,
    cameras: Trajectory,
    static: Mesh,
    parts: Sequence[FinishedPart],
    labels: Mapping[int, NDArray[np.uint8]],
    provenance: Mapping[str, Any],
) -> Twin:
    """The twin, without mass or collision geometry yet (`twin.physics`, `twin.collision` add them)."""
    name = legal_name(recording.name)
    taken = [name, "static"]
    finished = []
    for part in parts:
        kind = "drawer" if part.moving.joint.kind == "prismatic" else "door"
        part_name = legal_name(f"{kind}_{part.moving.id}", taken)
        taken.append(part_name)
        finished.append(
            Part(
                id=part.moving.id,
                name=part_name,
                mesh=part.mesh,
                joint=part.moving.joint.with_pivot(part.mesh.area_centroid),
                motion=part.moving.motion,
                contact=part.contact,
                limits_source="observed: quantiles of the smoothed state",
                closed_source=part.closed_source,
                type_source=part.type_source,
            )
        )
    return Twin(
        name=name,
        static=StaticPart(legal_name("static", []), static),
        parts=tuple(finished),
        cameras=cameras,
        recorded=Recorded(Path(recording.source).name, len(recording), recording.fingerprint),
        provenance=provenance,
        labels=labels,
    )

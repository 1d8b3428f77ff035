"""Put a twin together from what the stages found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.moving_part import MovingPart
from recon.recording import Recording
from twin import geometry as geo
from twin.names import legal_name
from twin.scene import ContactPath, Joint, Mesh, Part, Recorded, Revolute, StaticPart, Trajectory, Twin


@dataclass(frozen=True, eq=False)
class FinishedPart:
    """A part counted from its closed end, with all that was found about it."""

    moving: MovingPart
    mesh: Mesh
    contact: ContactPath | None
    type_source: str
    closed_source: str


def centred(joint: Joint, mesh: Mesh) -> Joint:
    """The joint with its pivot moved along the axis to the point nearest the mesh's area centroid, uncertainty included.

    A tilt (t1, t2) about the first two columns of the axis' basis shifts the axis, d metres along it, by d (t2, -t1).
    """
    if not isinstance(joint, Revolute):
        return joint
    pivot = geo.nearest_point_on_line(mesh.area_centroid, joint.pivot, joint.axis)
    moved = replace(joint, pivot=pivot)
    if joint.covariance is None:
        return moved
    d = float((pivot - joint.pivot) @ joint.axis)
    jacobian = np.eye(4)
    jacobian[2:, :2] = d * np.array([[0.0, 1.0], [-1.0, 0.0]])
    covariance = jacobian @ joint.covariance @ jacobian.T
    shift = float(np.sqrt(np.trace(covariance[2:, 2:]) / 2))
    sigma = None if joint.sigma is None else replace(joint.sigma, pivot=shift)
    return replace(moved, covariance=0.5 * (covariance + covariance.T), sigma=sigma)


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
                joint=centred(part.moving.joint, part.mesh),
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

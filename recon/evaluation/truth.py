"""The truth of a recording: cameras, joints, states, meshes, labels and grip (docs/recordings.md).

Whole beside a simulated recording. Others' annotations are less: `Truth.known` says what there is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.evaluation import metrics
from recon.evaluation.known import EVERYTHING, with_implied
from recon.evaluation.metrics import Span
from recon.recording import Intrinsics
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Joint, Mesh, Prismatic, Revolute, Trajectory

NOTHING = Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))  # a surface that is not known


@dataclass(frozen=True, eq=False)
class TruthPart:
    """A part as it truly moved.

    joint, mesh, grip: world frame at state 0. states (n,) m or rad and T_world_part (n, 4, 4), which maps the
    mesh to the frame, for every frame. grip: centre of the hand's grip (3,), None when no hand held the part.
    segments: for every motion the last frame at rest before it and the first after it.

    Of a truth that doesn't know them: states and T_world_part are empty, and states NaN in single frames; the
    mesh has no face. centre: the part's middle (3,) at state 0 if there is no mesh. told_spans: first and
    last moving frame of every motion, where they are annotated and not to be found in the states.
    """

    id: int
    name: str
    joint: Joint
    states: Array
    T_world_part: Array
    mesh: Mesh
    segments: tuple[Span, ...]
    grip: Array | None
    centre: Array | None = None
    told_spans: tuple[Span, ...] | None = None

    @property
    def _known_states(self) -> Array:
        """The states that are known; zero where none is."""
        known = self.states[np.isfinite(self.states)]
        return known if len(known) else np.zeros(1)

    @property
    def closed(self) -> float:
        """The most closed state that the recording shows; a twin's state 0."""
        return float(self._known_states.min())

    @property
    def travel(self) -> float:
        """Range of states that the recording shows, m or rad."""
        return float(np.ptp(self._known_states))

    @property
    def spans(self) -> tuple[Span, ...]:
        """First and last moving frame of every motion."""
        if self.told_spans is not None:
            return self.told_spans
        found = (metrics.moving_span(self.states[a : b + 1], a) for a, b in self.segments)
        return tuple(s for s in found if s is not None)

    @property
    def span(self) -> Span | None:
        """First and last moving frame of all motions; None when the part never moves."""
        return metrics.span_hull(self.spans)

    @property
    def moving_frames(self) -> NDArray[np.int64]:
        """Frames (n,) inside one of `spans`; those between two motions are none."""
        return metrics.span_frames(self.spans)

    @property
    def T_world_closed(self) -> Array:
        """Pose (4, 4) that takes the mesh from state 0 to the most closed state shown."""
        return self.joint.pose(self.closed)

    @property
    def closed_mesh(self) -> Mesh:
        """The mesh at the most closed state shown."""
        return self.mesh.transformed(self.T_world_closed)

    @property
    def closed_centre(self) -> Array | None:
        """The part's middle (3,) at the most closed state shown, None where it isn't known."""
        if len(self.mesh.faces):
            return self.closed_mesh.area_centroid
        return (
            None
            if self.centre is None
            else np.array(geo.transform(self.T_world_closed, self.centre[None])[0])
        )

    @property
    def handle(self) -> Array:
        """Point (3,) at the most closed state shown that the hand leads: grip or farthest vertex."""
        point = self.grip
        if point is None:
            v = self.mesh.vertices
            moved = np.linalg.norm(geo.transform(self.joint.pose(max(self.travel, 1e-3)), v) - v, axis=1)
            point = v[int(np.argmax(moved))]
        return np.array(geo.transform(self.T_world_closed, point[None])[0])


@dataclass(frozen=True, eq=False)
class Truth:
    """Truth of one recording of `frames` frames; labels as in a twin, static: everything that never moves.
    intrinsics: where those of the recording are wrong on purpose.

    known: what it knows, names of `recon.evaluation.known.FACTS`; cameras is None and labels, static and the
    parts' own are empty where it doesn't. name: of the recording, where that is not the folder around the
    truth. notes: what was left out of it, for people.
    """

    folder: Path
    frames: int
    cameras: Trajectory | None
    parts: tuple[TruthPart, ...]
    labels: Mapping[int, NDArray[np.uint8]] = field(default_factory=dict)
    static: Mesh = NOTHING
    intrinsics: Intrinsics | None = None
    known: frozenset[str] = EVERYTHING
    name: str = ""
    notes: tuple[str, ...] = ()

    def knows(self, *names: str) -> bool:
        """Whether all these facts are known."""
        return with_implied(self.known).issuperset(names)

    @property
    def tells_surfaces(self) -> bool:
        """Whether meshes can be compared: by what the recording shows of them."""
        return self.knows("labels") and bool(self.known & {"meshes", "static"})

    def part(self, key: int) -> TruthPart:
        """The part with this id. Raises InputError that lists the ids."""
        for p in self.parts:
            if p.id == key:
                return p
        raise InputError(f"{self.folder} has no part {key}", f"its parts are {[p.id for p in self.parts]}")


def joint_of(kind: str, axis: Any, pivot: Any, states: Array) -> Joint:
    """A joint limited by the states (n,) shown. Raises ValueError for an axis without direction."""
    told = states[np.isfinite(states)]
    limits = float(min(told.min(initial=0.0), 0.0)), float(max(told.max(initial=0.0), 0.0))
    direction = geo.unit(np.array(axis, dtype=np.float64))
    if kind == "prismatic":
        return Prismatic(direction, *limits)
    return Revolute(direction, *limits, pivot=np.array(pivot, dtype=np.float64))

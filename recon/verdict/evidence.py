"""What a verdict is told by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recon.contact.closed_end import ClosedEnd
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from recon.verdict.bare_borders import bare_border
from recon.verdict.camera_drift import camera_drift
from recon.verdict.explained import static_seen_through, unexplained
from recon.verdict.hand_visits import idle_visit
from recon.verdict.in_motion import seen_through
from recon.verdict.places import Places, places
from recon.verdict.posed import PosedTwin
from twin.scene import Mesh, Trajectory


@dataclass(frozen=True, eq=False)
class SceneEvidence:
    """What the stages made of a window. labels: label images (H, W) of some frames. parts: refined, with
    their meshes at state 0 of the joint; None for a part without a surface."""

    recording: Recording
    cameras: Trajectory
    labels: Mapping[int, NDArray[np.uint8]]
    static: Mesh
    parts: Sequence[tuple[MovingPart, Mesh | None]]

    @cached_property
    def posed(self) -> PosedTwin:
        """The twin, to be looked at in its states."""
        return PosedTwin(self.recording, self.cameras, self.static, self.parts)

    @cached_property
    def camera_drift(self) -> tuple[int, int, float]:
        """Two frames that agree least on where the room is, and by how much, m."""
        return camera_drift(self.posed, self.labels)

    @cached_property
    def unexplained(self) -> tuple[int, float]:
        """The frame of rest that the twin explains worst, and the share of the picture."""
        return unexplained(self.posed, self.labels)

    @cached_property
    def static_seen_through(self) -> tuple[int, float]:
        """The frame in which most of the static scene is seen through, and the share of the picture."""
        return static_seen_through(self.posed)

    @cached_property
    def idle_visit(self) -> tuple[int, int] | None:
        """First and last frame of the longest time that a hand is in view and moves nothing."""
        return idle_visit(self.recording, self.labels, [part for part, _ in self.parts])


@dataclass(frozen=True, eq=False)
class PartEvidence:
    """One part among all of them.

    closed: the end that is taken for the closed one; None without a surface.
    """

    scene: SceneEvidence
    part: MovingPart
    mesh: Mesh | None
    closed: ClosedEnd | None = None

    @cached_property
    def has_surface(self) -> bool:
        """Whether it has a mesh, and a label image shows it."""
        shown = any((image == self.part.id).any() for image in self.scene.labels.values())
        return self.mesh is not None and len(self.mesh.faces) > 0 and shown

    @cached_property
    def seen_through(self) -> tuple[int, float] | None:
        """The frame of its motion in which most is seen through, and all of that over its own pixels; None
        without such frames or without a surface."""
        return seen_through(self.scene.posed, self.part) if self.has_surface else None

    @cached_property
    def places(self) -> Places | None:
        """What was seen of the places of its surface; None without one, or without motion."""
        if self.mesh is None or not self.has_surface:
            return None
        return places(self.scene.posed, self.part, self.mesh)

    @cached_property
    def bare_border(self) -> tuple[int, float] | None:
        """A frame of the rest that shows more of its border as an edge, and the share that is none; None if
        unmoved, unseen."""
        if not self.part.motion.intervals:
            return None
        return bare_border(self.scene.posed, self.part, self.scene.labels)

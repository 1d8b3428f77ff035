"""What a reconstructed world shows of its up: how the camera is held, large planes, parts and the arm."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.contact.closed_end import travel_ends
from recon.contact.faces import sample
from recon.contact.front import front_of
from recon.fusion.fuse import FusedScene
from recon.interaction.parts.moving_part import MovingPart
from twin import geometry as geo
from twin.geometry import Array
from twin.level import Plane, large_planes
from twin.scene import HAND_LABEL, Mesh, Prismatic, Trajectory

# Share of a label image that a hand must fill to show where its arm comes from; chosen by us (hand visits).
_HAND_SHARE = 0.004
# Fewest pixels of the picture's border that an arm crosses; a narrow wrist has some thirty. Chosen by us.
_BORDER_PIXELS = 10


@dataclass(frozen=True, eq=False)
class PartShown:
    """A moving part: whether it slides, its axis (3,), and the outward normal (3,) of its front at both ends
    of its travel, that of the end nearer to the first states first."""

    slides: bool
    axis: Array
    fronts: tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class UpEvidence:
    """What tells up, in a world as it stands.

    Attributes:
        eye: (3,) m, mean place of the camera.
        camera: (3, 3), columns: the mean of the camera's x (right), y (down) and z (forward), which are
            nearly unit vectors.
        planes: large static planes; their normals point to the side on which the camera is.
        parts: those that move.
        arm: (3,) unit vector in the picture's plane from the hand to where its arm leaves the picture; None
            where it isn't seen.
    """

    eye: Array
    camera: Array
    planes: tuple[Plane, ...]
    parts: tuple[PartShown, ...]
    arm: Array | None


def up_evidence(
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    parts: Sequence[MovingPart],
    fused: FusedScene,
) -> UpEvidence:
    """Gather it. parts: with state 0 at the first frame, as the meshes of `fused`."""
    eyes = cameras.T_world_cam[:, :3, 3]
    eye = eyes.mean(axis=0)
    planes = tuple(_facing(plane, eye) for plane in large_planes(fused.static))
    meshes = ((part, fused.parts[part.id]) for part in parts if part.id in fused.parts)
    shown = tuple(_shown(part, mesh, eyes) for part, mesh in meshes if len(mesh.faces))
    return UpEvidence(eye, cameras.T_world_cam[:, :3, :3].mean(axis=0), planes, shown, _arm(cameras, labels))


def _facing(plane: Plane, eye: Array) -> Plane:
    """The plane with its normal towards the camera, which sees its outer side."""
    side = 1.0 if (eye - plane.centre) @ plane.normal >= 0.0 else -1.0
    return Plane(side * plane.normal, plane.centre, plane.area)


def _shown(part: MovingPart, mesh: Mesh, eyes: Array) -> PartShown:
    low, high = travel_ends(part.handled_states)
    starts = float(np.median(part.handled_states[:5]))
    ends = (low, high) if abs(starts - low) <= abs(starts - high) else (high, low)
    normal = front_of(sample(mesh), part, eyes).normal
    joint = part.joint
    first, last = (geo.rotate(joint.pose(end), normal) for end in ends)
    return PartShown(isinstance(joint, Prismatic), joint.axis, (first, last))


def _arm(cameras: Trajectory, labels: Mapping[int, NDArray[np.uint8]]) -> Array | None:
    ways = list(_ways_out(cameras, labels))
    if not ways:
        return None
    mean = np.mean(ways, axis=0)
    return geo.unit(mean) if np.linalg.norm(mean) > 1e-9 else None


def _ways_out(cameras: Trajectory, labels: Mapping[int, NDArray[np.uint8]]) -> Iterator[Array]:
    """Of each label image: unit vector (3,) from the hand's middle to the arm's exit."""
    for frame, image in labels.items():
        T, hand = cameras.pose(frame), image == HAND_LABEL
        if T is None or hand.mean() < _HAND_SHARE:
            continue
        border = hand.copy()
        border[1:-1, 1:-1] = False
        if border.sum() < _BORDER_PIXELS:
            continue
        (y, x), (by, bx) = (np.argwhere(mask).mean(axis=0) for mask in (hand, border))
        way = T[:3, :3] @ [bx - x, by - y, 0.0]
        if np.linalg.norm(way) > 1e-9:
            yield geo.unit(way)

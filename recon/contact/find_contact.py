"""Where the hand holds a part: the hand's surface, in the part's frame, against the part's handle.

Seen from outside, a hand's surface lies 2 to 6 cm before what it grips. So the hand says which handle, and
where along it; the handle says where exactly.

FunREC, supplement 4: the hand's surface in place of fingertips.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from recon.contact.faces import SurfaceSamples, sample
from recon.contact.handles import Handle, around_edge, find_edge, find_handle, unseen_handle
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.setting import Settings, setting
from twin.scene import HAND_LABEL, ContactPath, Mesh, Trajectory
from twin.voxels import voxel_keys

_BEYOND_M = 0.15  # a hand farther from the part than this does not hold it


@dataclass(frozen=True)
class ContactConfig(Settings):
    """Finding the contact."""

    source: Literal["geometry", "keypoints"] = setting(
        "geometry", '"geometry" needs no model, "keypoints" asks a hand detector (extra `hands`)'
    )


# Hand pixels come from a grid of about so many columns. Chosen by us.
_COLUMNS = 320
# Frames for which the hand holds the part before it moves and after. Chosen by us.
_HOLD_FRAMES = 2
# m; a hand whose surface comes so close to the part holds it. Chosen by us.
_NEAR = 0.05
# m; how much farther from what they hold the fingers' surface may be than its nearest point. Chosen by us.
_FINGER = 0.025
# m; breadth of a fist with its thumb: adults have some 9 to 10.5 cm. Chosen by us.
_BREADTH = 0.10
# Fewest hand pixels that count as seen. Chosen by us.
_MIN_POINTS = 6


@dataclass(frozen=True, eq=False)
class HandPoints:
    """Points (n, 3) of the hand in the part's frame at state 0, frames (n,), distances (n,) to the part."""

    points: Array
    frame: NDArray[np.int64]
    distance: Array

    def chosen(self, mask: NDArray[np.bool_]) -> HandPoints:
        """The points where the mask (n,) is set."""
        return HandPoints(self.points[mask], self.frame[mask], self.distance[mask])


def find_contact(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    part: MovingPart,
    mesh: Mesh,
    config: ContactConfig = ContactConfig(),
) -> ContactPath | None:
    """Where the hand held the part, in the world with the part at state 0.

    Args:
        labels: label images (H, W) of some frames, 255 = hand.
        part: its joint and states, with the same state 0 as `mesh`.
        mesh: its surface.

    Warns and returns None when no hand comes near the part while it moves.
    """
    surface = sample(mesh)
    T_part_cam = _T_part_cam(recording, cameras, labels, part)
    hand = _hand_points(recording, labels, T_part_cam, surface)
    touch, seen_by = _steady(_close(hand, hand.distance)), "hand label"
    if config.source == "keypoints":
        tips = _fingertips(recording, labels, T_part_cam, surface)
        if len(tips.points):
            touch, seen_by = tips, "fingertips"
        else:
            warnings.warn(
                f"no fingertip was detected near part {part.id}: its contact comes from the hand label",
                stacklevel=2,
            )
    if not len(touch.points):
        warnings.warn(
            f"no hand is within {100 * _NEAR:.0f} cm of part {part.id} while it moves: it gets no contact; "
            "record the hand that moves it",
            stacklevel=2,
        )
        return None
    handle = find_handle(surface, touch.points, part.joint)
    if handle is None:
        handle = find_edge(surface, touch.points, part.joint)
        if not around_edge(handle, touch.points):
            eye = np.mean([T_part_cam[int(f)][:3, 3] for f in np.unique(touch.frame)], axis=0)
            handle = unseen_handle(handle, touch.points, eye, part.joint)
    elif handle.kind == "bar" and seen_by == "fingertips":
        handle = handle.shifted(float(np.median(handle.along(touch.points))))
    elif handle.kind == "bar":
        handle = handle.shifted(_middle_of_fingers(handle, hand, T_part_cam))
    return ContactPath(
        handle.surface_point,
        handle.rotation,
        handle.width,
        tuple(range(int(touch.frame.min()), int(touch.frame.max()) + 1)),
        f"{config.source if seen_by == 'fingertips' else 'geometry'}: {seen_by} on the part's {handle.kind}",
    )


def _hand_points(
    recording: Recording,
    labels: Mapping[int, NDArray[np.uint8]],
    T_part_cam: Mapping[int, Array],
    surface: SurfaceSamples,
) -> HandPoints:
    """The hand's surface in the labelled frames in which the part moves, as far as it is near the part."""
    tree = cKDTree(surface.points)
    step = max(1, round(recording.intrinsics.width / _COLUMNS))
    found = []
    for frame, pose in T_part_cam.items():
        is_hand = _largest_piece(labels[frame] == HAND_LABEL)[::step, ::step]
        if np.count_nonzero(is_hand) < _MIN_POINTS:
            continue
        depth = recording.depth(frame)[::step, ::step]
        y, x = np.nonzero(is_hand & (depth > 0))
        pixels = step * np.stack([x, y], axis=-1).astype(np.float64)
        points = recording.intrinsics.backproject(pixels, depth[y, x].astype(np.float64))
        points = geo.transform(pose, points)
        distance, _ = tree.query(points, distance_upper_bound=_BEYOND_M)
        close = np.isfinite(distance)
        found.append(HandPoints(points[close], np.full(int(close.sum()), frame), distance[close]))
    return _joined(found)


def _largest_piece(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The largest connected piece (H, W): the arm. The part's own rims may be labelled as hand too."""
    _, pieces, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    stats[0, cv2.CC_STAT_AREA] = 0  # the background
    return np.asarray(mask & (pieces == np.argmax(stats[:, cv2.CC_STAT_AREA])))


def _T_part_cam(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    part: MovingPart,
) -> dict[int, Array]:
    """Camera points to the part's frame at state 0, for the labelled frames in which the hand may hold it."""
    spans = part.motion.intervals or ((0, len(recording) - 1),)
    out = {}
    for frame in sorted(labels):
        pose, camera = part.pose(frame), cameras.pose(frame)
        if (
            pose is not None
            and camera is not None
            and any(a - _HOLD_FRAMES <= frame <= b + _HOLD_FRAMES for a, b in spans)
        ):
            out[frame] = geo.invert_pose(pose) @ camera
    return out


def _steady(hand: HandPoints) -> HandPoints:
    """What of the hand stays at the same place of the part: 2 cm cells filled half as often as any."""
    if len(hand.points) < _MIN_POINTS:
        return hand.chosen(np.zeros(len(hand.points), dtype=bool))
    keys = voxel_keys(hand.points.astype(np.float32), 0.02)
    cells, cell = np.unique(keys, return_inverse=True)
    pairs = np.unique(np.stack([cell, hand.frame]), axis=1)
    frames = np.bincount(pairs[0], minlength=len(cells))
    return hand.chosen((frames >= 0.5 * frames.max())[cell])


def _middle_of_fingers(handle: Handle, hand: HandPoints, T_part_cam: Mapping[int, Array]) -> float:
    """Coordinate along a bar: the median over frames of the middle of the fist's extent along it.

    A camera along the bar sees one end of the fist only. What a hand's breadth lacks lies at the far end.
    """
    fingers = _close(hand, handle.distance(hand.points), limit=np.inf)
    middles = []
    for frame in np.unique(fingers.frame):
        along = handle.along(fingers.points[fingers.frame == frame])
        low, high = np.quantile(along, [0.02, 0.98])
        to_eye = geo.unit(T_part_cam[int(frame)][:3, 3] - handle.centre)
        one_sided = np.clip(2.0 * (to_eye @ handle.rotation[:, 1]), -1.0, 1.0)  # from 30 degrees on, wholly
        hidden = max(0.0, _BREADTH - (high - low))
        middles.append(float(0.5 * (low + high) - 0.5 * hidden * one_sided))
    return float(np.median(middles)) if middles else 0.0


def _close(hand: HandPoints, distance: Array, limit: float | None = None) -> HandPoints:
    """In each frame the points whose distance (n,) exceeds the smallest one by less than `_FINGER`.

    Frames in which no point comes within `limit`, by default `_NEAR`, hold nothing.
    """
    keep = np.zeros(len(distance), dtype=bool)
    for frame in np.unique(hand.frame):
        of = hand.frame == frame
        # single pixels of another surface may be labelled as hand
        nearest = float(np.quantile(distance[of], 0.02))
        close = of & (distance < nearest + _FINGER)
        if nearest < (_NEAR if limit is None else limit) and np.count_nonzero(close) >= _MIN_POINTS:
            keep |= close
    return hand.chosen(keep)


def _fingertips(
    recording: Recording,
    labels: Mapping[int, NDArray[np.uint8]],
    T_part_cam: Mapping[int, Array],
    surface: SurfaceSamples,
) -> HandPoints:
    """The fingertips near the part, in each frame no farther from it than `_NEAR` beyond the nearest."""
    from recon.contact.hand_keypoints import FINGERTIPS, detect_hands

    keypoints = detect_hands(recording, list(T_part_cam), labels)
    tree = cKDTree(surface.points)
    found = []
    for frame, hand in zip(keypoints.frames.tolist(), keypoints.points_cam, strict=True):
        tips = hand[list(FINGERTIPS)]
        points = geo.transform(T_part_cam[frame], tips[np.isfinite(tips).all(axis=1)])
        if len(points):
            distance, _ = tree.query(points)
            near = (distance < distance.min() + _NEAR) & (distance.min() < 2 * _NEAR)
            found.append(HandPoints(points[near], np.full(int(near.sum()), frame), distance[near]))
    return _joined(found)


def _joined(parts: list[HandPoints]) -> HandPoints:
    if not parts:
        return HandPoints(np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0))
    return HandPoints(
        np.concatenate([h.points for h in parts]),
        np.concatenate([h.frame for h in parts]),
        np.concatenate([h.distance for h in parts]),
    )

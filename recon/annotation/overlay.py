"""What is drawn over the pictures of a recording: each part in its states, its axis and its point."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from recon.annotation.seen import Seen, filled
from recon.annotation.solve import Annotated, with_pivot_at
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Revolute

# m of a slide's arrow and half of a hinge's line. Chosen by us.
_LONG = 0.25
_RIM = 3  # px from an outline to what is surely inside


def overlay(seen: Seen, part: Annotated) -> dict[str, Any]:
    """JSON types. outline: by frame, corners [x, y] px of the part's first outline as its states move it;
    axis: by frame, two ends; None in frames without a camera or where it is behind it."""
    frame, corners = next(iter(part.marks.outlines.items()))
    back = geo.invert_pose(part.pose(frame))
    points = geo.transform(back, _lifted(seen, frame, corners))
    middle = points.mean(axis=0)
    joint = with_pivot_at(part.joint, middle)
    if isinstance(joint, Revolute):
        ends = np.stack([joint.pivot - _LONG * joint.axis, joint.pivot + _LONG * joint.axis])
    else:
        ends = np.stack([middle, middle + _LONG * joint.axis])
    turns = isinstance(joint, Revolute)
    return {
        "states": [round(float(s), 5) for s in (np.rad2deg(part.states) if turns else 1e3 * part.states)],
        "unit": "°" if turns else "mm",
        "outline": [_drawn(seen, k, geo.transform(part.pose(k), points)) for k in range(len(part.states))],
        "axis": [_drawn(seen, k, ends) for k in range(len(part.states))],
        "told": told(part),
        "notes": list(part.notes),
    }


def told(part: Annotated) -> str:
    """One line: how well marks and video agree."""
    low, high = part.joint.lower, part.joint.upper
    turns = isinstance(part.joint, Revolute)
    span = (
        f"{np.rad2deg(low):.1f} to {np.rad2deg(high):.1f}°"
        if turns
        else f"{1e3 * low:.0f} to {1e3 * high:.0f} mm"
    )
    text = f"{span}; {part.followed} corners follow it, {part.off_mm:.1f} mm off"
    later = list(part.clicked_px.values())[1:]
    if later:
        text += f"; clicks are {np.median(later):.1f} px off"
    return text


def _lifted(seen: Seen, frame: int, corners: Array) -> Array:
    """Corners (n, 3) in the world, each with the depth of the part's nearest inner pixel."""
    depth = seen.recording.depth(frame).astype(np.float64)
    inside = cv2.erode(
        filled(corners, depth.shape[:2]).astype(np.uint8), np.ones((2 * _RIM + 1,) * 2, np.uint8)
    )
    y, x = np.nonzero((inside > 0) & (depth > 0))
    if not len(x):
        return seen.world(frame, corners)
    nearest = [int(np.argmin((x - u) ** 2 + (y - v) ** 2)) for u, v in corners]
    z = depth[y[nearest], x[nearest]]
    return geo.transform(seen.camera(frame), seen.recording.intrinsics.backproject(corners, z))


def _drawn(seen: Seen, frame: int, points: Array) -> list[list[float]] | None:
    if seen.cameras.pose(frame) is None:
        return None
    places = seen.pixels(frame, points)
    return np.round(places, 1).tolist() if np.isfinite(places).all() else None

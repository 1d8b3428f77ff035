"""Opposite faces of a board are parallel: what keeps a door's two sides together when it crosses edge-on.

While a door is seen edge-on, nothing ties the frames that show its front to those that show its inside: a step in the state
there fits all depth equally well and doubles the mesh. But the step tilts one face against the other, and doors, lids and
drawer fronts are boards.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.geometry import Array
from twin.robust import geman_mcclure
from twin.scene import Joint, Revolute

# Chosen by us: a face is at least this many surfels, this flat (m, robust RMS) and this long across the axis (m); normals
# within MAX_TURN of opposite belong to it, by median within MAX_SPREAD (a round body's are not), and larger steps than MAX_STEP are no edge-on crossing but another shape.
MIN_SURFELS, MAX_RMS, MIN_LENGTH = 40, 0.006, 0.10
MAX_TURN, MAX_STEP, MAX_SPREAD = np.radians(25.0), np.radians(10.0), np.radians(10.0)


def face_step(
    joint: Joint, points: Array, normals: Array
) -> tuple[float, NDArray[np.bool_], NDArray[np.bool_]] | None:
    """How far (rad) the far face is turned about the joint's axis from being parallel to the near face.

    Args:
        points: surfels (K, 3) in the part's frame.
        normals: theirs (K, 3).

    Returns:
        the step and the masks (K,) of both faces' surfels; None when the part is no board seen from both sides.
    """
    if not isinstance(joint, Revolute) or len(points) < 2 * MIN_SURFELS:
        return None
    basis = geo.orthogonal_basis(joint.axis)[:, :2]
    flat = (points - joint.pivot) @ basis
    turned = normals @ basis
    across = (
        np.linalg.norm(turned, axis=1) > 0.7
    )  # faces that hold the axis' direction, not the top and bottom rims
    angle = np.arctan2(turned[:, 1], turned[:, 0])
    near_angle = _mode(angle[across])
    near = across & (np.abs(_wrap(angle - near_angle)) < MAX_TURN)
    far = across & (np.abs(_wrap(angle - near_angle - np.pi)) < MAX_TURN)
    for mask, middle in ((near, near_angle), (far, near_angle + np.pi)):
        if not mask.any() or np.median(np.abs(_wrap(angle[mask] - middle))) > MAX_SPREAD:
            return None
    lines = [_line_angle(flat[mask], near_angle) for mask in (near, far)]
    if lines[0] is None or lines[1] is None:
        return None
    step = float(_wrap_half(lines[1] - lines[0]))
    return (step, near, far) if abs(step) <= MAX_STEP else None


def _wrap(angle: Array) -> Array:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def _wrap_half(angle: float) -> float:
    """An angle between undirected lines, -pi/2..pi/2."""
    return float((angle + np.pi / 2) % np.pi - np.pi / 2)


def _mode(angle: Array) -> float:
    """Most frequent direction, by a histogram of 5 degree bins over three neighbours."""
    count, edges = np.histogram(angle, bins=72, range=(-np.pi, np.pi))
    smooth = count + np.roll(count, 1) + np.roll(count, -1)
    k = int(np.argmax(smooth))
    centre = 0.5 * (edges[k] + edges[k + 1])
    close = angle[np.abs(_wrap(angle - centre)) < np.radians(10.0)]
    return float(centre + np.median(_wrap(close - centre))) if len(close) else float(centre)


def _line_angle(points: Array, normal_angle: float) -> float | None:
    """Direction (rad) of the line that most points (n, 2) lie on; None when they form no long, flat face."""
    if len(points) < MIN_SURFELS:
        return None
    weight = np.ones(len(points))
    normal = np.array([np.cos(normal_angle), np.sin(normal_angle)])
    offset = float(np.median(points @ normal))
    for scale in (0.03, 0.03, 0.015, 0.01, 0.006, 0.006, 0.006, 0.006):
        weight = geman_mcclure(((points @ normal - offset) / scale) ** 2, 1.0)
        centre = (points * weight[:, None]).sum(axis=0) / weight.sum()
        d = points - centre
        _, vectors = np.linalg.eigh((d * weight[:, None]).T @ d)
        normal = vectors[:, 0] * np.sign(vectors[:, 0] @ normal)
        offset = float(centre @ normal)
    distance = points @ normal - offset
    inlier = np.abs(distance) < 2 * MAX_RMS
    along = (points - centre) @ vectors[:, 1]
    if inlier.sum() < MIN_SURFELS or np.sqrt(np.mean(distance[inlier] ** 2)) > MAX_RMS:
        return None
    if np.ptp(np.quantile(along[inlier], [0.05, 0.95])) < MIN_LENGTH:
        return None
    return float(np.arctan2(vectors[1, 1], vectors[0, 1]))

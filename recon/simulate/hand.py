"""A right hand and its sleeve, built from rounded cones; no scanned or licensed geometry.

The hand's frame is the grip frame: origin on the axis of the gripped bar, z along the bar towards the thumb,
y the direction in which the hand approaches, x = y cross z (where the palm lies).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numba
import numpy as np
import trimesh
from numpy.typing import NDArray
from skimage.measure import marching_cubes

from recon.simulate.surfaces import Surface
from recon.simulate.textures import Material
from twin import geometry as geo
from twin.geometry import Array

# Lengths in metres of proximal, middle and distal phalanx, adult means (Buryanov & Kotiuk 2010, rounded).
PHALANGES = {
    "index": (0.040, 0.023, 0.021),
    "middle": (0.044, 0.027, 0.022),
    "ring": (0.041, 0.026, 0.022),
    "little": (0.033, 0.019, 0.020),
}
FINGER_Z = {"index": 0.031, "middle": 0.010, "ring": -0.011, "little": -0.031}
FINGER_RADIUS = {"index": 0.0088, "middle": 0.0090, "ring": 0.0085, "little": 0.0075}
# Directions of the phalanges in the x-y plane, degrees from x (chosen by us to wrap 6 to 10 mm bars).
CLOSED_DEG = (97.0, 178.0, 248.0)
OPEN_DEG = (62.0, 84.0, 100.0)
WRIST = np.array([0.020, -0.108, 0.000])
KNUCKLE_X = 0.020
KNUCKLE_Y = -0.023
KEYPOINTS = 21  # wrist, thumb 4, index 4, middle 4, ring 4, little 4
FOREARM = 0.25  # metres from wrist to elbow
BLEND = 0.007  # metres of the smooth union between the cones


@dataclass(frozen=True)
class HandShape:
    """A hand in its grip frame: `surface` and the 21 `keypoints` (21, 3) in metres."""

    surface: Surface
    keypoints: Array


def skeleton(closure: float, left: bool = False) -> Array:
    """Keypoints (21, 3) of a hand that is `closure` 0 (open) .. 1 (around the bar); left: mirrored in x."""
    out = np.zeros((KEYPOINTS, 3))
    out[0] = WRIST
    thumb_closed = np.array(
        [[0.013, -0.078, 0.036], [-0.008, -0.048, 0.053], [-0.019, -0.019, 0.050], [-0.017, 0.006, 0.041]]
    )
    thumb_open = np.array(
        [[0.013, -0.078, 0.036], [-0.018, -0.050, 0.058], [-0.036, -0.025, 0.063], [-0.045, 0.000, 0.062]]
    )
    out[1:5] = (1.0 - closure) * thumb_open + closure * thumb_closed
    for k, finger in enumerate(PHALANGES):
        sag = {"index": 0.003, "middle": 0.0, "ring": 0.002, "little": 0.008}[finger]
        point = np.array([KNUCKLE_X, KNUCKLE_Y - sag, FINGER_Z[finger]])
        out[5 + 4 * k] = point
        for j, length in enumerate(PHALANGES[finger]):
            angle = np.radians((1.0 - closure) * OPEN_DEG[j] + closure * CLOSED_DEG[j])
            point = point + length * np.array([np.cos(angle), np.sin(angle), 0.0])
            out[6 + 4 * k + j] = point
    return out * [-1.0, 1.0, 1.0] if left else out


def _cones(points: Array) -> list[tuple[Array, Array, float, float]]:
    """Rounded cones (start, end, start radius, end radius) of a hand with these keypoints."""
    cones: list[tuple[Array, Array, float, float]] = []
    for k, finger in enumerate(PHALANGES):
        r = FINGER_RADIUS[finger]
        joints = points[5 + 4 * k : 9 + 4 * k]
        cones.append((points[0] + [0.0, 0.012, 0.35 * FINGER_Z[finger]], joints[0], 0.021, r + 0.0045))
        for j in range(3):
            cones.append((joints[j], joints[j + 1], r * (1.12 - 0.08 * j), r * (1.04 - 0.1 * j)))
    thumb = points[1:5]
    cones.append((points[0] + [0.0, 0.012, 0.008], thumb[0], 0.021, 0.018))
    cones.append((thumb[0], thumb[1], 0.0175, 0.0125))
    cones.append((thumb[1], thumb[2], 0.0120, 0.0100))
    cones.append((thumb[2], thumb[3], 0.0105, 0.0082))
    cones.append((points[5] + [0.004, -0.01, 0.0], points[17] + [0.004, -0.01, 0.0], 0.0125, 0.0115))
    return cones


@numba.njit(cache=True, nogil=True)
def _nearness(points: NDArray[np.float32], cones: Array) -> NDArray[np.float32]:
    """Sum (n,) over cones (m, 8) = start, end, start and end radius (spherical ends, radius interpolated
    along the axis) of exp(-2.5 distance / BLEND) at points (n, 3): 1 on the smooth union's surface."""
    total = np.zeros(len(points), np.float32)
    for k in range(len(cones)):
        cone = cones[k]
        ax, ay, az = cone[3] - cone[0], cone[4] - cone[1], cone[5] - cone[2]
        square = max(ax * ax + ay * ay + az * az, 1e-12)
        for i in range(len(points)):
            x, y, z = points[i, 0] - cone[0], points[i, 1] - cone[1], points[i, 2] - cone[2]
            t = min(max((x * ax + y * ay + z * az) / square, 0.0), 1.0)
            x, y, z = x - t * ax, y - t * ay, z - t * az
            distance = math.sqrt(x * x + y * y + z * z) - (cone[6] + (cone[7] - cone[6]) * t)
            total[i] += np.float32(math.exp(min(max(-distance / (BLEND / 2.5), -60.0), 60.0)))
    return total


def hand_shape(closure: float, material: Material, spacing: float = 0.003, left: bool = False) -> HandShape:
    """Mesh of the hand by marching cubes over the smooth union of its cones.

    Args:
        closure: 0 open .. 1 closed.
        material: skin.
        spacing: grid step in metres.
        left: the right hand mirrored at x = 0.
    """
    points = skeleton(closure)
    cones = _cones(points)
    ends = np.array([p for c in cones for p in c[:2]])
    low, high = ends.min(axis=0) - 0.036, ends.max(axis=0) + 0.036
    axes = [np.arange(a, b, spacing) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    flat = grid.reshape(-1, 3).astype(np.float32)
    total = _nearness(flat, np.array([[*start, *end, r0, r1] for start, end, r0, r1 in cones]))
    field = (-np.log(np.maximum(total, 1e-30)) * (BLEND / 2.5)).reshape(grid.shape[:3])
    vertices, faces, normals, _ = marching_cubes(
        field, 0.0, spacing=(spacing,) * 3, gradient_direction="ascent"
    )
    faces = np.asarray(faces, dtype=np.int64)
    corner = np.asarray(normals, dtype=np.float64)[faces]
    surface = Surface(
        "hand",
        vertices.astype(np.float64) + low,
        faces,
        material,
        corner_normals=_outward(vertices, faces, corner),
    )
    return mirrored(HandShape(surface, points)) if left else HandShape(surface, points)


def mirrored(hand: HandShape) -> HandShape:
    """The other hand in its own grip frame, whose x axis points away from the palm then."""
    flip, surface = np.array([-1.0, 1.0, 1.0]), hand.surface
    normals = None if surface.corner_normals is None else surface.corner_normals[:, ::-1] * flip
    turned = replace(
        surface, vertices=surface.vertices * flip, faces=surface.faces[:, ::-1], corner_normals=normals
    )
    return HandShape(turned, hand.keypoints * flip)


def _outward(vertices: NDArray[np.float32], faces: NDArray[np.int64], corner: Array) -> Array:
    """Corner normals signed like the faces' own (the renderer turns all normals towards the viewer)."""
    sign = np.sign(np.einsum("ij,ikj->ik", geo.vector_areas(vertices[faces].astype(np.float64)), corner))
    return corner * np.where(sign == 0.0, 1.0, sign)[..., None]


def arm(skin: Material, cloth: Material, bare: bool = False) -> tuple[Surface, ...]:
    """Wrist and sleeve in the arm's frame: origin at the wrist, y towards the elbow, z up across the arm.

    bare: the sleeve ends at the elbow.
    """
    wrist = trimesh.creation.capsule(radius=0.0265, height=0.075, count=[12, 28])
    turn = trimesh.transformations.rotation_matrix(-np.pi / 2.0, [1.0, 0.0, 0.0])
    wrist.apply_translation(-wrist.bounds.mean(axis=0))
    wrist.apply_transform(turn)
    wrist.apply_translation([0.0, 0.0375, 0.0])
    wrist.apply_scale([1.0, 1.0, 0.92])
    forearm = Surface("forearm", np.asarray(wrist.vertices), np.asarray(wrist.faces, dtype=np.int64), skin)
    elbow, shoulder = np.array([0.0, FOREARM, 0.0]), np.array([0.0, FOREARM + 1.5, 0.0])  # ends out of view
    lower = (np.array([0.0, 0.05, 0.0]), elbow, 0.034, 0.045)
    upper = (elbow, shoulder, 0.045, 0.056)
    if bare:
        return (
            forearm,
            _tube("bare_forearm", [(lower[0], elbow, 0.027, 0.041)], 0.0, skin),
            _tube("sleeve", [upper], 0.03, cloth),
        )
    return forearm, _tube("sleeve", [lower, upper], 0.03, cloth)


def _tube(
    name: str, pieces: list[tuple[Array, Array, float, float]], folds_height: float, material: Material
) -> Surface:
    """Open tube through cones (start, end, and their radii) about y, folds of a relative height."""
    sides, folds = 28, 36
    phi = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    circle = np.stack([np.cos(phi), np.zeros(sides), np.sin(phi)], axis=1)
    rings = []
    for a, b, r0, r1 in pieces:
        for t in np.linspace(0.0, 1.0, folds):
            fold = 1.0 + folds_height * np.sin(31.0 * t + 2.0 * np.sin(phi + 5.0 * t))
            rings.append(a + t * (b - a) + ((r0 + (r1 - r0) * t) * fold)[:, None] * circle)
    i = np.tile(np.arange(sides), len(rings) - 1)
    j, k = (i + 1) % sides, np.repeat(np.arange(len(rings) - 1) * sides, sides)
    faces = np.concatenate(
        [np.stack([k + i, k + j, k + sides + j], 1), np.stack([k + i, k + sides + j, k + sides + i], 1)]
    )
    return Surface(name, np.concatenate(rings), faces.astype(np.int64), material)

"""What static surface lies where a part's front comes, at each end of its travel and beyond."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from recon.contact.faces import SurfaceSamples, sample
from recon.contact.front import ALONG, Front
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Mesh

_EDGE_M = 0.05  # how much of the part beside its front's rim is looked at: the thickness of a fridge door


def flush_shares(
    surface: SurfaceSamples,
    face: Front,
    joint: Joint,
    ends: tuple[float, float],
    static: Mesh,
    gap: float,
    past: Array,
) -> list[list[float]]:
    """Shares (2, n) of the front's rim with static surface within `gap` of the part past each end.

    Pieces of the rim count by how far they move. past: rad or m past the ends, from 0.
    """
    low, high = ends
    poses = [[joint.pose(low - x) for x in past], [joint.pose(high + x) for x in past]]
    every = np.concatenate([geo.transform(p, face.rim) for of_end in poses for p in of_end])
    near_part = _cropped(static, every, 2 * _EDGE_M)
    if not len(near_part.faces):
        return [[0.0], [0.0]]
    tree = cKDTree(sample(near_part, 100_000).points)
    moves = np.linalg.norm(
        geo.transform(poses[1][0], face.rim) - geo.transform(poses[0][0], face.rim), axis=1
    )
    beside = surface.points[
        np.isfinite(cKDTree(face.rim).query(surface.points, distance_upper_bound=_EDGE_M)[0])
    ]
    edge = cKDTree(beside)
    _, near = edge.query(face.rim, k=min(40, edge.n), distance_upper_bound=_EDGE_M)
    near = near.reshape(len(face.rim), -1)

    def share(pose: Array) -> float:
        distance, _ = tree.query(geo.transform(pose, beside), distance_upper_bound=gap)
        nearest, _ = tree.query(geo.transform(pose, face.rim), distance_upper_bound=gap)
        nearest = np.minimum(nearest, np.append(distance, np.inf)[near].min(axis=1))
        return float(moves @ (nearest < gap) / max(float(moves.sum()), 1e-9))

    return [[share(pose) for pose in of_end] for of_end in poses]


def nearer_ahead(face: Front, joint: Joint, ends: tuple[float, float], static: Mesh) -> list[float]:
    """Of what slides in its own plane: by how much of the other's its outer edge is nearer to static surface
    at each end, the edge that goes ahead there. At both ends of a door that closes on either side it is as
    near, and both shares are small."""
    out = np.cross(np.roll(face.rim, -1, axis=0) - np.roll(face.rim, 1, axis=0), face.normal)
    out *= np.sign(((face.rim - face.rim.mean(axis=0)) * out).sum(axis=1, keepdims=True))
    along = (out @ joint.axis) / np.maximum(np.linalg.norm(out, axis=1), 1e-9)
    edges = [
        geo.transform(joint.pose(e), face.rim[sign * along > ALONG])
        for e, sign in zip(ends, (-1.0, 1.0), strict=True)
    ]
    if not all(len(e) for e in edges):
        return [0.0, 0.0]
    beside = _cropped(static, np.concatenate(edges), abs(ends[1] - ends[0]))
    if not len(beside.faces):
        return [0.0, 0.0]
    tree = cKDTree(sample(beside, 100_000).points)
    low, high = (float(np.median(tree.query(e)[0])) for e in edges)
    return [max(0.0, 1.0 - low / max(high, 1e-9)), max(0.0, 1.0 - high / max(low, 1e-9))]


def _cropped(mesh: Mesh, points: Array, margin: float) -> Mesh:
    """The faces whose bounding boxes come within `margin` m of the points' bounding box."""
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    corners = mesh.vertices[mesh.faces]
    keep = ((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)
    return Mesh(mesh.vertices, mesh.faces[keep])

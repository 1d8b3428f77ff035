"""Which end of a part's travel is the closed one. The motion alone can't tell; the furniture around it can.

FunREC, supplement 4: which of the limits is the closed end.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.spatial import cKDTree

from recon.contact.faces import Surface, sample
from recon.contact.front import ALONG, Front, front_of
from recon.dense.depth import look_up
from recon.parts.moving_part import MovingPart
from recon.recording import Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.setting import Settings, setting
from twin.scene import STATIC_LABEL, Joint, Mesh, Prismatic, Trajectory

_AT_WALL = 0.5  # share by which the edge ahead is nearer to a wall at the closed end; chosen by us on fifteen random sliding doors
_EDGE_M = 0.05  # how much of the part beside its front's rim is looked at: the thickness of a fridge door


@dataclass(frozen=True)
class ClosedEndConfig(Settings):
    """Deciding which end is closed; chosen by us."""

    gap: float = setting(
        0.03,
        "a rim closer than this to the static surface is flush with it: a panel's thickness and a joint gap",
        unit="m",
        above=0,
    )
    deep: float = setting(
        0.08,
        "what lies so far behind the part is a cavity, not the neighbour that a sliding door covers",
        unit="m",
        above=0,
    )
    margin: float = setting(0.2, "difference of shares that decides", unit="", above=0, at_most=1)
    frames: int = setting(8, "frames looked at for each end", unit="frames", at_least=1)
    quantile: float = setting(
        0.02, "of the smoothed state: an end of the travel", unit="", at_least=0, below=0.5
    )


@dataclass(frozen=True)
class ClosedEnd:
    """The closed end: its state in the part's own counting, the sign by which the state grows on opening, the reason.

    margin: by how much the shares of the cue that decided differ between the ends, where it is asked first and nothing speaks against
    it, or the way of a drawer speaks for it; else 0.
    """

    state: float
    opening_sign: Literal[1, -1]
    source: str
    margin: float = 0.0


def find_closed_end(
    part: MovingPart,
    part_mesh: Mesh,
    static: Mesh,
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    config: ClosedEndConfig = ClosedEndConfig(),
) -> ClosedEnd:
    """Decide by what surrounds and what lies behind the part at both ends of its travel.

    In this order: its face is flush with static surface there and not at the other end; of what slides along its front's normal, it is
    farther from the viewer and nearer to static surface there, as a drawer comes out of its furniture; it covers a cavity that is seen
    when it is away; it covers more space; else the first rest pose. What slides in its own plane may be flush all along: there its edge
    ahead is asked first, which stops at a wall of the furniture, then the cavity. What is flush only where it is farther out is unsure.
    part_mesh: at the part's state 0.
    """
    ends = travel_ends(part.motion.state, config.quantile)
    surface = sample(part_mesh)
    if len(surface.points):
        face = front_of(surface, part, cameras.T_world_cam[:, :3, 3])
        flush = _flush_shares(surface, face, part.joint, ends, static, config)
        depth = [
            _depth_behind(
                part, face, ends[k], _far_frames(part, labels, ends, k, config), recording, cameras, labels
            )
            for k in (0, 1)
        ]
        cavity = [float(np.mean(d > config.deep)) if len(d) else 0.0 for d in depth]
        cues = [(flush, "flush with its surroundings"), (cavity, "covers a cavity")]
        inward = _inward(face, part.joint, ends, static)
        if isinstance(part.joint, Prismatic) and abs(face.normal @ part.joint.axis) < 0.5:
            cues.reverse()
            ahead = _nearer_ahead(face, part.joint, ends, static)
            if max(ahead) > _AT_WALL:
                cues.insert(0, (ahead, "nearer to a wall with its edge ahead"))
        elif inward is not None:
            cues.insert(1, (inward, "nearer to its surroundings and farther from the viewer"))
        for number, (shares, what) in enumerate(cues):
            k = int(shares[1] > shares[0])
            margin = shares[k] - shares[1 - k]
            if margin > config.margin:
                of = f"{100 * shares[k]:.0f} %, at the other end {100 * shares[1 - k]:.0f} %"
                sure = (inward is None and not number) or (inward is not None and inward[k] > 0)
                return replace(_end(ends, k, f"{what} ({of})"), margin=margin if sure else 0.0)
        space = [float(np.mean(np.clip(d, 0, 0.5))) if len(d) else 0.0 for d in depth]
        if abs(space[0] - space[1]) > config.margin * max(space):
            return _end(ends, int(space[1] > space[0]), "its rest pose shows less uncovered space")
    first = float(np.median(part.motion.state[:5]))
    return _end(ends, int(abs(first - ends[1]) < abs(first - ends[0])), "first rest pose")


def _end(ends: tuple[float, float], k: int, source: str) -> ClosedEnd:
    return ClosedEnd(ends[k], -1 if k else 1, source)


def smoothed(state: Array) -> Array:
    """States (n,) after a running median over five frames."""
    return np.asarray(median_filter(state, size=min(5, len(state)), mode="nearest"))


def travel_ends(state: Array, quantile: float) -> tuple[float, float]:
    """Lowest and highest state (n,): robust quantiles of the smoothed state, and there the middle of the rest.

    Extremes grow with the number of frames; the middle of what lies within 2 % of the travel from them does not.
    """
    s = smoothed(state)
    low, high = np.quantile(s, [quantile, 1 - quantile])
    near = 0.02 * (high - low)
    return float(np.median(s[s <= low + near])), float(np.median(s[s >= high - near]))


def _flush_shares(
    surface: Surface,
    face: Front,
    joint: Joint,
    ends: tuple[float, float],
    static: Mesh,
    config: ClosedEndConfig,
) -> list[float]:
    """Share of the front's rim beside which the part comes within `config.gap` of static surface, at each end.

    Each piece of the rim counts by how far it moves: along a hinge it stays where it is and tells nothing.
    """
    poses = [joint.pose(end) for end in ends]
    near_part = _cropped(static, np.concatenate([geo.transform(p, face.rim) for p in poses]), 2 * _EDGE_M)
    if not len(near_part.faces):
        return [0.0, 0.0]
    tree = cKDTree(sample(near_part, 100_000).points)
    moves = np.linalg.norm(geo.transform(poses[1], face.rim) - geo.transform(poses[0], face.rim), axis=1)
    beside = np.isfinite(cKDTree(face.rim).query(surface.points, distance_upper_bound=_EDGE_M)[0])
    edge = cKDTree(surface.points[beside])
    shares = []
    for pose in poses:
        distance, _ = tree.query(geo.transform(pose, surface.points[beside]), distance_upper_bound=config.gap)
        nearest, _ = tree.query(geo.transform(pose, face.rim), distance_upper_bound=config.gap)
        _, near = edge.query(face.rim, k=min(40, edge.n), distance_upper_bound=_EDGE_M)
        padded = np.append(distance, np.inf)
        nearest = np.minimum(nearest, padded[near.reshape(len(nearest), -1)].min(axis=1))
        shares.append(float(moves @ (nearest < config.gap) / max(float(moves.sum()), 1e-9)))
    return shares


def _inward(face: Front, joint: Joint, ends: tuple[float, float], static: Mesh) -> list[float] | None:
    """Of what slides along its front's normal: at the end that is farther from the viewer, by how much nearer its rim is to static surface
    than at the other, over the travel (0 where it is not), and 0; else None."""
    along = float(face.normal @ joint.axis) * (ends[1] - ends[0])
    if not isinstance(joint, Prismatic) or abs(face.normal @ joint.axis) < ALONG:
        return None
    rims = [geo.transform(joint.pose(e), face.rim) for e in ends]
    beside = _cropped(static, np.concatenate(rims), abs(along) + 2 * _EDGE_M)
    if not len(beside.faces):
        return None
    tree = cKDTree(sample(beside, 100_000).points)
    near, far = (float(np.median(tree.query(rim)[0])) for rim in rims)
    share = max(0.0, float(np.sign(along)) * (far - near) / max(abs(along), 1e-9))
    return [share, 0.0] if along > 0 else [0.0, share]


def _nearer_ahead(face: Front, joint: Joint, ends: tuple[float, float], static: Mesh) -> list[float]:
    """Of what slides in its own plane: by how much of the other's its outer edge is nearer to static surface at each end, the edge that
    goes ahead there. At both ends of a door that closes on either side it is as near, and both shares are small."""
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


def _far_frames(
    part: MovingPart,
    labels: Mapping[int, NDArray[np.uint8]],
    ends: tuple[float, float],
    k: int,
    config: ClosedEndConfig,
) -> list[int]:
    """Labelled frames in which the part is nearest to the other end, spread evenly."""
    away = [f for f in sorted(labels) if (s := part.state(f)) is not None and _share(s, ends, k) > 0.8]
    step = max(1, len(away) // config.frames)
    return away[::step][: config.frames]


def _share(state: float, ends: tuple[float, float], k: int) -> float:
    """How far a state is on the way from end k to the other one, 0..1."""
    return (state - ends[k]) / (ends[1 - k] - ends[k]) if ends[0] != ends[1] else 0.0


def _depth_behind(
    part: MovingPart,
    face: Front,
    end: float,
    frames: list[int],
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
) -> Array:
    """How far (m, along its normal) static surface is seen behind each point of the front posed at an end, from frames
    in which it is away; points without a view are left out."""
    points = geo.transform(part.joint.pose(end), face.points[:: max(1, len(face.points) // 2000)])
    normal = geo.rotate(part.joint.pose(end), face.normal)
    seen = np.full((len(frames), len(points)), np.nan)
    for row, frame in zip(seen, frames, strict=True):
        T = cameras.pose(frame)
        if T is None:
            continue
        p = geo.transform(geo.invert_pose(T), points)
        inside, x, y, z = look_up(recording.depth(frame), recording.intrinsics, p)
        ok = inside & (z > 0) & (labels[frame][y, x] == STATIC_LABEL) & (z > p[:, 2] - 0.02)
        ray = (points[ok] - T[:3, 3]) * (z[ok] / p[ok, 2] - 1.0)[:, None]
        row[ok] = np.abs(ray @ normal)
    known = np.isfinite(seen).any(axis=0)
    return np.asarray(np.nanmedian(seen[:, known], axis=0))


def rebase(part: MovingPart, closed: ClosedEnd, quantile: float = 0.02) -> MovingPart:
    """The part counted from its closed end: state 0 there, opening positive, `lower` 0, `upper` the other end.

    The axis turns round when the state fell on opening. The frame of the part becomes its pose at the closed end, see
    `rebase_mesh`.
    """
    state = closed.opening_sign * (part.motion.state - closed.state)
    upper = max(0.0, travel_ends(state, quantile)[1])
    joint = part.joint if closed.opening_sign > 0 else part.joint.reversed()
    joint = replace(joint, lower=0.0, upper=upper)
    return replace(part, joint=joint, motion=replace(part.motion, state=state))


def rebase_mesh(mesh: Mesh, part: MovingPart, closed: ClosedEnd) -> Mesh:
    """The mesh of `part` (as it was before `rebase`) moved from state 0 to the closed end."""
    return mesh.transformed(part.joint.pose(closed.state))

"""A joint from free poses of a part, by random samples and a line or a circle, as the paper's baselines do.

FunREC, supplement 3.1: "articulation parameters are extracted by performing RANSAC-based line (prismatic
joints) or circle (revolute joints) fitting". What it leaves open is chosen here and said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.observations import Kind
from recon.interaction.motion.movers import Movers
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Prismatic, Revolute

# m: the paper's ε_f; of a line's or a circle's inliers
GATE = 0.01
_SAMPLES = 300
# m, rad: scatter of a pose in Sturm's models; log likelihood of an outlier (6 sigma)
_SIGMA_M, _SIGMA_RAD, _OUTLIER = 0.005, np.radians(1.0), -18.0


@dataclass(frozen=True, eq=False)
class Fitted:
    """A joint and the state (n,) of each pose on it, 0 at the first."""

    joint: Joint
    state: Array
    inliers: int


def line_of(points: Array) -> Fitted:
    """The line that most points (n, 3) are within `GATE` of."""
    rng = np.random.default_rng(0)
    best: tuple[int, Array] = (-1, np.array([1.0, 0.0, 0.0]))
    middle = points[0]
    for _ in range(_SAMPLES):
        a, b = points[rng.choice(len(points), 2, replace=False)]
        if np.linalg.norm(b - a) < GATE:
            continue
        axis = geo.unit(b - a)
        off = np.linalg.norm((points - a) - np.outer((points - a) @ axis, axis), axis=1)
        count = int((off < GATE).sum())
        if count > best[0]:
            inside = points[off < GATE]
            _, _, rows = np.linalg.svd(inside - inside.mean(axis=0))
            best, middle = (count, rows[0]), inside.mean(axis=0)
    axis = best[1]
    state = (points - middle) @ axis
    if state[-1] < state[0]:
        axis, state = -axis, -state
    return Fitted(_slide(axis, state - state[0]), state - state[0], max(best[0], 0))


def circle_of(poses: Array, points: Array) -> Fitted:
    """The circle that most points (n, 3) are within `GATE` of; its axis is the plane's normal."""
    rng = np.random.default_rng(0)
    best, chosen = -1, (np.array([0.0, 0.0, 1.0]), points.mean(axis=0))
    for _ in range(_SAMPLES):
        found = _circle(points[rng.choice(len(points), 3, replace=False)])
        if found is None:
            continue
        axis, centre, radius = found
        off = points - centre
        height = off @ axis
        apart = np.hypot(np.linalg.norm(off - np.outer(height, axis), axis=1) - radius, height)
        count = int((apart < GATE).sum())
        if count > best:
            best, chosen = count, (axis, centre)
    axis, centre = chosen
    turned = geo.log_so3(poses[:, :3, :3] @ poses[0, :3, :3].T) @ axis
    if turned[-1] < turned[0]:
        axis, turned = -axis, -turned
    return Fitted(_hinge(axis, centre, turned), turned, max(best, 0))


def _circle(p: Array) -> tuple[Array, Array, float] | None:
    """Axis, centre and radius of the circle through three points (3, 3); None of a line."""
    a, b = p[1] - p[0], p[2] - p[0]
    normal = np.cross(a, b)
    square = float(normal @ normal)
    if square < 1e-12:
        return None
    centre = p[0] + (np.cross(normal, a) * (b @ b) + np.cross(b, normal) * (a @ a)) / (2.0 * square)
    return geo.unit(normal), centre, float(np.linalg.norm(centre - p[0]))


def by_residual(poses: Array, point: Array) -> Fitted:
    """Line or circle of a point (3,) of the part in the poses (n, 4, 4), whichever more poses lie on."""
    points = np.stack([geo.transform(T, point[None])[0] for T in poses])
    line, circle = line_of(points), circle_of(poses, points)
    return circle if circle.inliers > line.inliers else line


def by_bic(poses: Array, point: Array) -> Fitted:
    """Rigid, prismatic or rotational by the least Bayesian information criterion (Sturm, Stachniss and
    Burgard 2011, section 3): each pose is an outlier or normal about the model. A rigid one is told as a
    slide of no travel."""
    points = np.stack([geo.transform(T, point[None])[0] for T in poses])
    line, circle = line_of(points), circle_of(poses, points)
    still = Fitted(_slide(line.joint.axis, np.zeros(len(poses))), np.zeros(len(poses)), 0)
    told = [(_bic(fit, poses, unknowns), k, fit) for k, (fit, unknowns) in enumerate(
        ((still, 6), (line, 9), (circle, 12)))]  # fmt: skip
    return min(told)[2]


def _bic(fit: Fitted, poses: Array, unknowns: int) -> float:
    """Of a model of so many unknowns, its part at rest at the first pose."""
    rest = geo.invert_pose(fit.joint.pose(float(fit.state[0]))) @ poses[0]
    error = geo.log_se3(geo.invert_pose(fit.joint.poses(fit.state) @ rest) @ poses)
    square = (error[:, :3] ** 2).sum(1) / _SIGMA_M**2 + (error[:, 3:] ** 2).sum(1) / _SIGMA_RAD**2
    return float(-2.0 * np.logaddexp(-0.5 * square, _OUTLIER).sum() + unknowns * np.log(len(poses)))


def by_screws(poses: Array, point: Array, kind: Kind) -> Fitted:
    """The screw of a known kind, of pairs of poses (n, 4, 4), that most other pairs agree with by 10 deg."""
    n, rng = len(poses), np.random.default_rng(0)
    at = np.stack([geo.transform(T, point[None])[0] for T in poses])
    pairs = np.stack([rng.integers(0, n, 4 * n), rng.integers(0, n, 4 * n)], axis=1)
    pairs = pairs[np.abs(pairs[:, 0] - pairs[:, 1]) >= max(n // 8, 1)]
    move = poses[pairs[:, 1]] @ geo.invert_pose(poses[pairs[:, 0]])
    way = at[pairs[:, 1]] - at[pairs[:, 0]]
    twist = geo.log_so3(move[:, :3, :3]) if kind == "revolute" else way
    size = np.linalg.norm(twist, axis=1)
    strong = size > (np.radians(5.0) if kind == "revolute" else 0.02)
    axes = twist[strong] / size[strong, None]
    if not len(axes):
        axes, pairs, move = np.array([[0.0, 0.0, 1.0]]), pairs[:1], move[:1]
    else:
        pairs, move = pairs[strong], move[strong]
    agree = np.abs(axes @ axes.T) > np.cos(np.radians(10.0))
    best = int(np.argmax(agree.sum(axis=1)))
    near = agree[best]
    signed = axes[near] * np.sign(axes[near] @ axes[best])[:, None]
    axis = geo.unit(signed.mean(axis=0))
    if kind == "prismatic":
        state = (at - at[0]) @ axis
        axis, state = (axis, state) if state[-1] >= state[0] else (-axis, -state)
        return Fitted(_slide(axis, state), state, int(near.sum()))
    # a turn leaves its axis: (I - R) p = t, least squares over the pairs
    left = (np.eye(3) - move[near][:, :3, :3]).reshape(-1, 3)
    pivot = np.linalg.lstsq(left, move[near][:, :3, 3].reshape(-1), rcond=1e-3)[0]
    state = geo.log_so3(poses[:, :3, :3] @ poses[0, :3, :3].T) @ axis
    axis, state = (axis, state) if state[-1] >= state[0] else (-axis, -state)
    return Fitted(_hinge(axis, pivot, state), state, int(near.sum()))


def _slide(axis: Array, state: Array) -> Prismatic:
    return Prismatic(axis, min(float(state.min()), 0.0), max(float(state.max()), 0.0))


def _hinge(axis: Array, pivot: Array, state: Array) -> Revolute:
    return Revolute(axis, min(float(state.min()), 0.0), max(float(state.max()), 0.0), pivot=pivot)


def poses_of_tracks(movers: Movers, members: NDArray[np.bool_]) -> tuple[NDArray[np.int64], Array, Array]:
    """Frames (n,), poses (n, 4, 4) of tracks against the frame that shows most of them, by random samples
    (1 cm), and their middle (3,) there. Frames with fewer than four inliers are left out."""
    points, visible = movers.points_world[:, members], movers.visible[:, members]
    first = int(np.argmax(visible.sum(axis=1)))
    frames, poses = [], []
    for k in range(len(points)):
        both = visible[k] & visible[first]
        pose = _rigid(points[first, both], points[k, both])
        if pose is not None:
            frames.append(k)
            poses.append(pose)
    there = points[first, visible[first]]
    middle = np.median(there, axis=0) if len(there) else np.zeros(3)
    return np.array(frames, np.int64), np.array(poses).reshape(-1, 4, 4), middle


def _rigid(source: Array, target: Array, gate: float = 0.01) -> Array | None:
    if len(source) < 4:
        return None
    rng = np.random.default_rng(0)
    some = np.stack([rng.choice(len(source), 3, replace=False) for _ in range(100)])
    tried = geo.fit_rigid(source[some], target[some])
    off = np.linalg.norm(
        source @ np.swapaxes(tried[:, :3, :3], 1, 2) + tried[:, None, :3, 3] - target, axis=2
    )
    best = off[int(np.argmax((off < gate).sum(axis=1)))] < gate
    return geo.fit_rigid(source[best], target[best]) if best.sum() >= 4 else None

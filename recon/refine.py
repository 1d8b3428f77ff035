"""Refine a joint and its states with every pixel of the part: surfels (point to plane) and tracks in one system.

Once labels tell the part from the hand, its surface says more than its tracks: a surfel's distance to the depth image
fixes the state even where nothing can be tracked. Each surfel keeps a free offset along its normal and each track
three free coordinates; these are eliminated exactly (Schur complement), so that only the joint and the states remain.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.board_prior import face_step
from recon.depth import depth_normals, depth_sigma, shrink_depth
from recon.intervals import IntervalConfig, Movers, state_intervals
from recon.motion import FoundParts, PartTracks
from recon.parts import MovingPart
from recon.recording import Intrinsics, Recording
from twin import geometry as geo
from twin.errors import ConfigError
from twin.geometry import Array
from twin.scene import Joint, JointSigma, Revolute, Trajectory


@dataclass(frozen=True)
class RefineConfig:
    """Lengths in metres. Chosen by us unless the comment says otherwise."""

    width: int = 320
    voxel: float = 0.010
    max_surfels: int = 2500
    gates: tuple[float, ...] = (0.03, 0.015, 0.015, 0.01, 0.01, 0.01)  # one association round each
    steps: int = 2  # Gauss-Newton steps a round
    grazing: float = 0.25  # least cosine between surfel normal and viewing ray
    min_views: int = 2
    pixel_sigma: float = 0.6  # px at the recording's width, of a track

    def __post_init__(self) -> None:
        if self.width < 64 or self.voxel <= 0 or not self.gates or min(self.gates) <= 0 or self.steps < 1:
            raise ConfigError(f"refine: width >= 64, positive voxel, gates and steps are needed, got {self}")


_BLOCK = 8  # frames whose errors count as one; about half a second, the time scale of head sway


@dataclass(frozen=True, eq=False)
class _Views:
    """Shrunken depth images of all posed frames."""

    camera: Intrinsics
    depth: NDArray[np.float32]  # (N, h, w) m
    T_world_cam: Array  # (N, 4, 4)
    row: dict[int, int]  # recording frame -> row


@dataclass(frozen=True, eq=False)
class _Terms:
    """Scalar observations: distance of a world point q to the plane of term k in the part's frame."""

    term: NDArray[np.int64]
    frame: NDArray[np.int64]  # row
    q: Array
    sigma: Array
    normals: Array  # (K, 3) of the terms


def load_views(recording: Recording, cameras: Trajectory, config: RefineConfig = RefineConfig()) -> _Views:
    """Read every posed frame's depth once, at the working width."""
    width = min(config.width, recording.intrinsics.width)
    size = (width, max(1, round(recording.intrinsics.height * width / recording.intrinsics.width)))
    depth = np.stack([shrink_depth(recording.frame(int(f)).depth, size) for f in cameras.frames])
    rows = {int(f): k for k, f in enumerate(cameras.frames)}
    return _Views(recording.intrinsics.scaled(*size), depth, cameras.T_world_cam, rows)


def refine_parts(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    found: FoundParts,
    config: RefineConfig = RefineConfig(),
    interval: IntervalConfig | None = None,
) -> tuple[MovingPart, ...]:
    """All parts with refined joints, states, uncertainties and intervals.

    Args:
        labels: label images of some frames, from a first pass with the joints in `found`.
    """
    views = _load_views(recording, cameras, config)
    out = []
    for tracks in found.parts:
        fit = _refine_one(views, labels, tracks, found.movers, recording.intrinsics.fx, config)
        spans = state_intervals(
            tracks.part.motion.frames, fit.state, fit.jitter, interval or IntervalConfig()
        )
        joint = replace(fit.joint, covariance=fit.covariance, sigma=fit.sigma)
        motion = replace(
            tracks.part.motion,
            state=fit.state,
            intervals=tuple((i.first, i.last) for i in spans),
            residual=fit.residual,
        )
        out.append(replace(tracks.part, joint=joint, motion=motion))
    return tuple(out)


@dataclass(frozen=True, eq=False)
class _Refined:
    joint: Joint  # without uncertainty
    state: Array
    covariance: Array
    sigma: JointSigma
    residual: float
    jitter: float  # standard deviation of the state from frame to frame, m or rad


def _load_views(recording: Recording, cameras: Trajectory, config: RefineConfig) -> _Views:
    """Read every posed frame's depth once, at the working width."""
    width = min(config.width, recording.intrinsics.width)
    size = (width, max(1, round(recording.intrinsics.height * width / recording.intrinsics.width)))
    depth = np.stack([shrink_depth(recording.frame(int(f)).depth, size) for f in cameras.frames])
    rows = {int(f): k for k, f in enumerate(cameras.frames)}
    return _Views(recording.intrinsics.scaled(*size), depth, cameras.T_world_cam, rows)


def _refine_one(
    views: _Views,
    labels: Mapping[int, NDArray[np.uint8]],
    tracks: PartTracks,
    movers: Movers,
    focal: float,
    config: RefineConfig,
) -> _Refined:
    """Alternate association and Gauss-Newton; `focal` is the recording's, px."""
    part = tracks.part
    rows = np.array([views.row[int(f)] for f in part.motion.frames])
    state = np.array(part.motion.state)
    joint: Joint = replace(part.joint, covariance=None, sigma=None)
    for gate in config.gates:
        surfels = _build_surfels(views, labels, part, joint, state, config)
        terms = _join(
            _surfel_terms(views, surfels, rows, joint, state, gate, config),
            _track_terms(views, movers, tracks.members, part, rows, joint, state, focal, config),
        )
        for _ in range(config.steps):
            joint, state = _step(joint, state, part.motion.state, terms)
        state = _with_parallel_faces(joint, state, surfels, terms)
    # States are counted from the first frame, whose pose is the part's frame.
    state = state - state[0]
    return _with_uncertainty(joint, state, part.motion.state, terms)


def _part_points(views: _Views, joint: Joint, state: Array, rows: NDArray[np.int64]) -> Array:
    """T_part_cam (n, 4, 4) of the part's frames."""
    return geo.invert_pose(joint.poses(state)) @ views.T_world_cam[rows]


def _build_surfels(
    views: _Views,
    labels: Mapping[int, NDArray[np.uint8]],
    part: MovingPart,
    joint: Joint,
    state: Array,
    config: RefineConfig,
) -> tuple[Array, Array]:
    """Mean points and normals (K, 3) in the part frame per voxel and normal direction, seen in several frames."""
    h, w = views.depth.shape[1:]
    v, u = np.mgrid[0:h, 0:w]
    pixels = np.stack([u, v], axis=-1).astype(float)
    keys, points, normals, seen_in = [], [], [], []
    index = {int(f): k for k, f in enumerate(part.motion.frames)}
    for frame, label in labels.items():
        if frame not in index:
            continue
        mask = cv2.resize((label == part.id).astype(np.uint8), (w, h), interpolation=cv2.INTER_NEAREST)
        mask = cv2.erode(mask, np.ones((3, 3), np.uint8))
        depth = views.depth[views.row[frame]]
        n = depth_normals(cv2.GaussianBlur(depth, (5, 5), 1.2), views.camera, 6.0)
        ok = (mask > 0) & (depth > 0) & np.isfinite(n).all(axis=-1)
        T = geo.invert_pose(joint.pose(float(state[index[frame]]))) @ views.T_world_cam[views.row[frame]]
        x = geo.transform(T, views.camera.backproject(pixels[ok], depth[ok].astype(float)))
        m = n[ok] @ T[:3, :3].T
        cell = np.floor(x / config.voxel).astype(np.int64) + 2**19
        octant = (
            np.abs(m).argmax(axis=1) * 2 + (np.take_along_axis(m, np.abs(m).argmax(1)[:, None], 1)[:, 0] > 0)
        ).astype(np.int64)
        keys.append(((cell[:, 0] * 2**20 + cell[:, 1]) * 2**20 + cell[:, 2]) * 6 + octant)
        points.append(x)
        normals.append(m)
        seen_in.append(np.full(len(x), frame))
    if not keys:
        return np.zeros((0, 3)), np.zeros((0, 3))
    key, where = np.unique(np.concatenate(keys), return_inverse=True)
    pairs = np.unique(np.stack([where, np.concatenate(seen_in)]), axis=1)
    views_of = np.bincount(pairs[0], minlength=len(key))
    count = np.bincount(where, minlength=len(key))
    mean = np.stack([np.bincount(where, c, len(key)) / count for c in np.concatenate(points).T], axis=-1)
    normal = np.stack([np.bincount(where, c, len(key)) / count for c in np.concatenate(normals).T], axis=-1)
    length = np.linalg.norm(normal, axis=1)
    keep = np.flatnonzero((views_of >= config.min_views) & (length > 0.8))
    if len(keep) > config.max_surfels:
        keep = keep[np.linspace(0, len(keep) - 1, config.max_surfels).astype(int)]
    return mean[keep], normal[keep] / length[keep][:, None]


def _surfel_terms(
    views: _Views,
    surfels: tuple[Array, Array],
    rows: NDArray[np.int64],
    joint: Joint,
    state: Array,
    gate: float,
    config: RefineConfig,
) -> _Terms:
    """Look every surfel up in every frame's depth."""
    points, normals = surfels
    h, w = views.depth.shape[1:]
    term, frame, q, sigma = [], [], [], []
    T_part_cam = _part_points(views, joint, state, rows)
    T_cam_part = geo.invert_pose(T_part_cam)
    for i, row in enumerate(rows):
        x = geo.transform(T_cam_part[i], points)
        n = normals @ T_cam_part[i, :3, :3].T
        cosine = -(x * n).sum(axis=1) / np.linalg.norm(x, axis=1)
        ok = (x[:, 2] > 0.1) & (cosine > config.grazing)
        pixel = np.rint(views.camera.project(np.where(ok[:, None], x, [0.0, 0.0, 1.0]))).astype(int)
        ok &= (pixel >= 0).all(axis=1) & (pixel[:, 0] < w) & (pixel[:, 1] < h)
        pixel[~ok] = 0
        z = views.depth[row][pixel[:, 1], pixel[:, 0]].astype(float)
        seen = views.camera.backproject(pixel.astype(float), z)
        distance = (n * (seen - x)).sum(axis=1)
        ok &= (z > 0) & (np.abs(distance) < gate)
        k = np.flatnonzero(ok)
        term.append(k)
        frame.append(np.full(len(k), i))
        q.append(geo.transform(views.T_world_cam[row], seen[k]))
        # a plane seen at an angle: axial noise counts by its cosine, half a pixel of offset by the sine
        half = 0.5 * z[k] / views.camera.fx
        sigma.append(np.sqrt((depth_sigma(z[k]) * cosine[k]) ** 2 + half**2 * (1 - cosine[k] ** 2)))
    return _Terms(
        np.concatenate(term), np.concatenate(frame), np.concatenate(q), np.concatenate(sigma), normals
    )


def _track_terms(
    views: _Views,
    movers: Movers,
    members: NDArray[np.bool_],
    part: MovingPart,
    rows: NDArray[np.int64],
    joint: Joint,
    state: Array,
    focal: float,
    config: RefineConfig,
) -> _Terms:
    """Three scalar terms per track, along directions square and parallel to its mean viewing ray."""
    ids = np.flatnonzero(members)
    frames = np.asarray(part.motion.frames)
    seen = movers.visible[frames][:, ids]
    i, k = np.nonzero(seen)
    q = movers.points_world[frames[i], ids[k]]
    T_part_world = geo.invert_pose(joint.poses(state))
    ray = q - views.T_world_cam[rows[i], :3, 3]
    depth = np.linalg.norm(ray, axis=1)
    ray_part = np.einsum("nij,nj->ni", T_part_world[i][:, :3, :3], ray / depth[:, None])
    mean_ray = np.stack([np.bincount(k, c, len(ids)) for c in ray_part.T], axis=-1)
    mean_ray[np.linalg.norm(mean_ray, axis=1) < 1e-9] = [0.0, 0.0, 1.0]
    basis = np.stack([geo.orthogonal_basis(d) for d in mean_ray]) if len(ids) else np.zeros((0, 3, 3))
    normals = np.swapaxes(basis, 1, 2).reshape(-1, 3)
    term = (3 * k[:, None] + np.arange(3)).ravel()
    cosine2 = (normals[term].reshape(-1, 3, 3) @ ray_part[:, :, None])[..., 0] ** 2
    lateral = config.pixel_sigma * depth / focal
    sigma = np.sqrt(cosine2 * depth_sigma(depth)[:, None] ** 2 + (1 - cosine2) * lateral[:, None] ** 2)
    return _Terms(term, np.repeat(i, 3), np.repeat(q, 3, axis=0), sigma.ravel(), normals)


def _join(a: _Terms, b: _Terms) -> _Terms:
    """Both sets, sorted by term, terms of `b` numbered after those of `a`."""
    term = np.concatenate([a.term, b.term + len(a.normals)])
    order = np.argsort(term, kind="stable")
    return _Terms(
        term[order],
        np.concatenate([a.frame, b.frame])[order],
        np.concatenate([a.q, b.q])[order],
        np.concatenate([a.sigma, b.sigma])[order],
        np.concatenate([a.normals, b.normals]),
    )


def _step(joint: Joint, state: Array, start: Array, terms: _Terms) -> tuple[Joint, Array]:
    """One robust Gauss-Newton step over the joint's tangent and all states."""
    value, jac = _linearise(joint, state, terms)
    weight, _ = _robust_weights(value, terms)
    h, g = _reduced(terms.term, terms.frame, weight, value, jac, len(state))
    d = jac.shape[1] - 1
    h, g = _add_priors(h, g, d, state, start)
    delta = -np.linalg.solve(h, g)
    basis = geo.orthogonal_basis(joint.axis)
    axis = geo.unit(geo.exp_so3(basis[:, :2] @ delta[:2]) @ joint.axis)
    new = replace(joint, axis=axis, covariance=None)
    if isinstance(new, Revolute):
        new = replace(new, pivot=new.pivot + basis[:, :2] @ delta[2:4])
    return new, state + delta[d:]


def _with_uncertainty(joint: Joint, state: Array, start: Array, terms: _Terms) -> _Refined:
    """Covariance of the joint's tangent and of the states, robust to errors shared within spans of frames.

    Sandwich estimator (Liang and Zeger 1986): what one bad camera pose or one leaking label does to all pixels of a few
    neighbouring frames counts once, not once a pixel.
    """
    value, jac = _linearise(joint, state, terms)
    weight, mean = _robust_weights(value, terms)
    d = jac.shape[1] - 1
    h, g = _reduced(terms.term, terms.frame, weight, value, jac, len(state))
    h, _ = _add_priors(h, g, d, state, start)
    score = weight * (value - mean[terms.term])
    blocks = terms.frame // _BLOCK
    scores = np.zeros((int(blocks.max(initial=0)) + 1, len(h)))
    for k in range(d):
        np.add.at(scores[:, k], blocks, score * jac[:, k])
    np.add.at(scores, (blocks, d + terms.frame), score * jac[:, d])
    inverse = np.linalg.inv(h)
    pushed = scores @ inverse
    covariance = pushed[:, :d].T @ pushed[:, :d] + inverse[:d, :d]
    residual = np.abs(value - mean[terms.term])
    inlier = weight * terms.sigma**2 > 0.25 * np.median(weight * terms.sigma**2)
    rms = float(np.sqrt(np.mean(residual[inlier] ** 2))) if inlier.any() else 0.0
    second = np.diff(state, 2)
    noise = 1.4826 * float(np.median(np.abs(second))) / np.sqrt(6.0)
    drift = float(np.sqrt(np.median(np.einsum("bi,bi->i", pushed[:, d + 1 :], pushed[:, d + 1 :]))))
    tilt = float(np.sqrt(np.trace(covariance[:2, :2]) / 2))
    shift = float(np.sqrt(np.trace(covariance[2:, 2:]) / 2)) if d == 4 else None
    sigma = JointSigma(tilt, shift, float(np.hypot(noise, drift)))
    return _Refined(joint, state, 0.5 * (covariance + covariance.T), sigma, rms, noise)


def _with_parallel_faces(joint: Joint, state: Array, surfels: tuple[Array, Array], terms: _Terms) -> Array:
    """Take the step between the frames that see a board's one face and those that see the other out of the state."""
    found = face_step(joint, *surfels)
    if found is None:
        return state
    step, near, far = found
    of_surfels = terms.term < len(near)
    term, frame = terms.term[of_surfels], terms.frame[of_surfels]
    sees_near = np.bincount(frame, near[term], len(state))
    sees_far = np.bincount(frame, far[term], len(state))
    known = sees_near + sees_far > 0
    if not known.any():
        return state
    share = sees_far[known] / (sees_near + sees_far)[known]
    every = np.interp(np.arange(len(state)), np.flatnonzero(known), share)
    # Seen in the part's frame, a state that is too large turns what is seen backwards by as much.
    return np.asarray(state + step * every)


def _linearise(joint: Joint, state: Array, terms: _Terms) -> tuple[Array, Array]:
    """Values n.y (n,) and their derivatives (n, d + 1) by the joint's tangent and by the frame's own state.

    y = T(s)^-1 q is the observed point in the part frame.
    """
    n = terms.normals[terms.term]
    s = state[terms.frame]
    basis = geo.orthogonal_basis(joint.axis)[:, :2]
    if isinstance(joint, Revolute):
        back = geo.exp_so3(-joint.axis * state[:, None])[terms.frame]
        v = terms.q - joint.pivot
        rv = np.einsum("nij,nj->ni", back, v)
        dy = [np.cross(b, rv) - np.einsum("nij,nj->ni", back, np.cross(b, v)) for b in basis.T]
        dy += [b - back @ b for b in basis.T]
        dy.append(-np.cross(joint.axis, rv))
        y = rv + joint.pivot
    else:
        y = terms.q - s[:, None] * joint.axis
        dy = [-s[:, None] * np.cross(b, joint.axis) for b in basis.T]
        dy.append(np.broadcast_to(-joint.axis, y.shape))
    return (n * y).sum(axis=1), np.stack([(n * d).sum(axis=1) for d in dy], axis=-1)


def _robust_weights(value: Array, terms: _Terms) -> tuple[Array, Array]:
    """Geman-McClure weights (n,) about each term's weighted mean (K,); the scale comes from the data."""
    weight = 1.0 / terms.sigma**2
    robust = np.ones_like(weight)
    count = len(terms.normals)
    for _ in range(3):
        total = np.bincount(terms.term, weight * robust, count)
        mean = np.bincount(terms.term, weight * robust * value, count) / np.maximum(total, 1e-12)
        chi2 = ((value - mean[terms.term]) / terms.sigma) ** 2
        scale2 = max(float(np.median(chi2)) / 0.455, 0.05) * 9.0  # 0.455 is the median of chi2 with one dof
        robust = 1.0 / (1.0 + chi2 / scale2) ** 2
    return np.asarray(weight * robust / max(scale2 / 9.0, 1e-12)), np.asarray(mean)


def _add_priors(h: Array, g: Array, d: int, state: Array, start: Array) -> tuple[Array, Array]:
    """Fix the zero of the state (gauge); where the data say little, ask for small second differences, and for states
    within a fifth of the range from where they started, so that unseen frames at the ends don't run away."""
    n = len(state)
    second = np.diff(state, 2)
    noise = 1.4826 * float(np.median(np.abs(second)))
    spread = float(np.quantile(np.abs(second), 0.95)) if n > 2 else 0.0
    sigma = max(noise, spread, 1e-5)
    rows = np.zeros((n - 2, n))
    k = np.arange(n - 2)
    rows[k, k], rows[k, k + 1], rows[k, k + 2] = 1.0, -2.0, 1.0
    h[d:, d:] += rows.T @ rows / sigma**2
    g[d:] += rows.T @ second / sigma**2
    anchor = max(0.2 * float(np.ptp(start)), 1e-3)
    every = d + np.arange(n)
    h[every, every] += 1.0 / anchor**2
    g[every] += (state - state[0] - start + start[0]) / anchor**2
    h[d, d] += 1e8 * max(1.0, float(np.abs(np.diag(h)).max()) * 1e-6)
    scale = float(np.diag(h).mean())
    h[np.diag_indices_from(h)] += 1e-9 * scale
    return h, g


@njit(cache=True)
def _reduced(term, frame, weight, value, jac, n_states):  # type: ignore[no-untyped-def]
    """Normal equations of joint and states after eliminating every term's offset. Observations are sorted by term."""
    d = jac.shape[1] - 1
    size = d + n_states
    h = np.zeros((size, size))
    g = np.zeros(size)
    a = np.zeros(size)
    used = np.empty(size, np.int64)
    start = 0
    while start < len(term):
        stop = start
        while stop < len(term) and term[stop] == term[start]:
            stop += 1
        if stop - start > 1:
            total, mean = 0.0, 0.0
            for o in range(start, stop):
                total += weight[o]
                mean += weight[o] * value[o]
            mean /= total
            for i in range(d):
                a[i] = 0.0
                used[i] = i
            count = d
            for o in range(start, stop):
                r = value[o] - mean
                s = d + frame[o]
                a[s] = 0.0
            for o in range(start, stop):
                r = value[o] - mean
                s = d + frame[o]
                w = weight[o]
                for i in range(d):
                    ji = jac[o, i]
                    g[i] += w * ji * r
                    a[i] += w * ji
                    h[i, s] += w * ji * jac[o, d]
                    h[s, i] += w * ji * jac[o, d]
                    for k in range(d):
                        h[i, k] += w * ji * jac[o, k]
                g[s] += w * jac[o, d] * r
                h[s, s] += w * jac[o, d] * jac[o, d]
                a[s] += w * jac[o, d]
                used[count] = s
                count += 1
            for i in range(count):
                for k in range(count):
                    h[used[i], used[k]] -= a[used[i]] * a[used[k]] / total
        start = stop
    return h, g

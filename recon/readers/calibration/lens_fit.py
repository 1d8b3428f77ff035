"""A lens from views of a board: OpenCV's start, then least squares in which a board may be a bit uneven.

A printed board is uneven by a tenth of a millimetre or two. Close to the camera that is more than a pixel and
far away nothing, so that pictures do not tell the lens equally well: a corner's variance is noise^2 + (focal
x unevenness / distance)^2, both measured from the residuals, and corners beyond `ROBUST` of it count less
(Huber). Projections and their derivatives are OpenCV's.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.optimize import nnls

from recon.readers.calibration.pictures import View
from twin.errors import InputError
from twin.geometry import Array

ROBUST = 2.5  # standard deviations; Huber's bound, chosen by us
ROUNDS = 4  # of weights, chosen by us: the fourth changes the focal length by less than 1e-6
SETTLED = 1e-3  # of the cost, in which a standard deviation counts 1
STEPS = 50  # of Levenberg and Marquardt's method, at most
MIN_NOISE = 0.01  # px, chosen by us: no corner is found better
MEDIAN_RADIUS = np.sqrt(2.0 * np.log(2.0))  # of two normal errors of variance 1
PNP_STEPS = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-12)


@dataclass(frozen=True)
class Model:
    """Which of OpenCV's coefficients are free: 5 or 8 of them, with or without the two tangential ones."""

    count: int
    tangential: bool

    @property
    def flags(self) -> int:
        rational = cv2.CALIB_RATIONAL_MODEL if self.count == 8 else 0
        return rational | (0 if self.tangential else cv2.CALIB_ZERO_TANGENT_DIST)

    @property
    def free(self) -> list[int]:
        """Columns of projectPoints' Jacobian: focal lengths, centre and free coefficients."""
        bent = [k for k in range(self.count) if self.tangential or k not in (2, 3)]
        return [6, 7, 8, 9, *(10 + k for k in bent)]

    def __str__(self) -> str:
        names = {5: "k1 k2 k3", 8: "k1 to k6"}[self.count]
        return names + (" p1 p2" if self.tangential else "")


@dataclass(frozen=True, eq=False)
class Fit:
    """A camera that explains views of a board.

    matrix (3, 3), distortion (5 or 8,); poses: rotation vector, translation (m) a view; residuals: (n, 2) px,
    projected less found; noise px, unevenness m; sigma: formal sigmas of fx, fy, cx, cy (px).
    """

    matrix: Array
    distortion: Array
    poses: tuple[tuple[Array, Array], ...]
    residuals: tuple[Array, ...]
    noise: float
    unevenness: float
    sigma: Array

    @property
    def rms(self) -> float:
        """Root mean square distance (px) of all corners, as OpenCV counts it."""
        return rms(self.residuals)

    def nearness(self, views: Sequence[View], points: Array) -> list[Array]:
        """Focal length / distance (n,) of each view's corners, px/m."""
        return [
            self.matrix[0, 0] / (points[v.ids] @ cv2.Rodrigues(r)[0][2] + t[2])
            for v, (r, t) in zip(views, self.poses, strict=True)
        ]

    def deviations(self, views: Sequence[View], points: Array) -> list[Array]:
        """The standard deviation (n,), px, that is expected of each view's corners."""
        return [np.hypot(self.noise, self.unevenness * n) for n in self.nearness(views, points)]


def rms(residuals: Sequence[Array]) -> float:
    """Root mean square length of residuals (n, 2)."""
    all_of = np.concatenate(residuals)
    return float(np.sqrt((all_of**2).sum(axis=1).mean()))


def fit_lens(views: Sequence[View], points: Array, size: tuple[int, int], model: Model) -> Fit:
    """Fit a lens to views of a board with corners `points` (n, 3) m. Raises InputError without one."""
    objects = [points[v.ids].astype(np.float32) for v in views]
    corners = [v.corners.astype(np.float32).reshape(-1, 1, 2) for v in views]
    try:
        _, K, bent, turns, shifts, *_ = cv2.calibrateCameraExtended(
            objects,
            corners,
            size,
            None,
            None,
            flags=model.flags,  # type: ignore[call-overload]
        )
    except cv2.error:
        K, bent, turns, shifts = np.full((3, 3), np.nan), np.zeros(model.count), [], []
    poses = tuple((r.ravel(), t.ravel()) for r, t in zip(turns, shifts, strict=True))
    fit = Fit(K, bent.ravel()[: model.count], poses, (), 0.0, 0.0, np.zeros(4))
    _require_lens(fit)
    fit = replace(fit, residuals=_residuals(fit, views, points))
    for _ in range(ROUNDS):
        fit = _with_noise(fit, views, points)
        fit = _least_squares(fit, views, points, model)
    _require_lens(fit)
    return _with_noise(fit, views, points)


def without(fit: Fit, views: Sequence[View], points: Array, model: Model, left_out: Collection[int]) -> Fit:
    """The fit without some views, with the noise and unevenness of all. Raises InputError as `fit_lens`."""
    kept = [k for k in range(len(views)) if k not in left_out]
    start = replace(fit, poses=tuple(fit.poses[k] for k in kept))
    part = _least_squares(start, [views[k] for k in kept], points, model)
    _require_lens(part)
    return part


def _require_lens(fit: Fit) -> None:
    K = fit.matrix
    if not (np.all(np.isfinite(K)) and np.all(np.isfinite(fit.distortion)) and K[0, 0] > 0 and K[1, 1] > 0):
        raise InputError("the pictures do not tell the lens", "turn and tilt the board between the pictures")


def pose_of(view: View, points: Array, matrix: Array, distortion: Array) -> tuple[Array, Array, Array]:
    """Rotation vector and translation (m) of the board in a camera, and the residuals (n, 2) px there."""
    seen, corners = points[view.ids], view.corners.reshape(-1, 1, 2)
    try:
        _, turn, shift = cv2.solvePnP(seen, corners, matrix, distortion)
        turn, shift = cv2.solvePnPRefineLM(seen, corners, matrix, distortion, turn, shift, PNP_STEPS)
        again = cv2.projectPoints(seen, turn, shift, matrix, distortion)[0].reshape(-1, 2)
    except cv2.error:
        raise InputError(
            f"the corners in {view.name} don't tell where the board is", "leave out this picture"
        ) from None
    pose = (np.asarray(v, dtype=np.float64).ravel() for v in (turn, shift))
    return *pose, again - view.corners  # type: ignore[return-value]


def _residuals(fit: Fit, views: Sequence[View], points: Array) -> tuple[Array, ...]:
    return tuple(
        cv2.projectPoints(points[v.ids], r, t, fit.matrix, fit.distortion)[0].reshape(-1, 2) - v.corners
        for v, (r, t) in zip(views, fit.poses, strict=True)
    )


def _with_noise(fit: Fit, views: Sequence[View], points: Array) -> Fit:
    """Noise and unevenness by the spread of each view's residuals, which grows with its nearness."""
    spread = np.array([np.median(np.linalg.norm(e, axis=1)) / MEDIAN_RADIUS for e in fit.residuals]) ** 2
    nearness = np.array([(n**2).mean() for n in fit.nearness(views, points)])
    unit = float(nearness.mean())
    rows = np.stack([np.ones_like(nearness), nearness / unit], axis=1)
    expected = np.full(len(spread), max(float(spread.mean()), MIN_NOISE**2))
    found = np.zeros(2)
    for _ in range(ROUNDS):  # a spread is known in proportion to itself
        found, _ = nnls(rows / expected[:, None], spread / expected)
        expected = np.maximum(rows @ found, MIN_NOISE**2)
    noise = max(float(np.sqrt(found[0])), MIN_NOISE)
    return replace(fit, noise=noise, unevenness=float(np.sqrt(found[1] / unit)))


def _least_squares(fit: Fit, views: Sequence[View], points: Array, model: Model) -> Fit:
    """Levenberg and Marquardt's method on the lens and all poses, with the weights of the fit's noise."""
    deviations, damping = fit.deviations(views, points), 1e-3
    cost, H, g = _normal_equations(fit, views, points, model, deviations)
    for _ in range(STEPS):
        try:
            step = np.asarray(np.linalg.solve(H + np.diag(damping * np.diag(H)), -g), dtype=np.float64)
        except np.linalg.LinAlgError:
            break
        moved = _moved(fit, step, model)
        lower, next_H, next_g = _normal_equations(moved, views, points, model, deviations)
        if lower < cost:
            done = cost - lower < SETTLED
            fit, cost, H, g, damping = moved, lower, next_H, next_g, damping / 5.0
            if done:
                break
        else:
            damping *= 5.0
            if damping > 1e9:
                break
    fit = replace(fit, residuals=_residuals(fit, views, points))
    variance = cost / max(2 * sum(len(v.ids) for v in views) - len(g), 1)
    covariance = np.linalg.pinv(H)[:4, :4] * variance
    return replace(fit, sigma=np.sqrt(np.maximum(np.diag(covariance), 0.0)))


def _normal_equations(
    fit: Fit, views: Sequence[View], points: Array, model: Model, deviations: Sequence[Array]
) -> tuple[float, Array, Array]:
    """Huber's cost, and J'WJ and J'We over the free numbers of the lens and six of each view's pose."""
    free, own = model.free, len(model.free)
    total = own + 6 * len(views)
    H, g, cost = np.zeros((total, total)), np.zeros(total), 0.0
    for k, (view, (turn, shift), sd) in enumerate(zip(views, fit.poses, deviations, strict=True)):
        again, J = cv2.projectPoints(points[view.ids], turn, shift, fit.matrix, fit.distortion)
        e = (again.reshape(-1, 2) - view.corners) / sd[:, None]
        length = np.linalg.norm(e, axis=1)
        if not np.all(np.isfinite(length)):
            return np.inf, H, g
        beyond = np.maximum(length / ROBUST, 1.0)
        cost += float(np.where(beyond > 1.0, ROBUST * (2.0 * length - ROBUST), length**2).sum())
        w = np.repeat(1.0 / np.sqrt(beyond), 2)
        A = J[:, free + list(range(6))] * (w / np.repeat(sd, 2))[:, None]
        place = np.r_[0:own, own + 6 * k : own + 6 * k + 6]
        H[np.ix_(place, place)] += A.T @ A
        g[place] += A.T @ (e.ravel() * w)
    return cost, H, g


def _moved(fit: Fit, step: Array, model: Model) -> Fit:
    own = len(model.free)
    K, bent = fit.matrix.copy(), fit.distortion.copy()
    K[0, 0], K[1, 1], K[0, 2], K[1, 2] = K[[0, 1, 0, 1], [0, 1, 2, 2]] + step[:4]
    bent[[c - 10 for c in model.free[4:]]] += step[4:own]
    each = step[own:].reshape(-1, 6)
    poses = tuple((r + s[:3], t + s[3:]) for (r, t), s in zip(fit.poses, each, strict=True))
    return replace(fit, matrix=K, distortion=bent, poses=poses)

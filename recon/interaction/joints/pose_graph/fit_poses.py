"""Joint and motion from a part's own poses, by the part-pose graph."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.interaction.joints.config import LIMIT_QUANTILE, SIGMA_FLOOR, SIGMA_FLOOR_RAD
from recon.interaction.joints.observations import KINDS, Kind, Model
from recon.interaction.joints.pose_graph.bundle import FLOOR, PoseBundle, chi2, refine_poses
from recon.interaction.joints.pose_graph.edges import edges_from_poses, graph_pairs
from recon.interaction.joints.pose_graph.screws import twist_of
from recon.interaction.joints.pose_graph.solver import PoseGraph, edge_errors, solve_pose_graph
from recon.interaction.joints.result import MotionFit
from recon.interaction.joints.sign_and_limits import orient
from recon.interaction.joints.type_selection import TypeEvidence, decide, delta_bic, truncated_chi2
from twin import geometry as geo
from twin.errors import InputError, ReconstructionError
from twin.geometry import Array
from twin.robust import cauchy, mad_sigma

_LOOPS = 10  # loop closures a frame; more changed neither axis nor states on the measured graphs
_GRAPH_POSES = 120  # poses that the graph uses; every pose takes part in the refinement (by us, for speed)


def fit_motion_poses(
    poses: ArrayLike,
    frames: ArrayLike | None = None,
    *,
    joint_type: Kind | None = None,
) -> MotionFit:
    """Fit a joint to poses of the part.

    Args:
        poses: T_world_part (N, 4, 4) in any part coordinates, as markers, a robot's hand or a pose tracker
            give them; rows that are not finite are left out.
        frames: (N,) recording frames, increasing; default 0..N-1.
        joint_type: take this type instead of deciding it.

    Raises:
        InputError: shapes, order or rotations are wrong.
        ReconstructionError: the poses do not move.
    """
    T_world_part, numbers = _checked(poses, frames)
    fits: dict[Kind, PoseBundle] = {}
    for kind in KINDS:
        try:
            fits[kind] = _fit(T_world_part, kind, SIGMA_FLOOR, SIGMA_FLOOR_RAD)
        except ReconstructionError:
            if kind == joint_type or (kind == "revolute" and "prismatic" not in fits):
                raise
    evidence = _evidence(fits, T_world_part)
    kind, source = decide(evidence) if joint_type is None else (joint_type, "given")
    return _motion_fit(fits[kind], numbers, evidence, source)


def _checked(poses: ArrayLike, frames: ArrayLike | None) -> tuple[Array, NDArray[np.int64]]:
    t = geo.as_float(poses)
    if t.ndim != 3 or t.shape[1:] != (4, 4):
        raise InputError(f"poses must have shape (N, 4, 4), got {t.shape}")
    numbers = np.arange(len(t)) if frames is None else np.asarray(frames, dtype=np.int64)
    if numbers.shape != (len(t),) or np.any(np.diff(numbers) <= 0):
        raise InputError("frames must be one increasing number for each pose")
    finite = np.isfinite(t).all(axis=(1, 2))
    t, numbers = t[finite], numbers[finite]
    if len(t) < 4:
        raise ReconstructionError(f"{len(t)} finite poses are too few for a joint", "give at least 4")
    r = t[:, :3, :3]
    if not geo.is_rotation(r, 1e-4):
        raise InputError(
            "poses must be rigid: a rotation is not orthonormal", "check the quaternions' order and length"
        )
    return t, numbers


def _fit(T_world_part: Array, kind: Kind, sigma: float, sigma_rad: float) -> PoseBundle:
    """Pose graph with translation and rotation noise taken from the data, then a refinement on every pose."""
    some = np.unique(
        np.linspace(0, len(T_world_part) - 1, min(_GRAPH_POSES, len(T_world_part))).astype(np.int64)
    )
    poses = T_world_part[some]
    pairs = graph_pairs(len(poses), _LOOPS)
    graph: PoseGraph | None = None
    for _ in range(2):
        edges = edges_from_poses(poses, pairs, sigma, sigma_rad)
        graph = solve_pose_graph(edges, len(poses), kind, start=graph)
        error = edge_errors(edges, graph)
        sigma = max(mad_sigma(error[:, :3]), FLOOR)
        sigma_rad = max(mad_sigma(error[:, 3:]), FLOOR)
    assert graph is not None
    xi = twist_of(kind, graph.axis, graph.pivot)
    rest = _robust_mean(poses @ geo.exp_se3(-graph.state[:, None] * xi))
    state = np.interp(np.arange(len(T_world_part)), some, graph.state)
    axis = geo.unit(geo.rotate(rest, graph.axis))
    pivot = geo.transform(rest, graph.pivot[None])[0]
    return refine_poses(T_world_part, kind, axis, pivot, state, rest)


def _robust_mean(poses: Array) -> Array:
    """Middle (4, 4) of poses (N, 4, 4) that scatter about one: Cauchy-weighted means of their logs."""
    mean = poses[len(poses) // 2]
    for _ in range(10):
        logs = geo.log_se3(geo.invert_pose(mean) @ poses)
        shift, turn = np.linalg.norm(logs[:, :3], axis=1), np.linalg.norm(logs[:, 3:], axis=1)
        size = (shift / max(float(np.median(shift)), FLOOR)) ** 2 + (
            turn / max(float(np.median(turn)), FLOOR)
        ) ** 2
        weight = cauchy(size, 8.0)
        mean = mean @ geo.exp_se3((weight[:, None] * logs).sum(0) / weight.sum())
    return np.asarray(mean)


def _rms(fit: PoseBundle, part: slice) -> float:
    """RMS length of the translation (:3) or rotation (3:) errors of the good poses."""
    return float(np.sqrt(np.mean((fit.error[fit.good, part] ** 2).sum(1))))


def _evidence(fits: dict[Kind, PoseBundle], T_world_part: Array) -> TypeEvidence:
    """Compare both kinds: translation and rotation residuals over their noise floors."""

    def total(fit: PoseBundle) -> float:
        square = chi2(fit.error, max(SIGMA_FLOOR, fit.sigma), max(SIGMA_FLOOR_RAD, fit.sigma_rad))
        return truncated_chi2(square, 1.0, dof=6)

    if "revolute" not in fits:
        return TypeEvidence(0.0, 0.0, float("inf"))
    hinge = fits["revolute"]
    low, high = np.quantile(hinge.state, [LIMIT_QUANTILE, 1.0 - LIMIT_QUANTILE])
    away = T_world_part[:, :3, 3] - hinge.pivot
    radius = float(np.median(np.linalg.norm(np.cross(away, hinge.axis), axis=1)))
    if "prismatic" not in fits:
        return TypeEvidence(float("inf"), float(high - low), radius)
    dbic = delta_bic(total(fits["prismatic"]), total(hinge), 6 * len(T_world_part))
    return TypeEvidence(dbic, float(high - low), radius)


def _motion_fit(
    fit: PoseBundle, numbers: NDArray[np.int64], evidence: TypeEvidence, source: str
) -> MotionFit:
    picked = np.flatnonzero(fit.good)
    model = Model(fit.kind, fit.axis, fit.pivot, fit.state)
    oriented = orient(model, fit.covariance, picked, LIMIT_QUANTILE)
    return MotionFit(
        joint=oriented.joint,
        frames=numbers[picked],
        state=oriented.state,
        state_sigma=oriented.state_sigma,
        residual=_rms(fit, slice(0, 3)),
        inliers=float(fit.good.mean()),
        track_inliers=np.zeros(0, dtype=bool),
        landmarks=np.zeros((0, 3)),
        evidence=evidence,
        type_source=source,
        residual_rad=_rms(fit, slice(3, 6)),
    )

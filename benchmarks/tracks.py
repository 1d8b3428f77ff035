"""Joint fits on the public track recipe and on real logged poses.

    python -m benchmarks.tracks [--seeds 20] [--case NAME ...]

The recipe (`benchmarks.scenes.tracks.track_scene`): 40 frames, 200 tracks, 5 mm noise, minimum-jerk motion,
20 % outliers of the named kind. Axis and state errors follow their usual definitions; a wrong type or a
failed fit is charged 90 degrees, 1 m and the whole range. `sigma` is the median of the fits' own axis sigma;
`err/sigma` is the RMS of the normalised axis and pivot errors, 1 when the uncertainty is honest. Seconds are
CPU seconds of one process. With $FUNTWIN_DATA set, the real kitchen logs follow: RMS and median residual of
the poses that agree.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.scenes.tracks import TrackScene, track_scene
from recon.interaction.joints.fit_tracks import MotionFit, fit_motion, fit_motion_poses
from twin import geometry as geo
from twin.errors import FuntwinError
from twin.geometry import Array
from twin.scene import Revolute

SLIDES = ("M2U00394", "M2U00395")  # the other kitchen logs turn


def cases() -> dict[str, dict[str, Any]]:
    """Name -> arguments of `track_scene`."""
    out: dict[str, dict[str, Any]] = {}
    for part, small in (("door", float(np.radians(20.0))), ("drawer", 0.10)):
        for kind in ("none", "static", "drift", "mixed", "obs"):
            out[f"{part} {kind}"] = {"part": part, "outliers": kind}
        out[f"{part} small"] = {"part": part, "outliers": "mixed", "travel": small}
        out[f"{part} 80% static"] = {"part": part, "outliers": "none", "background_share": 0.8}
        out[f"{part} 20% hand"] = {"part": part, "outliers": "hand"}
        out[f"{part} 47% hand"] = {"part": part, "outliers": "hand", "outlier_share": 0.47}
    return out


@dataclass(frozen=True)
class Row:
    """One fit: right type, axis deg, pivot m (NaN for slides), state in percent of the range, normalised axis
    and pivot errors, own axis sigma deg, share of part tracks found, share of found tracks that are the
    part's, CPU s."""

    right: bool
    axis: float
    pivot: float
    state: float
    axis_z: float
    pivot_z: float
    sigma: float
    recall: float
    precision: float
    seconds: float


def judge(scene: TrackScene) -> Row:
    """Fit one scene and compare it with its truth."""
    true = scene.joint
    hinge = isinstance(true, Revolute)
    before = time.process_time()
    try:
        fit: MotionFit | None = fit_motion(scene.points, scene.visible)
    except FuntwinError:
        fit = None
    seconds = time.process_time() - before
    if fit is None or fit.joint.kind != true.kind:
        return Row(False, 90.0, 1.0 if hinge else np.nan, 100.0, np.nan, np.nan, np.nan, 0.0, 0.0, seconds)
    sigma = fit.joint.sigma
    assert sigma is not None
    axis = float(np.degrees(geo.line_angle(fit.joint.axis, true.axis)))
    pivot = np.nan
    if isinstance(fit.joint, Revolute) and isinstance(true, Revolute):
        pivot = geo.point_line_distance(fit.joint.pivot, true.pivot, true.axis)
    state = 100.0 * float(np.abs(fit.state - scene.state[fit.frames]).mean()) / float(scene.state.max())
    common = int((fit.track_inliers & scene.member).sum())
    return Row(
        True,
        axis,
        pivot,
        state,
        float(np.radians(axis)) / sigma.axis,
        pivot / sigma.pivot if sigma.pivot else np.nan,
        float(np.degrees(sigma.axis)),
        common / int(scene.member.sum()),
        common / int(fit.track_inliers.sum()),
        seconds,
    )


def recipe_table(names: Sequence[str], seeds: int) -> None:
    """Print a line a case."""
    print(
        f"{'case':16s} {'type':>6s} {'axis deg':>14s} {'sigma':>6s} {'pivot mm':>12s} {'state %':>8s} "
        f"{'err/sigma':>11s} {'recall':>6s} {'precis.':>7s} {'CPU s':>11s}"
    )
    print(
        f"{'':16s} {'%':>6s} {'median':>7s}{'max':>7s} {'deg':>6s} {'median':>6s}{'max':>6s} {'median':>8s} "
        f"{'axis':>5s}{'pivot':>6s} {'%':>6s} {'%':>7s} {'median':>6s}{'max':>5s}"
    )
    for name in names:
        rows = [judge(track_scene(seed=seed, **cases()[name])) for seed in range(seeds)]
        right = [r for r in rows if r.right]
        axis, pivot = np.array([r.axis for r in rows]), 1e3 * np.array([r.pivot for r in rows])
        seconds = np.array([r.seconds for r in rows])

        def rms(field: str, rows: Sequence[Row] = right) -> float:
            return float(np.sqrt(np.mean([getattr(r, field) ** 2 for r in rows]))) if rows else np.nan

        def mean(field: str, rows: Sequence[Row] = rows) -> float:
            return float(np.mean([getattr(r, field) for r in rows]))

        sigma = float(np.median([r.sigma for r in right])) if right else np.nan
        print(
            f"{name:16s} {100 * len(right) / len(rows):6.0f} {np.median(axis):7.3f}{axis.max():7.3f} {sigma:6.3f} "
            f"{np.median(pivot):6.2f}{pivot.max():6.2f} {np.median([r.state for r in rows]):8.2f} "
            f"{rms('axis_z'):5.2f}{rms('pivot_z'):6.2f} {100 * mean('recall'):6.1f} {100 * mean('precision'):7.1f} "
            f"{np.median(seconds):6.2f}{seconds.max():5.2f}",
            flush=True,
        )


def read_log(path: Path) -> Array:
    """Poses (N, 4, 4) of a kitchen log: x y z qx qy qz qw a line."""
    values = np.loadtxt(path)
    poses = np.tile(np.eye(4), (len(values), 1, 1))
    poses[:, :3, :3] = geo.matrix_from_quat_wxyz(values[:, [6, 3, 4, 5]])
    poses[:, :3, 3] = values[:, :3]
    return poses


def kitchen_table(folder: Path) -> None:
    """Print a line a log."""
    print(f"\n{'log':10s} {'poses':>5s} {'type':>10s} {'right':>5s} {'mm':>6s} {'deg':>5s} {'range':>10s} "
          f"{'radius':>7s} {'sigma deg':>9s} {'used %':>6s} {'CPU s':>6s}")  # fmt: skip
    hits = 0
    logs = sorted(folder.glob("*.log"))
    for path in logs:
        poses = read_log(path)
        before = time.process_time()
        fit = fit_motion_poses(poses)
        seconds = time.process_time() - before
        truth = "prismatic" if path.stem in SLIDES else "revolute"
        hits += fit.joint.kind == truth
        turns = fit.joint.kind == "revolute"
        upper = f"{np.degrees(fit.joint.upper):.1f} deg" if turns else f"{fit.joint.upper:.3f} m"
        radius = f"{fit.evidence.radius:.3f}" if turns else "-"
        assert fit.residual_rad is not None
        assert fit.joint.sigma is not None
        print(
            f"{path.stem:10s} {len(poses):5d} {fit.joint.kind:>10s} {'yes' if fit.joint.kind == truth else 'NO':>5s} "
            f"{1e3 * fit.residual:6.2f} {np.degrees(fit.residual_rad):5.2f} {upper:>10s} {radius:>7s} "
            f"{np.degrees(fit.joint.sigma.axis):9.3f} {100 * fit.inliers:6.1f} {seconds:6.2f}",
            flush=True,
        )
    print(f"types right: {hits} of {len(logs)}")


def main() -> None:
    """Parse the arguments and print both tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--case", nargs="*", choices=list(cases()), default=list(cases()))
    args = parser.parse_args()
    warm = track_scene("door", seed=1000)
    fit_motion(warm.points, warm.visible)  # compiles what is not cached yet
    recipe_table(args.case, args.seeds)
    data = os.environ.get("FUNTWIN_DATA", "")
    kitchen = Path(data) / "real_tracks" / "kitchen"
    if data and kitchen.is_dir():
        kitchen_table(kitchen)
    else:
        print("\nFUNTWIN_DATA is not set: no real kitchen tracks")


if __name__ == "__main__":
    main()

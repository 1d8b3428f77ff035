"""What binds a device's two cameras: the pose between them, and the scale of the depth of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from recon.readers.calibration.lens_fit import PNP_STEPS, pose_of
from recon.readers.calibration.pictures import MIN_CORNERS, View
from recon.recording.rig import Lens
from twin.errors import InputError
from twin.geometry import Array, invert_pose, make_pose, rotation_angle

MIN_PIXELS = 100  # of a board in a depth map, chosen by us
SAMPLED = 20_000  # pixels of a board, at most, chosen by us
NOISE_FACTOR = 1.4826  # median absolute deviation to standard deviation of normal errors
GOOD_PAIRS = 5  # for a trusted pose or scale, chosen by us
GOOD_POSE = (1.5e-3, 0.1)  # m and degrees, standard deviations, chosen by us
GOOD_SCALE = 2e-3  # standard deviation, chosen by us
SCALES = (0.5, 2.0)  # beyond, the unit is another; chosen by us


@dataclass(frozen=True, eq=False)
class PoseResult:
    """T_color_depth (4, 4) from `pairs` pictures, rms px; sigma: m and degrees, None from one pair."""

    T_color_depth: Array
    pairs: int
    rms: float
    sigma: tuple[float, float] | None
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class ScaleResult:
    """True depth = scale x measured depth, by `maps` depth maps; sigma: of the scale."""

    scale: float
    sigma: float
    maps: int
    reasons: tuple[str, ...]


def pose_between(
    pairs: Sequence[tuple[View, View]], points: Array, color: Lens, depth: Lens, turns: bool
) -> PoseResult:
    """The depth camera's pose in the colour camera, from views of one board at the same moments.

    turns: whether the board looks the same upside down, so that the depth camera's corners may be counted
    from the other end; the two cameras then are taken to stand less than a quarter turn apart. Raises
    InputError when no pair shares enough corners.
    """
    if turns:
        pairs = [(a, _upright(a, b, points, color, depth)) for a, b in pairs]
    shared = [(a, b, np.intersect1d(a.ids, b.ids)) for a, b in pairs]
    shared = [s for s in shared if len(s[2]) >= MIN_CORNERS]
    if not shared:
        raise InputError(
            "no pair of a colour and a depth picture shows the same part of the board",
            "give pictures that both cameras took of the board at the same moment",
        )
    objects = [points[ids].astype(np.float32) for _, _, ids in shared]
    first, second = [_at(a, ids) for a, _, ids in shared], [_at(b, ids) for _, b, ids in shared]
    K1, D1 = color.camera.matrix, np.asarray(color.distortion)
    K2, D2 = depth.camera.matrix, np.asarray(depth.distortion)
    try:
        total, *_, R, t, _, _, _, _, _ = cv2.stereoCalibrateExtended(
            objects, first, second, K1, D1, K2, D2, (color.camera.width, color.camera.height), None, None,
            flags=cv2.CALIB_FIX_INTRINSIC | _flags(D1, D2), criteria=PNP_STEPS,
        )  # type: ignore[call-overload]  # fmt: skip
    except cv2.error:
        raise InputError(
            "the pairs of pictures don't tell the pose between the cameras", "take more pairs"
        ) from None
    T = invert_pose(make_pose(R, t.ravel()))
    each = [_relative(a, b, points, color, depth) for a, b, _ in shared]
    sigma, reasons = None, []
    if len(each) > 1:
        moved = NOISE_FACTOR * float(np.median([np.linalg.norm(E[:3, 3] - T[:3, 3]) for E in each]))
        turned = NOISE_FACTOR * float(np.median([rotation_angle(E[:3, :3].T @ T[:3, :3]) for E in each]))
        sigma = (moved / np.sqrt(len(each)), float(np.rad2deg(turned)) / np.sqrt(len(each)))
        if sigma[0] > GOOD_POSE[0] or sigma[1] > GOOD_POSE[1]:
            reasons.append(
                f"pairs differ: it is known to {1e3 * sigma[0]:.1f} mm and {sigma[1]:.2f} degrees, "
                f"{1e3 * GOOD_POSE[0]:g} mm and {GOOD_POSE[1]:g} are needed"
            )
    if len(each) < GOOD_PAIRS:
        reasons.append(f"{len(each)} pairs of pictures show it, {GOOD_PAIRS} are needed")
    return PoseResult(
        T, len(each), float(total), sigma, tuple(f"pose between the cameras: {r}" for r in reasons)
    )


def depth_scale(maps: Sequence[tuple[View, Path]], points: Array, lens: Lens) -> ScaleResult:
    """The scale of depth maps (16-bit PNG, mm), by the board's plane that each map's view tells.

    A map lies on the view's pixel grid, or at another resolution. Raises InputError if none shows the board.
    """
    ratios = []
    for view, path in maps:
        measured = files.decode_depth(files.shown(path), files.read_bytes(path), 1000.0)
        ratio = _ratio(view, measured, points, lens, files.shown(path))
        if ratio is not None:
            ratios.append(ratio)
    if not ratios:
        raise InputError(
            "no depth map has depth where the board is",
            "give depth maps of the board, 16-bit PNG in mm, 0 = unknown",
        )
    scale = float(np.median(ratios))
    if not SCALES[0] < scale < SCALES[1]:
        raise InputError(
            f"true depth is {scale:.4g} times what the depth maps hold",
            "give depth maps in mm, and check the size of the board's squares",
        )
    n = len(ratios)
    spread = NOISE_FACTOR * float(np.median(np.abs(np.array(ratios) - scale)))
    sigma, reasons = spread / np.sqrt(n) if n > 1 else float("inf"), []
    if n < GOOD_PAIRS:
        reasons.append(f"{n} depth maps show the board, {GOOD_PAIRS} are needed")
    if n > 1 and sigma > GOOD_SCALE:
        reasons.append(f"it is known to {sigma:.2%}, {GOOD_SCALE:.1%} is needed")
    return ScaleResult(scale, sigma, n, tuple(f"depth scale: {r}" for r in reasons))


def _flags(*distortions: Array) -> int:
    """What makes OpenCV use more than the first five coefficients that it is given."""
    flags, most = 0, max(len(d) for d in distortions)
    for above, flag in (
        (5, cv2.CALIB_RATIONAL_MODEL),
        (8, cv2.CALIB_THIN_PRISM_MODEL),
        (12, cv2.CALIB_TILTED_MODEL),
    ):
        flags |= flag if most > above else 0
    return flags


def _at(view: View, ids: NDArray[np.int64]) -> NDArray[np.float32]:
    order = {int(i): k for k, i in enumerate(view.ids)}
    return view.corners[[order[int(i)] for i in ids]].astype(np.float32).reshape(-1, 1, 2)


def _pose(view: View, points: Array, lens: Lens) -> Array:
    turn, shift, _ = pose_of(view, points, lens.camera.matrix, np.asarray(lens.distortion))
    return make_pose(cv2.Rodrigues(turn)[0], shift)


def _relative(a: View, b: View, points: Array, color: Lens, depth: Lens) -> Array:
    return np.asarray(_pose(a, points, color) @ invert_pose(_pose(b, points, depth)))


def _upright(a: View, b: View, points: Array, color: Lens, depth: Lens) -> View:
    """The depth camera's view with corners counted from the end from which the cameras are turned less."""
    other = replace(b, ids=len(points) - 1 - b.ids)
    angles = [rotation_angle(_relative(a, v, points, color, depth)[:3, :3]) for v in (b, other)]
    return b if angles[0] <= angles[1] else other


def _ratio(view: View, measured: NDArray[np.float32], points: Array, lens: Lens, name: str) -> float | None:
    """Median of expected / measured depth over the board; None where the map holds none of it."""
    (height, width), k = measured.shape, lens.camera
    if abs(k.height * width / k.width - height) >= 1.0:
        raise InputError(
            f"{name} is {width}x{height}, its camera's pictures are {k.width}x{k.height}, another shape",
            "give the depth maps as they lie on those pictures",
        )
    T, small = _pose(view, points, lens), lens.scaled(width, height).camera
    corners = (view.corners + 0.5) * (width / k.width, height / k.height) - 0.5
    mask = np.zeros(measured.shape, dtype=np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(np.rint(corners).astype(np.int32)), 1)
    rows, columns = np.nonzero((mask > 0) & (measured > 0))
    if len(rows) < MIN_PIXELS:
        return None
    step = 1 + len(rows) // SAMPLED
    rows, columns = rows[::step], columns[::step]
    pixels = np.stack([columns, rows], axis=-1).astype(np.float64).reshape(-1, 1, 2)
    rays = cv2.undistortPoints(pixels, small.matrix, np.asarray(lens.distortion), criteria=PNP_STEPS).reshape(
        -1, 2
    )
    normal = T[:3, 2]
    expected = (normal @ T[:3, 3]) / (rays @ normal[:2] + normal[2])
    ratio = expected / measured[rows, columns]
    return float(np.median(ratio[np.isfinite(ratio)]))

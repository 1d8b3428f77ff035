"""One camera of a device: its lens model, how far the result can be trusted, and what speaks against it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from recon.readers.calibration.lens_fit import Fit, Model, fit_lens, pose_of, rms, without
from recon.readers.calibration.pictures import MIN_CORNERS, Pictures, View
from recon.recording import Intrinsics
from recon.recording.rig import Lens
from twin.errors import InputError
from twin.geometry import Array, angle_between
from twin.runs.loop import Loop, untold

MODELS = (Model(5, False), Model(5, True), Model(8, False), Model(8, True))  # from the simplest on
MIN_PICTURES = 5  # with a board: fewer tell no lens apart from poses that happen to fit; chosen by us
MAX_FOLDS = 8  # times that a part of the pictures is left out, chosen by us
BETTER = 0.98  # of the left-out error of a simpler model, chosen by us: else the simpler one is taken
# Standard deviations beyond which a corner is another one, or a reflection; chosen by us: on a real, uneven
# board some of the right ones are beyond 6 and none beyond 12.
WRONG = 12.0
_ROBUST = 3.0  # px^2 cap in standard deviations: a wrong corner doesn't choose the model

# What a trusted calibration needs; chosen by us.
GOOD_PICTURES = 8
GOOD_COVERAGE = 0.5  # of the picture's area that boards were seen in
# degrees between the two board normals that differ most: parallel boards don't tell the focal length
GOOD_TILT = 25.0
GOOD_SIGMA = 2e-3  # relative, of the focal length
GOOD_RMS = (0.5, 2.5e-4)  # px, or part of the picture's width, whichever is more
GOOD_LEFT_OUT = 1.6  # left-out error / error of the fit


@dataclass(frozen=True, eq=False)
class CameraResult:
    """A calibrated camera.

    rms px; per_picture: name -> rms px of the pictures with a board; unused: names of those without; corners,
    residuals: (n, 2) px of all corners, projected less found. coverage: part of the picture; tilt: degrees;
    left_out: rms px of pictures outside the fit (None for a known lens); sigma_focal: relative, sigma_centre:
    px, by leaving pictures out; unevenness: m, of the board. reasons: why to doubt it, empty when trusted.
    """

    name: str
    lens: Lens
    model: str
    rms: float
    per_picture: dict[str, float]
    unused: tuple[str, ...]
    corners: Array
    residuals: Array
    coverage: float
    tilt: float
    left_out: float | None
    sigma_focal: float
    sigma_centre: float
    unevenness: float
    reasons: tuple[str, ...]


def calibrate_camera(
    name: str, pictures: Pictures, progress: Loop = untold, coefficients: int | None = None
) -> CameraResult:
    """The lens of one camera, with 5 or 8 coefficients, or as many as pictures that are left out bear. Raises
    InputError when too few pictures show the board."""
    views, points = pictures.usable, pictures.board.points
    require_pictures(name, pictures, MIN_PICTURES)
    models = [m for m in MODELS if coefficients is None or m.count == coefficients]
    fits = {model: fit_lens(views, points, pictures.size, model) for model in models}
    groups = _groups(len(views))
    errors, parts = {}, {}
    for model in progress(models, f"{name} lens models"):
        errors[model], parts[model] = _left_out(fits[model], fits[models[-1]], views, points, model, groups)
    model = models[0]
    for other in models[1:]:
        if errors[other] < BETTER * errors[model]:
            model = other
    fit, own = fits[model], parts[model]
    if not own:
        raise InputError(
            f"the {name} pictures do not tell the lens", "turn and tilt the board between the pictures"
        )
    found = [
        pose_of(views[k], points, f.matrix, f.distortion)[2]
        for f, g in zip(own, groups, strict=True)
        for k in g
    ]
    spread = _jackknife([f.matrix[[0, 1, 0, 1], [0, 1, 2, 2]] for f in own])
    sigma = np.maximum(spread, fit.sigma)
    lens = Lens(
        Intrinsics(*pictures.size, *(float(v) for v in fit.matrix[[0, 1, 0, 1], [0, 1, 2, 2]])),
        tuple(fit.distortion.tolist()),
    )
    turns = [r for r, _ in fit.poses]
    return _result(
        name, lens, str(model), pictures, fit.residuals, turns,
        left_out=rms(found),
        sigma=(float((sigma[:2] / fit.matrix[[0, 1], [0, 1]]).max()), float(sigma[2:].max())),
        unevenness=fit.unevenness,
    )  # fmt: skip


def without_wrong_corners(pictures: Pictures) -> tuple[Pictures, int]:
    """The pictures without corners that no lens explains, and how many these are."""
    views, points = pictures.usable, pictures.board.points
    if len(views) < MIN_PICTURES:
        return pictures, 0
    fit = fit_lens(views, points, pictures.size, MODELS[-1])
    kept = []
    for v, e, sd in zip(views, fit.residuals, fit.deviations(views, points), strict=True):
        good = np.linalg.norm(e, axis=1) < WRONG * sd
        kept.append(View(v.name, v.ids[good], v.corners[good]))
    lost = sum(len(v.ids) for v in views) - sum(len(v.ids) for v in kept)
    rest = iter(kept)
    left = [None if v is None else next(rest) for v in pictures.views]
    return replace(
        pictures, views=tuple(v if v is not None and len(v.ids) >= MIN_CORNERS else None for v in left)
    ), lost


def known_camera(name: str, pictures: Pictures, lens: Lens) -> CameraResult:
    """How well a lens that is known already explains pictures of a board."""
    k, (width, height) = lens.camera, pictures.size
    if abs(k.height * width / k.width - height) >= 1.0:
        raise InputError(
            f"the {name} pictures are {width}x{height}, its known lens is of {k.width}x{k.height}, another shape",
            "give pictures in the mode that the lens was calibrated in",
        )
    lens = lens.scaled(width, height)
    require_pictures(name, pictures, 1)
    bent = np.asarray(lens.distortion)
    poses = [pose_of(v, pictures.board.points, lens.camera.matrix, bent) for v in pictures.usable]
    return _result(
        name, lens, "known", pictures, [p[2] for p in poses], [p[0] for p in poses], None, (0.0, 0.0), 0.0
    )


def require_pictures(name: str, pictures: Pictures, least: int) -> None:
    """Raises InputError when fewer pictures show the board."""
    count, total = len(pictures.usable), len(pictures.views)
    if count >= least:
        return
    if count == 0:
        raise InputError(
            f"no {pictures.board} in any of {total} {name} pictures",
            "check the board's numbers (columns and rows count squares) and that it lies flat, sharp and lit in the picture",
        )
    raise InputError(
        f"{count} of {total} {name} pictures show the board, {least} are needed at least",
        "take 10 to 20 with the board tilted and in every corner of the picture",
    )


def _result(
    name: str,
    lens: Lens,
    model: str,
    pictures: Pictures,
    residuals: Sequence[Array],
    turns: Sequence[Array],
    left_out: float | None,
    sigma: tuple[float, float],
    unevenness: float,
) -> CameraResult:
    views = pictures.usable
    coverage, tilt, total = _coverage(views, pictures.size), _tilt(turns), rms(residuals)
    reasons = []
    if left_out is not None:  # of a lens that is known already nothing is asked but that it fits
        if len(views) < GOOD_PICTURES:
            reasons.append(f"{len(views)} pictures show the board, {GOOD_PICTURES} are needed")
        if coverage < GOOD_COVERAGE:
            reasons.append(
                f"the board was seen in {coverage:.0%} of the picture, {GOOD_COVERAGE:.0%} are needed"
            )
        if tilt < GOOD_TILT:
            reasons.append(f"the board's tilts differ by {tilt:.0f} degrees, {GOOD_TILT:.0f} are needed")
        if sigma[0] > GOOD_SIGMA:
            reasons.append(f"the focal length is known to {sigma[0]:.2%}, {GOOD_SIGMA:.1%} is needed")
        if left_out > GOOD_LEFT_OUT * total:
            reasons.append(
                f"pictures left out fit {left_out / total:.1f} times worse, {GOOD_LEFT_OUT:g} is allowed"
            )
    bound = max(GOOD_RMS[0], GOOD_RMS[1] * pictures.size[0])
    if total > bound:
        reasons.append(f"corners are off by {total:.2f} px, {bound:.2f} is allowed")
    return CameraResult(
        name=name,
        lens=lens,
        model=model,
        rms=total,
        per_picture={v.name: rms([e]) for v, e in zip(views, residuals, strict=True)},
        unused=tuple(n for n, v in zip(pictures.names, pictures.views, strict=True) if v is None),
        corners=np.concatenate([v.corners for v in views]),
        residuals=np.concatenate(residuals),
        coverage=coverage,
        tilt=tilt,
        left_out=left_out,
        sigma_focal=sigma[0],
        sigma_centre=sigma[1],
        unevenness=unevenness,
        reasons=tuple(f"{name}: {r}" for r in reasons),
    )


def _groups(count: int) -> list[list[int]]:
    """Pictures to leave out together, each once, spread over the whole list."""
    folds = min(count, MAX_FOLDS)
    return [list(range(k, count, folds)) for k in range(folds)]


def _left_out(
    fit: Fit, full: Fit, views: Sequence[View], points: Array, model: Model, groups: Sequence[Sequence[int]]
) -> tuple[float, list[Fit]]:
    """Error of left-out pictures, in sigmas of the fullest model's fit, and the fits without them.

    A model that a part of the pictures does not bear has an infinite error.
    """
    fits, errors = [], []
    deviations = full.deviations(views, points)
    for group in groups:
        try:
            part = without(fit, views, points, model, group)
            off = [pose_of(views[k], points, part.matrix, part.distortion)[2] for k in group]
        except InputError:
            return np.inf, []
        fits.append(part)
        for k, e in zip(group, off, strict=True):
            errors.append(np.minimum((e**2).sum(axis=1) / deviations[k] ** 2, _ROBUST**2 * 2.0).mean())
    return float(np.sqrt(np.mean(errors))), fits


def _jackknife(values: Sequence[Array]) -> Array:
    """Standard deviations of a result by its values without each part of the data."""
    n = len(values)
    return np.asarray(np.sqrt((n - 1) / n * ((np.stack(values) - np.mean(values, axis=0)) ** 2).sum(axis=0)))


def _coverage(views: Sequence[View], size: tuple[int, int], cells: int = 64) -> float:
    """Part of the picture that lies within the corners of any view."""
    mask = np.zeros((cells, cells), dtype=np.uint8)
    for v in views:
        at = (v.corners + 0.5) / size * cells - 0.5
        cv2.fillConvexPoly(mask, cv2.convexHull(np.rint(at).astype(np.int32)), 1)
    return float(mask.mean())


def _tilt(turns: Sequence[Array]) -> float:
    normals = [cv2.Rodrigues(r)[0][:, 2] for r in turns]
    return max((np.rad2deg(angle_between(a, b)) for a in normals for b in normals), default=0.0)

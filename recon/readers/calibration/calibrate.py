"""Calibrating a device from pictures of a board: lenses, their pose, the depth's scale, and its trust."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from recon.readers.calibration.board import CalibrationBoard
from recon.readers.calibration.camera import (
    CameraResult,
    calibrate_camera,
    known_camera,
    without_wrong_corners,
)
from recon.readers.calibration.file import Calibration
from recon.readers.calibration.pair import PoseResult, ScaleResult, depth_scale, pose_between
from recon.readers.calibration.pictures import Pictures, find_boards, paired
from recon.recording.rig import Lens
from twin.errors import InputError
from twin.files.atomic import write_file
from twin.runs.loop import Loop, untold

CALIBRATION_FILE, PICTURE_FILE = "calibration.json", "residuals.png"


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """A calibration and how it came about.

    calibration: what the file holds. color, depth: both cameras; None where no pictures were given. pose,
    scale: what binds them. board: as it fits. notes: what to know besides. reasons: why to doubt it.
    """

    calibration: Calibration
    board: CalibrationBoard
    color: CameraResult | None
    depth: CameraResult | None
    pose: PoseResult | None
    scale: ScaleResult | None
    notes: tuple[str, ...]

    @property
    def reasons(self) -> tuple[str, ...]:
        parts = (self.color, self.depth, self.pose, self.scale)
        return tuple(r for p in parts if p is not None for r in p.reasons)

    @property
    def verdict(self) -> str:
        """trusted or doubtful."""
        return "doubtful" if self.reasons else "trusted"

    @property
    def lines(self) -> list[str]:
        """What was found, for the terminal."""
        told = [_summary(c) for c in (self.color, self.depth) if c is not None]
        if self.pose is not None:
            x, y, z = 1e3 * self.pose.T_color_depth[:3, 3]
            s = self.pose.sigma
            known = "" if s is None else f" (known to {1e3 * s[0]:.2f} mm, {s[1]:.3f} degrees)"
            told.append(
                f"depth camera at {x:+.1f} {y:+.1f} {z:+.1f} mm in the colour camera{known}, {self.pose.pairs} pairs"
            )
        if self.scale is not None:
            known = f" +- {self.scale.sigma:.4f}" if self.scale.maps > 1 else ""
            told.append(
                f"true depth = {self.scale.scale:.4f}{known} x measured depth, {self.scale.maps} maps"
            )
        return [*told, *self.notes, self.verdict + "".join(f"\n  {r}" for r in self.reasons)]


def calibrate(
    color: Sequence[Path],
    board: CalibrationBoard,
    *,
    depth: Sequence[Path] = (),
    depth_maps: Sequence[Path] = (),
    known: Calibration | None = None,
    coefficients: Literal[5, 8] | None = None,
    progress: Loop = untold,
) -> CalibrationResult:
    """Calibrate a device.

    Args:
        color: the colour camera's pictures of the board.
        depth: the depth camera's own pictures (infrared), taken at the same moments: of the same name or
            number, or in the same order.
        depth_maps: 16-bit PNG (mm) on the grid of the `depth` pictures, or of the colour pictures without
            these; paired likewise.
        coefficients: of the lens, in OpenCV's order; None: as many as pictures that are left out bear.
        known: lenses in it are taken as they are; then one pair of pictures is enough for a pose.

    Raises:
        InputError: pictures that can't be read, of mixed sizes, without the board, or too few.
    """
    if not color and not depth:
        raise InputError("no pictures", "give pictures of the board")
    lenses = {"colour": known.color if known else None, "depth": known.depth if known else None}
    seen, results, wrong = _cameras({"colour": color, "depth": depth}, board, lenses, coefficients, progress)
    as_seen = next(iter(seen.values())).board
    pose = _pose(color, depth, seen, results) if len(seen) == len(lenses) else None
    scale = None
    if depth_maps:
        name = "depth" if depth else "colour"
        pairs = paired(depth or color, depth_maps, (name, "depth map"))
        found = [(v, depth_maps[j]) for i, j in pairs if (v := seen[name].views[i]) is not None]
        scale = depth_scale(found, as_seen.points, results[name].lens)
    calibration = Calibration(
        color=results["colour"].lens if "colour" in results else lenses["colour"],
        depth=results["depth"].lens if "depth" in results else lenses["depth"],
        T_color_depth=pose.T_color_depth if pose else (known.T_color_depth if known else None),
        depth_scale=scale.scale if scale else (known.depth_scale if known else None),
    )
    digest = hashlib.sha256(calibration.text.encode()).hexdigest()
    return CalibrationResult(
        replace(calibration, digest=digest),
        as_seen,
        results.get("colour"),
        results.get("depth"),
        pose,
        scale,
        _notes(board, as_seen, results, wrong),
    )


def write_calibration(result: CalibrationResult, folder: Path) -> tuple[Path, Path]:
    """Write calibration.json and residuals.png into a folder, made if need be; such files are replaced."""
    from recon.readers.calibration.picture import residual_picture  # here: matplotlib takes half a second

    paths = folder / CALIBRATION_FILE, folder / PICTURE_FILE
    picture = residual_picture(result)
    try:
        write_file(paths[0], result.calibration.text.encode())
        write_file(paths[1], picture)
    except OSError as error:
        raise InputError(f"can't write {folder}: {error.strerror}", "choose another place") from error
    return paths


def _cameras(
    paths: dict[str, Sequence[Path]],
    board: CalibrationBoard,
    lenses: dict[str, Lens | None],
    coefficients: int | None,
    progress: Loop,
) -> tuple[dict[str, Pictures], dict[str, CameraResult], dict[str, int]]:
    """Of each camera with pictures: these, its result, and how many of its corners were wrong."""
    seen: dict[str, Pictures] = {}
    results: dict[str, CameraResult] = {}
    wrong: dict[str, int] = {}
    for name in (n for n in paths if paths[n]):
        certain = bool(seen)  # one board stands before both cameras, and the first has told its pattern
        seen[name] = find_boards(paths[name], board, f"{name} pictures", progress, certain)
        board = seen[name].board
        lens = lenses[name]
        if lens is None:
            seen[name], wrong[name] = without_wrong_corners(seen[name])
            results[name] = calibrate_camera(name, seen[name], progress, coefficients)
        else:
            results[name] = known_camera(name, seen[name], lens)
    return seen, results, wrong


def _pose(
    color: Sequence[Path], depth: Sequence[Path], seen: dict[str, Pictures], results: dict[str, CameraResult]
) -> PoseResult:
    first, second = seen["colour"], seen["depth"]
    pairs = [(first.views[i], second.views[j]) for i, j in paired(color, depth, ("colour", "depth"))]
    both = [(a, b) for a, b in pairs if a is not None and b is not None]
    turns = first.board.kind == "checkerboard"
    lens: tuple[Lens, Lens] = (results["colour"].lens, results["depth"].lens)
    return pose_between(both, first.board.points, *lens, turns)


def _notes(
    board: CalibrationBoard, seen: CalibrationBoard, results: dict[str, CameraResult], wrong: dict[str, int]
) -> tuple[str, ...]:
    notes = []
    if seen.legacy != board.legacy:
        told = "before 4.6" if seen.legacy else "from 4.6 on"
        notes.append(f"the board's first square is that of OpenCV {told}; it fits better")
    for r in results.values():
        if r.unused:
            names = ", ".join(r.unused[:5]) + ("" if len(r.unused) <= 5 else " ...")
            notes.append(f"{r.name}: no board in {len(r.unused)} pictures: {names}")
    notes += [f"{name}: {count} wrong corners left out" for name, count in wrong.items() if count]
    return tuple(notes)


def _summary(r: CameraResult) -> str:
    k = r.lens.camera
    sigma = (
        "" if r.left_out is None else f" (known to {r.sigma_focal:.3%}), centre to {r.sigma_centre:.1f} px"
    )
    left = "" if r.left_out is None else f", left-out pictures {r.left_out:.2f} px"
    return (
        f"{r.name}: fx {k.fx:.2f} fy {k.fy:.2f} cx {k.cx:.2f} cy {k.cy:.2f}{sigma}; lens {r.model}; corners {r.rms:.2f} px{left}; "
        f"{len(r.per_picture)} pictures cover {r.coverage:.0%}"
    )

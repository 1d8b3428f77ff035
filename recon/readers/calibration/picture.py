"""The residual picture of a calibration: where corners are off, and by how much in each picture."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from recon.readers.calibration.camera import CameraResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from recon.readers.calibration.calibrate import CalibrationResult

ARROW_PART = 0.04  # of the picture's width, length of a typical residual's arrow; chosen by us
MAX_NAMES = 40  # pictures whose names can be read below their bars


def residual_picture(result: CalibrationResult) -> bytes:
    """A PNG with a row a camera: its residuals over the picture, and each picture's rms."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    cameras = [c for c in (result.color, result.depth) if c is not None]
    figure = Figure(figsize=(12.0, 4.6 * len(cameras)), dpi=110, layout="constrained")
    axes = figure.subplots(len(cameras), 2, squeeze=False)
    for (field, bars), camera in zip(axes, cameras, strict=True):
        _arrows(field, camera)
        _bars(bars, camera)
    figure.suptitle(f"{result.verdict}: {result.board}")
    out = io.BytesIO()
    FigureCanvasAgg(figure).print_png(out)
    return out.getvalue()


def _arrows(axes: Axes, camera: CameraResult) -> None:
    k = camera.lens.camera
    typical = max(camera.rms, 1e-6)
    scale = typical / (ARROW_PART * k.width)
    x, y = camera.corners.T
    dx, dy = camera.residuals.T
    axes.quiver(x, y, dx, dy, angles="xy", scale_units="xy", scale=scale, color="#c92a2a", width=0.0015)
    axes.plot(k.cx, k.cy, "+", color="#1c7ed6", ms=10)
    axes.set_xlim(-0.5, k.width - 0.5)
    axes.set_ylim(k.height - 0.5, -0.5)
    axes.set_aspect("equal")
    axes.set_title(
        f"{camera.name}: corners off by {camera.rms:.2f} px, arrows {1.0 / scale:.0f} times as long",
        fontsize=9,
    )
    axes.set_xlabel(f"x, px (the boards cover {camera.coverage:.0%}; + is the centre)", fontsize=8)
    axes.set_ylabel("y, px", fontsize=8)


def _bars(axes: Axes, camera: CameraResult) -> None:
    names, values = list(camera.per_picture), list(camera.per_picture.values())
    place = np.arange(len(names))
    axes.bar(place, values, color="#748ffc")
    axes.axhline(camera.rms, color="#343a40", lw=1, ls="--", label=f"all pictures {camera.rms:.2f} px")
    if camera.left_out is not None:
        axes.axhline(
            camera.left_out,
            color="#e67700",
            lw=1,
            ls=":",
            label=f"left-out pictures {camera.left_out:.2f} px",
        )
    if len(names) <= MAX_NAMES:
        axes.set_xticks(place, names, rotation=60, ha="right", fontsize=7)
    axes.set_ylabel("corners off by, px (rms)", fontsize=8)
    axes.legend(frameon=False, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)

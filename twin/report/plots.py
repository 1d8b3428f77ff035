"""Plots and film pictures of the page."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import InputError
from twin.report.frames import Image, part_color
from twin.scene import Part

FILM_LIMIT = 12_000_000  # bytes; a longer film is named on the page, not put into it


def shown(part: Part, state: Any) -> Any:
    """States in the unit of the page: degrees or millimetres."""
    return np.rad2deg(state) if part.joint.kind == "revolute" else np.asarray(state) * 1000.0


def unit(part: Part) -> str:
    """The unit of `shown`."""
    return "°" if part.joint.kind == "revolute" else "mm"


def state_plot(part: Part) -> str:
    """SVG of the state over time, with limits, moving intervals and frames in which the hand held it."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    motion, color = part.motion, "#{:02x}{:02x}{:02x}".format(*part_color(part))
    times = motion.times - motion.times[0]
    figure = Figure(figsize=(7.2, 2.6), layout="constrained")
    axes = figure.add_subplot()
    for first, last in motion.intervals:
        inside = (motion.frames >= first) & (motion.frames <= last)
        if inside.any():
            axes.axvspan(*times[inside][[0, -1]], color=color, alpha=0.10, lw=0, label="moving")
    for limit in (part.joint.lower, part.joint.upper):
        axes.axhline(float(shown(part, limit)), color="#8a8f98", lw=1, ls="--", label="limits")
    axes.plot(times, shown(part, motion.state), color=color, lw=1.8, label="state")
    if part.contact is not None:
        held = np.isin(motion.frames, part.contact.frames)
        low = axes.get_ylim()[0]
        axes.plot(times[held], np.full(held.sum(), low), "|", color="#f08c2e", ms=8, label="hand holds")
    axes.set_xlabel("time since the first frame, s")
    axes.set_ylabel(f"state, {unit(part)}")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#e6e8eb", lw=0.6)
    axes.margins(x=0.01)
    handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    axes.legend(handles.values(), handles.keys(), loc="best", frameon=False, fontsize=8)
    out = io.StringIO()
    FigureCanvasSVG(figure).print_svg(out, metadata={"Date": None})
    return out.getvalue()


def film_pictures(path: Path, count: int = 6, width: int = 480) -> list[Image]:
    """`count` pictures (H, W, 3) RGB spread evenly over a film. Raises InputError when it can't be read."""
    import av

    try:
        with av.open(str(path)) as film:
            frames = [f.pts for f in film.demux(video=0) if f.pts is not None]
        wanted = sorted(frames)[:: max(1, (len(frames) - 1) // max(1, count - 1))][:count] if frames else []
        pictures = []
        with av.open(str(path)) as film:
            for frame in film.decode(video=0):
                if frame.pts in wanted:
                    height = round(frame.height * width / frame.width)
                    picture = frame.reformat(width=width, height=height, format="rgb24").to_ndarray()
                    pictures.append(np.asarray(picture, dtype=np.uint8))
    except (av.FFmpegError, IndexError) as e:
        raise InputError(f"film {path} can't be read ({e})", "run `twin replay` again") from e
    return pictures

"""The picture of a set of trials: success over the size of the error."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from robots.trials.report import TrialReport, TrialRow
from robots.trials.statistics import Estimate, binned

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BINS = 8
_GOOD, _BAD, _INK = "#2a7f62", "#c8553d", "#333333"


def plot(report: TrialReport) -> bytes:
    """PNG: left, opening and success of all trials over the path error; right, success by size of error."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 4.6), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=(1.2, 1))
    _over_path_error(left, report)
    _per_size(right, report)
    figure.suptitle(f"{report.robot} opens {report.part}: {len(report.rows[0].trials)} trials a row")
    buffer = io.BytesIO()
    canvas.print_png(buffer, metadata={"Software": None})
    return buffer.getvalue()


def _over_path_error(axes: Axes, report: TrialReport) -> None:
    trials = [t for row in report.rows for t in row.trials]
    errors = [1000 * t.path_error for t in trials]
    good = [t.report.success_90 for t in trials]
    opening = np.array([t.report.opening_final for t in trials])
    colours = [_GOOD if g else _BAD for g in good]
    axes.scatter(errors, opening, s=9, c=colours, alpha=0.5, linewidths=0, label="opening of a trial")
    rates = binned(errors, good, min(_BINS, len(trials)))
    _with_bars(axes, [x for x, _ in rates], [r for _, r in rates], "success@.90, 95 % interval")
    axes.set_xlabel("largest distance between expected and real path of the held point (mm)")
    axes.set_ylabel("share")
    axes.set_ylim(-0.03, 1.05)
    axes.set_xlim(left=0)
    axes.legend(loc="lower left", frameon=False)


def _per_size(axes: Axes, report: TrialReport) -> None:
    rows: tuple[TrialRow, ...] = report.rows
    y = np.arange(len(rows))[::-1].astype(float)
    for shift, key, colour, name in (
        (0.12, "success_75", _INK, "success@.75 and static"),
        (-0.12, "success_90", _GOOD, "success@.90"),
    ):
        rates: list[Estimate] = [getattr(row, key) for row in rows]
        x = np.array([r.value for r in rates])
        reach = np.array([[r.value - r.low for r in rates], [r.high - r.value for r in rates]])
        axes.errorbar(
            x, y + shift, xerr=np.maximum(reach, 0), fmt="o", ms=4, capsize=2, color=colour, label=name
        )
    axes.set_yticks(y, [row.name for row in rows])
    axes.set_xlim(-0.03, 1.03)
    axes.set_ylim(-0.7, len(rows) - 0.3)
    axes.set_xlabel("share of trials, 95 % interval")
    axes.grid(axis="x", alpha=0.3)
    axes.legend(loc="lower left", frameon=False)


def _with_bars(axes: Axes, x: list[float], rates: list[Estimate], label: str) -> None:
    y = np.array([r.value for r in rates])
    reach = np.array([[r.value - r.low for r in rates], [r.high - r.value for r in rates]])
    axes.errorbar(x, y, yerr=np.maximum(reach, 0), fmt="o-", ms=4, capsize=2, color=_INK, label=label)

"""A catch from a log of the force of opening: a peak near the closed state, then the force without it.

A log begins with the part closed and nobody pulling hard, and opens it slowly. What a sensor adds everywhere,
its zero or the friction of the arm that carries it, and the friction of the part's own joint, are in the peak
and in the level after it alike: the catch is their difference, and none of the three is told from the others.
What a sensor gets wrong by a factor stays in it.
"""

from __future__ import annotations

import csv
import math
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from twin.errors import InputError
from twin.files.paths import AnyPath
from twin.geometry import Array
from twin.quantities import Catch, Quantity
from twin.robust import mad_sigma

# Column or array -> what it is, and its unit in rad, m, N or N m. The last two are names of gt-ros-pkg/hrl.
STATES: dict[str, tuple[Literal["rad", "m"], float]] = {
    "angle_rad": ("rad", 1.0),
    "angle_deg": ("rad", float(np.pi / 180)),
    "opening_m": ("m", 1.0),
    "opening_mm": ("m", 1e-3),
    "config": ("rad", 1.0),
}
FORCES: dict[str, Literal["N", "N m"]] = {"force_N": "N", "torque_Nm": "N m", "ftan": "N"}
_WANTED = "a log has one of angle_rad, angle_deg, opening_m, opening_mm and one of force_N, torque_Nm"
# Fewest samples of a log. Chosen by us.
_SAMPLES = 20
# Fewest samples of its wide open half. Chosen by us.
_WIDE = 8
# Samples of a median, which removes single spikes. Chosen by us.
_SMOOTH = 5
_HALF = 0.5  # of the range: a catch lets go before, and after it the level is taken; chosen by us
_SPREAD = (5.0, 95.0)  # percentiles of the level that bound it; chosen by us


@dataclass(frozen=True, eq=False)
class ForceLog:
    """What it took to open a part.

    Attributes:
        name: of the file.
        state: (n,) how far open, in `state_unit`.
        force: (n,) pull, positive opens, in `force_unit`.
        state_unit: "rad", or "m" along the way of the hand.
        force_unit: "N" at the hand, or "N m" about the hinge.
    """

    name: str
    state: Array
    force: Array
    state_unit: Literal["rad", "m"]
    force_unit: Literal["N", "N m"]


@dataclass(frozen=True)
class CatchFit:
    """A catch as a log shows it, in the units of the arrays it was found in.

    Attributes:
        peak: greatest force near closed, a running median.
        at: state of the peak.
        still: force with which the log begins, before anything moves: that of a sensor without a zero is all
            offset.
        level: median force over the wide open half: friction and offset.
        force: peak less level, with low and high end.
        width: state at which the force has fallen halfway, with those at which it has by a quarter and by
            three.
    """

    peak: float
    at: float
    still: float
    level: float
    force: tuple[float, float, float]
    width: tuple[float, float, float]


def read_force_log(path: AnyPath) -> ForceLog:
    """Read a log: npz with arrays, or csv with a line of names, called as in STATES and FORCES.

    Raises InputError for a file that is neither, lacks a column, or holds what is no number.
    """
    path = Path(path)
    columns = _npz(path) if path.suffix == ".npz" else _csv(path)
    states, forces = ([k for k in known if k in columns] for known in (STATES, FORCES))
    if len(states) != 1 or len(forces) != 1:
        raise InputError(f"{path} has {', '.join(columns) or 'no columns'}", _WANTED)
    state, force = columns[states[0]], columns[forces[0]]
    if state.ndim != 1 or state.shape != force.shape:
        raise InputError(
            f"{path}: {states[0]} has shape {state.shape}, {forces[0]} {force.shape}",
            "give a force for each state",
        )
    if len(state) < _SAMPLES:
        raise InputError(
            f"{path} has {len(state)} samples", f"log at least {_SAMPLES} on the way from closed to open"
        )
    if not (np.isfinite(state).all() and np.isfinite(force).all()):
        raise InputError(f"{path} holds values that are not finite", "leave those samples out")
    unit, size = STATES[states[0]]
    return ForceLog(path.name, size * state, force, unit, FORCES[forces[0]])


def _npz(path: Path) -> dict[str, Array]:
    """Arrays of an npz file by name; no pickle is ever read."""
    try:
        with np.load(path, allow_pickle=False) as data:
            wanted = [k for k in data.files if k in STATES or k in FORCES]
            return {k: np.asarray(data[k], dtype=np.float64) for k in wanted or data.files}
    except (OSError, ValueError, TypeError, AttributeError, EOFError, zipfile.BadZipFile, zlib.error) as e:
        raise InputError(f"{path} can't be read as npz: {e or type(e).__name__}", _WANTED) from e


def _csv(path: Path) -> dict[str, Array]:
    """Columns of a csv file by the names in its first line."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as f:
            rows = [r for r in csv.reader(f) if r]
    except (OSError, UnicodeDecodeError, csv.Error) as e:
        raise InputError(f"{path} can't be read as csv: {e}", "give a file .csv or .npz") from e
    names = [c.strip() for c in rows[0]] if rows else []
    kept = [(k, c) for k, c in enumerate(names) if c in STATES or c in FORCES]
    values = np.zeros((max(len(rows) - 1, 0), len(kept)))
    for i, row in enumerate(rows[1:]):
        for j, (k, name) in enumerate(kept):
            try:
                values[i, j] = float(row[k])
            except (IndexError, ValueError):
                told = row[k] if k < len(row) else "nothing"
                raise InputError(
                    f"{path}: row {i + 1} has {told!r:.40} for {name}", "give a number"
                ) from None
    return {name: values[:, j] for j, (_, name) in enumerate(kept)} or dict.fromkeys(names, np.zeros(0))


def along_joint(
    log: ForceLog, kind: Literal["revolute", "prismatic"], lever: float | None
) -> tuple[Array, Array]:
    """States (n,) and forces (n,) of a log along a joint: rad and N m of a hinge, m and N of a slide.

    Args:
        log: to be turned.
        kind: of the joint.
        lever: m from the hinge to where the log's force was taken; a slide needs none.

    Raises InputError: angles or a torque of what slides, or a lever that is needed and not there.
    """
    if kind == "prismatic":
        if log.state_unit == "rad" or log.force_unit == "N m":
            raise InputError(
                f"{log.name} is the log of a hinge, and this part slides", "give opening_m and force_N"
            )
        return log.state, log.force
    if lever is None and (log.state_unit == "m" or log.force_unit == "N"):
        raise InputError(
            f"{log.name} is in {log.state_unit} and {log.force_unit}, and how far from the hinge that was is not known",
            "give it in m with --lever",
        )
    arm = 1.0 if lever is None else lever
    state = log.state / arm if log.state_unit == "m" else log.state
    return state, log.force * arm if log.force_unit == "N" else log.force


def fit_catch(state: Array, force: Array) -> CatchFit:
    """The catch in a log of an opening.

    Args:
        state: (n,) in order of time; the first is the closed one, what comes after the widest is left out.
        force: (n,).

    Raises InputError where the force is not greatest near the closed state, by more than it scatters later.
    """
    opened = state[: int(np.argmax(state)) + 1] - state[0]
    smooth = _running_median(force[: len(opened)])
    near = opened <= _HALF * opened[-1]
    wide = force[: len(opened)][~near]
    if np.count_nonzero(~near) < _WIDE:
        raise InputError(
            f"the log has {np.count_nonzero(~near)} samples beyond half of its way",
            f"log at least {_WIDE} there, too",
        )
    first = int(np.argmax(np.where(near, smooth, -np.inf)))
    peak, level = float(smooth[first]), float(np.median(wide))
    least, most = (float(v) for v in np.percentile(wide, _SPREAD))
    # twice the standard error of such a median, of normal noise: a maximum over many lies that much too high
    error = 2 * 1.2533 * mad_sigma(force[: len(opened)] - smooth) / math.sqrt(_SMOOTH)
    if peak - error <= most:
        raise InputError(
            f"the log shows no catch: {peak:.3g} near closed, and {least:.3g} to {most:.3g} where it is wide open",
            "give the force of the catch with --hold, or none",
        )
    highest = float(force[: len(opened)][near].max())
    ends = [_falls(opened, smooth, first, level + share * (peak - level)) for share in (0.75, 0.5, 0.25)]
    middle = sum(ends[1]) / 2
    width = (middle, min(ends[0][0], middle), max(ends[2][1], middle))
    bounds = (peak - level, peak - error - most, max(highest, peak) - least)
    return CatchFit(peak, float(opened[first]), float(np.median(force[:_SMOOTH])), level, bounds, width)


def _running_median(values: Array) -> Array:
    """Median (n,) of _SMOOTH samples around each."""
    padded = np.pad(values, _SMOOTH // 2, mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, _SMOOTH), axis=1))


def _falls(state: Array, force: Array, first: int, to: float) -> tuple[float, float]:
    """Last state from a peak on above `to`, and the first one with no more: between them it falls."""
    below = first + int(np.argmax(force[first:] <= to))
    return float(state[first:below].max(initial=0.0)), float(
        max(state[below], state[first:below].max(initial=0.0))
    )


def measured_catch(
    log: ForceLog, fit: CatchFit, kind: Literal["revolute", "prismatic"], note: str = ""
) -> Catch:
    """The catch that a fit in a joint's own units tells, with the source `measured`."""
    unit, of_state = ("N m", "rad") if kind == "revolute" else ("N", "m")
    more = f", {note}" if note else ""
    peak = f"peak of {fit.peak:.3g} {unit} at {fit.at:.2g} {of_state} less {fit.level:.3g} {unit} of friction and offset after it, {fit.still:.3g} {unit} before it moves"
    force, width = fit.force, fit.width
    return Catch(
        Quantity(force[0], f"measured: {log.name}: {peak}{more}", (force[1], force[2])),
        Quantity(
            width[0], f"measured: {log.name}: where that force has fallen halfway{more}", (width[1], width[2])
        ),
    )

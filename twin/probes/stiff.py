"""The course of an engine's own accelerations, for engines beside SciPy, in this environment."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from .common import Array


def integrated(
    acceleration: Callable[[Array, Array], Array],
    position: ArrayLike,
    velocity: ArrayLike,
    times: Sequence[float],
) -> Array:
    """Positions (t, n) at `times` (s, increasing) to about 1e-8.

    The step follows the motion and the method its stiffness (LSODA): a part of 1 g with a door's damping
    stands still within microseconds, where explicit fixed steps break down. Raises ValueError when it fails.
    """
    start = np.concatenate([np.asarray(position, float), np.asarray(velocity, float)])
    n = len(start) // 2

    def rate(_: float, y: Array) -> Array:
        return np.concatenate([y[n:], acceleration(y[:n], y[n:])])

    done = solve_ivp(rate, (0.0, times[-1]), start, "LSODA", t_eval=times, rtol=1e-8, atol=1e-10)
    if not done.success:
        raise ValueError(f"the motion can't be integrated: {done.message}")
    return np.asarray(done.y[:n].T)

"""What two parts do at the same time, by their states."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twin.geometry import Array

# Both chosen by us. Share of a part's moving frames in which another part moves, from which the two move
# together.
MEANWHILE = 0.5
# Share of a part's fastest step from which the part moves.
_CREEPS = 0.1


def together(state: Array, other: Array) -> float:
    """Share of the frames of change of states (n,) in which others (n,) change, too."""
    moves = moving(state)
    return float(moving(other)[moves].mean()) if moves.any() else 1.0


def moving(state: Array) -> NDArray[np.bool_]:
    """The frames (n,) of change of states (n,)."""
    steps = np.abs(np.gradient(state))
    return np.asarray(steps > _CREEPS * steps.max())


def carried_along(state: Array, other: Array) -> float:
    """How far states (n,) go with others (n,), over how far those go: 1 if carried along."""
    mine, its = np.gradient(state), np.gradient(other)
    moves = np.abs(its) > _CREEPS * np.abs(its).max()
    return float(mine[moves] @ np.sign(its[moves])) / max(float(np.abs(its[moves]).sum()), 1e-12)

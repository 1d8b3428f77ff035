"""What a robot is asked to do with a part: bring it from one state to another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.errors import InputError
from twin.scene import Part

Goal = float | str
_LEAST = 0.02  # of the demonstrated range; a shorter way could not be told from play in the hinge


@dataclass(frozen=True)
class Task:
    """Bring a part from state `start` to state `goal`, in m or rad."""

    start: float
    goal: float

    @property
    def direction(self) -> float:
        """1 where the part opens, -1 where it closes."""
        return 1.0 if self.goal > self.start else -1.0

    def states(self, count: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """States (count,) from start to goal, equally far apart."""
        return np.linspace(self.start, self.goal, count)

    def reached(self, state: float) -> float:
        """Share of the way that is done at `state`: 1 at the goal, less short of it and less beyond it."""
        return 1.0 - abs(state - self.goal) / abs(self.goal - self.start)


def task_of(part: Part, goal: Goal | None = None, start: Goal | None = None) -> Task:
    """The task that a user asks for.

    Args:
        goal: a number is a state in m or rad; a text is "open", "close" or a share of the demonstrated range, "0.5" or
            "50%". Default: open.
        start: the same. Default: the closed end, or the open end where the goal is closed.

    Raises:
        InputError: no such text, a state outside the demonstrated range, or no way between start and goal.
    """
    lower, upper = part.joint.lower, part.joint.upper
    end = _state(part, "goal", "open" if goal is None else goal)
    if start is None:
        begin = upper if end <= lower + _LEAST * (upper - lower) else lower
    else:
        begin = _state(part, "start", start)
    if abs(end - begin) < _LEAST * (upper - lower):
        raise InputError(
            f"part {part.name!r} is asked to go from {begin:.3f} to {end:.3f} {unit(part)}, which is no way to go",
            f"choose start and goal at least {_LEAST * (upper - lower):.3f} {unit(part)} apart",
        )
    return Task(begin, end)


def unit(part: Part) -> str:
    """Of the part's state."""
    return "rad" if part.joint.kind == "revolute" else "m"


def _state(part: Part, what: str, wanted: Goal) -> float:
    lower, upper = part.joint.lower, part.joint.upper
    value = _from_text(part, what, wanted) if isinstance(wanted, str) else float(wanted)
    if not lower - 1e-9 <= value <= upper + 1e-9:
        raise InputError(
            f"{what} {value:.3f} {unit(part)} of part {part.name!r} is outside its demonstrated range",
            f"choose a state of at least {lower:.3f} and at most {upper:.3f} {unit(part)}, or a share such as '50%'",
        )
    return float(np.clip(value, lower, upper))


def _from_text(part: Part, what: str, text: str) -> float:
    lower, upper = part.joint.lower, part.joint.upper
    word = text.strip().lower()
    ends = {"open": upper, "close": lower, "closed": lower}
    if word in ends:
        return ends[word]
    try:
        share = float(word.removesuffix("%")) / (100.0 if word.endswith("%") else 1.0)
    except ValueError:
        share = np.nan
    if not 0.0 <= share <= 1.0:
        raise InputError(
            f"{what} {text!r} of part {part.name!r} is no share of its range",
            "write open, close, or a share from 0 to 1 such as 0.5 or 50%",
        )
    return float(lower + share * (upper - lower))

"""What a robot is asked to do with a part: bring it from one state to another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.errors import InputError
from twin.scene import Part
from twin.units import ANGLES, LENGTHS, number_and_unit

Goal = float | str
_LEAST = 0.02  # of the demonstrated range; a shorter way could not be told from play in the hinge


@dataclass(frozen=True)
class MotionRequest:
    """What a user says of a motion, as `robots.plan` takes it; None where nothing.

    contact: (3,) m, where a part is held, twin's world at state 0. floor: its height, m.
    """

    goal: Goal = "open"
    from_state: Goal | None = None
    contact: tuple[float, ...] | None = None
    floor: float | None = None


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


def task_of(part: Part, goal: Goal | None = None, from_state: Goal | None = None) -> Task:
    """The task that a user asks for.

    Args:
        goal: "open", "close", a share of the demonstrated range (0.5, "0.5" or "50%"), or a state with its
            unit ("15deg", "0.3rad", "0.2m", "40mm"). Default: open.
        from_state: the same. Default: the closed end, or the open end if the goal is closed.

    Raises:
        InputError: neither word, share nor state; a state outside the demonstrated range; both states alike.
    """
    lower, upper = part.joint.lower, part.joint.upper
    end = _state(part, "goal", "open" if goal is None else goal)
    if from_state is None:
        begin = upper if end <= lower + _LEAST * (upper - lower) else lower
    else:
        begin = _state(part, "from-state", from_state)
    if abs(end - begin) < _LEAST * (upper - lower):
        raise InputError(
            f"part {part.name!r} is asked to go from {begin:.3f} to {end:.3f} {unit(part)}, which is no way to go",
            f"choose goal and from-state at least {_LEAST * (upper - lower):.3f} {unit(part)} apart",
        )
    return Task(begin, end)


def unit(part: Part) -> str:
    """Of the part's state."""
    return "rad" if part.joint.kind == "revolute" else "m"


def _state(part: Part, what: str, wanted: Goal) -> float:
    """State (m or rad) of a word, a share or a text with a unit."""
    lower, upper = part.joint.lower, part.joint.upper
    ends = {"open": upper, "close": lower, "closed": lower}
    text = str(wanted).strip()
    if text.lower() in ends:
        return ends[text.lower()]
    number, symbol = number_and_unit(text)
    sizes = ANGLES if part.joint.kind == "revolute" else LENGTHS
    if symbol in sizes:
        return _inside(part, what, text, number * sizes[symbol])
    share = number / 100.0 if symbol == "%" else number
    if symbol not in ("", "%") or not 0.0 <= share <= 1.0:
        raise InputError(
            f"{what} {text!r} of part {part.name!r} is no share of its range and no state",
            f"write open, close, a share from 0 to 1 such as 0.5 or 50%, or a state in {' or '.join(sizes)}, such as "
            f"{_example(part)}",
        )
    return float(lower + share * (upper - lower))


def _inside(part: Part, what: str, text: str, state: float) -> float:
    lower, upper = part.joint.lower, part.joint.upper
    if not lower - 1e-9 <= state <= upper + 1e-9:
        raise InputError(
            f"{what} {text!r} of part {part.name!r} is outside its demonstrated range",
            f"choose a state from {_text(part, lower)} to {_text(part, upper)}, or a share such as 50%",
        )
    return float(np.clip(state, lower, upper))


def _text(part: Part, state: float) -> str:
    return f"{np.rad2deg(state):.1f}deg" if part.joint.kind == "revolute" else f"{state:.3f}m"


def _example(part: Part) -> str:
    return _text(part, (part.joint.lower + part.joint.upper) / 2)

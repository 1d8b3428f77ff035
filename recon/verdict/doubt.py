"""A number beyond what right parts have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from twin.verdict import Reason, reason

SURELY = float("inf")  # of a doubt that refuses whatever else is told


@dataclass(frozen=True)
class Doubt:
    """A reason against a part, and by how many times its number is beyond the limit: above 1."""

    reason: Reason
    times: float

    @property
    def amount(self) -> float:
        """What the posterior counts: 1 at the limit, 1 more for each factor of e, at most 5."""
        return 1.0 + min(float(np.log(self.times)), 4.0)


def above(type: str, value: float, limit: float, *told: Any) -> Doubt | None:
    """The doubt about a value above its limit. told: the reason's numbers but the limit; the value alone."""
    return _beyond(type, value / limit, (told or (value,)), limit)


def below(type: str, value: float, limit: float, *told: Any) -> Doubt | None:
    """The doubt about a value below its limit, likewise."""
    return _beyond(type, limit / max(value, 1e-9), (told or (value,)), limit)


def _beyond(type: str, times: float, told: tuple[Any, ...], limit: float) -> Doubt | None:
    return Doubt(reason(type, "doubtful", *told, limit), times) if times > 1.0 else None

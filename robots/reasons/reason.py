"""One cause of a refused plan or a failed replay."""

from __future__ import annotations

from dataclasses import dataclass

from twin.cause import Cause
from twin.errors import PlanningError


@dataclass(frozen=True)
class Reason(Cause):
    """One cause of a refused plan or a failed replay."""


class RefusedError(PlanningError):
    """A path or trajectory can't be, for `reason`."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason

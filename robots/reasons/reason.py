"""One cause of a refused plan or a failed replay."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from twin.errors import PlanningError


@dataclass(frozen=True)
class Reason(ABC):
    """One cause."""

    @property
    @abstractmethod
    def text(self) -> str:
        """What happened, with its numbers."""

    @property
    @abstractmethod
    def kind(self) -> str:
        """What happened, without numbers: equal for causes that are alike."""


class RefusedError(PlanningError):
    """A path or trajectory can't be, for `reason`."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason

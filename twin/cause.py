"""Why something is doubted, refused, failed or found wrong: one type for each cause, which alone writes its
text."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass


@dataclass(frozen=True)
class Cause(ABC):
    """One cause. Its fields are its numbers; who wants to know what happened asks for the type, who counts
    causes counts `kind`."""

    @property
    @abstractmethod
    def text(self) -> str:
        """What happened, with its numbers, in one line."""

    @property
    @abstractmethod
    def kind(self) -> str:
        """What happened, without numbers: equal for causes that are alike."""

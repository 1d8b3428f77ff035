"""Why something is doubted, refused, failed or wrong: one type for each cause, which writes its text."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass


@dataclass(frozen=True)
class Cause(ABC):
    """One cause. Its fields are its numbers; its type says what happened, `kind` is what causes count by."""

    @property
    @abstractmethod
    def text(self) -> str:
        """What happened, with its numbers, in one line."""

    @property
    @abstractmethod
    def kind(self) -> str:
        """What happened, without numbers: equal for causes that are alike."""

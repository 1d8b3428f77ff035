"""What stands in for verbs and for what they import by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from twin.cli import steps, verbs
from twin.cli.console import Outcome


@dataclass(frozen=True)
class Settings:
    """Stands for a configuration class."""

    seed: int = 0
    name: str = "a"
    sizes: tuple[int, ...] = ()


@dataclass(frozen=True)
class Nested:
    """Stands for a configuration of stages."""

    labels: Settings = Settings()


def stub(monkeypatch: pytest.MonkeyPatch, verb: str, answer: Any) -> list[dict[str, Any]]:
    """Replace a verb's function; returns the list of options it is called with."""
    calls: list[dict[str, Any]] = []

    def function(**options: Any) -> Outcome:
        calls.append(options)
        if isinstance(answer, BaseException):
            raise answer
        return answer

    monkeypatch.setattr(verbs, verb, function)
    return calls


def stand_in(monkeypatch: pytest.MonkeyPatch, **functions: Any) -> None:
    """Replace what verbs import by name: keys are the names' last words."""
    real = steps.named
    monkeypatch.setattr(steps, "named", lambda name: functions.get(name.partition(":")[2]) or real(name))

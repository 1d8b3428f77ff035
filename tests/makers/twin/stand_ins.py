"""What stands in for verbs and for what they import by name."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import pytest

from twin.cli import table, verbs
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


# Where the verbs find what they call by these names.
HOMES = {
    "ReconConfig": "recon.config",
    "complete": "twin.exporters",
    "export": "twin.exporters",
    "open_recording": "recon.readers",
    "plan": "robots",
    "reconstruct": "recon.pipeline",
    "replay": "robots",
}


def stub(monkeypatch: pytest.MonkeyPatch, verb: str, answer: Any) -> list[dict[str, Any]]:
    """Replace a verb's function; returns the list of options it is called with."""
    calls: list[dict[str, Any]] = []

    def function(**options: Any) -> Outcome:
        calls.append(options)
        if isinstance(answer, BaseException):
            raise answer
        return answer

    monkeypatch.setattr(verbs, f"stub_{verb}", function, raising=False)
    monkeypatch.setitem(table.VERBS, verb, (f"twin.cli.verbs:stub_{verb}", table.VERBS[verb][1]))
    return calls


def stand_in(monkeypatch: pytest.MonkeyPatch, **functions: Any) -> None:
    """Replace what verbs import when they are called: keys are the functions' names."""
    for name, function in functions.items():
        monkeypatch.setattr(import_module(HOMES[name]), name, function, raising=False)

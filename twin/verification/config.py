"""Settings of `twin check`."""

from __future__ import annotations

from dataclasses import dataclass

from twin.runs.setting import Settings, setting


@dataclass(frozen=True)
class CheckConfig(Settings):
    """How `twin check` works; it changes no answer."""

    processes: int = setting(2, "engines that load files at the same time", unit="", at_least=1)

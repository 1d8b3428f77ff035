"""Settings of `twin export`."""

from __future__ import annotations

from dataclasses import dataclass

from twin.collision import CollisionConfig
from twin.runs.setting import Settings, group


@dataclass(frozen=True)
class ExportConfig(Settings):
    """How `twin export` makes what a twin lacks. With settings other than the defaults, shapes that were made
    before are made anew."""

    collision: CollisionConfig = group(CollisionConfig, "collision shapes")

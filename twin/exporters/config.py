"""Settings of `twin export`."""

from __future__ import annotations

from dataclasses import dataclass

from twin.collision import CollisionConfig
from twin.runs.setting import Settings, group


@dataclass(frozen=True)
class ExportConfig(Settings):
    """How `twin export` makes what a twin lacks. Other settings than the defaults remake earlier shapes."""

    collision: CollisionConfig = group(CollisionConfig, "collision shapes")

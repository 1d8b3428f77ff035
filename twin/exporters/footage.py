"""What a recording shows beside its twin, for formats that show a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from twin.geometry import Array


@dataclass(frozen=True, eq=False)
class Footage:
    """run: the run folder, which keeps a film. tracks: points (n, 3) m in a frame's camera, by frame."""

    run: Path
    tracks: Mapping[int, Array] = field(default_factory=dict)

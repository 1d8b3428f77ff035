"""The declared stages of one run, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from twin.runs.keys import Stage
from twin.runs.stages import Read, Run, StageResult

T = TypeVar("T")


@dataclass(frozen=True)
class Chain:
    """Computes the declared stages of one run with its settings, a dataclass with a section for each stage.

    also: what a result depends on besides. item: see `Run.stage`. source: digest of the part of the recording
    that its stages read; empty: all of it.
    """

    run: Run
    config: Any
    source: str = ""

    def __call__(
        self,
        what: Stage,
        reads: Sequence[Read],
        compute: Callable[[], T],
        *also: object,
        item: str = "",
    ) -> StageResult[T]:
        settings = what.settings_of(self.config)
        told = (settings, *also) if also else settings
        return self.run.stage(what.name, what.version, told, reads, compute, item=item, source=self.source)

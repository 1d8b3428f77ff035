"""A run seen from a process that computes some of its stages ahead."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import Any, TypeVar

from twin.errors import FuntwinError
from twin.runs.codec import Codec, TreeCodec
from twin.runs.stages import Run, StageResult

T = TypeVar("T")


# s after which a process notices that the one that started it has ended
_NOTICED_S = 1.0


class NotComputedError(FuntwinError):
    """A stage that a run would have to compute."""


class AttachedRun(Run):
    """The run of another process, which holds the folder and writes its manifest.

    Args:
        folder: of that run.
        fingerprint: of its recording.
        before: names and keys of its stages so far, in their order; they number the folders.
        computes: False raises `NotComputedError` for what is not stored.
        owner: process id of the run; results are no longer stored once it has ended, since another run may
            hold the folder then. None: this process.
    """

    def __init__(
        self,
        folder: Path,
        fingerprint: str,
        before: Sequence[tuple[str, str]],
        *,
        computes: bool = True,
        owner: int | None = None,
    ) -> None:
        super().__init__(None, fingerprint)
        self.folder = folder
        self.results = [StageResult(name, key, None, 0.0, 0.0, (), True, "") for name, key in before]
        self.computed: dict[str, str] = {}
        self._computes, self._owner = computes, owner

    def read(self, name: str) -> StageResult[Any]:
        """A stage of `before` with its value, loaded."""
        (known,) = (r for r in self.results if r.name == name)
        stored = self._stored(name)
        assert stored is not None
        return StageResult(name, known.key, TreeCodec().load(stored), 0.0, 0.0, (), True, "")

    def _compute(
        self, name: str, parts: Mapping[str, Any], compute: Callable[[], T], codec: Codec[T], reason: str
    ) -> StageResult[T]:
        if not self._computes:
            raise NotComputedError(f"stage {name} is not stored", reason)
        self.computed[name] = reason
        return super()._compute(name, parts, compute, codec, reason)

    def _store(self, name: str, value: T, record: Mapping[str, Any], codec: Codec[T]) -> None:
        if self._owner is not None and os.getppid() != self._owner:
            raise SystemExit(1)
        super()._store(name, value, record, codec)

    def _write_manifest(self) -> None:
        pass


@contextmanager
def ends_with(owner: int) -> Iterator[None]:
    """Within, this process ends soon after the one that started it, by its id: it may have been killed."""
    over = Event()

    def watch() -> None:
        while not over.wait(_NOTICED_S):
            if os.getppid() != owner:
                os._exit(1)

    Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        over.set()

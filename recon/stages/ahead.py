"""Pieces of a recording of minutes, solved in processes of their own ahead of the run that reads them.

A submap's or a window's solution depends on nothing of another's: two cores solve two at a time, where
threads of one process would wait for its interpreter.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from recon.readers import open_recording
from recon.recording import Recording
from recon.recording.decoded import decoded_beside
from twin.interrupt import spared
from twin.runs.attached import AttachedRun, NotComputedError, ends_with
from twin.runs.chain import Chain
from twin.runs.stages import StageResult
from twin.runs.threads import threads

Item = TypeVar("Item")
# Solves a piece: the stages, the recording, what all pieces read, and which piece.
Solve = Callable[[Chain, Recording, Sequence[StageResult[Any]], Item], object]


@dataclass(frozen=True, eq=False)
class _Place:
    """What a process needs to go on with a run: its folder, its recording, its settings, its stages so far,
    and which of these the pieces read."""

    folder: Path
    path: Path | str
    opened_with: Mapping[str, Any]
    fingerprint: str
    config: Any
    before: tuple[tuple[str, str], ...]
    reads: tuple[str, ...]
    owner: int = field(default_factory=os.getpid)

    def run(self, *, computes: bool, owner: int | None) -> AttachedRun:
        return AttachedRun(self.folder, self.fingerprint, self.before, computes=computes, owner=owner)


def solve_ahead(
    stage: Chain,
    recording: Recording,
    reads: Sequence[StageResult[Any]],
    solve: Solve[Item],
    items: Sequence[Item],
    name: str,
) -> None:
    """Solve those of several pieces that are not stored, and leave their stages in the run's folder.

    Nothing is done where one process does as well: for one piece, on one core, without a folder, for a
    recording in memory.

    Args:
        reads: results that all pieces read.
        solve: a function of a module, which another process can import.
        name: of the pieces, for the progress.
    """
    run, count = stage.run, threads()
    if len(items) < 2 or count < 2 or run.folder is None or recording.path is None:
        return
    place = _Place(
        run.folder,
        recording.path,
        recording.opened_with,
        recording.fingerprint,
        stage.config,
        tuple((r.name, r.key) for r in run.results),
        tuple(r.name for r in reads),
    )
    todo = [item for item in items if not _stored(place, recording, reads, solve, item)]
    if len(todo) < 2:
        return
    from joblib import Parallel, delayed, parallel_config

    with parallel_config("loky", n_jobs=min(count, len(todo)), inner_max_num_threads=1):
        with spared():
            done = Parallel(return_as="generator_unordered")(
                delayed(_solve)(place, solve, item) for item in todo
            )
        for k, computed in enumerate(done):
            run.report(name, (k + 1) / (len(todo) + 1), f"of {len(items)}")
            run.ahead |= computed


def _stored(
    place: _Place,
    recording: Recording,
    reads: Sequence[StageResult[Any]],
    solve: Solve[Item],
    item: Item,
) -> bool:
    """Whether all stages of a piece are in the run's folder."""
    try:
        solve(Chain(place.run(computes=False, owner=None), place.config), recording, reads, item)
    except NotComputedError:
        return False
    return True


def _solve(place: _Place, solve: Solve[Item], item: Item) -> dict[str, str]:
    """In a process of its own: the stages that it computed, each with the reason."""
    run = place.run(computes=True, owner=place.owner)
    recording = open_recording(place.path, **place.opened_with)
    with ends_with(place.owner), decoded_beside(recording, place.folder) as recording:
        solve(Chain(run, place.config), recording, [run.read(name) for name in place.reads], item)
    return run.computed

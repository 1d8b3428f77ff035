"""Windows solved in processes of their own, ahead of the run that reads them.

A window's solution depends on nothing of another's: two cores solve two at a time, where threads of one
process would wait for its interpreter.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from recon.interaction.interaction import Observed, interact
from recon.interaction.joints.type_selection import TypeHint
from recon.readers import open_recording
from recon.recording.decoded import decoded_beside
from recon.recording.said import Said
from recon.windows.windows import Window
from twin.interrupt import spared
from twin.runs.attached import AttachedRun, NotComputedError
from twin.runs.chain import Chain
from twin.runs.threads import threads

Told = tuple[Window, Said]


@dataclass(frozen=True, eq=False)
class _Place:
    """What a process needs to go on with a run: its folder, its recording, its settings, its stages so far,
    and which of these windows read."""

    folder: Path
    path: Path | str
    opened_with: Mapping[str, Any]
    fingerprint: str
    config: Any
    before: tuple[tuple[str, str], ...]
    reads: tuple[str, str, str, str]
    owner: int = field(default_factory=os.getpid)

    def run(self, *, computes: bool, owner: int | None) -> AttachedRun:
        return AttachedRun(self.folder, self.fingerprint, self.before, computes=computes, owner=owner)


def solve_ahead(stage: Chain, seen: Observed, windows: Sequence[Told], hints: Sequence[TypeHint]) -> None:
    """Solve those of several windows that are not stored, and leave their stages in the run's folder.

    Nothing is done where one process does as well: for one window, on one core, without a folder, for a
    recording in memory.
    """
    run, recording, count = stage.run, seen.recording, threads()
    if len(windows) < 2 or count < 2 or run.folder is None or recording.path is None or seen.contents is None:
        return
    place = _Place(
        run.folder,
        recording.path,
        recording.opened_with,
        recording.fingerprint,
        stage.config,
        tuple((r.name, r.key) for r in run.results),
        (seen.tracks.name, seen.cameras.name, seen.noise.name, seen.contents.name),
    )
    todo = [told for told in windows if not _stored(place, seen, told, hints)]
    if len(todo) < 2:
        return
    from joblib import Parallel, delayed, parallel_config

    with parallel_config("loky", n_jobs=min(count, len(todo)), inner_max_num_threads=1):
        with spared():
            done = Parallel(return_as="generator_unordered")(
                delayed(_solve)(place, told, hints) for told in todo
            )
        for k, computed in enumerate(done):
            run.report("interactions", (k + 1) / (len(todo) + 1), f"of {len(windows)}")
            run.ahead |= computed


def _stored(place: _Place, seen: Observed, told: Told, hints: Sequence[TypeHint]) -> bool:
    """Whether all stages of a window are in the run's folder."""
    window, word = told
    try:
        interact(Chain(place.run(computes=False, owner=None), place.config), seen, window, hints, word)
    except NotComputedError:
        return False
    return True


def _solve(place: _Place, told: Told, hints: Sequence[TypeHint]) -> dict[str, str]:
    """In a process of its own: the stages that it computed, each with the reason."""
    window, word = told
    run = place.run(computes=True, owner=place.owner)
    with decoded_beside(open_recording(place.path, **place.opened_with), place.folder) as recording:
        seen = Observed(recording, *(run.read(name) for name in place.reads))
        interact(Chain(run, place.config), seen, window, hints, word)
    return run.computed

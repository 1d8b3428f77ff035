"""What the batch itself may cost beside its units."""

from __future__ import annotations

from pathlib import Path

import pytest

from twin.batch import work
from twin.batch.batch import State
from twin.cli import batch_verb


def test_one_look_at_all_processes_serves_all_units(monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[float] = []

    def looked() -> dict[int, float]:
        looks.append(now[0])
        now[0] += 0.05  # it takes so long
        return {7: 100.0 * len(looks)}

    now, held = [1000.0], work.Held()
    monkeypatch.setattr(work.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(work, "sessions_mb", looked)
    assert [held.by(k) for k in (7, 8, 7, 9)] == [100.0, 0.0, 100.0, 0.0]
    assert looks == [1000.0]
    now[0] = 1002.4
    assert held.by(7) == 100.0
    now[0] = 1002.6  # a fiftieth of the time
    assert held.by(7) == 200.0


def test_the_page_of_a_batch_at_work_takes_a_tenth_of_the_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, written = [1000.0], list[int]()

    def wrote(_: Path, state: State) -> None:
        written.append(len(state.rows))
        now[0] += 2.0  # it takes so long

    monkeypatch.setattr(batch_verb.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(batch_verb, "write_page", wrote)
    so_far = batch_verb._PageSoFar(tmp_path)
    for rows, moment in ((0, 1000.0), (1, 1003.0), (2, 1019.0), (3, 1021.0), (3, 1050.0)):
        now[0] = moment
        so_far.write(State([], {str(k): {} for k in range(rows)}, {}))
    assert written == [0, 3]

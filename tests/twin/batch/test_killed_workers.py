"""Workers and nodes that are killed while units are at work on them: told in one line, or done elsewhere."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.twin.batch.test_batch import STAND_IN, called, go, gone, recordings, until
from twin.batch import Settings, work
from twin.batch.batch import State
from twin.batch.journal import JOURNAL
from twin.cli.main import run as twin_verb

ROOT = Path(__file__).parents[3]
PATIENT = 120.0  # s; Ray takes a while to notice


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))  # of Ray's workers
    path = tmp_path / "calls"
    monkeypatch.setattr(work, "PROGRAM", (sys.executable, str(STAND_IN), str(path)))
    return path


def same_twins(out: Path, whole: Path, state: State) -> None:
    for unit in state.rows:
        twins = [place / "runs" / unit / "twin" / "twin.json" for place in (out, whole)]
        assert twins[0].read_bytes() == twins[1].read_bytes()


def meanwhile(done: Callable[[], None]) -> threading.Thread:
    """A thread that does something while the batch, which needs the main one, is at work."""
    thread = threading.Thread(target=done)
    thread.start()
    return thread


def test_a_killed_process_is_told_and_the_others_go_on(
    tmp_path: Path, calls: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = recordings(tmp_path, "a", "b", "c")
    monkeypatch.setenv("STAND_IN_SECONDS", "1")
    killed: list[str] = []

    def kill() -> None:
        until(lambda: calls.exists() and len(called(calls, "reconstruct")) == 2)
        _, name, pid = calls.read_text().splitlines()[0].split()
        os.kill(int(pid), signal.SIGKILL)
        killed.append(name)

    killer = meanwhile(kill)
    state = go(given, tmp_path / "out", Settings(workers=2, timeout=PATIENT))
    killer.join()
    (name,) = killed
    assert {k: r["exit"] for k, r in state.rows.items() if r["exit"]} == {name: 1}
    assert state.rows[name]["error"] == (
        "reconstruct: was ended by signal 9, from outside, as the system does where memory lacks; give --retry failed"
    )
    go(given, tmp_path / "out", Settings(workers=2, retry="failed"))
    times = called(calls, "reconstruct")
    assert {k: times.count(k) for k in state.rows} == {k: 2 if k == name else 1 for k in state.rows}


def test_a_killed_ray_worker_is_begun_again_and_told_at_last(
    tmp_path: Path, calls: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("ray", reason="needs the extra fleet")
    given = recordings(tmp_path, "a", "killed", "worker_once", "worker_always", "z")
    command = ["batch", *given, "-o", str(tmp_path / "out"), "--workers", "2", "--backend", "ray", "--json"]
    assert twin_verb(command) == 2
    told = json.loads(capsys.readouterr().out)  # that and nothing of Ray's own
    rows = {r["id"].rpartition("_")[0]: r for r in told["units"]}
    assert {k: r["exit"] for k, r in rows.items()} == {
        "a": 0, "z": 0, "worker_once": 0, "worker_always": 1, "killed": 1,
    }  # fmt: skip
    assert "signal 9" in rows["killed"]["error"]
    assert rows["worker_always"]["error"] == (
        "its worker died 3 times (The worker died unexpectedly while executing this task); give --retry failed"
    )
    times = [k.rpartition("_")[0] for k in called(calls, "reconstruct")]
    assert {k: times.count(k) for k in rows} == {
        "a": 1, "z": 1, "worker_once": 2, "worker_always": 3, "killed": 1,
    }  # fmt: skip
    assert gone(calls)
    before = calls.read_text()
    assert twin_verb([*command, "--retry", "failed"]) == 2
    again = {line.split()[1].rpartition("_")[0] for line in calls.read_text()[len(before) :].splitlines()}
    assert again == {"killed", "worker_always"}


@pytest.fixture
def cluster(calls: Path) -> Iterator[Any]:
    """Three nodes on this machine: a head without room for units, and two that have it."""
    pytest.importorskip("ray", reason="needs the extra fleet")
    from ray.cluster_utils import Cluster

    head = {"num_cpus": 0, "include_dashboard": False}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    yield cluster
    cluster.shutdown()


def test_units_of_a_killed_node_are_done_on_another(
    tmp_path: Path, calls: Path, cluster: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, threads = recordings(tmp_path, *"abcdefgh"), max(1, len(os.sched_getaffinity(0)) // 2)
    monkeypatch.setenv("STAND_IN_SECONDS", "4")  # of what the nodes start
    nodes = [cluster.add_node(num_cpus=2 * threads, memory=4 * 10**9) for _ in range(2)]
    settings = Settings(workers=4, timeout=PATIENT, ray=True, address=cluster.address)

    def kill() -> None:
        until(lambda: calls.exists() and len(called(calls, "reconstruct")) == 4, PATIENT)  # two on each node
        cluster.remove_node(nodes[1], allow_graceful=False)

    killer = meanwhile(kill)
    state = go(given, tmp_path / "out", settings)
    killer.join()
    assert [r["exit"] for r in state.rows.values()] == [0] * 8
    assert len((tmp_path / "out" / JOURNAL).read_text().splitlines()) == 8
    assert len(called(calls, "reconstruct")) == 10  # two were cut off and begun again
    assert gone(calls)
    assert not list((tmp_path / "out" / "claims").iterdir())
    monkeypatch.setenv("STAND_IN_SECONDS", "0")
    go(given, tmp_path / "whole", Settings(workers=2, timeout=PATIENT))
    same_twins(tmp_path / "out", tmp_path / "whole", state)

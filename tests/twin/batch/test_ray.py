"""Units as Ray tasks, with the stand-in for the program: the same bytes, and whatever fails."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.twin.batch.test_batch import STAND_IN, called, go, recordings
from twin.batch import Settings, work
from twin.cli.main import run as twin_verb
from twin.errors import InputError, MissingDependencyError

ROOT = Path(__file__).parents[3]


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    pytest.importorskip("ray", reason="needs the extra fleet")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))  # of Ray's workers
    path = tmp_path / "calls"
    monkeypatch.setattr(work, "PROGRAM", (sys.executable, str(STAND_IN), str(path)))
    return path


def test_ray_gives_the_bytes_of_processes_and_tells_what_fails(tmp_path: Path, calls: Path) -> None:
    given = recordings(tmp_path, "a", "b", "poisoned", "crashes", "doubtful")
    alone = go(given, tmp_path / "alone", Settings(workers=2, timeout=60.0))
    rayed = go(given, tmp_path / "rayed", Settings(workers=2, timeout=60.0, ray=True))
    assert rayed.rows.keys() == alone.rows.keys()
    for unit, row in rayed.rows.items():
        same = ("exit", "verdict", "reasons", "error", "settings", "do")
        assert {k: row[k] for k in same} == {k: alone.rows[unit][k] for k in same}
        twins = [tmp_path / out / "runs" / unit / "twin" / "twin.json" for out in ("alone", "rayed")]
        assert twins[0].is_file() == twins[1].is_file()
        assert not twins[0].is_file() or twins[0].read_bytes() == twins[1].read_bytes()
    assert len(called(calls, "reconstruct")) == 10
    assert not list((tmp_path / "rayed" / "claims").iterdir())


def test_an_address_is_of_a_cluster(tmp_path: Path, calls: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = [*recordings(tmp_path, "a"), "-o", str(tmp_path / "out")]
    assert twin_verb(["batch", *given, "--address", "127.0.0.1:1"]) == 1
    assert "give --backend ray too" in capsys.readouterr().err


def test_a_unit_that_no_node_has_room_for_is_refused(
    tmp_path: Path, calls: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [*recordings(tmp_path, "a"), "-o", str(tmp_path / "out"), "--backend", "ray"]
    assert twin_verb(["batch", *given, "--memory", "100000"]) == 1
    assert "cores and 100000.0 GB for a recording; cores here: " in capsys.readouterr().err


def test_a_ray_that_does_not_start_is_told(
    tmp_path: Path, calls: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import ray

    def late(**_: object) -> None:
        raise Exception("The current node timed out during startup.\nmore")  # as Ray raises it

    monkeypatch.setattr(ray, "init", late)
    with pytest.raises(InputError, match=r"timed out during startup\.\).* without --backend ray"):
        go(recordings(tmp_path, "a"), tmp_path / "out", Settings(workers=1, ray=True))


def test_without_ray_its_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingDependencyError, match="fleet"):
        go(recordings(tmp_path, "a"), tmp_path / "out", Settings(workers=1, ray=True))

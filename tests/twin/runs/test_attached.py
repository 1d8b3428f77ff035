"""Stages that another process computes ahead of the run that reads them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from twin.geometry import Array
from twin.runs.attached import AttachedRun, NotComputedError
from twin.runs.stages import Run, StageResult

ITEMS = ("000000-000040", "000030-000090")


def solve(run: Run, before: StageResult[Array], item: str) -> StageResult[Array]:
    return run.stage("motion", 1, None, [before], lambda: before.value * len(item), item=item)


def first(run: Run) -> StageResult[Array]:
    return run.stage("map", 1, None, [], lambda: np.arange(3.0))


def attached(folder: Path, run: Run, **options: object) -> AttachedRun:
    return AttachedRun(folder, "x", [(r.name, r.key) for r in run.results], **options)  # type: ignore[arg-type]


def files(folder: Path) -> dict[str, bytes]:
    return {
        p.relative_to(folder).as_posix(): p.read_bytes()
        for p in sorted((folder / "stages").rglob("*"))
        if p.is_file() and p.name != "stage.json"
    }


def test_what_is_computed_ahead_is_what_the_run_would_compute(tmp_path: Path) -> None:
    alone, helped = tmp_path / "alone", tmp_path / "helped"
    with Run(alone, "x") as run:
        before = first(run)
        want = [solve(run, before, item).value for item in ITEMS]
    with Run(helped, "x") as run:
        before = first(run)
        for item in reversed(ITEMS):  # each in a process of its own, in any order
            other = attached(helped, run)
            solve(other, other.read("map"), item)
            assert other.computed == {f"motion/{item}": "not computed yet"}
            run.ahead |= other.computed
        found = [solve(run, before, item) for item in ITEMS]
    assert all(np.array_equal(f.value, w) for f, w in zip(found, want, strict=True))
    assert files(helped) == files(alone)
    assert [(f.cached, f.reason) for f in found] == [(False, "not computed yet")] * 2
    with Run(helped, "x") as run:
        assert solve(run, first(run), ITEMS[0]).cached  # of another run it is from the cache


def test_a_run_that_computes_nothing_tells_what_is_missing(tmp_path: Path) -> None:
    with Run(tmp_path, "x") as run:
        before = first(run)
        solve(attached(tmp_path, run), before, ITEMS[0])
        looking = attached(tmp_path, run, computes=False)
        assert solve(looking, before, ITEMS[0]).cached
        with pytest.raises(NotComputedError, match=f"motion/{ITEMS[1]} is not stored"):
            solve(looking, before, ITEMS[1])


def test_nothing_is_stored_once_the_run_has_ended(tmp_path: Path) -> None:
    """Another run may hold the folder then."""
    with Run(tmp_path, "x") as run:
        before = first(run)
        orphan = attached(tmp_path, run, owner=0)  # process 0 is nobody's parent
        with pytest.raises(SystemExit):
            solve(orphan, before, ITEMS[0])
    assert [p.name for p in (tmp_path / "stages").iterdir()] == ["01_map"]


WORKER = """
import os, sys, time
from twin.runs.attached import ends_with
with ends_with(os.getppid()):
    print("begun", flush=True)
    time.sleep(20)
    print("done", flush=True)
"""
STARTER = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {WORKER!r}])"


def test_a_worker_ends_with_the_run_that_was_killed() -> None:
    """Its work would take the cores of the run that goes on."""
    with subprocess.Popen([sys.executable, "-c", STARTER], stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        assert run.stdout.readline() == "begun\n"
        run.kill()
        run.wait()
        assert run.stdout.read() == ""  # up to the end of the worker, which holds the other end

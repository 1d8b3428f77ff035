"""A stage over items: each in a folder of its own, whole or not there, found again in any order."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from twin.files.text import read_json
from twin.geometry import Array
from twin.runs.stages import Run

ITEMS = ("000000-000040", "000030-000090", "000100-000150")


def solve(
    folder: Path | None, computed: list[str], items: tuple[str, ...] = ITEMS, fail: str = ""
) -> list[Array]:
    """Two stages on each item, between one stage before and one after."""
    with Run(folder, "x") as run:
        before = run.stage("map", 1, None, [], lambda: np.arange(3.0))
        out = []
        for k, item in enumerate(items):

            def compute(item: str = item, k: int = k) -> Array:
                if item == fail:
                    raise RuntimeError("killed")
                computed.append(item)
                return np.full(2, float(k))

            found = run.stage("motion", 1, item, [before], compute, item=item)
            out.append(run.stage("labels", 1, None, [found], lambda v=found.value: v + 1.0, item=item))
        last = run.stage("merge", 1, None, out, lambda: np.concatenate([r.value for r in out]))
        return [*(r.value for r in out), last.value]


def files(folder: Path) -> dict[str, bytes]:
    return {
        p.relative_to(folder).as_posix(): p.read_bytes()
        for p in sorted(folder.rglob("*"))
        if p.is_file() and p.name not in ("manifest.json", "stage.json")
    }


def test_each_item_has_a_folder_and_the_stage_one_number(tmp_path: Path) -> None:
    solve(tmp_path, [])
    assert sorted(p.name for p in (tmp_path / "stages").iterdir()) == [
        "01_map",
        "02_motion",
        "03_labels",
        "04_merge",
    ]
    assert sorted(p.name for p in (tmp_path / "stages/02_motion").iterdir()) == list(ITEMS)
    names = [s["name"] for s in read_json(tmp_path / "manifest.json")["stages"]]
    assert names[:3] == ["map", f"motion/{ITEMS[0]}", f"labels/{ITEMS[0]}"]


def test_a_killed_run_goes_on_from_the_last_whole_item_to_the_same_bytes(tmp_path: Path) -> None:
    whole, killed, computed = tmp_path / "whole", tmp_path / "killed", []
    solve(whole, [])
    with pytest.raises(RuntimeError):
        solve(killed, computed, fail=ITEMS[2])
    assert computed == list(ITEMS[:2])
    solve(killed, computed)
    assert computed == list(ITEMS)  # none twice
    assert files(killed) == files(whole)


def test_what_a_killed_process_was_writing_is_removed(tmp_path: Path) -> None:
    solve(tmp_path, [])
    half = tmp_path / "stages/02_motion" / f".{ITEMS[0]}.tmp"
    half.mkdir()
    solve(tmp_path, [])
    assert not half.exists()


def test_an_item_more_computes_that_alone(tmp_path: Path) -> None:
    computed: list[str] = []
    solve(tmp_path, computed, ITEMS[:2])
    solve(tmp_path, computed)
    assert computed == list(ITEMS)


def test_memory_and_folder_agree(tmp_path: Path) -> None:
    for a, b in zip(solve(None, []), solve(tmp_path, []), strict=True):
        np.testing.assert_array_equal(a, b)


def test_an_item_is_solved_once_in_a_run() -> None:
    with Run(None, "x") as run:
        run.stage("motion", 1, None, [], lambda: 1, item="a")
        run.stage("motion", 1, None, [], lambda: 1, item="b")
        with pytest.raises(ValueError, match="motion/a"):
            run.stage("motion", 1, None, [], lambda: 1, item="a")

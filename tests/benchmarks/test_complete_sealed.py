"""Sealed runs of the judge: which clips, what is counted and charged, its page and command line."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from benchmarks import complete, sealing
from benchmarks.completed.counts import counts
from benchmarks.completed.judge import judge, missed
from benchmarks.completed.page import table
from recon.evaluation.truth import Truth
from recon.simulate.random.strata import sealed_set
from tests.makers.benchmarks.completed import (
    write_run,
    write_truth,
)


def test_a_part_that_was_not_found_is_charged(truth: Truth) -> None:
    judged = missed(truth.folder)
    found = counts(judged)
    assert found["parts"] == found["handles"] == found["full bin 0"] == 2
    assert found["drawers"] == 1
    assert found["found"] == found["full"] == found["handle right"] == found["drawers that hold all"] == 0
    assert "not found" in table([judged])
    assert [p["carcass"] for p in judged["parts"]] == [0.0, 0.0]


def test_a_handle_is_right_where_it_is_drawn_and_touched_so_and_else_may_say_that_it_is_assumed(
    truth: Truth,
) -> None:
    door = missed(truth.folder)["parts"][0]
    layer = {"inferred": {}, "pieces": 2, "open pieces": ["a"], "shapes": 25, "open shapes": []}
    whole = {
        "full": 0.8,
        "full, seen layer": 0.4,
        "outside p95, mm": 7.0,
        "volume ratio": 1.2,
        "sight": None,
        "balls": None,
    }
    part = {**door, **layer, **whole, "found": True, "rear seen": True, "both faces seen": True}

    def told(visual: float, collider: float, gap: float, assumed: bool) -> dict[str, int]:
        handle = {"true": 0.012, "visual": visual, "collider": collider, "gap": gap}
        one = {**part, "handle": handle, "handle assumed": assumed}
        return dict(counts({"parts": [one], "static": None}))

    names = ("handle right", "handle right or assumed", "handle wrong but assumed", "gap free")
    right, thick, marked = (
        told(0.015, 0.009, 0.7, False),
        told(0.012, 0.017, 0.69, False),
        told(0.017, 0.012, 0.69, True),
    )
    assert [right.get(n, 0) for n in names] == [1, 1, 0, 1]
    assert [thick.get(n, 0) for n in names] == [0, 0, 0, 0]
    assert [marked.get(n, 0) for n in names] == [0, 1, 1, 0]
    bars = (
        "full",
        "full, rear seen",
        "few shapes",
        "outside",
        "ratio",
        "two-faced ratio",
        "open pieces",
        "full bin 80",
    )
    assert [right.get(n, 0) for n in bars] == [1, 0, 0, 0, 1, 0, 1, 1]


def test_the_sealed_clips_are_of_both_groups_and_all_factors() -> None:
    strata = [sealed_set()[i] for i in complete.CLIPS]
    assert len(set(complete.CLIPS)) == 40
    assert Counter(s.group for s in strata) == {"ordinary": 20, "hard": 20}
    for group, sensors in (("ordinary", 3), ("hard", 5)):
        of = Counter(s.sensor for s in strata if s.group == group)
        assert len(of) == sensors
        assert min(of.values()) >= 3
    assert {s.view for s in strata} == {"ordinary", "near", "steep", "moving"}
    assert {s.short for s in strata} == {True, False}


def test_a_sealed_run_keeps_rates_and_goes_on_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    good = {
        "clips": 1,
        "with twin": 1,
        "parts": 1,
        "found": 1,
        "full": 1,
        "full bin 80": 1,
        "evidence, cm2": 100,
        "evidence off, cm2": 3,
    }
    bad = {"clips": 1, "parts": 1, "full bin 0": 1}
    broken = {"clips": 1, "broken": 1, "broken time": 1}
    monkeypatch.setattr(complete, "PAGE", tmp_path / "complete.md")
    monkeypatch.setattr(complete, "STATE", tmp_path / "state")
    monkeypatch.setattr(sealing, "commit", lambda: "abc1234567")
    rows = {0: broken, 4: bad}
    monkeypatch.setattr(complete, "_clip_alone", lambda _, i: [rows.get(i, good)])
    assert complete.main(["sealed"]) == 0
    page = (tmp_path / "complete.md").read_text()
    assert page.startswith("# Completed assets")
    assert "## abc1234567\n\n40 clips." in page
    assert "| full surface, of all | ≥ 75 % | 18/19 = 95 % [75-99] | 20/20 = 100 % [84-100] |" in page
    assert "| full surface, median of all |  | 80-85 % of 19 | 80-85 % of 20 |" in page
    assert "| part inferred area off, evidence |  | 3.0 % of 0.18 m² | 3.0 % of 0.20 m² |" in page
    assert "broken time 1" in page
    complete.main(["sealed"])
    assert (tmp_path / "complete.md").read_text().count("## abc1234567") == 2, "no row is taken off"


def test_the_chain_of_a_clip_counts_what_each_step_leaves(
    truth: Truth, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[str, ...]] = []
    made = {"reconstruct": True, "export": True}

    def simulated(_seed: int, out: Path, _stratum: object) -> None:
        write_truth(out)

    def verb(_code: Path, folder: Path, *words: str) -> int:
        calls.append(words)
        if words[0] == "reconstruct" and made["reconstruct"]:
            write_run(folder / "run")
        return 0 if made[words[0]] else 1

    monkeypatch.setattr(complete, "simulate_random", simulated)
    monkeypatch.setattr(sealing, "twin_verb", verb)
    monkeypatch.setattr(complete, "judge", lambda *_: {"parts": [], "static": None})
    places = [tmp_path / n for n in "abc"]
    assert complete.clip(1, 0, places[0], Path()) == {"clips": 1, "with twin": 1}
    made["export"] = False
    unexported = complete.clip(1, 0, places[1], Path())
    assert (unexported["broken export"], unexported["parts"], unexported.get("found", 0)) == (1, 2, 0)
    made["reconstruct"] = False
    assert "with twin" not in complete.clip(1, 0, places[2], Path())
    assert [c[0] for c in calls] == ["reconstruct", "export", "reconstruct", "export", "reconstruct"]


def test_the_command_line_prints_a_table_and_tells_errors_in_one_line(
    truth: Truth, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told = missed(truth.folder)
    monkeypatch.setattr(complete, "judge", lambda *_: told)
    monkeypatch.setattr(complete, "PAGE", tmp_path / "page.md")
    assert complete.main(["run", "truth", "--page", "by hand"]) == 0
    printed = capsys.readouterr().out
    assert "drawer" in printed
    assert printed.strip() in (tmp_path / "page.md").read_text()
    monkeypatch.setattr(complete, "judge", judge)
    assert complete.main([str(tmp_path), str(truth.folder)]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    with pytest.raises(SystemExit):
        complete.main(["run"])

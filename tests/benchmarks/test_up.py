"""The benchmark of up: its clips, going on where it stopped, and its page."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import sealing, up


def test_all_clips_are_open_and_look_steeply() -> None:
    strata = up.strata()
    assert len(strata) == up.CLIPS
    assert {s.view for s in strata.values()} == {"steep"}
    assert len({(s.sensor, s.hard_picture, s.short) for s in strata.values()}) >= 10
    assert up.FIRST_SEED + up.CLIPS <= sealing.OPEN_SEEDS


def test_a_stopped_run_goes_on_and_the_last_clip_writes_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def one(_: str, words: tuple[int, int], __: object) -> sealing.Rows:
        asked.append(words)
        if words[1] == 4:
            return [{"clips": 1, "broken": 1, "broken time": 1}]
        return [{"all: clips": 1, "all: right": 1, "pitched less: clips": 1}]

    monkeypatch.setattr(sealing, "clip_alone", one)
    monkeypatch.setattr(up, "STATE", tmp_path / "up.json")
    monkeypatch.setattr(up, "PAGE", tmp_path / "up.md")
    assert up.run(7) == 0
    assert not up.PAGE.exists()
    up.run(up.CLIPS)
    assert sorted(asked) == [(up.FIRST_SEED + k, k) for k in range(up.CLIPS)]
    page = up.PAGE.read_text()
    assert "| all | 59 | 59 | 0 | 0 | 0 | 0 |" in page
    assert "| broken | 1 |" in page

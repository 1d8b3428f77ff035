"""The user's word on failures: the click lies on the part, a stopped run goes on, the page counts."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import words
from recon.evaluation.truth import Truth


def test_the_click_is_in_the_middle_of_the_part_while_it_moves(truth: Truth) -> None:
    part = replace(
        truth.parts[0],
        states=np.linspace(0.0, 0.3, truth.frames),
        segments=((0, truth.frames - 1),),
    )
    image = np.ones((60, 80), np.uint8)
    image[20:41, 30:61] = part.id
    middle = sum(part.span or (0, 0)) // 2
    word = words.pointed(replace(truth, labels={middle: image, truth.frames + 9: image}), part)
    assert word is not None
    assert word.point is not None
    x, y, frame = word.point
    assert frame == middle
    assert abs(y - 30) <= 1
    assert 40 <= x <= 50
    assert word.type == ("slide" if part.joint.kind == "prismatic" else "hinge")
    assert words.pointed(replace(truth, labels={middle: np.ones_like(image)}), part) is None


def test_a_stopped_run_goes_on_and_ends_with_the_tenth_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    def tried(seed: int, _: Path) -> list[dict[str, Any]]:
        asked.append(seed)
        if seed % 2:
            return [{"seed": seed}]
        after = None if seed % 4 else "labels"
        return [{"seed": seed, "part": "door", "before": "missed", "said": "--at 1,2@3", "after": after}]

    monkeypatch.setattr(words, "tried", tried)
    monkeypatch.setattr(words, "ROWS", tmp_path / "words.jsonl")
    monkeypatch.setattr(words, "PAGE", tmp_path / "words.md")
    words.run(3)
    words.run(None)
    words.run(None)
    assert asked == [words.FIRST_SEED + k for k in range(19)]
    assert len((tmp_path / "words.jsonl").read_text().splitlines()) == 19
    page = words.PAGE.read_text()
    assert "19 recordings, 10 failures, 5 mended." in page
    assert f"| {words.FIRST_SEED + 2} | door | missed | `--at 1,2@3` | right |" in page
    assert json.loads((tmp_path / "words.jsonl").read_text().splitlines()[1]) == {"seed": 9201}

"""What docs/python.md shows runs as it stands and finds what it says."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "python.md"
SNIPPETS = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def run_snippet(code: str) -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(compile(code, str(PAGE), "exec"), names)  # noqa: S102  (the page's own code)
    return names


def test_the_page_has_its_snippets() -> None:
    assert len(SNIPPETS) == 3  # the first needs a run: tests/test_documents.py


def test_a_recording_from_arrays_as_the_page_shows(capsys: pytest.CaptureFixture[str]) -> None:
    names = run_snippet(SNIPPETS[1])
    told = capsys.readouterr().out.strip()
    assert f"# {told}" in SNIPPETS[1]
    assert len(names["middle"]) == 20
    assert names["last"].color.shape == (48, 64, 3)


def test_a_joint_from_tracks_as_the_page_shows(capsys: pytest.CaptureFixture[str]) -> None:
    found = run_snippet(SNIPPETS[2])["found"]
    assert found.joint.kind == "revolute"
    assert abs(found.joint.axis[2]) > 0.9999
    assert found.state[-1] == pytest.approx(1.2, abs=0.005)
    assert capsys.readouterr().out.split()[-1] == "revolute"

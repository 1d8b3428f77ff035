"""What tables and messages show: no negative zero, no "1 share", no numbers of system errors."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from benchmarks.scenes.boards import cabinet_twin
from recon.evaluation import evaluate, read_truth
from recon.evaluation.rows import Row
from recon.verbs.twins import evaluate_step
from twin.cli import main as cli
from twin.errors import InputError
from twin.page.replays import _phases
from twin.runs.progress import silent
from twin.storage import save


def test_nothing_opened_is_no_negative_zero(tmp_path: Path) -> None:
    """A part that springs back by a tenth of a millimetre is open by 0 %, not by -0 %."""
    row = {
        "phase": "approach", "start": 0, "end": 1, "opening_peak": -0.001, "opening_final": -0.004, "at_rest": True,
        "slip_mm": 0, "tool_error_mm": 0, "torque_share": 0.1, "unintended": 0, "reason": "",
    }  # fmt: skip
    (tmp_path / "report.json").write_text(json.dumps({"phases": [row]}), encoding="utf-8")
    table = _phases(tmp_path / "report.json")
    assert table is not None
    assert "0 / 0 %" in table.rows[0]


def test_a_share_is_a_number_without_a_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save(cabinet_twin(), tmp_path / "twin")
    rows = (
        Row("frames with camera", "scene", 1.0, 1.0, "share", None),
        Row("ATE", "scene", 2.0, 2.0, "mm", None),
    )
    found: Any = SimpleNamespace(rows=rows, ok=True, name="made", remarks=(), as_dict=dict, walk=None)
    monkeypatch.setattr(read_truth, "load_truth", lambda _: None)
    monkeypatch.setattr(evaluate, "evaluate", lambda *_: found)
    (table,) = evaluate_step(silent, tmp_path, tmp_path).outcome.tables
    assert [row[2] for row in table.rows] == ["1", "2 mm"]


def test_a_message_has_no_number_of_a_system_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "none.json"
    with pytest.raises(OSError, match="Errno 2") as e:
        missing.read_text()
    told = InputError(f"{missing} can't be read: {e.value}", "give another")
    assert told.problem == f"{missing} can't be read: No such file or directory: '{missing}'"
    assert str(told) == f"{told.problem}; give another"
    recording = Path(__file__).parents[3] / "assets/recordings/cabinet_drawer"
    order = ["reconstruct", str(recording), "-o", str(tmp_path / "run"), "--type-hint", str(missing)]
    assert cli.run(order) == 1
    err = capsys.readouterr().err
    assert "Errno" not in err
    assert str(missing) in err

"""The tables of replays and trials: what is rounded to zero has no sign, of a part that hardly moved back."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import robots
from benchmarks.scenes import furniture
from robots.floor import Floor
from robots.replay_verb import _replay_part
from robots.simulation.report import ReplayReport
from robots.task import MotionRequest
from robots.trials.report import Trial, TrialRow
from tests.laws import assert_for_all, has_no_negative_zero

LITTLE = -0.001  # of the way, backwards


@pytest.fixture
def report() -> ReplayReport:
    told: dict[str, Any] = dict.fromkeys(ReplayReport.__dataclass_fields__)
    told |= {
        "robot": "franka",
        "part": "part",
        "ok": False,
        "faults": (),
        "grasp": "bar",
        "torque_share": (0.1,),
    }
    told |= dict.fromkeys(("reached", "opening_peak", "opening_final"), LITTLE)
    missed = dict.fromkeys(("success_75", "success_90"), False)
    return ReplayReport(**told | {"slip_mm": 0.3, "pedestal": 0.4, "phases": ()} | missed)


def test_a_replay_that_reached_nothing(report: ReplayReport, monkeypatch: pytest.MonkeyPatch) -> None:
    messages: list[str] = []
    twin = furniture.drawer()
    config = SimpleNamespace(plan=None, replay=None)
    bench: Any = SimpleNamespace(
        progress=lambda _stage, _fraction, message: messages.append(message),
        twin=twin, robot="franka", config=config, request=MotionRequest(), floor=Floor(0.0, "assumed"),
        folder=lambda *_: Path("replay"), demonstration=None,
    )  # fmt: skip
    monkeypatch.setattr(robots, "plan", lambda *_, **__: SimpleNamespace(grasp="bar"))
    monkeypatch.setattr(robots, "replay", lambda *_, **__: report)
    row, *_ = _replay_part(bench, twin.parts[0], ())
    assert row[:2] == ["0 %", "0 %"]
    assert messages[-1] == "0 % of the way"
    assert_for_all(has_no_negative_zero, [*row, repr(report)])


def test_trials_that_opened_nothing(report: ReplayReport) -> None:
    trial = Trial(None, 0.0, False, report)  # type: ignore[arg-type]
    row = TrialRow(None, (trial, trial))
    assert row.cells()[4] == "0 % (0–0)"

"""What robots are told of a part that is not trusted."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from robots.formats import FORMATS, PlannedMotion, export_trajectory, native, require_trust
from tests.makers.robots import planned_motions
from tests.makers.robots.planned_motions import contents
from twin import verdict as v
from twin.cli.main import run
from twin.errors import InputError
from twin.storage import save
from twin.verdict import Verdict, of_twin, reason

DOUBT = Verdict((reason("AxisUnsure", "doubtful", 1.25, 0.5),))
LIGHT = [f for f in FORMATS if f != "lerobot"]


@cache
def source(verdict: Verdict | None) -> PlannedMotion:
    opened = planned_motions.door()
    return replace(opened, part=replace(opened.part, verdict=verdict))


@pytest.mark.parametrize("verdict", [None, Verdict()], ids=["none", "trusted"])
def test_a_part_that_nobody_doubts_is_exported(verdict, tmp_path):
    require_trust(source(verdict).part)
    export_trajectory(source(verdict), ["csv"], tmp_path)
    assert (tmp_path / "verdict.json").is_file() == (verdict is not None)


def test_a_doubtful_part_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(InputError) as caught:
        export_trajectory(source(DOUBT), LIGHT, tmp_path / "out")
    assert "door is doubtful: its axis is known to ± 1.25° only" in str(caught.value)
    assert "--accept-doubtful (in Python accept_doubtful=True)" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_what_is_accepted_carries_the_verdict(tmp_path):
    written = export_trajectory(source(DOUBT), LIGHT, tmp_path, accept_doubtful=True)
    files = contents(tmp_path)
    assert json.loads(files["verdict.json"]) == v.verdict_document(DOUBT)
    assert json.loads(files["trajectory.json"])["verdict"] == v.verdict_document(DOUBT)
    assert str(np.load(written["npz"][0])["verdict"]) == DOUBT.text
    for path in (*written["ros2"], *written["moveit"]):
        assert path.read_text(encoding="utf-8").startswith(f"# verdict: {DOUBT.text}\n")
    again = native.load(written["json"][0])
    assert np.abs(again.q - source(DOUBT).trajectory.q).max() < 1e-9  # as the file rounds


def test_an_export_of_another_verdict_leaves_none_of_the_first(tmp_path):
    export_trajectory(source(DOUBT), ["csv"], tmp_path, accept_doubtful=True)
    export_trajectory(source(None), ["csv"], tmp_path)
    assert not (tmp_path / "verdict.json").exists()


def test_the_command_asks_for_consent(tmp_path, capsys):
    motion = source(DOUBT)
    twin = planned_motions.furniture.door("left")
    doubted = replace(twin, parts=(motion.part,), verdict=of_twin({"door": DOUBT}))
    save(doubted, tmp_path / "run/twin")
    native.save(motion.trajectory, tmp_path / "run/replay/franka/door")
    order = ["trajectory", str(tmp_path / "run"), "--format", "csv", "-o", str(tmp_path / "out")]
    assert run(order) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "door is doubtful" in line
    assert "--accept-doubtful" in line
    assert not (tmp_path / "out").exists()
    assert run([*order, "--accept-doubtful", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"]["level"] == "doubtful"
    assert run([*order, "--accept-doubtful"]) == 0
    assert capsys.readouterr().out.startswith("verdict: doubtful: door: its axis is known to")


def test_a_doubt_of_the_whole_twin_counts_against_each_part(tmp_path, capsys):
    motion = source(Verdict())
    up = reason("UpUnsure", "doubtful", 3.0, 20.0, "0,-1,0", "0,0,-1")
    twin = planned_motions.furniture.door("left")
    doubted = replace(twin, parts=(motion.part,), verdict=of_twin({"door": Verdict()}, own=[up]))
    assert doubted.verdict is not None
    assert doubted.verdict.of_all.reasons == (up,)
    save(doubted, tmp_path / "run/twin")
    native.save(motion.trajectory, tmp_path / "run/replay/franka/door")
    order = ["trajectory", str(tmp_path / "run"), "--format", "csv", "-o", str(tmp_path / "out")]
    assert run(order) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "the twin is doubtful: up is unsure" in line
    assert not (tmp_path / "out").exists()
    assert run([*order, "--accept-doubtful"]) == 0


def test_a_report_of_a_replay_tells_the_verdict():
    from robots.simulation.report import ReplayReport

    report = ReplayReport(
        **dict.fromkeys(ReplayReport.__dataclass_fields__) | {"faults": (), "verdict": DOUBT}
    )  # type: ignore[arg-type]
    told = report.to_json()
    assert next(iter(told)) == "verdict"
    assert told["verdict"] == v.verdict_document(DOUBT)
    assert replace(report, verdict=None).to_json()["verdict"] is None

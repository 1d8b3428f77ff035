"""Settings of a verb: from a file, from the command line, and what is wrong with them in one line."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from benchmarks.scenes.boards import cabinet_twin
from robots.config import PlanConfig, ReplayConfig
from tests.makers.twin.judged import doubted
from tests.makers.twin.stand_ins import Nested, Settings, stand_in
from twin import verification
from twin.cli import given
from twin.cli import main as cli
from twin.errors import ConfigError, InputError
from twin.physics import with_physics
from twin.scene import Twin
from twin.storage import save


def test_settings_come_from_file_and_command_line(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text("[labels]\nseed = 3\nname = 'b'\n")
    got = given.settings(
        Nested, tmp_path / "c.toml", ["labels.seed=4", "labels.sizes=[1, 2]", "labels.name=word"]
    )
    assert got == Nested(Settings(4, "word", (1, 2)))
    assert given.settings(Settings, None, []) == Settings()


@pytest.mark.parametrize(
    ("assignments", "words"),
    [
        (["seed"], "'seed' is not KEY=VALUE"),
        (["sed=1"], "did you mean 'seed'"),
        (["seed=x"], "seed = 'x' must be a whole number"),
        (["seed=1", "seed.x=1"], "'seed' is a value, not a table"),
    ],
)
def test_wrong_settings_are_named(assignments: list[str], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        given.settings(Settings, None, assignments)


def test_missing_settings_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no\.toml does not exist"):
        given.settings(Settings, tmp_path / "no.toml", [])


def unshaped(twin: Twin) -> Twin:
    parts = tuple(replace(p, collision=()) for p in twin.parts)
    return replace(twin, static=replace(twin.static, collision=()), parts=parts)


def shapes_in(run: Path) -> int:
    """Collision shapes of the exported door."""
    text = (run / "export/mjcf/cabinet.xml").read_text(encoding="utf-8")
    return len(set(re.findall(r'name="door_collision_\d+"', text)))


def test_export_takes_settings_of_shapes_and_makes_those_of_an_earlier_export_anew(tmp_path: Path) -> None:
    save(unshaped(doubted()), tmp_path / "twin")
    order = ["export", str(tmp_path), "--format", "mjcf", "--geometry", "seen"]
    assert cli.run(order) == 0
    before = shapes_in(tmp_path)
    assert cli.run([*order, "--set", "collision.part_pieces=2"]) == 0
    assert shapes_in(tmp_path) < before


def test_settings_of_shapes_that_a_twin_states_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save(cabinet_twin(), tmp_path / "twin")
    assert cli.run(["export", str(tmp_path), "--set", "collision.part_pieces=2"]) == 1
    assert "cabinet states all its collision shapes" in capsys.readouterr().err


def test_check_takes_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save(with_physics(cabinet_twin()), tmp_path / "twin")
    (tmp_path / "export/mjcf").mkdir(parents=True)
    (tmp_path / "export/mjcf/cabinet.xml").touch()
    asked: list[int] = []

    def ask(sources: Any, engines: Any, processes: int) -> Any:
        asked.append(processes)
        raise InputError("asked")

    monkeypatch.setattr(verification, "check_many", ask)
    for extra in ([], ["--set", "processes=7"]):
        assert cli.run(["check", str(tmp_path), "--format", "mjcf", *extra]) == 1
    assert asked == [2, 7]


def test_replay_takes_settings_of_plan_and_replay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An option of its own goes before a file."""
    save(cabinet_twin(), tmp_path / "twin")
    (tmp_path / "c.toml").write_text("[plan]\nseed = 3\n[replay]\nstiffness = 2\ncontrol = 'position'\n")
    asked: list[Any] = []

    def plan(*_: Any, config: PlanConfig, **__: Any) -> Any:
        asked.append(config)
        return type("Planned", (), {"start": 0.0, "goal": 1.4, "grasp": "bar"})

    def replay(*_: Any, config: ReplayConfig, **__: Any) -> Any:
        asked.append(config)
        raise InputError("asked")

    stand_in(monkeypatch, plan=plan, replay=replay)
    options = ["--config", str(tmp_path / "c.toml"), "--set", "plan.finalists=2", "--control", "impedance"]
    assert cli.run(["replay", str(tmp_path), "--part", "door", *options]) == 1
    assert asked == [PlanConfig(seed=3, finalists=2), ReplayConfig(stiffness=2.0, control="impedance")]

"""What `twin replay` hands on: planning and simulation are stood in for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from benchmarks.scenes.boards import cabinet_twin
from robots.task import task_of
from tests.makers.twin.stand_ins import stand_in
from twin.cli import main as cli
from twin.errors import InputError, PlanningError
from twin.runs.manifest import update_manifest
from twin.storage import save


@pytest.fixture(autouse=True)
def plain_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page without its pictures, which have tests of their own."""
    from twin.page import page

    monkeypatch.setattr(page, "_pictures", lambda _: {"opening": [], "dollhouse": "", "plan": ""})


@dataclass(frozen=True)
class Trajectory:
    goal: float
    start: float = 0.0
    grasp: str = "bar"


@dataclass(frozen=True)
class Replayed:
    opening_peak: float
    ok: bool
    reason: str = ""
    opening_final: float = 0.9
    slip_mm: float = 1.25
    torque_share: tuple[float, ...] = (0.1, 0.5)
    grasp: str = "bar"
    pedestal: float = 0.4
    reached: float = 0.9

    def to_json(self) -> dict[str, Any]:
        return {"ok": self.ok, "opening_peak": self.opening_peak}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    save(cabinet_twin(), tmp_path / "run" / "twin")
    return tmp_path / "run"


def test_replay_opens_every_part_and_keeps_the_result(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    planned: list[tuple[int, str]] = []
    tasks: list[tuple[Any, ...]] = []

    def plan(
        twin: Any,
        part: int,
        robot: str,
        *,
        contact: Any,
        goal: str,
        from_state: str | None,
        floor: Any,
        config: Any,
    ) -> Trajectory:
        assert floor.source == "assumed"
        task = task_of(twin.part(part), goal, from_state)
        tasks.append((task.start, task.goal, None if contact is None else tuple(contact.tolist())))
        planned.append((part, robot))
        if part == 3:
            raise PlanningError("the drawer is out of reach by 0.30 m", "raise the base")
        return Trajectory(task.goal, task.start)

    def replay(
        twin: Any, trajectory: Trajectory, out: Path, *, robot: str, config: Any, demonstration: Any
    ) -> Replayed:
        assert demonstration is None
        name = "door_close" if trajectory.goal == 0 else "door"
        assert out == run / "replay" / "franka" / name
        return Replayed(0.98, ok=True)

    stand_in(monkeypatch, plan=plan, replay=replay)
    assert cli.run(["replay", str(run)]) == 2
    out = capsys.readouterr().out
    assert planned == [(2, "franka"), (3, "franka")]
    assert "98 %" in out
    assert "out of reach by 0.30 m" in out
    page = (run / "report.html").read_text(encoding="utf-8")
    assert "98 %" in page
    assert "out of reach" in page
    assert cli.run(["replay", str(run / "twin"), "--part", "door"]) == 0
    assert planned[2:] == [(2, "franka")]
    assert cli.run(["replay", str(run), "--part", "door", "--goal", "close"]) == 0
    upper, drawn = (p.joint.upper for p in cabinet_twin().parts)
    assert tasks == [(0, upper, None), (0, drawn, None), (0, upper, None), (upper, 0, None)]
    point = ["--contact", "-0.1,0.2,3e-1"]
    assert cli.run(["replay", str(run), "--part", "door", *point]) == 0
    assert tasks[-1] == (0, upper, (-0.1, 0.2, 0.3))
    assert cli.run(["replay", str(run), *point]) == 1
    assert "add --part with one of: door, drawer" in capsys.readouterr().err
    assert cli.run(["replay", str(run), "--part", "window"]) == 1
    assert "its parts are: door (id 2), drawer (id 3)" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text", ["1,2", "1,2,3,4", "a,b,c", "nan,0,0", "0,inf,0", "", "0.1 0.2 0.3", "-1,,2"]
)
def test_a_contact_that_is_no_point_is_told(text: str, run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["replay", str(run), "--part", "door", "--contact", text]) == 1
    told = capsys.readouterr().err
    assert "write three numbers in m" in told
    assert told.count("\n") == 1
    assert not (run / "replay").exists()


def test_a_part_that_can_not_be_held_fails_alone_among_several(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from robots.grasp.by_shape import NothingToHold

    def plan(twin: Any, part: int, robot: str, **_: Any) -> Trajectory:
        if part == 2:
            raise NothingToHold("part 'door' has no contact", "give one")
        return Trajectory(twin.part(part).joint.upper)

    stand_in(monkeypatch, plan=plan, replay=lambda *_, **__: Replayed(0.97, True))
    assert cli.run(["replay", str(run)]) == 2
    told = capsys.readouterr()
    assert "97 %" in told.out
    assert "has no contact; give one" in " ".join(told.out.split())
    assert cli.run(["replay", str(run), "--part", "door"]) == 1
    assert capsys.readouterr().err == "twin: part 'door' has no contact; give one\n"


def test_replay_of_a_missed_goal_exits_with_two(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(
        monkeypatch,
        plan=lambda *_, **__: Trajectory(1.0),
        replay=lambda *_, **__: Replayed(0.5, False, "slipped"),
    )
    assert cli.run(["replay", str(run), "--part", "door"]) == 2


class Opened:
    """A recording with frames that are their own index."""

    def __init__(self, fingerprint: str) -> None:
        self.fingerprint = fingerprint

    def __len__(self) -> int:
        return 30

    def color(self, index: int) -> int:
        return index


@pytest.fixture
def films(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The demonstrations that replays are given; a folder is a recording whose fingerprint is its name."""
    given: list[Any] = []
    (tmp_path / "data" / cabinet_twin().recorded.fingerprint).mkdir(parents=True)
    (tmp_path / "data" / "another").mkdir()

    def replay(*_: Any, demonstration: Any, **__: Any) -> Replayed:
        given.append(demonstration)
        return Replayed(1.0, ok=True)

    def open_recording(path: Path, **_: object) -> Opened:
        if not path.is_dir():
            raise InputError(f"recording {path} does not exist", "check the path")
        return Opened(path.resolve().name)

    stand_in(monkeypatch, plan=lambda *_, **__: Trajectory(1.0), replay=replay, open_recording=open_recording)
    return given


def test_a_replay_finds_the_recording_that_the_run_was_made_from(
    run: Path, films: list[Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = cabinet_twin().recorded.fingerprint
    replay = ["replay", str(run), "--part", "door"]
    assert cli.run(replay) == 0
    assert films == [None]
    assert "--recording" in capsys.readouterr().out
    update_manifest(run, recording=f"../data/{own}")
    assert cli.run(replay) == 0
    assert films[1].frames == 30
    assert films[1].image(7) == 7
    assert "alone" not in capsys.readouterr().out
    (tmp_path / "data" / own).rename(tmp_path / own)
    assert cli.run(replay) == 0
    assert films[2] is None
    assert cli.run([*replay, "--recording", str(tmp_path / own)]) == 0
    assert films[3].frames == 30


@pytest.mark.usefixtures("films")
def test_a_replay_opens_the_recording_as_the_run_did(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own, asked = cabinet_twin().recorded.fingerprint, []

    def open_recording(path: Path, **told: object) -> Opened:
        asked.append(told)
        return Opened(path.resolve().name)

    stand_in(monkeypatch, open_recording=open_recording)
    told = {"layout": "ros", "start": 1.5, "calibration": "../camera.json"}
    update_manifest(run, recording=f"../data/{own}", opened_with=told)
    assert cli.run(["replay", str(run), "--part", "door"]) == 0
    assert asked == [told | {"calibration": run / "../camera.json"}]


def test_control_and_stiffness_reach_the_replay(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    used: list[tuple[str, float]] = []

    def keep(*_: Any, config: Any, **__: Any) -> Replayed:
        used.append((config.control, config.stiffness))
        return Replayed(0.98, ok=True)

    stand_in(monkeypatch, plan=lambda *_, **__: Trajectory(1.0), replay=keep)
    replay = ["replay", str(run), "--part", "door"]
    assert cli.run(replay) == 0
    assert cli.run([*replay, "--control", "position", "--stiffness", "0.5"]) == 0
    assert used == [("impedance", 1.0), ("position", 0.5)]


def test_another_recording_is_not_shown_and_a_wrong_path_is_told_before_planning(
    run: Path, films: list[Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    replay = ["replay", str(run), "--part", "door", "--recording"]
    assert cli.run([*replay, str(tmp_path / "data" / "another")]) == 0
    assert films == [None]
    shown = " ".join("".join(capsys.readouterr()).split())
    assert "is not, or no longer, what the twin was made from" in shown
    assert cli.run([*replay, str(tmp_path / "data" / "nowhere")]) == 1
    assert "nowhere does not exist" in capsys.readouterr().err
    assert len(films) == 1
    update_manifest(run, recording="twin/twin.json")
    assert cli.run(replay[:-1]) == 0, "a manifest that points at something else costs the picture alone"
    assert films == [None, None]

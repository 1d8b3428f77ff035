"""What a robot stands on: seen where the twin shows it, else given or assumed, and said everywhere."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from benchmarks.scenes.furniture import box, mesh_of
from benchmarks.scenes.random_furniture import HANDLES, KINDS, random_furniture
from robots.config import PlanConfig
from robots.floor import Floor, find_floor, floor_of
from robots.formats import native
from robots.trials.run_trials import run_trials
from twin import geometry as geo
from twin.cli import main as cli
from twin.errors import InputError
from twin.scene import StaticPart, Trajectory, Twin
from twin.storage import save

FAST = PlanConfig(candidates=150, finalists=1)


def with_static(twin: Twin, boxes: list) -> Twin:
    """The same parts in front of another scene."""
    return replace(twin, static=StaticPart("scene", mesh_of(boxes), tuple(boxes)))


def kitchen(worktop: float = 0.9, lowest: float = 0.35) -> Twin:
    """A drawer under a worktop of 2 m, seen down to `lowest`: fronts beside it, a wall behind, no floor."""
    twin = furniture.drawer(height=worktop - 0.2)
    below = worktop - lowest
    fronts = [box([x, 0.04, lowest + below / 2 - 0.03], [0.7, 0.018, below - 0.06]) for x in (-0.65, 0.65)]
    top = box([0, 0.3, worktop - 0.02], [2.0, 0.6, 0.04])
    return with_static(twin, [top, *fronts, box([0, 0.65, worktop + 0.5], [2.0, 0.05, 1.0])])


def seen_from(twin: Twin, height: float) -> Twin:
    """The twin with cameras at this height."""
    poses = np.stack([geo.make_pose(translation=[0.0, -1.0, height + dz]) for dz in (0.0, 0.02, -0.03)])
    return replace(twin, cameras=Trajectory(np.arange(3), np.arange(3) / 15, poses))


def test_a_worktop_55_cm_above_the_lowest_point_is_no_floor() -> None:
    floor = find_floor(kitchen())
    assert floor.source == "assumed"
    assert floor.height == pytest.approx(0.35, abs=0.01), "was 0.84, right below the worktop"
    assert "--floor Z" in floor.warning
    assert "0.35" in floor.warning


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("handle", HANDLES)
def test_a_floor_that_is_shown_is_seen(kind: str, handle: str) -> None:
    floor = find_floor(random_furniture(kind, handle, 0))
    assert (floor.height, floor.source) == (pytest.approx(0.0, abs=1e-6), "seen")


@pytest.mark.parametrize("seed", range(4))
def test_noise_a_slab_and_a_degree_of_tilt_leave_the_floor_seen(seed: int) -> None:
    rng = np.random.default_rng(seed)
    twin = with_static(
        furniture.drawer(), [box([0, -0.5, -0.05], [2.5, 2.5, 0.1]), box([0, 0.6, 1.0], [2.5, 0.1, 2.0])]
    )
    import trimesh

    v, f = trimesh.remesh.subdivide_to_size(twin.static.mesh.vertices, twin.static.mesh.faces, 0.06)
    v = v @ geo.exp_so3([np.deg2rad(1.0), 0, 0]).T + rng.normal(0, 0.004, v.shape)
    stray = np.array([[0, 0, -3.0], [0.01, 0, -3.0], [0, 0.01, -3.0]])
    mesh = type(twin.static.mesh)(
        np.concatenate([v, stray]), np.concatenate([f, [[len(v), len(v) + 1, len(v) + 2]]])
    )
    floor = find_floor(replace(twin, static=replace(twin.static, mesh=mesh)))
    assert floor.source == "seen"
    assert floor.height == pytest.approx(0.0, abs=0.05)


def test_neither_the_inside_of_a_wall_cabinet_nor_a_table_below_the_eyes_is_a_floor() -> None:
    cabinet = with_static(furniture.drawer(height=1.6), furniture.shell(0.9, 0.6, 0.6, [0, 0.3, 1.6]))
    assert find_floor(cabinet).source == "assumed"
    assert find_floor(cabinet).height <= 1.3
    table = with_static(furniture.drawer(height=0.9), [box([0, -0.2, 0.7], [1.6, 1.6, 0.03])])
    assert find_floor(seen_from(table, 1.45)).source == "assumed"
    assert find_floor(seen_from(furniture.drawer(), 1.45)).source == "seen"
    assert find_floor(seen_from(furniture.drawer(), 1.1)).source == "seen", "of one who kneels"


def test_a_height_is_given_in_m_and_finite() -> None:
    twin = furniture.drawer()
    assert floor_of(twin, -0.2) == Floor(-0.2, "given")
    assert floor_of(twin, Floor(0.1, "assumed")) == Floor(0.1, "assumed")
    for wrong in (np.nan, np.inf):
        with pytest.raises(InputError, match="floor's height"):
            floor_of(twin, wrong)
    with pytest.raises(InputError, match="'seen', 'given', 'assumed'"):
        Floor(0.0, "guessed")
    assert (Floor(0.0, "seen").warning, Floor(0.0, "given").warning) == ("", "")
    assert Floor(-0.0004, "assumed").text == "assumed, z 0.00 m"


@pytest.fixture(scope="module")
def planned():
    twin = kitchen()
    return twin, robots.plan(twin, "part", "spot", config=FAST)


def test_spot_no_longer_stands_on_the_height_of_a_worktop(planned) -> None:
    twin, plan = planned
    assert plan.floor == find_floor(twin)
    assert plan.T_world_base[2, 3] == pytest.approx(plan.floor.height, abs=1e-9)
    given = robots.plan(twin, "part", "spot", config=FAST, floor=0.2)
    assert given.floor == Floor(0.2, "given")
    assert given.T_world_base[2, 3] == pytest.approx(0.2, abs=1e-9)
    report = robots.replay(twin, given, video=False)
    assert report.floor == given.floor
    assert report.to_json()["floor"] == {"height": 0.2, "source": "given"}


def test_files_carry_the_floor_and_earlier_ones_are_read(planned, tmp_path: Path) -> None:
    _, plan = planned
    path, _ = native.save(plan, tmp_path)
    assert native.load(path).floor == plan.floor
    document = json.loads(path.read_text())
    del document["floor"]
    path.write_text(json.dumps(document))
    assert native.load(path).floor is None
    for wrong in ({"height": 0.0}, {"height": None, "source": "seen"}, {"height": 0.0, "source": "dreamt"}):
        path.write_text(json.dumps(document | {"floor": wrong}))
        with pytest.raises(InputError, match="does not hold a valid trajectory"):
            native.load(path)


def test_trials_say_that_the_floor_is_assumed(planned) -> None:
    twin, plan = planned
    report = run_trials(twin, plan, trials=1, workers=1)
    assert report.to_json()["floor"]["source"] == report.summary()["floor"]["source"] == "assumed"
    assert any("no floor" in line for line in report.assumed)


@pytest.mark.parametrize("floor", ["high", "nan", "1e999", ""])
def test_a_floor_that_is_no_height_is_refused_in_one_line(
    floor: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save(kitchen(), tmp_path / "twin")
    assert cli.run(["replay", str(tmp_path), "--floor", floor]) == 1
    err = capsys.readouterr().err
    assert "is no height" in err
    assert err.count("\n") == 1


def test_the_command_line_tells_an_assumed_floor_and_takes_a_given_one(
    planned, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robots.film.video.write_video", lambda *_a, **_k: False)
    save(kitchen(), tmp_path / "twin")
    told = {}
    for name, options in (("assumed", []), ("given", ["--floor", "-0.05"])):
        code = cli.run(["replay", str(tmp_path), *options, "--json"])
        told[name] = json.loads(capsys.readouterr().out)
        assert code == 0
        report = json.loads((tmp_path / "replay" / "franka" / "part" / "report.json").read_text())
        assert report["floor"]["source"] == told[name]["parts"]["part"]["floor"]["source"] == name
        section = json.loads(next((tmp_path / "report").glob("*replay*.json")).read_text())
        assert f"{name}, z" in json.dumps(section)
    assert any("shows no floor" in w for w in told["assumed"]["warnings"])
    assert not any("floor" in w for w in told["given"]["warnings"])
    native.save(planned[1], tmp_path / "replay" / "spot" / "part")
    assert (
        cli.run(
            [
                "trajectory",
                str(tmp_path),
                "--part",
                "part",
                "--format",
                "json",
                "-o",
                str(tmp_path / "out"),
                "--json",
                "--robot",
                "spot",
            ]
        )
        == 0
    )
    assert any("shows no floor" in w for w in json.loads(capsys.readouterr().out)["warnings"])
    handed = json.loads((tmp_path / "out" / "trajectory.json").read_text())
    assert handed["floor"]["source"] == "assumed"

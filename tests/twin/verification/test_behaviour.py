"""What behaves passes in every format; every planted fault turns exactly its own demand red."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.scenes.boards import Board, cabinet_twin, world_from_cabinet
from twin import geometry as geo
from twin.cli import main as cli
from twin.errors import InputError
from twin.exporters import FORMATS, Exported, export
from twin.joint import JointSigma
from twin.scene import Motion, Part, Quantity, Twin
from twin.storage import save
from twin.verification.behaviour import HAND, BehaviourReport, BehaviourRow, behave

CLOSED_OR_NOT = {"rest_m", "open", "close", "sweep_m", "energy", "demonstration_m"}


def with_part(twin: Twin, name: str, change: Callable[[Part], Part]) -> Twin:
    return replace(twin, parts=tuple(change(p) if p.name == name else p for p in twin.parts))


def with_joint(twin: Twin, name: str, **values: Any) -> Twin:
    return with_part(twin, name, lambda p: replace(p, joint=replace(p.joint, **values)))


def with_physics(twin: Twin, name: str, **values: float) -> Twin:
    quantities = {k: Quantity(v, "planted", (v, v)) for k, v in values.items()}

    def change(part: Part) -> Part:
        assert part.physics is not None
        return replace(part, physics=replace(part.physics, **quantities))

    return with_part(twin, name, change)


def red(report: BehaviourReport) -> dict[str, set[tuple[str, str]]]:
    """Format -> the (part, demand) that failed."""
    return {f: {(r.part, r.quantity) for r in report.failures if r.format == f} for f in FORMATS}


@pytest.fixture(scope="module")
def cabinet(tmp_path_factory: pytest.TempPathFactory) -> tuple[Twin, Exported]:
    """The flap was moved last: it is judged on the open door."""
    twin = cabinet_twin(nested=True, lid=True)
    twin = with_part(twin, "flap", lambda p: replace(p, motion=replace(p.motion, intervals=((50, 59),))))
    return twin, export(twin, tmp_path_factory.mktemp("behaviour"))


def test_the_cabinet_behaves_in_every_format(cabinet: tuple[Twin, Exported]) -> None:
    report = behave(*cabinet)
    assert report.warnings == ()
    assert report.failures == ()
    assert report.ok
    for fmt in FORMATS:
        for part, level in {"door": True, "drawer": True, "lid": False, "flap": False}.items():
            asked = {r.quantity for r in report.rows if (r.format, r.part) == (fmt, part)}
            assert asked == (CLOSED_OR_NOT | {"rest_half_open_m"} if level else CLOSED_OR_NOT)
    # the closed form is exact, so what the demonstration misses is the servo's lag and the formats' digits
    assert max(r.measured for r in report.rows if r.quantity == "demonstration_m") < 3e-4
    json.dumps(report.to_dict(), allow_nan=False)


def test_friction_short_limits_and_negative_damping_turn_their_own_rows_red(
    cabinet: tuple[Twin, Exported], tmp_path: Path
) -> None:
    twin, _ = cabinet
    # N m: more than the 2 of the pull, less than a hand has at the handle
    spoilt = with_physics(twin, "door", frictionloss=5.0)
    spoilt = with_joint(spoilt, "drawer", upper=0.27)  # shown to 0.30
    spoilt = with_physics(spoilt, "flap", damping=0.5)
    physics = spoilt.part("flap").physics
    assert physics is not None
    # no twin has it, but a writer might turn the sign
    object.__setattr__(physics, "damping", replace(physics.damping, value=-0.5, interval=(-0.5, -0.5)))
    report = behave(twin, export(spoilt, tmp_path))
    want = {("door", "open"), ("door", "close"), ("drawer", "demonstration_m"), ("flap", "energy")}
    assert red(report) == dict.fromkeys(FORMATS, want)
    clipped = [r for r in report.failures if r.part == "drawer"]
    assert [r.measured for r in clipped] == pytest.approx([0.03] * 3, abs=5e-4)
    forces = [float(r.explanation.split("at most ")[1].split()[0]) for r in clipped]
    assert max(forces) < HAND, "the servo meets the stop but does not keep pressing against it"
    assert not report.ok


def test_a_state_that_may_be_off_excuses_no_deviation_but_one_that_trembles_does(
    cabinet: tuple[Twin, Exported],
) -> None:
    """A drawer known to 5 cm is asked for what one known exactly is; a door whose states tremble by 0.6 deg
    can't be followed as near."""
    twin, exported = cabinet
    unsure = with_joint(twin, "drawer", sigma=JointSigma(0.1, None, 0.05))
    noise = np.random.default_rng(4).normal(0.0, 0.01, len(twin.part("door").motion.state))
    trembling = with_part(
        unsure, "door", lambda p: replace(p, motion=replace(p.motion, state=p.motion.state + noise))
    )
    limits = {r.part: r.limit for r in behave(trembling, exported).rows if r.quantity == "demonstration_m"}
    assert limits["drawer"] < 1.1 * 3.0 * twin.part("drawer").motion.residual  # its jerk is most of the tenth
    assert limits["door"] > 3.0 * limits["drawer"]


def test_a_demonstration_ends_where_the_range_does(
    cabinet: tuple[Twin, Exported],
) -> None:
    twin, exported = cabinet

    def kept_beyond(part: Part) -> Part:
        """At the end of its motion it stays 5 mm beyond its range, four times as long as it moved."""
        motion = part.motion
        n, step = 5 * len(motion.state), motion.times[1] - motion.times[0]
        state = np.r_[motion.state, np.full(n - len(motion.state), part.joint.upper + 0.005)]
        frames, times = motion.frames[0] + np.arange(n), motion.times[0] + step * np.arange(n)
        return replace(part, motion=replace(motion, frames=frames, times=times, state=state))

    report = behave(with_part(twin, "drawer", kept_beyond), exported)
    assert "drawer" not in {r.part for r in report.failures}


def test_an_obstacle_is_met_also_where_a_format_keeps_the_pair_apart(
    cabinet: tuple[Twin, Exported], tmp_path: Path
) -> None:
    twin = replace(cabinet[0], parts=tuple(p for p in cabinet[0].parts if p.name != "lid"))
    stop = Board((-0.1, -0.35, 0.65), (0.1, -0.32, 0.72)).box(world_from_cabinet())  # in front of the drawer
    into_door = Board((-0.15, -0.034, 0.05), (0.05, -0.018, 0.2)).box(world_from_cabinet())  # 3 mm deep
    spoilt = replace(twin, static=replace(twin.static, collision=(*twin.static.collision, stop)))
    spoilt = with_part(spoilt, "flap", lambda p: replace(p, collision=(into_door,)))
    exported = export(spoilt, tmp_path)
    parts = red(behave(twin, exported))
    met = {("drawer", "sweep_m"), ("flap", "sweep_m")}
    assert parts["mjcf"] == parts["usd"] == met
    # URDF can't keep the pair apart, so that the shapes of one give way, and export says whose
    assert parts["urdf"] == {("flap", "sweep_m")}
    assert any("'carcass' give way to 'drawer'" in w for w in exported.warnings if w.startswith("urdf: "))


def test_a_leaning_door_without_friction_does_not_rest(tmp_path: Path) -> None:
    """Its far corner sinks by 11 mm as it opens, below the cabinet: the floor of scene.xml has to be out of
    its way."""
    twin = cabinet_twin()
    door = twin.part("door")
    lean = geo.exp_so3(np.deg2rad(1.5) * geo.unit(world_from_cabinet()[:3, 0]))
    twin = with_joint(twin, "door", axis=lean @ door.joint.axis)
    free = with_physics(twin, "door", frictionloss=0.0)
    assert red(behave(twin, export(free, tmp_path, formats=("mjcf",))))["mjcf"] == {
        ("door", "slides_m"), ("door", "rest_half_open_m"),
    }  # fmt: skip


def test_a_part_that_was_opened_later_waits_behind_one_that_was_open(tmp_path: Path) -> None:
    """A drawer behind a door: judged with the door where the recording had it."""
    twin = cabinet_twin()
    behind = replace(
        twin.part("drawer"),
        collision=tuple(b.box(world_from_cabinet()) for b in [Board((-0.2, 0.02, 0.1), (0.2, 0.3, 0.3))]),
        motion=replace(twin.part("drawer").motion, intervals=((50, 59),)),
    )
    twin = replace(twin, parts=(twin.part("door"), behind))
    files = export(twin, tmp_path, formats=("urdf",))
    assert behave(twin, files).ok
    first = replace(behind, motion=replace(behind.motion, intervals=((0, 9),)))
    failed = behave(replace(twin, parts=(twin.part("door"), first)), files).failures
    assert {(r.part, r.quantity) for r in failed} >= {("drawer", "sweep_m"), ("drawer", "open")}


def test_a_simulation_that_breaks_down_or_a_file_that_cannot_be_read_is_told(
    cabinet: tuple[Twin, Exported], tmp_path: Path
) -> None:
    twin, _ = cabinet
    files = export(twin, tmp_path, formats=("mjcf", "urdf"))
    text = files["mjcf"].read_text()
    files["mjcf"].write_text(text.replace('name="lid_joint"', 'name="lid_joint" stiffness="1e9"'))
    files["urdf"].write_text("<robot>")
    report = behave(twin, files)
    broken = [r for r in report.failures if r.part == "lid" and r.quantity == "energy"]
    assert [(r.format, r.measured) for r in broken] == [("mjcf", math.inf)]
    assert [w.split(":")[0] for w in report.warnings] == ["urdf"]
    assert not report.ok
    assert json.dumps(report.to_dict(), allow_nan=False)
    (tmp_path / "gone.xml").unlink(missing_ok=True)
    with pytest.raises(InputError, match="does not exist"):
        behave(twin, {"mjcf": tmp_path / "gone.xml"})
    with pytest.raises(InputError, match="no exported file"):
        behave(twin, {})


def test_the_check_of_a_run_fails_by_its_behaviour(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    twin = with_physics(cabinet_twin(), "door", frictionloss=5.0)
    never_seen = replace(twin.part("drawer"), motion=Motion(np.zeros(0), np.zeros(0), np.zeros(0)))
    twin = replace(twin, parts=(twin.part("door"), never_seen))
    save(twin, tmp_path / "twin")
    export(twin, tmp_path / "export", formats=("mjcf",))
    assert cli.run(["check", str(tmp_path), "--format", "mjcf", "--json"]) == 2
    told = json.loads(capsys.readouterr().out)
    assert all(r["ok"] for r in told["agreement"]["rows"]), "the file says what the twin says"
    behaviour = told["behaviour"]["rows"]
    assert {(r["part"], r["quantity"]) for r in behaviour if not r["ok"]} == {
        ("door", "open"),
        ("door", "close"),
    }
    assert "demonstration_m" not in {r["quantity"] for r in behaviour if r["part"] == "drawer"}, (
        "none was recorded"
    )


def test_a_row_is_met_up_to_its_limit() -> None:
    row = BehaviourRow("mjcf", "door", "rest_m", 1e-3, 1e-3, "")
    assert row.ok
    assert not replace(row, measured=1.001e-3).ok
    assert not BehaviourReport((row,), ("urdf: can't be simulated",)).ok

"""Catches: closed forms of what MuJoCo does with one, what other formats say of it, and how it follows rests
and the check."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from tests.makers.twin.rested import by_law, cabinet, leaning, left_at, only
from twin.errors import InputError
from twin.exporters import export
from twin.physics import rests, with_known, with_physics
from twin.physics.catches import AT_HANDLE, WIDEST, lever_of, set_catch, stated_catch, typical_catch
from twin.physics.edit import given, set_physics
from twin.physics.text import described
from twin.quantities import Catch, Quantity
from twin.scene import Part, Prismatic, Twin
from twin.storage import load, save, update
from twin.verification.behaviour import behave
from twin.verification.rest import hold
from twin.verification.rested import rested

UNIT = {"door": "N m", "drawer": "N"}


def caught(twin: Twin, name: str, force: float, width: float) -> Twin:
    """The twin with a catch on one part."""
    numbers = (Quantity(v, "measured: closed form", (v, v)) for v in (force, width))
    return set_catch(twin, name, Catch(*numbers)).twin


def weighing(part: Part, times: float) -> Part:
    """The part so many times heavier."""
    assert part.inertial is not None
    mass = part.inertial.mass
    return replace(
        part, inertial=part.inertial.with_mass(Quantity(times * mass.value, mass.source, (0.0, 1e4)))
    )


class Simulated:
    """A part of an exported MJCF, as it is but for gravity."""

    def __init__(self, twin: Twin, name: str, folder: Path) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(export(twin, folder, ["mjcf"])["mjcf"]))
        self.model.opt.gravity[:] = 0.0
        self.joint = self.model.joint(f"{name}_joint").id
        self.dof, self.at = self.model.jnt_dofadr[self.joint], self.model.jnt_qposadr[self.joint]

    def pulled(
        self, force: float, seconds: float, start: float = 0.0, until: float = np.inf
    ) -> tuple[float, float]:
        """State after `seconds` of a steady pull, or where it passes `until`, and the speed there."""
        data = mujoco.MjData(self.model)
        data.qpos[self.at] = start
        data.qfrc_applied[self.dof] = force
        while data.time < seconds and data.qpos[self.at] < until:
            mujoco.mj_step(self.model, data)
        return float(data.qpos[self.at]), float(data.qvel[self.dof])

    def opens_at(self, guess: float, width: float) -> float:
        """Least steady pull, within an eightieth of `guess`, that takes the closed part past its catch in 5
        s."""
        held, gone = 0.5 * guess, 2.0 * guess
        while gone - held > guess / 80:
            middle = (held + gone) / 2
            opened = self.pulled(middle, 5.0, until=width)[0] >= width
            held, gone = (held, middle) if opened else (middle, gone)
        return gone

    def hold_at(self, state: float, most: float) -> float:
        """Greatest pull up to `most` under which the part, at rest at a state and without friction, does not
        begin to open."""
        loss, least = self.model.dof_frictionloss.copy(), 0.0
        self.model.dof_frictionloss[:] = 0.0
        for _ in range(20):
            data, middle = mujoco.MjData(self.model), (least + most) / 2
            data.qpos[self.at], data.qfrc_applied[self.dof] = state, middle
            mujoco.mj_forward(self.model, data)
            least, most = (least, middle) if data.qacc[self.dof] > 0 else (middle, most)
        self.model.dof_frictionloss[:] = loss
        return least


@pytest.mark.parametrize(
    ("name", "force", "width", "times"),
    [
        ("door", 7.2, 0.05, 1.0),
        ("door", 2.5, 0.37, 1.0),
        ("door", 20.0, 0.59, 1.0),
        ("door", 7.2, 0.05, 0.02),
        ("door", 7.2, 0.05, 10.0),
        ("drawer", 15.0, 0.01, 1.0),
        ("drawer", 60.0, 0.03, 0.05),
    ],
)  # fmt: skip
def test_it_opens_at_the_stated_force_and_beyond_its_width_friction_is_all(
    tmp_path: Path, name: str, force: float, width: float, times: float
) -> None:
    bare = only(cabinet(), name)
    bare = by_law(replace(bare, parts=tuple(weighing(p, times) for p in bare.parts)))
    part = Simulated(caught(bare, name, force, width), name, tmp_path / "with")
    physics = bare.part(name).physics
    assert physics is not None
    friction = physics.frictionloss.value
    assert part.opens_at(force + friction, width) == pytest.approx(force + friction, rel=0.05)
    state, _ = part.pulled(0.95 * force, 10.0)
    assert abs(state) < (1e-3 if name == "drawer" else 1e-3 / 0.6), "held within a millimetre for 10 s"
    state, _ = part.pulled(1.05 * (force + friction), 60.0, until=width)
    assert state >= width, "let go"
    for share in (0.1, 0.5, 0.9):
        assert part.hold_at(share * width, 3 * force) == pytest.approx(force, rel=0.05), "all over its width"
    for share in (1.01, 1.2):
        assert part.hold_at(share * width, 3 * force) == pytest.approx(0.0, abs=1e-4)
    free = Simulated(bare, name, tmp_path / "without")
    beyond = 1.05 * width
    want = free.pulled(3 * friction, 0.3, beyond)
    assert part.pulled(3 * friction, 0.3, beyond) == pytest.approx(want, abs=1e-9), "as if there were none"
    shut, speed = part.pulled(0.0, 20.0, 0.9 * width)
    assert shut == pytest.approx(0.0, abs=1e-4), "pulled shut from within"
    assert abs(speed) < 1e-6, "and quiet"


@pytest.fixture(scope="module")
def filled() -> Twin:
    return by_law(cabinet_twin(nested=True))


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_a_catch_that_was_taken_away_leaves_no_byte(filled: Twin, tmp_path: Path) -> None:
    save(filled, tmp_path / "twin")
    before = (tmp_path / "twin" / "twin.json").read_bytes()
    assert b"catch" not in before
    with_one = caught(filled, "door", 7.2, 0.05)
    update(filled, with_one, tmp_path / "twin")
    read = load(tmp_path / "twin")
    assert read.part("door").physics == with_one.part("door").physics
    told = json.loads((tmp_path / "twin" / "twin.json").read_text())
    door = next(p for p in told["parts"] if p["name"] == "door")
    assert door["physics"]["catch"]["force"] == {
        "value": 7.2,
        "source": "measured: closed form",
        "interval": [7.2, 7.2],
    }
    assert read.extra == {}
    assert not read.part("door").extra
    without = set_catch(read, "door", None)
    assert [(c.name, c.after) for c in without.changes] == [("catch", "none"), ("catch width", "none")]
    update(read, without.twin, tmp_path / "twin")
    assert (tmp_path / "twin" / "twin.json").read_bytes() == before
    export(filled, tmp_path / "plain")
    export(without.twin, tmp_path / "again")
    assert files(tmp_path / "plain") == files(tmp_path / "again")


def test_other_edits_and_a_twin_made_again_keep_it(filled: Twin) -> None:
    twin = caught(filled, "door", 7.2, 0.05)
    door = twin.part("door")
    assert door.physics is not None
    heavier = set_physics(
        twin, "door", {"mass": given("mass", 9.0), "friction": given("friction", 0.3)}, "glass"
    )
    assert heavier.twin.part("door").physics.catch == door.physics.catch  # type: ignore[union-attr]
    again = with_physics(twin, renew=True).part("door").physics
    assert again is not None
    assert again.catch == door.physics.catch
    assert again.frictionloss.origin == "default"
    fresh = with_known(filled.part("door"), door)
    assert fresh.physics == door.physics
    assert {k: v for k, v, _ in described(door)}["catch"] == "7.2 N m (7.2 to 7.2)"
    assert {k: v for k, v, _ in described(door)}["catch width"] == "2.86 deg (2.86 to 2.86)"
    assert "catch 7.2" in repr(door.physics)


def test_what_cannot_simulate_it_says_so(filled: Twin, tmp_path: Path) -> None:
    from pxr import Usd, UsdPhysics

    told = export(caught(filled, "door", 7.2, 0.05), tmp_path)
    lost = [w for w in told.warnings if "a catch holds 7.2 N m within 0.05 rad" in w]
    assert [w.partition(":")[0] for w in lost] == ["urdf", "usd"]
    assert "<!-- not simulated, URDF has no word for it: a catch holds 7.2 N m" in told["urdf"].read_text()
    stage = Usd.Stage.Open(str(told["usd"]))
    joints = [p for p in stage.Traverse() if p.IsA(UsdPhysics.Joint) and p.GetName() == "door_joint"]
    assert joints[0].GetCustomDataByKey("catch") == {
        "force": 7.2,
        "width": 0.05,
        "source": "measured: closed form",
    }
    for path in told.values():
        assert (
            json.loads((path.parent / "asset.json").read_text())["catches"]["door"]["force"]["value"] == 7.2
        )
        assert "a catch holds 7.2 N m" in (path.parent / "README.md").read_text()


def test_the_check_states_pull_and_hold_and_asks_mjcf_alone_for_it(tmp_path: Path) -> None:
    twin = caught(only(by_law(cabinet()), "door"), "door", 7.2, 0.05)
    report = behave(twin, export(twin, tmp_path))
    assert report.ok, report.failures
    rows = {(r.format, r.quantity): r for r in report.rows}
    assert {f for f, q in rows if q.startswith("catch_")} == {"mjcf"}
    assert "a catch of 7.2 N m and friction of" in rows["mjcf", "catch_holds_m"].explanation
    assert "a catch 7.2 N m against being opened" in rows["mjcf", "rest_m"].explanation
    assert "without its catch" in rows["urdf", "rest_m"].explanation
    assert "opened by 9.56 N m" in rows["mjcf", "open"].explanation, "2 N m and 1.05 times the catch"
    weaker = export(caught(twin, "door", 3.0, 0.05), tmp_path / "weaker", ["mjcf"])
    assert {r.quantity for r in behave(twin, weaker).failures} == {"catch_holds_m"}
    stronger = export(caught(twin, "door", 12.0, 0.05), tmp_path / "stronger", ["mjcf"])
    assert "catch_lets_go" in {r.quantity for r in behave(twin, stronger).failures}


def test_a_part_that_rested_closed_by_its_catch_needs_no_more_friction(tmp_path: Path) -> None:
    """A drawer that leans out by 3 degrees rolls open by itself; it was closed for a second with no hand in
    view, and put back."""
    out = leaning(only(cabinet(), "drawer"), "drawer", np.deg2rad(3.0), np.array([1.0, 0.0, 0.0]))
    twin = with_physics(left_at(out, "drawer", 0.0, start=0.0))
    pull = hold(twin, twin.part("drawer"), 0.0).pull
    assert pull > 0
    physics = twin.part("drawer").physics
    assert physics is not None
    assert physics.frictionloss.origin == "recording"
    assert physics.frictionloss.value == pytest.approx(1.1 * pull)
    edited = set_catch(twin, "drawer", stated_catch(twin.part("drawer"), f"{2 * pull}N", width="10mm"))
    new = edited.twin.part("drawer").physics
    assert new is not None
    assert new.frictionloss.origin == "default"
    held = hold(edited.twin, edited.twin.part("drawer"), 0.0)
    assert not held.moves
    assert held.caught == pytest.approx(2 * pull)
    assert hold(edited.twin, edited.twin.part("drawer"), 0.05).moves, "farther out it rolls"
    told = rested(edited.twin, edited.twin.part("drawer"))
    assert "as it rested at 0.000 m" in told.closed
    report = behave(edited.twin, export(edited.twin, tmp_path))
    assert report.ok, report.failures
    rows = {(r.format, r.quantity) for r in report.rows}
    assert ("mjcf", "rest_m") in rows
    assert ("urdf", "slides_m") in rows, "without the catch it opens by itself, and that is said"
    weak = set_catch(twin, "drawer", stated_catch(twin.part("drawer"), f"{0.5 * pull}N", width="10mm")).twin
    assert max(r.least for r in rests(weak, "drawer")) == pytest.approx(0.5 * pull), (
        "friction has to do the rest"
    )


def test_forces_at_the_handle_become_those_of_the_hinge(filled: Twin) -> None:
    door, drawer = filled.part("door"), filled.part("drawer")
    lever = lever_of(door)
    assert lever is not None
    assert lever > 0.2
    told = stated_catch(door, "24N")
    assert told.force.value == pytest.approx(24 * lever)
    assert told.force.origin == "user"
    assert told.force.interval == pytest.approx((0.8 * 24 * lever, 1.2 * 24 * lever))
    assert told.width.value == pytest.approx(AT_HANDLE / lever)
    assert told.width.origin == "default"
    own = stated_catch(door, "7.2 N m", ("7Nm", "8Nm"), "3deg", measured=True, note="gauge")
    assert (own.force.value, own.force.interval, own.force.source) == (7.2, (7.0, 8.0), "measured: gauge")
    assert own.width.value == pytest.approx(np.deg2rad(3.0))
    assert stated_catch(door, "7.2", width="0.05").width.value == 0.05
    assert stated_catch(door, "7.2", width="15mm").width.value == pytest.approx(0.015 / lever)
    assert stated_catch(drawer, "15N", width="8mm").width.value == pytest.approx(0.008)
    assert typical_catch(door).force.origin == "typical"
    assert "benchmarks/door_forces.md" in typical_catch(door).force.source


@pytest.mark.parametrize(
    ("name", "force", "width", "said"),
    [
        ("door", "24kg", None, "give a number and N, kN, Nm"),
        ("door", "strong", None, "not understood"),
        ("door", "0N", None, "must be positive"),
        ("door", "-3", None, "must be positive"),
        ("door", "nan", None, "not understood"),
        ("door", "1e400N", None, "must be positive"),
        ("drawer", "7Nm", None, "give a number and N, kN"),
        ("drawer", "15N", "3deg", "give a number and m, cm, mm"),
        ("drawer", "15N", "0.3", "give a --width below that"),
        ("door", "7Nm", "50deg", "give a --width below that"),
    ],
)
def test_what_a_joint_cannot_have_is_refused_in_one_line(
    filled: Twin, name: str, force: str, width: str | None, said: str
) -> None:
    with pytest.raises(InputError) as e:
        set_catch(filled, name, stated_catch(filled.part(name), force, width=width))
    assert said in str(e.value)
    assert "\n" not in str(e.value)


def test_a_part_without_a_handle_or_with_two_ways_to_go_is_asked_for_more(filled: Twin) -> None:
    bare: Any = replace(filled.part("door"), contact=None)
    with pytest.raises(InputError, match="give it in Nm"):
        stated_catch(bare, "24N")
    with pytest.raises(InputError, match="give --width"):
        stated_catch(bare, "7.2Nm")
    both = replace(filled.part("drawer"), joint=Prismatic(filled.part("drawer").joint.axis, -0.1, 0.4))
    twin = replace(filled, parts=tuple(both if p.id == both.id else p for p in filled.parts))
    with pytest.raises(InputError, match="the other way"):
        set_catch(twin, "drawer", stated_catch(both, "15N"))
    with pytest.raises(InputError, match="ever measured"):
        typical_catch(filled.part("drawer"))
    assert typical_catch(filled.part("door")).width.value < WIDEST["revolute"]

"""An error is surely wrong; what an author may mean is a warning."""

from __future__ import annotations

from pathlib import Path

import pytest

from twin.lint import lint


def scene(folder: Path, joint: str, inside: str, around: str = "", option: str = "") -> Path:
    """A slide along x with a box of 10 cm at the origin."""
    path = folder / "scene.xml"
    path.write_text(
        f"""<mujoco><compiler angle="radian"/><option {option}/><worldbody>{around}<body name="part"><joint name="j" {joint}/>
        <inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.01"/>{inside}</body></worldbody></mujoco>"""
    )
    return path


SLIDE = 'type="slide" axis="1 0 0" range="0 0.4"'
BOX = '<geom type="box" size=".05 .05 .05"/>'


def found(path: Path) -> list[tuple[str, str]]:
    return [(f.rule, f.severity) for f in lint([path]).findings]


@pytest.mark.parametrize("free", [0.1, 0.38], ids=["a latch", "a stop with slack"])
def test_a_way_that_shapes_cut_off_is_a_warning(free: float, tmp_path: Path) -> None:
    wall = f'<geom type="box" size=".05 .2 .2" pos="{free + 0.1} 0 0"/>'
    (finding,) = lint([scene(tmp_path, f'{SLIDE} frictionloss="1"', BOX, wall)]).findings
    assert (finding.rule, finding.severity) == ("limit-unreachable", "warning")
    assert "shapes in its way" in finding.remedy


@pytest.mark.parametrize("resists", ['frictionloss="15"', 'damping="5000" frictionloss="1"'])
def test_a_stiff_joint_is_a_warning_that_names_friction_and_damping(resists: str, tmp_path: Path) -> None:
    (finding,) = lint([scene(tmp_path, f"{SLIDE} {resists}", BOX)]).findings
    assert (finding.rule, finding.severity) == ("limit-unreachable", "warning")
    assert "friction, damping" in finding.remedy


def test_a_part_that_its_weight_moves_is_a_warning(tmp_path: Path) -> None:
    path = scene(tmp_path, 'type="slide" axis="0 0 -1" range="0 0.4"', BOX)
    assert found(path) == [("drift-at-rest", "warning")]


def test_a_moving_mark_without_a_collider_is_a_warning(tmp_path: Path) -> None:
    path = scene(tmp_path, f'{SLIDE} frictionloss="1"', BOX.replace("/>", ' contype="0" conaffinity="0"/>'))
    assert found(path) == [("collider-missing", "warning")]


@pytest.mark.parametrize(("beside", "severity"), [(0.01, ""), (0.1, "warning"), (0.3, "error")])
def test_a_hinge_beside_its_part_is_an_error_beyond_the_part_s_size(
    beside: float, severity: str, tmp_path: Path
) -> None:
    joint = f'type="hinge" axis="0 0 1" range="0 1.5" frictionloss="0.1" pos="{-0.05 - beside} 0 0"'
    found = lint([scene(tmp_path, joint, BOX)], ignore=["limit-unreachable", "drift-at-rest"]).findings
    assert [(f.rule, f.severity) for f in found] == [("pivot-off-part", severity)] * (beside > 0.05)


def test_a_part_whose_geoms_are_in_groups_that_weigh_nothing_has_no_mass(tmp_path: Path) -> None:
    """MuJoCo's own reason, "larger than mjMINVAL", names neither the groups nor what to do."""
    path = tmp_path / "door.xml"
    path.write_text(
        """<mujoco><compiler inertiagrouprange="4 5"/><worldbody><body name="door"><joint axis="0 0 1" range="0 90"/>
        <geom type="box" size=".3 .01 .3" mass="2"/></body></worldbody></mujoco>"""
    )
    (finding,) = lint([path]).findings
    assert (finding.rule, finding.severity) == ("mass-missing", "error")
    assert "inertiagrouprange" in finding.problem


def test_geoms_outside_of_the_groups_that_weigh_leave_a_stated_mass_as_it_is(tmp_path: Path) -> None:
    """Visuals have MuJoCo's default density, which counts for nothing there."""
    path = tmp_path / "door.xml"
    path.write_text(
        """<mujoco><compiler inertiagrouprange="4 5"/><worldbody><body name="door">
        <joint axis="0 0 1" range="0 90" frictionloss="0.1"/>
        <geom type="box" size=".3 .01 .3" contype="0" conaffinity="0" group="1"/>
        <geom type="box" size=".3 .01 .3" mass="2" group="4"/></body></worldbody></mujoco>"""
    )
    assert lint([path]).findings == ()

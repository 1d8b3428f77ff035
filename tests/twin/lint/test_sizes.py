"""Lengths in wrong units, and bodies that are drawn elsewhere than they collide."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from twin.lint import Finding, lint, read
from twin.lint.rules import RULES

STILL = [name for name, rule in RULES.items() if rule.simulates]
SIDES = (0.4, 0.02, 0.7)
PANEL = f'<box size="{SIDES[0]} {SIDES[1]} {SIDES[2]}"/>'
MASS = '<inertial><mass value="3"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
Turn = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
TURNS: dict[str, Turn] = {
    "z": np.eye(3),
    "y": np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]),
}  # which axis is up


def urdf(
    folder: Path, visual: str = PANEL, collision: str = PANEL, joint: str = "revolute", upper: float = 1.5, at: str = "0 0 0"
) -> Path:  # fmt: skip
    """A door whose panel's middle is in the axis, its collider at `at`."""
    solid = (
        f'<collision><origin xyz="{at}"/><geometry>{collision}</geometry></collision>' if collision else ""
    )
    path = folder / "door.urdf"
    path.write_text(
        f"""<robot name="r"><link name="base"/><link name="door">{MASS}<visual><geometry>{visual}</geometry></visual>{solid}</link>
        <joint name="j" type="{joint}"><parent link="base"/><child link="door"/><axis xyz="0 0 1"/>
        <limit lower="0" upper="{upper}" effort="1" velocity="1"/></joint></robot>"""
    )
    return path


def found(path: Path) -> list[tuple[str, str]]:
    return [(f.rule, f.severity) for f in lint([path], ignore=STILL).findings]


def mesh_of(folder: Path, name: str, turn: Turn = TURNS["z"], scale: float = 1, asset: str = "") -> str:
    """The panel as a mesh file, z up unless turned; `asset` are COLLADA's elements for unit and axis."""
    made = trimesh.creation.box(extents=SIDES)
    made.vertices = scale * made.vertices @ turn.T
    made.export(folder / name)
    if asset:
        text = (folder / name).read_text()
        (folder / name).write_text(re.sub("<up_axis>.*?</up_axis>", asset, text))
        assert asset in (folder / name).read_text()
    return f'<mesh filename="{name}"/>'


@pytest.mark.parametrize(
    ("joint", "upper", "expected"),
    [
        ("revolute", 0.007, True),  # 0.4 rad, taken for degrees and converted
        ("revolute", np.deg2rad(np.deg2rad(90)), True),
        ("revolute", np.deg2rad(8), False),  # a rocker switch
        ("prismatic", 0.0004, True),  # 400 mm, divided twice
        ("prismatic", 0.002, False),  # a key of a keyboard
    ],
)
def test_limits_that_were_converted_twice_are_an_error(
    joint: str, upper: float, expected: bool, tmp_path: Path
) -> None:
    assert found(urdf(tmp_path, joint=joint, upper=upper)) == [("limits-small", "error")] * expected


@pytest.mark.parametrize(
    ("scale", "severity"),
    [(1000.0, "error"), (10.0, "warning"), (1.0, ""), (0.005, "warning"), (0.0005, "error")],
)
def test_a_part_of_another_unit_is_noticed_in_urdf(scale: float, severity: str, tmp_path: Path) -> None:
    """A mesh in millimetres that is read in metres: a door of 400 m."""
    mesh = mesh_of(tmp_path, "door.obj", scale=scale)
    assert found(urdf(tmp_path, mesh, mesh)) == [("part-size", severity)] * bool(severity)


def test_a_helper_between_two_joints_may_be_small(tmp_path: Path) -> None:
    text = """<mujoco><worldbody><body><joint axis="0 0 1"/><geom size=".001" mass=".1"/>
        <body><joint axis="1 0 0"/><geom size=".1" mass="1"/></body></body></worldbody></mujoco>"""
    (tmp_path / "a.xml").write_text(text)
    assert found(tmp_path / "a.xml") == []


def only(path: Path) -> Finding:
    (finding,) = lint([path], ignore=STILL).findings
    assert finding.rule == "collider-elsewhere"
    return finding


def test_a_visual_that_lies_while_its_collider_stands_is_an_error(tmp_path: Path) -> None:
    finding = only(urdf(tmp_path, mesh_of(tmp_path, "door.obj", TURNS["y"])))
    assert finding.severity == "error"
    assert "across its collider" in finding.problem


@pytest.mark.parametrize(("name", "asset"), [("door.glb", ""), ("door.dae", "<up_axis>Y_UP</up_axis>")])
@pytest.mark.parametrize(("up", "way"), [("y", "turned from y up to z up"), ("z", "as its numbers are")])
def test_a_mesh_that_counts_y_upwards_fits_in_some_readers_only(
    name: str, asset: str, up: str, way: str, tmp_path: Path
) -> None:
    finding = only(urdf(tmp_path, mesh_of(tmp_path, name, TURNS[up], asset=asset)))
    assert finding.severity == "warning"
    assert f"only {way}" in finding.problem


def test_a_collada_file_that_counts_z_upwards_is_read_as_it_is(tmp_path: Path) -> None:
    assert found(urdf(tmp_path, mesh_of(tmp_path, "door.dae", asset="<up_axis>Z_UP</up_axis>"))) == []


def test_a_collada_file_in_millimetres_has_the_size_that_it_states(tmp_path: Path) -> None:
    asset = '<unit name="millimeter" meter="0.001"/><up_axis>Z_UP</up_axis>'
    assert found(urdf(tmp_path, mesh_of(tmp_path, "door.dae", scale=1000, asset=asset))) == []


def test_a_visual_in_other_units_than_its_collider_is_an_error(tmp_path: Path) -> None:
    finding = only(urdf(tmp_path, mesh_of(tmp_path, "door.obj", scale=1e-3)))
    assert finding.severity == "error"
    assert "0.001 times the size" in finding.problem


@pytest.mark.parametrize("at", ["0.4 0 0", "2 0 0", "0 0.2 0"])
def test_a_visual_beside_its_collider_is_told(at: str, tmp_path: Path) -> None:
    """The first is a door that was mirrored about its hinge."""
    assert only(urdf(tmp_path, at=at)).severity == "warning"


@pytest.mark.parametrize(
    ("collision", "at"),
    [
        (PANEL, "0 0.02 0"),  # behind the panel
        ('<box size="0.02 0.05 0.15"/>', "0.15 -0.03 0"),  # its bar alone
        ('<box size="0.36 0.3 0.6"/>', "0 0.16 0"),  # the drawer behind its front
        ('<sphere radius="0.001"/>', "0 0 0"),
        ('<sphere radius="0.2"/>', "0 0 0.2"),
        ('<cylinder radius="0.3" length="0.7"/>', "0 0 0"),
        ('<box size="0.4 0.06 0.7"/>', "0 0.02 0"),  # with what stands out of it
        ("", ""),
    ],
)
def test_a_collider_may_be_a_part_of_its_body_or_simpler(collision: str, at: str, tmp_path: Path) -> None:
    assert [
        f for f in found(urdf(tmp_path, collision=collision, at=at)) if f[0] == "collider-elsewhere"
    ] == []


def test_a_capsule_spans_its_round_ends_and_is_told_to_be_no_urdf(tmp_path: Path) -> None:
    """Its length is that of the cylinder, as MuJoCo, PyBullet and the import take it."""
    path = urdf(tmp_path, collision='<capsule radius="0.05" length="0.6"/>')
    (shape,) = (s for s in read(path).shapes if s.role == "collision")
    assert shape.points is not None
    assert np.ptp(shape.points, axis=0) == pytest.approx([0.1, 0.1, 0.7])
    assert found(path) == [("shape-unknown", "warning")]


@pytest.mark.parametrize("shape", ['<cone radius="0.1" length="0.1"/>', ""])
def test_a_shape_that_no_reader_knows_is_an_error(shape: str, tmp_path: Path) -> None:
    assert found(urdf(tmp_path, visual=shape)) == [("shape-unknown", "error")]

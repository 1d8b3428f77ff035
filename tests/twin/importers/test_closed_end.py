"""Where a joint of a file is closed: the user's word, a keyframe, the end near the rest pose, else rest."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import twin
from tests.makers.twin.scene_texts import board, carcass
from twin.cli import main as cli
from twin.importers.source import Closed
from twin.scene import Part

# A box drawer, flush in its carcass and 2 mm before the carcass' back, that opens along -y.
DEPTH, GAP = 0.4, 0.002


def _drawer(low: float, high: float, opens: float = -1.0, after: str = "") -> str:
    """A carcass with a drawer whose slide has a range and opens along `opens` times y."""
    back = DEPTH - 0.003 - GAP
    boards = [
        board((0.022, 0, 0.022), (0.578, 0.018, 0.278)),
        board((0.022, back - 0.01, 0.022), (0.578, back, 0.2)),
        board((0.022, 0, 0.022), (0.578, back, 0.03)),
    ]
    joint = f'<joint name="slide" type="slide" axis="0 {-opens} 0" range="{low} {high}" limited="true"/>'
    body = f'<body name="drawer">{joint}{"".join(boards)}</body>'
    return f"<mujoco><worldbody>{carcass(DEPTH)}{body}</worldbody>{after}</mujoco>"


def _read(path: Path, text: str, **options: Mapping[str, Closed]) -> tuple[Part, list[str]]:
    path.write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        (part,) = twin.from_mjcf(path, **options).parts  # type: ignore[arg-type]
    return part, [str(w.message) for w in caught if "joint 'slide' is closed" in str(w.message)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("slack", [0.005, 0.01])
def test_an_end_that_would_push_a_drawer_into_the_carcass_is_not_closed(
    sign: float, slack: float, tmp_path: Path
) -> None:
    """The ranges -0.16..0.01 and -0.005..0.16 of other people's cabinets, whose rest pose is 0."""
    low, high = sorted([-0.16 * sign, slack * sign])
    part, (told,) = _read(tmp_path / "drawer.xml", _drawer(low, high, -sign))
    assert np.allclose(part.joint.axis, [0, -1, 0])
    assert (part.joint.lower, part.joint.upper) == (0.0, pytest.approx(0.16))
    assert part.mesh.vertices[:, 1].min() == pytest.approx(0.0, abs=1e-9)
    assert f"from 0 to {slack * sign:g} is cut off" in told
    assert "mm or more inside others" in told
    assert "--closed slide=" in told
    assert "cut off" in part.limits_source


def test_an_end_that_keeps_clear_is_closed_and_nothing_is_told(tmp_path: Path) -> None:
    """A drawer that the file has 1.5 mm open, and 2 mm of room behind it."""
    part, told = _read(tmp_path / "drawer.xml", _drawer(-0.16, 0.0015))
    assert told == []
    assert part.joint.upper == pytest.approx(0.1615)
    assert part.mesh.vertices[:, 1].min() == pytest.approx(0.0015)
    assert "next to its rest pose" in part.closed_source


@pytest.mark.parametrize(("low", "high"), [(-1.5, 1.5), (-0.5, 1.0), (-1.0, 0.5)])
def test_a_range_that_does_not_tell_leaves_closed_at_rest_and_asks_for_the_option(
    low: float, high: float, tmp_path: Path
) -> None:
    """Faucets and dials turn to both sides; no end of them is more closed."""
    part, (told,) = _read(tmp_path / "drawer.xml", _drawer(low, high))
    assert (-part.joint.lower, part.joint.upper) == pytest.approx(sorted([-low, high]))
    assert part.mesh.vertices[:, 1].min() == pytest.approx(0.0, abs=1e-9)
    assert "--closed slide=lower|upper|NUMBER" in told
    part, told_then = _read(tmp_path / "drawer.xml", _drawer(low, high), closed={"slide": "lower"})
    assert told_then == []
    assert (part.joint.lower, part.joint.upper) == (0.0, pytest.approx(high - low))


@pytest.mark.parametrize(("low", "high"), [(-0.16, 0.01), (-0.01, 0.16)])
def test_closed_at_a_number_opens_the_longer_way(low: float, high: float, tmp_path: Path) -> None:
    """Opening is positive whatever the sign in the file; what lies behind closed is cut, unless the user says
    the range."""
    text = _drawer(low, high, -1.0 if high < 0.1 else 1.0)
    part, (told,) = _read(tmp_path / "drawer.xml", text, closed={"slide": 0.0})
    assert (part.joint.lower, part.joint.upper) == (0.0, pytest.approx(0.16))
    assert np.allclose(part.joint.axis, [0, -1, 0])
    assert "cut off" in told
    part, (told,) = _read(tmp_path / "drawer.xml", text, closed={"slide": 0.0}, limits={"slide": (low, high)})
    assert (part.joint.lower, part.joint.upper) == (pytest.approx(-0.01), pytest.approx(0.16))
    assert "both sides" in told


@pytest.mark.parametrize("name", ["closed", "CLOSED", "slide_closed", "drawer closed"])
def test_a_keyframe_named_closed_goes_before_the_range(name: str, tmp_path: Path) -> None:
    key = f'<keyframe><key name="{name}" qpos="-0.16"/></keyframe>'
    part, told = _read(tmp_path / "drawer.xml", _drawer(-0.16, 0.01, after=key))
    assert told == []
    assert np.allclose(part.joint.axis, [0, 1, 0])
    assert (part.joint.lower, part.joint.upper) == (0.0, pytest.approx(0.17))
    assert "keyframe" in part.closed_source


@pytest.mark.parametrize("name", ["half", "robot_closed", "closet", "door_open"])
def test_a_keyframe_that_does_not_speak_of_the_joint_says_nothing(name: str, tmp_path: Path) -> None:
    key = f'<keyframe><key name="{name}" qpos="-0.16"/></keyframe>'
    part, _ = _read(tmp_path / "drawer.xml", _drawer(-0.16, 0.0, after=key))
    assert np.allclose(part.joint.axis, [0, -1, 0])
    assert "rest pose" in part.closed_source


def test_a_keyframe_named_open_says_which_way_a_joint_opens(tmp_path: Path) -> None:
    """Of a symmetric range, where the rest pose tells nothing; one that leaves the joint at rest is
    silent."""
    key = '<keyframe><key name="open" qpos="{}"/></keyframe>'
    part, _ = _read(tmp_path / "drawer.xml", _drawer(-0.3, 0.3, after=key.format(-0.2)))
    assert np.allclose(part.joint.axis, [0, -1, 0])
    part, (told,) = _read(tmp_path / "drawer.xml", _drawer(-0.3, 0.3, after=key.format(0.001)))
    assert "not known" in told
    both = '<keyframe><key name="open" qpos="-0.2"/><key name="closed" qpos="0.005"/></keyframe>'
    part, (told,) = _read(tmp_path / "drawer.xml", _drawer(-0.2, 0.02, after=both))
    assert part.joint.upper == pytest.approx(0.205)
    assert "from 0.005 to 0.02 is cut off" in told


def test_a_rest_pose_outside_the_range_is_clamped_to_it(tmp_path: Path) -> None:
    part, told = _read(tmp_path / "drawer.xml", _drawer(-0.5, -0.1))
    assert told == []
    assert part.joint.upper == pytest.approx(0.4)
    assert part.mesh.vertices[:, 1].min() == pytest.approx(-0.1)
    assert np.allclose(part.joint.axis, [0, -1, 0])


def test_the_command_line_tells_where_parts_are_closed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "drawer.xml"
    path.write_text(_drawer(-0.16, 0.01))
    assert cli.run(["import", str(path), "-o", str(tmp_path / "run"), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert any("joint 'slide' is closed at 0" in w for w in answer["warnings"])
    assert answer["closed"] == {"drawer": "the rest pose of drawer.xml"}


BASE = '<geom type="box" size=".15 .1 .01" pos="0 0 -.01"/>'
LID = '<geom type="box" size=".15 .1 .004" pos="0 .1 .004"/>'


@pytest.mark.parametrize("turn", [0.0, 1.5708])
def test_a_lid_that_rests_open_at_an_end_of_its_range_is_doubted(turn: float, tmp_path: Path) -> None:
    """Metaworld's laptop: its rest pose is an exact end of the range, and the other end shuts it."""
    hinge = '<joint name="slide" axis="1 0 0" range="{} {}" limited="true"/>'
    place = f'pos="0 -.1 0" euler="{turn} 0 0"'
    shut = f'<compiler angle="radian"/><worldbody><geom type="plane" size="1 1 .1" pos="0 0 -.02"/><body>{BASE}<body {place}>'
    ends = (0, 1.5) if turn == 0.0 else (-1.5, 0)
    text = f"<mujoco>{shut}{hinge.format(*ends)}{LID}</body></body></worldbody></mujoco>"
    part, told = _read(tmp_path / "lid.xml", text)
    assert (part.joint.lower, part.joint.upper) == (0.0, pytest.approx(1.5))
    assert [("of the room" in t and "--closed slide=" in t) for t in told] == ([True] if turn else [])
    _, told = _read(tmp_path / "lid.xml", text, closed={"slide": "lower"})
    assert told == []

"""Import tells what `twin lint` calls errors in the file's text, and refuses nothing for it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import twin
from tests.makers.twin.scene_texts import HINGE, LIMIT, mjcf, urdf
from twin.cli import main as cli

# robosuite's door: the file counts in degrees, its range is meant in radians.
DOOR = '<body name="door"><joint name="hinge" range="0 0.4" limited="true"/><geom type="box" size=".3 .01 .4"/></body>'


def test_a_door_of_a_few_thousandths_is_told_by_the_rule_for_units(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "door.xml"
    path.write_text(mjcf(DOOR))
    assert cli.run(["import", str(path), "-o", str(tmp_path / "run"), "--json"]) == 0
    (told,) = (w for w in json.loads(capsys.readouterr().out)["warnings"] if "lint" in w)
    assert "limits-unit" in told
    assert "joint 'hinge'" in told
    assert "look like radians" in told
    assert twin.load(tmp_path / "run").part("door").joint.upper == pytest.approx(0.00698, abs=1e-5)
    with pytest.warns(UserWarning, match="limits-unit"):
        twin.from_mjcf(path)


def test_errors_of_one_kind_are_one_line(tmp_path: Path) -> None:
    """A file without masses has as many errors as parts."""
    links = [f"c{k}" for k in range(6)]
    shape = '<visual><geometry><box size="0.4 0.02 0.6"/></geometry></visual>'
    joints = [
        HINGE.format("revolute", LIMIT).replace('"b"', f'"{n}"').replace('"j"', f'"j{n}"') for n in links
    ]
    path = tmp_path / "many.urdf"
    path.write_text(urdf("".join(joints), "".join(f'<link name="{n}">{shape}</link>' for n in links)))
    with pytest.warns(UserWarning, match="mass-missing: link 'c0' .*, link 'c2' .*, 3 more: ") as caught:
        assert len(twin.from_urdf(path).parts) == len(links)
    assert sum("mass-missing" in str(w.message) for w in caught) == 1

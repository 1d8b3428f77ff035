"""Two joints on one part, through a helper without a shape: merged where the helper has no range."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest

import twin
from tests.makers.twin.scene_texts import LIMIT, urdf
from twin.errors import InputError
from twin.scene import Prismatic


def _chain(above: str) -> str:
    """A slide with a range on a helper without a shape that hangs on another joint, as in PartNet."""
    helper = f'<joint name="turn" type="{above}"><parent link="a"/><child link="helper"/><axis xyz="0 0 1"/>{{}}</joint>'
    slide = (
        '<joint name="push" type="prismatic"><parent link="helper"/><child link="b"/><axis xyz="0 1 0"/>'
        '<limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>'
    )
    return urdf(helper + slide, '<link name="helper"/>')


@pytest.mark.parametrize("limit", ["", LIMIT.replace('upper="1"', 'upper="0"')])
def test_a_helper_without_shape_and_range_is_merged(limit: str, tmp_path: Path) -> None:
    path = tmp_path / "knob.urdf"
    path.write_text(_chain("revolute" if limit else "continuous").format(limit))
    with pytest.warns(UserWarning, match="joint 'turn' moves body 'helper'.*held at rest"):
        (part,) = twin.from_urdf(path).parts
    assert part.name == "b"
    assert part.parent is None
    assert isinstance(part.joint, Prismatic)
    assert part.joint.upper == pytest.approx(0.1)


def test_a_helper_with_a_range_is_refused_with_the_body_to_exclude(tmp_path: Path) -> None:
    path = tmp_path / "knob.urdf"
    path.write_text(_chain("revolute").format(LIMIT))
    with pytest.raises(InputError) as caught:
        twin.from_urdf(path)
    told = str(caught.value)
    assert "joint 'turn' moves body 'helper', which has no shape, and joint 'push' moves 'b' on it" in told
    assert "--exclude helper" in told
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        assert twin.from_urdf(path, exclude=["helper"]).parts == ()

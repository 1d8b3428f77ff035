"""What import refuses: the reason names element and remedy, and sends nobody to another verb for it."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import twin
from tests.makers.twin.scene_texts import HINGE, LIMIT, mjcf, urdf
from twin.errors import InputError

DOOR = '<body name="door"><joint name="hinge" range="0 90" limited="true"/><geom type="box" size=".3 .01 .4" group="{}"/></body>'
CAPSULE = '<{0}><geometry><capsule radius="0.02" length="0.2"/></geometry></{0}>'


def _refused(path: Path, text: str) -> str:
    path.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        with pytest.raises(InputError) as caught:
            (twin.from_mjcf if "<mujoco" in text else twin.from_urdf)(path)
    told = str(caught.value)
    assert "\n" not in told
    assert "twin lint" not in told
    return told


def test_a_body_without_mass_is_told_by_the_groups_that_leave_it_so(tmp_path: Path) -> None:
    """LIBERO's microwave: masses are taken from geoms of groups 4 to 5, and the door has none there."""
    text = mjcf(DOOR.format(1)).replace("<mujoco>", '<mujoco><compiler inertiagrouprange="4 5"/>')
    told = _refused(tmp_path / "microwave.xml", text)
    assert "mass and inertia of moving bodies" in told
    assert "Element name 'door'" in told
    assert 'inertiagrouprange="4 5"' in told
    assert "body 'door' has geoms in 1 alone" in told
    assert "<inertial>" in told


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (mjcf('<body name="door"><joint range="0 1"/></body>'), ["'door'", "its geoms a mass"]),
        (mjcf("", '<asset><mesh name="m" file="no.obj"/></asset>'), ["'no.obj'", "put the file there", "meshdir"]),
        (mjcf('<geom size="-1"/>'), ["size 0 must be positive", "correct what the message names"]),
        (mjcf("<region/>"), ["unrecognized element", "'region'"]),
    ],
)  # fmt: skip
def test_mujocos_reason_is_whole_and_has_a_remedy(text: str, words: list[str], tmp_path: Path) -> None:
    told = _refused(tmp_path / "scene.xml", text)
    for word in words:
        assert word in told


LINK = '<link name="c"><visual>\n<geometry>{}</geometry></visual></link>'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (urdf("", LINK.format("<cone/>")), ["<visual> (line 1) of link 'c'", "<capsule>", "has <cone>"]),
        (urdf("", LINK.format("")), ["<visual> (line 1) of link 'c'", "and has none"]),
        (urdf("", LINK.format('<cylinder length="1"/>')), ["<cylinder> (line 2)", "'radius'"]),
        (urdf("", LINK.format("<mesh/>")), ["<mesh> (line 2)", "'filename'"]),
        (urdf('<joint name="j" type="fixed"><child link="b"/></joint>'), ["<joint> 'j' (line 1)", "no parent link"]),
        (urdf(HINGE.format("revolute", '<limit lower="a" upper="1"/>')), ["joint 'j' (line 1)", 'lower="a"']),
    ],
)  # fmt: skip
def test_urdf_is_refused_by_the_element_that_is_wrong(text: str, words: list[str], tmp_path: Path) -> None:
    told = _refused(tmp_path / "scene.urdf", text)
    assert "can't be read as URDF" in told
    for word in words:
        assert word in told


def test_a_capsule_of_urdf_is_read(tmp_path: Path) -> None:
    """Its length is that of the cylinder between the half spheres, as in MuJoCo and Drake."""
    path = tmp_path / "handle.urdf"
    link = f'<link name="c">{CAPSULE.format("visual")}{CAPSULE.format("collision")}</link>'
    fixed = HINGE.format("fixed", "").replace('"b"', '"c"').replace('"j"', '"k"')
    path.write_text(urdf(HINGE.format("revolute", LIMIT) + fixed, link))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        made = twin.from_urdf(path)
    (shape,) = made.static.collision
    assert np.allclose(np.ptp(shape.vertices, axis=0), [0.04, 0.04, 0.24], atol=1e-3)  # type: ignore[union-attr]
    drawn = made.static.mesh.vertices[8:]  # behind the corners of link a
    assert np.allclose(np.ptp(drawn, axis=0), [0.04, 0.04, 0.24], atol=1e-3)

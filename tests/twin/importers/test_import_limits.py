"""What an articulated scene from elsewhere can't bring along is refused or told, by its name."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

import twin
from tests.makers.twin.scene_texts import HINGE, LIMIT, mjcf, urdf
from twin.errors import InputError


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        yield


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (urdf(HINGE.format("continuous", "")), ["joint 'j'", "no limits", "limits={'j': (0.0, 1.5)}"]),
        (urdf(HINGE.format("revolute", '<limit effort="1" velocity="1"/>')), ["joint 'j'", "no limits"]),
        (urdf(HINGE.format("revolute", LIMIT.replace('"1"', '"0"', 1))), ["joint 'j'", "0 to 0"]),
        (urdf(HINGE.format("planar", LIMIT)), ["body 'b'", "'planar'", "exclude"]),
        (urdf(HINGE.format("revolute", f'<axis xyz="0 0 0"/>{LIMIT}')), ["joint 'j'", "axis"]),
        (urdf(HINGE.format("revolute", LIMIT) + HINGE.format("fixed", "").replace('"j"', '"k"')), ["'b'", "two joints"]),
        (urdf(HINGE.format("revolute", LIMIT).replace('"a"', '"z"')), ["joint 'j'", "'z'"]),
        (urdf(HINGE.format("revolute", LIMIT).replace('"b"', '"c"'), '<link name="c"/>'), ["body 'c'", "joint 'j'", "no shape"]),
        (urdf("", '<link name="c"><visual><geometry><mesh filename="no.obj"/></geometry></visual></link>'), ["visual 0", "'c'", "no.obj"]),
        (urdf("", '<link name="c"><visual><geometry><mesh filename="package://p/no.obj"/></geometry></visual></link>'), ["'c'", "no.obj"]),
        (urdf("", '<link name="c"><visual><geometry/></visual></link>'), ["can't be read as URDF"]),
        (urdf(HINGE.format("revolute", LIMIT)).replace("0.02", "-0.02"), ["link 'a'", "must be positive"]),
        (urdf(HINGE.format("revolute", f'{LIMIT}<dynamics damping="abc"/>')), ["link 'b'", "'abc'"]),
        (urdf(HINGE.format("revolute", f'{LIMIT}<dynamics damping="-1"/>')), ["body 'b'", "damping must be zero or more"]),
        (urdf("", '<link name="c"><inertial><mass value="-1"/></inertial></link>'), ["link 'c'", "mass must be positive"]),
        (urdf("", '<link name="b"/>'), ["two links 'b'"]),
        ('<robot name="r"><xacro:macro name="m"/></robot>', ["xacro"]),
        ('<!DOCTYPE r [<!ENTITY e SYSTEM "file:///etc/hostname">]><robot name="&e;"/>', ["document type"]),
        ("<html/>", ["<html>"]),
        ('<sdf version="1.9"/>', ["SDF", "convert it"]),
        ('<mujocoinclude><body name="b"/></mujocoinclude>', ["a piece of an MJCF model", "that includes it", "'scene.xml'"]),
        (mjcf('<body name="b"><joint type="ball"/><geom size=".1"/></body>'), ["body 'b'", "ball"]),
        (mjcf('<body name="b"><joint name="x" type="slide" range="0 1"/><joint name="y" type="slide" range="0 1"/><geom size=".1"/></body>'), ["'b'", "'x', 'y'"]),
        (mjcf('<body name="b"><joint name="k"/><geom size=".1"/></body>'), ["joint 'k'", "no limits"]),
        (mjcf('<body name="b"><joint nme="k"/></body>'), ["MuJoCo can't load", "nme"]),
        (mjcf("", '<option gravity="0 -9.81 0"/>'), ["gravity"]),
    ],
)  # fmt: skip
def test_what_no_twin_can_carry_is_refused_by_name(text: str, words: list[str], tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        (twin.from_mjcf if "<mujoco" in text else twin.from_urdf)(path)
    told = str(caught.value)
    assert "\n" not in told
    for word in words:
        assert word in told


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (mjcf("").replace("</worldbody>", '<body name="b"><freejoint/><geom size=".1"/></body></worldbody>'), ["'b'", "stands loose"]),
        (urdf(HINGE.format("floating", "")), ["'b'", "stands loose"]),
        (urdf(HINGE.format("revolute", f'{LIMIT}<mimic joint="j"/>')), ["joint 'j' follows 'j' (mimic)"]),
        (mjcf('<geom type="plane" size="0 0 1" name="floor"/>'), ["'floor'", "infinite plane"]),
        (mjcf('<body name="b"><joint name="k" range="0 1" stiffness="3" armature="1" limited="true"/><geom size=".1"/></body>',
              '<equality><joint joint1="k"/></equality><actuator><motor joint="k"/></actuator>'),
         ["spring of joint 'k'", "armature", "'joint' of joints 'k'", "1 actuators"]),
    ],
)  # fmt: skip
def test_what_is_left_out_is_told(text: str, words: list[str], tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    path.write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        made = (twin.from_mjcf if "<mujoco" in text else twin.from_urdf)(path)
    told = " | ".join(str(w.message) for w in caught if w.category is UserWarning)
    for word in words:
        assert word in told
    assert "scene.xml" in told
    assert [p.name for p in made.parts if p.name == "b"] == (["b"] if "'j'" in told or "'k'" in told else [])


def test_a_tensor_that_no_body_can_have_is_told_and_the_mass_kept(tmp_path: Path) -> None:
    path = tmp_path / "point.urdf"
    inertia = (
        '<inertial><mass value="3.5"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    )
    text = urdf(HINGE.format("revolute", LIMIT)).replace('<link name="b">', f'<link name="b">{inertia}')
    path.write_text(text)
    with pytest.warns(UserWarning, match="'b': inertia must be positive definite.*spread over the surface"):
        (part,) = twin.from_urdf(path).parts
    assert part.inertial is not None
    assert part.inertial.mass.value == 3.5
    assert part.inertial.mass.origin == "user"


def test_what_a_file_does_not_state_comes_from_the_table_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "bare.urdf"
    path.write_text(urdf(HINGE.format("revolute", LIMIT)))
    (part,) = twin.from_urdf(path).parts
    assert part.inertial is not None
    assert part.physics is not None
    quantities = [part.inertial.mass, *part.physics.numbers.values()]
    assert all("bare.urdf" not in q.source for q in quantities)
    assert len(part.motion.frames) == 0


def test_a_concave_collision_mesh_is_not_filled_up(tmp_path: Path) -> None:
    """A hull over a carcass would close it: shapes are made from the surface instead, and that is told."""
    import trimesh

    carcass = trimesh.util.concatenate(
        [trimesh.creation.box(extents=e).apply_translation(t) for e, t in
         (((0.02, 0.4, 0.6), (-0.3, 0, 0)), ((0.02, 0.4, 0.6), (0.3, 0, 0)), ((0.6, 0.02, 0.6), (0, 0.2, 0)))]
    )  # fmt: skip
    carcass.export(tmp_path / "carcass.stl")
    shape = '<geometry><mesh filename="carcass.stl" scale="1 1 1"/></geometry>'
    path = tmp_path / "open.urdf"
    path.write_text(urdf("", f'<link name="c"><visual>{shape}</visual><collision>{shape}</collision></link>'))
    with pytest.warns(UserWarning, match="collision 0 of link 'c' is not convex"):
        made = twin.from_urdf(path)
    assert made.static.collision == ()

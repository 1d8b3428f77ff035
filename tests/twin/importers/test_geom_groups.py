"""Colliders of an MJCF file are no visible surface: its contacts and groups say which geoms are seen."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import twin
from tests.makers.twin.scene_texts import HINGE, LIMIT, board, urdf
from twin.cli import main as cli
from twin.errors import InputError
from twin.scene import Twin

PANEL, BLOCK = ((0, 0, 0), (0.4, 0.02, 0.6)), ((-0.01, -0.01, -0.01), (0.41, 0.03, 0.61))
HANDLE, GRIP = ((0.3, -0.04, 0.2), (0.32, -0.02, 0.4)), ((0.29, -0.05, 0.19), (0.33, -0.01, 0.41))
SEEN = 'contype="0" conaffinity="0"'


def _scene(door: str, world: str = "") -> str:
    joint = '<joint name="hinge" axis="0 0 1" range="0 90" limited="true"/>'
    return f'<mujoco><worldbody>{world}<body name="door">{joint}{door}</body></worldbody></mujoco>'


def _read(path: Path, text: str, **options: Sequence[int]) -> tuple[Twin, str]:
    path.write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        made = twin.from_mjcf(path, **options)  # type: ignore[arg-type]
    return made, " | ".join(str(w.message) for w in caught)


def _boxes(made: Twin) -> int:
    """How many boxes the door's surface is made of."""
    return len(made.part("door").mesh.faces) // 12


@pytest.mark.parametrize(("visual", "collider"), [(1, 0), (0, 1), (2, 3), (0, 5)])
def test_colliders_in_a_group_of_their_own_are_not_seen(visual: int, collider: int, tmp_path: Path) -> None:
    """robosuite and LIBERO have colliders in group 0 beside visuals in 1, Menagerie 3 beside 2."""
    door = board(*PANEL, f'{SEEN} group="{visual}"') + board(*BLOCK, f'group="{collider}"')
    made, told = _read(tmp_path / "door.xml", _scene(door))
    part = made.part("door")
    assert np.allclose([part.mesh.vertices.min(axis=0), part.mesh.vertices.max(axis=0)], PANEL)
    (shape,) = part.collision
    assert np.allclose(shape.size, np.ptp(BLOCK, axis=0))  # type: ignore[union-attr]
    assert "geoms that touch" not in told


@pytest.mark.parametrize("group", [0, 1, 2])
def test_geoms_that_touch_are_seen_where_the_model_has_no_visuals(group: int, tmp_path: Path) -> None:
    """One geom for both: robosuite's door has all of them in group 1."""
    door = board(*PANEL, f'group="{group}"') + board(*HANDLE, f'group="{group}"')
    made, told = _read(tmp_path / "door.xml", _scene(door))
    assert _boxes(made) == 2
    assert "geoms that touch" not in told


def test_a_panel_stays_where_only_its_handle_is_drawn(tmp_path: Path) -> None:
    """The handle's collider goes; the panel, which nothing else shows, stays, and the option is named."""
    door = board(*HANDLE, f'{SEEN} group="1"') + board(*PANEL, 'group="0"') + board(*GRIP, 'group="0"')
    made, told = _read(tmp_path / "door.xml", _scene(door))
    mesh = made.part("door").mesh
    assert np.allclose([mesh.vertices.min(axis=0)[1], mesh.vertices.max(axis=0)[1]], [-0.04, 0.02])
    assert _boxes(made) == 2
    assert "1 geoms that touch, of 'door', are taken for visible surface" in told
    assert "--visual-group 1" in told


def test_walls_without_visuals_are_seen_beside_furniture_that_has_them(tmp_path: Path) -> None:
    """As in Metaworld: bodies that stand side by side on the floor don't cover each other."""
    door = board(*PANEL, f'{SEEN} group="1"') + board(*BLOCK, 'group="0"')
    wall = board((0, 0.2, 0), (0.4, 0.25, 0.6), 'group="0"')
    table = board((-1, -1, -1), (1, 1, 1), f'{SEEN} group="1"')
    world = f'<body name="wall">{wall}</body><body name="table">{table}</body>'
    made, told = _read(tmp_path / "door.xml", _scene(door, world))
    assert len(made.static.mesh.faces) == 24
    assert _boxes(made) == 1
    assert "'wall'" in told


def test_colliders_among_visuals_of_their_own_group_are_told(tmp_path: Path) -> None:
    door = board(*PANEL, SEEN) + board(*BLOCK)
    made, told = _read(tmp_path / "door.xml", _scene(door))
    assert _boxes(made) == 2
    assert "in a group of visuals" in told
    assert "'door'" in told


def test_the_user_says_which_groups_are_seen(tmp_path: Path) -> None:
    door = board(*PANEL, f'{SEEN} group="4"') + board(*BLOCK, 'group="0"') + board(*HANDLE, 'group="2"')
    path = tmp_path / "door.xml"
    assert _boxes(_read(path, _scene(door))[0]) == 2
    for groups, boxes in (((4,), 1), ((0, 2, 4), 3)):
        made, _ = _read(path, _scene(door), visual_groups=groups)
        assert _boxes(made) == boxes
    options = ["--visual-group", "4", "--visual-group", "2"]
    assert cli.run(["import", str(path), "-o", str(tmp_path / "run"), *options]) == 0
    assert _boxes(twin.load(tmp_path / "run")) == 2
    with pytest.raises(InputError, match="groups 0 to 5"):
        twin.from_mjcf(path, visual_groups=[6])


def test_urdf_has_no_groups(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "door.urdf"
    path.write_text(urdf(HINGE.format("revolute", LIMIT)))
    assert cli.run(["import", str(path), "-o", str(tmp_path / "run"), "--visual-group", "1"]) == 1
    assert "URDF, which has no geom groups" in capsys.readouterr().err

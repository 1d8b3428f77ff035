"""Mirrored meshes are the right side out, and meshes whose files say that y points up stand as their
colliders do."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import trimesh

import twin
from tests.makers.twin.colours import (
    BOARD,
    CORNERS,
    collada,
    hinged,
    meshed,
    seen_at,
    write_board,
    write_picture,
)
from twin.mesh import signed_volume
from twin.scene import Mesh, Twin

NEAR = 3
READ: dict[str, Callable[..., Twin]] = {"urdf": twin.from_urdf, "mjcf": twin.from_mjcf}
VOLUME = 0.8 * 0.6 * 0.2 / 3  # m^3 of the pyramid that the board is


def told(read: Callable[[], Twin]) -> tuple[Twin, str]:
    """A twin and all that was told of it."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        made = read()
    return made, "\n".join(str(w.message) for w in found)


def require_scaled(mesh: Mesh, scale: str) -> None:
    """The pyramid times `scale`: closed, right side out, with each corner's colour where the scale puts
    it."""
    by = np.array([float(s) for s in scale.split()])
    low, high = (
        np.minimum(by * [-0.4, 0, -0.3], by * [0.4, 0.2, 0.3]),
        np.maximum(by * [-0.4, 0, -0.3], by * [0.4, 0.2, 0.3]),
    )
    assert np.allclose([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], [low, high], atol=1e-6)
    assert signed_volume(mesh.vertices[mesh.faces]) == pytest.approx(VOLUME * abs(np.prod(by)), rel=1e-5)
    points = np.array(list(CORNERS)) * by
    assert np.abs(seen_at(mesh, points) - np.array(list(CORNERS.values()))).max() <= NEAR


@pytest.mark.parametrize("scale", ["1 -1 1", "-1 -1 -1", "2 -1 0.5"])
def test_mirrored_meshes_are_right_side_out_and_wear_their_picture_mirrored(
    scale: str, tmp_path: Path
) -> None:
    """In both formats, whose readers turn faces by themselves or not, and in what touches."""
    write_board(tmp_path)
    write_picture(tmp_path / "picture.png")
    solid = f'<collision><geometry><mesh filename="board.obj" scale="{scale}"/></geometry></collision>'
    (tmp_path / "door.urdf").write_text(hinged(meshed("board.obj", scale=scale), collision=solid))
    (tmp_path / "door.xml").write_text(
        '<mujoco><asset><texture name="p" type="2d" file="picture.png"/><material name="m" texture="p"/>'
        f'<mesh name="b" file="board.obj" scale="{scale}"/></asset><worldbody><body name="door">'
        '<joint type="hinge" axis="0 0 1" range="0 80"/><geom type="mesh" mesh="b" material="m"/></body></worldbody></mujoco>'
    )
    for fmt, file in (("urdf", "door.urdf"), ("mjcf", "door.xml")):
        made, _ = told(partial(READ[fmt], tmp_path / file))
        (door,) = made.parts
        require_scaled(door.mesh, scale)
        (hull,) = door.collision
        assert isinstance(hull, Mesh)
        corners = hull.vertices[hull.faces]
        assert signed_volume(corners) == pytest.approx(
            signed_volume(door.mesh.vertices[door.mesh.faces]), rel=1e-5
        )
        back, _ = told(partial(READ[fmt], twin.export(made, tmp_path / fmt, [fmt])[fmt]))
        require_scaled(back.parts[0].mesh, scale)


STANDING = '<collision><geometry><box size="0.8 0.02 0.6"/></geometry></collision>'
LYING = '<collision><geometry><box size="0.8 0.6 0.02"/></geometry></collision>'


def write_glb(path: Path) -> None:
    """The board as glTF has it: its height along y, its front facing z."""
    loaded = trimesh.load_mesh(write_board(path.parent), process=False)
    loaded.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    loaded.export(path)


def height(made: Twin) -> float:
    return float(np.ptp(made.parts[0].mesh.vertices[:, 2]))


@pytest.mark.parametrize(
    ("suffix", "solid", "stands", "said"),
    [
        ("glb", STANDING, True, ""),
        ("glb", LYING, False, "is left as its numbers are: only so it fits the collision shapes"),
        ("glb", "", True, "is turned from y up to z up: no shape confirms it"),
        ("dae", STANDING, True, ""),
        ("dae", "", True, "is left as its numbers are: no shape confirms it"),
        ("dae", LYING, False, "is turned from y up to z up: only so it fits the collision shapes"),
    ],
)
def test_visuals_whose_file_says_that_y_is_up_stand_as_the_colliders_do(
    suffix: str, solid: str, stands: bool, said: str, tmp_path: Path
) -> None:
    """glTF is turned and COLLADA is not, as RViz does both; collision shapes that say otherwise are
    believed."""
    write_picture(tmp_path / "picture.png")
    if suffix == "glb":
        write_glb(tmp_path / "board.glb")
    else:
        (tmp_path / "board.dae").write_text(collada("Y_UP"))
    (tmp_path / "door.urdf").write_text(hinged(meshed(f"board.{suffix}"), collision=solid))
    made, lines = told(lambda: twin.from_urdf(tmp_path / "door.urdf"))
    assert (height(made) > 0.5) == stands
    if said:
        assert f"link 'door': board.{suffix}" in lines
        assert said in lines
    else:
        assert not lines


def test_a_collision_mesh_whose_file_says_that_y_is_up_is_turned_with_its_visual(tmp_path: Path) -> None:
    write_glb(tmp_path / "board.glb")
    solid = '<collision><geometry><mesh filename="board.glb"/></geometry></collision>'
    (tmp_path / "door.urdf").write_text(hinged(meshed("board.glb"), collision=solid))
    made, _ = told(lambda: twin.from_urdf(tmp_path / "door.urdf"))
    (hull,) = made.parts[0].collision
    assert isinstance(hull, Mesh)
    assert np.ptp(hull.vertices[:, 2]) == pytest.approx(height(made)) == pytest.approx(0.6)


@pytest.mark.parametrize("file", ["board.dae", "board.obj"])
def test_a_file_that_does_not_say_that_y_is_up_is_left_as_its_numbers_are(file: str, tmp_path: Path) -> None:
    write_picture(tmp_path / "picture.png")
    (tmp_path / "board.dae").write_text(collada("Z_UP"))
    (tmp_path / "board.obj").write_text(BOARD)
    (tmp_path / "door.urdf").write_text(hinged(meshed(file), collision=LYING))
    made, lines = told(lambda: twin.from_urdf(tmp_path / "door.urdf"))
    assert height(made) == pytest.approx(0.6)
    # nothing is turned; that it lies across its collider is lint's word
    assert [x for x in lines.splitlines() if "lint, collider-elsewhere" not in x] == []

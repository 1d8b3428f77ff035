"""A mesh that can't stand for a body is named; touching boards and a scanner's folds are fine."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.laws import random_pose
from tests.twin.scenes import cabinet_twin
from twin.cli import run
from twin.errors import SceneError
from twin.scene import Mesh, Twin
from twin.soundness import crossing, require_sound
from twin.storage import save


def with_mesh(mesh: Mesh) -> Twin:
    twin = cabinet_twin()
    door, *others = twin.parts
    return replace(twin, parts=(replace(door, mesh=mesh), *others))


def crossed(turn: float) -> Mesh:
    """Two boards through the same middle, one turned."""
    one = trimesh.creation.box((0.5, 0.02, 0.5))
    other = one.copy()
    other.apply_transform(trimesh.transformations.rotation_matrix(turn, [0, 0, 1]))
    both = trimesh.util.concatenate([one, other])
    return Mesh(np.array(both.vertices), np.array(both.faces))


def test_boards_that_touch_are_sound() -> None:
    twin = cabinet_twin(nested=True, lid=True)
    require_sound(twin)
    for part in twin.parts:
        assert crossing(part.mesh)[0] == 0.0


@pytest.mark.parametrize("seed", range(3))
def test_crossing_boards_are_named_wherever_they_stand(seed: int) -> None:
    moved = crossed(0.7).transformed(random_pose(np.random.default_rng(seed)))
    share, at = crossing(moved)
    assert share > 0.5
    assert np.linalg.norm(at - moved.vertices.mean(axis=0)) < 0.4
    with pytest.raises(
        SceneError, match=r"'door' passes through itself on \d+ % of its area, for example at"
    ):
        require_sound(with_mesh(moved))


def test_a_fold_of_a_fine_surface_is_no_harm() -> None:
    """One corner of a fine, noisy sheet is pushed through a second sheet behind it; pushed in a little it crosses nothing."""
    sheet = trimesh.creation.box((0.4, 0.4, 0.02)).subdivide_to_size(0.02)
    top = int(np.argmax(np.array(sheet.vertices) @ [0.01, 0.02, 1.0]))
    for push, crosses in ((0.04, True), (0.004, False)):
        vertices = np.array(sheet.vertices)
        vertices[top, 2] -= push
        vertices[top, :2] -= 0.013
        share, _ = crossing(Mesh(vertices, np.array(sheet.faces)))
        assert (share > 0) == crosses
        assert share < 0.01


@pytest.mark.parametrize(
    ("mesh", "said"),
    [(Mesh(np.zeros((0, 3)), np.zeros((0, 3), int)), "is empty"), (crossed(0.7), "passes through itself")],
)
def test_export_names_it_and_writes_nothing(
    mesh: Mesh, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save(with_mesh(mesh), tmp_path / "run" / "twin")
    before = sorted(tmp_path.rglob("*"))
    assert run(["export", str(tmp_path / "run")]) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.strip().splitlines()[-1].startswith("twin: the mesh of part 'door'")
    assert "Traceback" not in error
    assert sorted(tmp_path.rglob("*")) == before

"""A part without a body is named, bodies that overlap are told; touching boards and a scanner's folds are
fine."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from benchmarks.scenes.boards import cabinet_twin
from tests.laws import random_pose
from twin.cli.main import run
from twin.physics import read_materials, shell_inertial, with_physics
from twin.scene import Mesh, Twin
from twin.soundness import crossing, overlaps, require_sound
from twin.storage import save

EMPTY = Mesh(np.zeros((0, 3)), np.zeros((0, 3), int))


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


def boxes(*sizes_and_places: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Mesh:
    bodies = []
    for size, at in sizes_and_places:
        body = trimesh.creation.box(size)
        body.apply_translation(at)
        bodies.append(body)
    both = trimesh.util.concatenate(bodies)
    return Mesh(np.array(both.vertices), np.array(both.faces))


@pytest.mark.parametrize("seed", range(3))
def test_bodies_that_overlap_are_told_with_their_share_wherever_they_stand(seed: int) -> None:
    """Two boards of 18 mm, the second 3 mm inside the first: 3 of 36 mm are held twice."""
    shelf = boxes(((0.4, 0.4, 0.018), (0, 0, 0)), ((0.4, 0.4, 0.018), (0, 0, 0.015)))
    twin = with_mesh(shelf.transformed(random_pose(np.random.default_rng(seed))))
    require_sound(twin)
    assert overlaps(twin) == ["bodies of part 'door' overlap by 8.3% of their volume; its mass is as stated"]
    made = replace(twin, parts=(replace(twin.parts[0], inertial=None), *twin.parts[1:]))
    assert "its mass is that of their union" in overlaps(with_physics(made))[0]


def test_what_overlapping_bodies_share_weighs_once() -> None:
    """Two bars of a cross, 20 mm thick: the mass is that of the cross made as one body."""
    bars = ((0.4, 0.02, 0.02), (0, 0, 0)), ((0.02, 0.4, 0.02), (0, 0, 0))
    table = read_materials()
    material = table.material(table.default)
    one = trimesh.boolean.union([trimesh.creation.box(size) for size, _ in bars], engine="manifold")
    want = shell_inertial(Mesh(np.array(one.vertices), np.array(one.faces)), material)
    got = shell_inertial(boxes(*bars), material)
    assert got.mass.value == pytest.approx(want.mass.value, rel=1e-6)
    np.testing.assert_allclose(got.inertia, want.inertia, rtol=1e-6, atol=1e-12)


def test_a_surface_through_itself_that_is_no_body_is_told_as_such() -> None:
    sheets = trimesh.util.concatenate(
        [trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
         trimesh.Trimesh([[0.2, 0.2, -0.5], [0.2, 0.2, 0.5], [0.9, 0.1, 0]], [[0, 1, 2]])]
    )  # fmt: skip
    twin = with_mesh(Mesh(np.array(sheets.vertices), np.array(sheets.faces)))
    require_sound(twin)
    assert "passes through itself on 100% of its area, for example at (" in overlaps(twin)[0]
    assert "can't be united" in overlaps(twin)[0]


def test_a_fold_of_a_fine_surface_is_no_harm() -> None:
    """One corner of a fine, noisy sheet is pushed through a second sheet behind it; pushed in a little it
    crosses nothing."""
    sheet = trimesh.creation.box((0.4, 0.4, 0.02)).subdivide_to_size(0.02)
    top = int(np.argmax(np.array(sheet.vertices) @ [0.01, 0.02, 1.0]))
    for push, crosses in ((0.04, True), (0.004, False)):
        vertices = np.array(sheet.vertices)
        vertices[top, 2] -= push
        vertices[top, :2] -= 0.013
        share, _ = crossing(Mesh(vertices, np.array(sheet.faces)))
        assert (share > 0) == crosses
        assert share < 0.01


def test_bodies_that_overlap_by_millimetres_are_exported_with_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    twin = with_mesh(crossed(0.7))
    save(twin, tmp_path / "run" / "twin")
    assert run(["export", str(tmp_path / "run"), "--format", "mjcf"]) == 0
    assert "bodies of part 'door' overlap by 3.1% of their volume" in capsys.readouterr().out.replace(
        "\n", " "
    )


def test_export_names_an_empty_mesh_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    twin = with_mesh(EMPTY)
    door, *others = twin.parts
    save(replace(twin, parts=(replace(door, collision=()), *others)), tmp_path / "run" / "twin")
    before = sorted(tmp_path.rglob("*"))
    assert run(["export", str(tmp_path / "run")]) == 1
    error = capsys.readouterr().err
    assert error.strip().splitlines()[-1].startswith("twin: the mesh of part 'door' is empty")
    assert "Traceback" not in error
    assert sorted(tmp_path.rglob("*")) == before

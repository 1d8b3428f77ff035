"""Mass and inertia of surfaces against closed forms."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.twin.scenes import Board, boards_inertial, boards_mesh, cabinet_twin
from twin import geometry as geo
from twin.errors import ConfigError, SceneError
from twin.physics import Material, read_materials, shell_inertial, with_physics
from twin.scene import Mesh, Quantity

PANEL = Board((0.1, -0.2, 0.3), (0.5, -0.182, 0.9))
TILTED = geo.make_pose(geo.exp_so3([0.3, -0.5, 0.9]), [1.0, 2.0, 0.5])


def exact(value: float) -> Quantity:
    return Quantity(value, "test", (value, value))


def board(thickness: float = 0.018, density: float = 700.0) -> Material:
    return Material("test_board", exact(density), exact(thickness), exact(0.5))


def faces_of(mesh: Mesh, keep: np.ndarray) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces[keep], mesh.colors)


def sides(mesh: Mesh, direction: list[float]) -> np.ndarray:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return geo.unit(np.cross(b - a, c - a)) @ np.array(direction)


def test_a_closed_panel_weighs_what_it_holds() -> None:
    got = shell_inertial(boards_mesh([PANEL], TILTED, cut=4), board())
    want = boards_inertial([PANEL], TILTED)
    assert got.mass.value == pytest.approx(want.mass.value, rel=1e-6)
    assert np.allclose(got.com, want.com, atol=1e-6)
    assert np.allclose(got.inertia, want.inertia, rtol=0.10, atol=0.02 * np.trace(want.inertia))


def test_a_board_counts_once_whether_one_or_both_sides_were_seen() -> None:
    mesh = boards_mesh([PANEL], cut=4)
    facing = sides(mesh, [0, 1, 0])
    both = shell_inertial(faces_of(mesh, abs(facing) > 0.5), board())
    front = shell_inertial(faces_of(mesh, facing < -0.5), board())
    want = boards_inertial([PANEL], np.eye(4))
    for got in (both, front):
        assert got.mass.value == pytest.approx(want.mass.value, rel=1e-6)
        assert np.allclose(got.com, want.com, atol=1e-6)
        assert np.allclose(got.inertia, want.inertia, rtol=1e-5, atol=1e-9)


def test_a_hollow_box_weighs_its_walls_not_its_inside() -> None:
    size, t = np.array([0.4, 0.5, 0.3]), 0.001
    mesh = boards_mesh([Board((0, 0, 0), tuple(size))], cut=3)
    got = shell_inertial(mesh, board(t, 7800.0))
    area = 2 * (size[0] * size[1] + size[0] * size[2] + size[1] * size[2])
    assert got.mass.value == pytest.approx(area * t * 7800, rel=1e-6)
    assert np.allclose(got.com, size / 2, atol=1e-9)


def test_a_gap_in_front_of_a_panel_is_not_material() -> None:
    front = Board((0, 0, 0), (0.4, 0.018, 0.4))
    bar = Board((0.1, -0.040, 0.19), (0.3, -0.022, 0.21))
    alone = [shell_inertial(boards_mesh([b], cut=3), board()).mass.value for b in (front, bar)]
    together = shell_inertial(boards_mesh([front, bar], cut=3), board()).mass.value
    assert together == pytest.approx(sum(alone), rel=0.02)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_any_surface_gives_a_lawful_inertia_that_turns_with_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-0.5, 0.5, (12, 3)) * [1, 1, 0 if seed % 2 else 1]  # flat for odd seeds
    faces = np.stack([rng.permutation(12)[:3] for _ in range(6)]).astype(np.int32)
    mesh = Mesh(vertices, faces)
    got = shell_inertial(mesh, board())  # Inertial checks positive definite and triangle inequality
    turned = shell_inertial(mesh.transformed(TILTED), board())
    r = TILTED[:3, :3]
    assert np.allclose(turned.inertia, r @ got.inertia @ r.T, rtol=1e-3, atol=1e-6)
    assert np.allclose(turned.com, geo.transform(TILTED, got.com[None])[0], atol=1e-4)
    assert turned.mass.value == pytest.approx(got.mass.value, rel=1e-4)


def test_with_physics_fills_what_is_missing_and_names_its_sources() -> None:
    twin = cabinet_twin()
    bare = replace(twin, parts=tuple(replace(p, inertial=None, physics=None) for p in twin.parts))
    full = with_physics(bare)
    for p, truth in zip(full.parts, twin.parts, strict=True):
        low, high = p.inertial.mass.interval
        assert low < truth.inertial.mass.value < high, "the exact mass lies in the interval"
        assert p.inertial.mass.value == pytest.approx(truth.inertial.mass.value, rel=0.25)
        assert "furniture_board" in p.inertial.mass.source
        assert "furniture_board" in p.physics.density.source
        assert p.physics.frictionloss == read_materials().joints[p.joint.kind]["frictionloss"]
    assert with_physics(twin).part("door").inertial is twin.part("door").inertial
    glass = with_physics(twin, {"door": "glass"}, renew=True)
    assert glass.part("door").physics.density.value == 2500.0
    assert glass.part("drawer").physics.density.value == 700.0


def test_unknown_names_and_empty_meshes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="did you mean 'plywood'"):
        with_physics(cabinet_twin(), {"door": "plywod"})
    with pytest.raises(SceneError, match="its parts are: door"):
        with_physics(cabinet_twin(), {"dor": "glass"})
    with pytest.raises(SceneError, match="no area"):
        shell_inertial(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]])), board())
    (tmp_path / "m.toml").write_text('default = "x"\n[materials]\n[joints]\n')
    with pytest.raises(ConfigError, match=r"m\.toml"):
        read_materials(tmp_path / "m.toml")


def test_the_table_states_a_source_for_every_number() -> None:
    table = read_materials()
    rows = [q for m in table.materials.values() for q in (m.density, m.thickness, m.friction)]
    rows += [q for j in table.joints.values() for q in j.values()]
    assert all(len(q.source) > 8 and q.interval[0] < q.interval[1] for q in rows)
    assert set(table.joints) == {"revolute", "prismatic"}

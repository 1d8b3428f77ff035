"""Collision shapes that the user stated stay as they are, what is made gives way to them, and what is not
convex is named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from benchmarks.scenes.boards import cabinet_twin
from twin.cli.main import run
from twin.collision import with_collision
from twin.collision.clearance import Yielding, find_touches
from twin.collision.meetings import meetings
from twin.collision.stated import hollow, require_convex
from twin.errors import SceneError
from twin.exporters import complete, export
from twin.scene import Box, Collision, Mesh, Twin
from twin.storage import load, save


def mesh_of(body: trimesh.Trimesh) -> Mesh:
    return Mesh(np.array(body.vertices), np.array(body.faces))


def with_shapes(twin: Twin, **lists: tuple[Collision, ...]) -> Twin:
    """The twin with these lists of shapes, by name of their owner, and none elsewhere."""
    parts = tuple(replace(p, collision=lists.get(p.name, ())) for p in twin.parts)
    static = replace(twin.static, collision=lists.get(twin.static.name, ()))
    return replace(twin, static=static, parts=parts)


def grown(box: Box, by: float) -> Box:
    return Box(box.T_world_box, box.size + 2 * by)


@pytest.fixture(scope="module")
def exact() -> Twin:
    return cabinet_twin()


@pytest.mark.parametrize("owner", ["door", "drawer", "cabinet"])
def test_stated_shapes_stay_when_other_lists_are_empty(exact: Twin, owner: str, tmp_path: Path) -> None:
    owners = {o.name: o for o in (exact.static, *exact.parts)}
    name = owner if owner in owners else exact.static.name
    stated = (*owners[name].collision[:2], mesh_of(trimesh.creation.box((0.01, 0.01, 0.01))))
    twin = with_shapes(exact, **{name: stated})
    for again in range(2):  # made, and from the cache
        shaped = with_collision(twin, cache_dir=tmp_path)
        assert {o.name: o for o in (shaped.static, *shaped.parts)}[name].collision == stated, again
        assert all(o.collision for o in (shaped.static, *shaped.parts))


def test_export_leaves_the_files_of_stated_shapes_byte_for_byte(exact: Twin, tmp_path: Path) -> None:
    wedge = mesh_of(trimesh.creation.cone(0.02, 0.05, sections=12))
    save(with_shapes(exact, door=(wedge, *exact.part("door").collision)), tmp_path / "twin")
    before = {p.name: p.read_bytes() for p in (tmp_path / "twin" / "meshes").glob("door*.ply")}
    assert len(before) >= 2
    assert run(["export", str(tmp_path), "--format", "mjcf"]) == 0
    assert {p.name: p.read_bytes() for p in (tmp_path / "twin" / "meshes").glob("door*.ply")} == before
    assert len(load(tmp_path).part("door").collision) == 1 + len(exact.part("door").collision)


def test_made_shapes_give_way_to_stated_ones(exact: Twin) -> None:
    """The door's shapes, stated 5 mm too large, reach into the walls beside it: the walls, made, give way all
    the more."""
    door = tuple(grown(s, 0.005) if isinstance(s, Box) else s for s in exact.part("door").collision)
    twin = with_collision(with_shapes(exact, door=door))
    assert twin.part("door").collision == door
    fixed = {1 + [p.name for p in twin.parts].index("door")}
    shapes = [list(twin.static.collision), *(list(p.collision) for p in twin.parts)]
    assert find_touches(twin, shapes, 0.0015, 0.01, Yielding(fixed)) == []
    assert meetings(twin) == []
    walls = with_collision(with_shapes(exact, **{exact.static.name: exact.static.collision}))
    assert walls.static.collision == exact.static.collision


def test_the_cache_tells_stated_shapes_apart(exact: Twin, tmp_path: Path) -> None:
    first = with_collision(with_shapes(exact), cache_dir=tmp_path)
    wall = Box(exact.part("drawer").collision[0].T_world_box, np.full(3, 0.3))  # type: ignore[union-attr]
    second = with_collision(with_shapes(exact, **{exact.static.name: (wall,)}), cache_dir=tmp_path)
    assert second.static.collision == (wall,)
    assert len(second.part("drawer").collision) != len(first.part("drawer").collision)


def test_stated_shapes_that_meet_are_told_and_left(exact: Twin, tmp_path: Path) -> None:
    wall = Box(exact.part("door").collision[0].T_world_box, np.full(3, 0.05))  # type: ignore[union-attr]
    twin = replace(exact, static=replace(exact.static, collision=(*exact.static.collision, wall)))
    ready = complete(twin)
    assert ready.static.collision == twin.static.collision
    assert ready.part("door").collision == twin.part("door").collision
    told = [w for w in export(twin, tmp_path, ["mjcf"]).warnings if "they were left as stated" in w]
    assert len(told) == 1
    assert f"'{exact.static.name}' and 'door' overlap by" in told[0]
    assert meetings(exact) == []


def test_a_made_shape_that_stays_in_a_stated_one_is_told_as_made(exact: Twin) -> None:
    """Who reads that it was left as stated looks for an error of his own."""
    wall = Box(exact.part("door").collision[0].T_world_box, np.full(3, 0.05))  # type: ignore[union-attr]
    twin = replace(exact, static=replace(exact.static, collision=(*exact.static.collision, wall)))
    (told,) = meetings(twin, {"door"})
    assert "those made for 'door' could not be cut free: state shapes that keep clear" in told.text
    assert "left as stated" not in told.text
    assert "left as stated" in meetings(twin)[0].text


CHANNEL = trimesh.util.concatenate(
    [
        trimesh.creation.box(bounds=[[0, 0, 0], [0.4, 0.06, 0.01]]),
        trimesh.creation.box(bounds=[[0, 0, 0], [0.4, 0.01, 0.03]]),
        trimesh.creation.box(bounds=[[0, 0.05, 0], [0.4, 0.06, 0.03]]),
    ]
)
APART = trimesh.util.concatenate(
    [trimesh.creation.box((0.1, 0.1, 0.1)), trimesh.creation.box(bounds=[[0.3, 0, 0], [0.4, 0.1, 0.1]])]
)
TUBE = trimesh.creation.annulus(0.02, 0.05, 0.1)
CORNER = trimesh.util.concatenate(
    [
        trimesh.creation.box(bounds=[[0, 0, 0], [0.4, 0.4, 0.018]]),
        trimesh.creation.box(bounds=[[0, 0, 0], [0.4, 0.018, 0.4]]),
    ]
)


@pytest.mark.parametrize("scale", [0.001, 1.0, 25.0])
@pytest.mark.parametrize("body", [CHANNEL, APART, TUBE, CORNER], ids=["channel", "apart", "tube", "corner"])
def test_a_concave_collision_mesh_is_refused_with_its_name(
    exact: Twin, body: trimesh.Trimesh, scale: float, tmp_path: Path
) -> None:
    mesh = mesh_of(body)
    concave = Mesh(mesh.vertices * scale, mesh.faces)
    door = exact.part("door").collision
    twin = replace(exact, parts=tuple(replace(p, collision=(*door, concave)) for p in exact.parts))
    with pytest.raises(
        SceneError, match=rf"collision\[{len(door)}\] of 'door' is not convex: .* mm off its surface"
    ):
        complete(twin)
    save(twin, tmp_path / "twin")
    assert len(load(tmp_path).part("door").collision) == len(door) + 1, "storage still loads it"
    assert run(["export", str(tmp_path)]) == 1


def test_thin_open_and_noisy_convex_meshes_are_accepted_and_flat_ones_refused(exact: Twin) -> None:
    rng = np.random.default_rng(0)
    scan = trimesh.creation.box((0.1, 0.1, 0.02)).subdivide_to_size(0.005)
    lidless = trimesh.creation.box((0.3, 0.3, 0.1))
    lidless.update_faces(lidless.face_normals[:, 2] < 0.5)
    nested = trimesh.util.concatenate([trimesh.creation.icosphere(3), trimesh.creation.icosphere(3, 0.7)])
    flat = Mesh(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1.0, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    noisy = Mesh(
        np.array(scan.vertices) + 0.0015 * rng.normal(size=scan.vertices.shape), np.array(scan.faces)
    )
    thin = mesh_of(trimesh.creation.box((0.5, 0.5, 0.0005)))
    shapes = (thin, mesh_of(lidless), mesh_of(nested), noisy, mesh_of(trimesh.creation.icosphere(4)))
    require_convex(with_shapes(exact, door=shapes))
    with pytest.raises(
        SceneError, match=r"collision\[1\] of 'door' is flat"
    ):  # MuJoCo loads no file with one
        require_convex(with_shapes(exact, door=(thin, flat)))
    turned = Mesh(shapes[1].vertices, shapes[1].faces[:, ::-1].copy())
    assert hollow(turned)[0] < 1e-6

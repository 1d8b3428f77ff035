"""Collision shapes: fingers fit behind handles, boards are boxes, nothing touches while it opens."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from benchmarks.scenes.boards import (
    BOARD,
    DOOR_HANDLE,
    DRAWER_HANDLE,
    GAP,
    Board,
    boards_mesh,
    cabinet_twin,
    carcass_boards,
    door_boards,
    drawer_boards,
    world_from_cabinet,
)
from twin import collision
from twin import geometry as geo
from twin.collision import PART_BOARDS, CollisionConfig, cache, make_part, with_collision
from twin.collision.boards import find_boards
from twin.collision.clearance import STEP, find_touches, make_clear, points_of, sweep_states
from twin.collision.convex import Hull, clip, cut, hull_of, thick_hull, triangles_of
from twin.collision.main_axes import outline_axes
from twin.collision.splitting import bulge, decompose
from twin.exporters import export
from twin.geometry import Array
from twin.scene import Box, Collision, Mesh, Revolute, Twin

CONFIG = CollisionConfig()
T = world_from_cabinet()


def hull_distance(hull: Hull, points: Array) -> Array:
    """How far points (n, 3) lie outside the faces' planes of a hull (m, negative inside)."""
    corners = hull.vertices[hull.faces]
    n, _ = geo.triangle_normals(corners)
    return np.asarray((points @ n.T - np.einsum("ij,ij->i", corners[:, 0], n)).max(axis=1))


def scanned(boards: list[Board], seed: int, cell: float = 0.012, noise: float = 0.0015) -> Mesh:
    """The boards as a scanner sees them: small triangles whose corners are off by noise, at random places."""
    done, triangles = [], triangles_of(boards_mesh(boards, T, cut=0))
    while len(triangles):
        edges = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        small = edges.max(axis=1) <= cell
        done.append(triangles[small])
        t, side = triangles[~small], edges[~small].argmax(axis=1)
        rows = np.arange(len(t))
        a, b, c = (t[rows, (side + k) % 3] for k in range(3))
        m = (a + b) / 2
        triangles = np.concatenate([np.stack([a, m, c], 1), np.stack([m, b, c], 1)])
    triangles = np.concatenate(done)
    corners, faces = np.unique(np.round(triangles.reshape(-1, 3), 9), axis=0, return_inverse=True)
    jitter = np.random.default_rng(seed).normal(size=corners.shape) * noise
    return Mesh(corners + jitter, faces.reshape(-1, 3).astype(np.int32))


def distance(shapes: tuple[Collision, ...] | list[Collision], points: np.ndarray) -> np.ndarray:
    """Least distance outside all shapes' faces (n,), negative inside one."""
    return np.min(
        [hull_distance(hull_of(s.corners if isinstance(s, Box) else s.vertices), points) for s in shapes], 0
    )


def volume(shapes: tuple[Collision, ...] | list[Collision]) -> float:
    return float(sum(hull_of(s.corners if isinstance(s, Box) else s.vertices).volume for s in shapes))


def behind_handle(center: tuple[float, float, float], along: int) -> np.ndarray:
    """World points in the gap between bar and panel, where fingers go: 30 % to 70 % of its depth and of its
    length."""
    depth, length = np.meshgrid(np.linspace(-0.024, -0.010, 4), np.linspace(-0.05, 0.05, 7))
    points = np.tile(np.array(center), (depth.size, 1))
    points[:, 1] += depth.ravel()
    points[:, along] += length.ravel()
    return geo.transform(T, points)


@pytest.fixture(scope="module")
def bare() -> Twin:
    """The cabinet as scanned, with neither shapes nor masses."""
    twin = cabinet_twin(T)
    boards = {"door": door_boards(), "drawer": drawer_boards()}
    parts = tuple(replace(p, mesh=scanned(boards[p.name], p.id), collision=()) for p in twin.parts)
    return replace(
        twin, static=replace(twin.static, mesh=scanned(carcass_boards(), 1), collision=()), parts=parts
    )


@pytest.fixture(scope="module")
def shaped(bare: Twin) -> Twin:
    return with_collision(bare)


@pytest.mark.parametrize(
    ("name", "center", "along"), [("door", DOOR_HANDLE, 2), ("drawer", DRAWER_HANDLE, 0)]
)
def test_the_gap_behind_a_handle_stays_free(shaped: Twin, name: str, center: tuple, along: int) -> None:
    shapes = shaped.part(name).collision
    assert distance(shapes, behind_handle(center, along)).min() > 0.003
    bar = np.array(center) + [0, -0.040, 0]
    assert distance(shapes, geo.transform(T, bar[None]))[0] < 0, "the bar itself is solid"


def test_shapes_cover_the_parts_and_little_else(shaped: Twin) -> None:
    for part, boards in zip(shaped.parts, (door_boards(), drawer_boards()), strict=True):
        true = sum(float(np.prod(b.size)) for b in boards)
        assert 0.8 * true < volume(part.collision) < 1.35 * true, part.name
        assert distance(part.collision, part.mesh.vertices).max() < 0.02
        assert np.quantile(distance(part.collision, part.mesh.vertices), 0.98) < 0.008
        assert len(part.collision) <= CONFIG.part_pieces


def test_boxes_have_right_handed_axes(bare: Twin) -> None:
    triangles = triangles_of(bare.part("door").mesh)
    boards, _ = find_boards(triangles, outline_axes(triangles), PART_BOARDS)
    assert boards
    for board in boards:
        assert np.linalg.det(board.box.T_world_box[:3, :3]) == pytest.approx(1.0)


def test_the_front_of_a_door_is_one_box(shaped: Twin) -> None:
    box = max((s for s in shaped.part("door").collision if isinstance(s, Box)), key=lambda s: np.prod(s.size))
    want = door_boards()[0].size
    assert np.allclose(sorted(box.size), sorted(want), atol=0.012)
    assert min(box.size) == pytest.approx(BOARD, abs=0.003)


def test_nothing_touches_while_a_part_opens(bare: Twin, shaped: Twin) -> None:
    shapes = [list(shaped.static.collision), *(list(p.collision) for p in shaped.parts)]
    assert find_touches(bare, shapes, 0.0015, 0.01) == []
    assert volume(shaped.static.collision) > 0.5 * sum(float(np.prod(b.size)) for b in carcass_boards())


@pytest.mark.parametrize("name", ["drawer", "door"])
def test_a_thin_edge_between_two_sampled_states_is_not_missed(name: str) -> None:
    """A blade of 2 mm on the part passes a static one of 2 mm; both sampled states have it well to one
    side."""
    twin = cabinet_twin(T)
    part = twin.part(name)
    states = sweep_states(part, STEP)
    away = part.joint.pose(float(states[4] + states[5]) / 2)
    middle = part.mesh.vertices.mean(axis=0)
    blade_pose = geo.make_pose(T[:3, :3], middle)
    fast = T[:3, :3].T @ (part.joint.pose(1e-6) @ [*middle, 1.0] - [*middle, 1.0])[:3]
    size = np.where(np.arange(3) == np.argmax(np.abs(fast)), 0.002, 0.05)
    own: list[Collision] = [Box(blade_pose, size)]
    shapes = [[Box(away @ blade_pose, size)], *([*own] if p is part else [] for p in twin.parts)]
    touches = find_touches(twin, shapes, 0.002, STEP)
    assert [(t.owner, t.index) for t in touches] == [(0, 0)]
    for state in states:
        moved = geo.transform(part.joint.pose(float(state)), own[0].corners)
        assert hull_distance(hull_of(moved), points_of(shapes[0][0])).max() > 0.004, (
            "apart in the sampled states"
        )
    left = make_clear(twin, [list(x) for x in shapes], 0.002, STEP)
    assert left[1:] == shapes[1:], "the part keeps its shape"
    assert find_touches(twin, left, 0.0019, 0.001) == []


def test_the_exported_shapes_keep_apart_in_the_engine_in_between_too(shaped: Twin, tmp_path: Path) -> None:
    """MuJoCo's distance of all pairs in the URDF, which has no exclusions, in states of no relation to the
    sweep's."""
    import mujoco

    export(shaped, tmp_path, ("urdf",))
    model = mujoco.MjSpec.from_file(str(tmp_path / "urdf" / f"{shaped.name}.urdf")).compile()
    data = mujoco.MjData(model)
    solid = np.flatnonzero(model.geom_contype)
    for part in shaped.parts:
        joint = model.joint(f"{part.name}_joint")
        own = solid[model.geom_bodyid[solid] == model.body(part.name).id]
        others = np.setdiff1d(solid, own)
        for state in np.linspace(part.joint.lower, part.joint.upper, 13):
            data.qpos[:] = 0.0
            data.qpos[joint.qposadr[0]] = state
            mujoco.mj_kinematics(model, data)
            for g in own:
                apart = np.linalg.norm(data.geom_xpos[others] - data.geom_xpos[g], axis=1)
                for h in others[apart < model.geom_rbound[others] + model.geom_rbound[g] + 0.002]:
                    found = mujoco.mj_geomDistance(model, data, int(g), int(h), 0.01, None)
                    assert found >= 0.0015, (part.name, state, model.geom(g).name, model.geom(h).name)


def test_a_static_ghost_of_the_door_gives_way(bare: Twin) -> None:
    """A fused scene may keep a surface where the closed door was: the recorded opening proves that space
    free."""
    ghost = boards_mesh([Board((-0.25, -0.02, 0.05), (0.25, -0.012, 0.5))], T)
    exact = cabinet_twin(T)
    twin = replace(
        exact,
        static=replace(exact.static, mesh=ghost, collision=()),
        parts=tuple(replace(p, collision=()) for p in exact.parts),
    )
    shaped = with_collision(twin)
    shapes = [list(shaped.static.collision), *(list(p.collision) for p in shaped.parts)]
    assert find_touches(twin, shapes, 0.0015, 0.01) == []
    assert sum(isinstance(s, Box) for s in shaped.part("door").collision) >= 1


def test_equal_input_gives_equal_shapes_and_the_cache_gives_them_back(
    bare: Twin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cache, "_last", {})
    one = replace(bare, parts=bare.parts[:1])
    first, again = with_collision(one, cache_dir=tmp_path), with_collision(one)
    assert sorted(f.name.partition("_")[0] for f in tmp_path.iterdir()) == ["part", "twin"]
    monkeypatch.setattr(collision, "_make", Mock(side_effect=AssertionError("made once")))
    cached, remembered = with_collision(one, cache_dir=tmp_path), with_collision(one)
    monkeypatch.undo()
    for a, b in ((first, again), (first, cached), (first, remembered)):
        for x, y in zip((a.static, *a.parts), (b.static, *b.parts), strict=True):
            assert len(x.collision) == len(y.collision)
            for s, t in zip(x.collision, y.collision, strict=True):
                assert type(s) is type(t)
                assert np.array_equal(getattr(s, "vertices", None), getattr(t, "vertices", None))
                assert np.array_equal(getattr(s, "size", None), getattr(t, "size", None))
    with_collision(one, replace(CONFIG, tolerance=0.008), cache_dir=tmp_path)
    assert len(list(tmp_path.iterdir())) == 4, "another config is another key"


def test_shapes_that_are_the_same_stay_once() -> None:
    twin = cabinet_twin(T)
    board, *others = twin.static.collision
    hull = hull_of(points_of(board)).mesh
    again = Mesh(hull.vertices[::-1].copy(), len(hull.vertices) - 1 - hull.faces)
    shapes = [[board, *others, hull, again], *(list(p.collision) for p in twin.parts)]
    clear = make_clear(twin, shapes, 0.001, 0.05)
    assert len(clear[0]) == 1 + len(others)
    assert [len(s) for s in clear[1:]] == [len(p.collision) for p in twin.parts]


def test_given_shapes_are_kept() -> None:
    twin = cabinet_twin()
    assert with_collision(twin) is twin


def test_a_front_seen_from_one_side_gets_its_thickness_behind() -> None:
    mesh = boards_mesh([Board((0, 0, 0), (0.4, 0.018, 0.5))], cut=3)
    triangles = triangles_of(mesh)
    facing = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])[:, 1] < -1e-9
    front = Mesh(mesh.vertices, mesh.faces[facing])
    board = PART_BOARDS.thickness
    for shape, want in (
        (make_part(front, CONFIG).shapes[0], board),
        (thick_hull(triangles_of(front), 0.006).mesh, 0.006),
    ):
        points = shape.corners if isinstance(shape, Box) else shape.vertices
        assert points[:, 1].min() == pytest.approx(0.0, abs=1e-6)
        assert points[:, 1].max() == pytest.approx(want, abs=1e-6)
    assert make_part(front, CONFIG).table == 1.0


def test_cutting_keeps_the_area_and_the_sides() -> None:
    triangles = triangles_of(boards_mesh(door_boards(), T))
    rng = np.random.default_rng(0)
    for _ in range(10):
        normal = geo.unit(rng.normal(size=3))
        offset = float(rng.choice(triangles.reshape(-1, 3) @ normal)) + 1e-4
        low, high = cut(triangles, normal, offset)
        assert geo.triangle_areas(low).sum() + geo.triangle_areas(high).sum() == pytest.approx(
            geo.triangle_areas(triangles).sum(), rel=1e-6
        )
        assert (low @ normal).max(initial=-9) <= offset + 1e-9
        assert (high @ normal).min(initial=9) >= offset - 1e-9


def test_clipping_a_cube_is_exact() -> None:
    cube = hull_of(Box(np.eye(4), np.ones(3)).corners)
    assert cube.volume == pytest.approx(1.0)
    assert clip(cube, np.array([1.0, 0, 0]), 0.2).volume == pytest.approx(0.3)
    corner = clip(cube, geo.unit([1.0, 1, 1]), np.sqrt(3) / 2 - 0.1 * np.sqrt(3) / 3 * 1)
    assert corner.volume == pytest.approx(0.1**3 / 6, rel=1e-6)
    assert clip(cube, np.array([1.0, 0, 0]), 0.6) is None
    assert hull_distance(cube, np.array([[0.0, 0, 0], [0.7, 0, 0]])) == pytest.approx([-0.5, 0.2])


def test_a_ring_is_split_and_a_ball_is_not() -> None:
    ring = triangles_of(boards_mesh([Board((0, 0, 0), (0.3, 0.02, 0.02)), Board((0, 0, 0.28), (0.3, 0.02, 0.3)),
                                     Board((0, 0, 0.02), (0.02, 0.02, 0.28)), Board((0.28, 0, 0.02), (0.3, 0.02, 0.28))]))  # fmt: skip
    hulls = [thick_hull(p, 0.006) for p in decompose(ring, 0.006, 0.006, 32)]
    middle = np.array([[0.15, 0.01, 0.15], [0.1, 0.01, 0.2], [0.2, 0.01, 0.1]])
    assert min(hull_distance(h, middle).min() for h in hulls) > 0.03
    whole = thick_hull(ring, 0.006)
    assert bulge(whole, ring, 0.006) > 0.1, "the middle of the hull's face is far from the ring"
    ball = hull_of(geo.unit(np.random.default_rng(1).normal(size=(300, 3))) * 0.1)
    assert len(decompose(ball.vertices[ball.faces], 0.006, 0.006, 20)) == 1


def test_main_axes_are_those_of_the_boards() -> None:
    axes = outline_axes(triangles_of(scanned(door_boards(), 5)))
    assert np.allclose(axes.T @ axes, np.eye(3), atol=1e-9)
    assert max(min(geo.line_angle(a, b) for b in T[:3, :3].T) for a in axes.T) < np.deg2rad(1.0)


def test_states_of_a_sweep_move_no_point_far() -> None:
    door = cabinet_twin().part("door")
    states = sweep_states(door, 0.02)
    assert (states[0], states[-1]) == (0.0, door.joint.upper)
    assert isinstance(door.joint, Revolute)
    moved = [geo.transform(door.joint.pose(s), door.mesh.vertices) for s in states[:2]]
    assert np.linalg.norm(moved[1] - moved[0], axis=1).max() <= 0.0201
    assert CONFIG.clearance < GAP

"""Shapes of closed bodies: exact boxes, round bodies, bodies that CoACD splits, bodies that are none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from benchmarks.scenes.boards import (
    Board,
    boards_mesh,
    cabinet_twin,
    door_boards,
    drawer_boards,
    world_from_cabinet,
)
from tests.twin.collision.test_collision import CONFIG, scanned
from twin import geometry as geo
from twin.collision import closed_pieces, make_part, with_collision
from twin.collision.closed_pieces import coacd_pieces, concave_share, enclosed, outward
from twin.collision.convex import box_of, hull_of
from twin.collision.fit import fit_of
from twin.collision.pieces import pieces_of
from twin.collision.solid import Solid
from twin.exporters.shape_report import collision_reports
from twin.mesh import joined
from twin.scene import Box, Mesh

T = world_from_cabinet()


def round_body(radius: float, length: float) -> Mesh:
    """A cylinder of 24 sides."""
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(24)], axis=1)
    hull = hull_of(np.concatenate([ring, ring + [0, 0, length]]))
    assert hull is not None
    return hull.mesh.transformed(T)


def channel(width: float = 0.2, wall: float = 0.02, length: float = 0.3) -> Mesh:
    """A solid U, one closed body: an outline of eight corners drawn out along y."""
    w, t = width, wall
    outline = np.array([[0, 0], [w, 0], [w, w], [w - t, w], [w - t, t], [t, t], [t, w], [0, w]])
    caps = np.array([[0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4], [0, 5, 6], [0, 6, 7]])
    front, back = (np.insert(outline, 1, y, axis=1) for y in (0.0, length))
    k = np.arange(8)
    n = (k + 1) % 8
    sides = np.concatenate([np.stack([k, k + 8, n], 1), np.stack([n, k + 8, n + 8], 1)])
    return Mesh(
        np.concatenate([front, back]), np.concatenate([caps, caps[:, ::-1] + 8, sides]).astype(np.int32)
    )


def flipped(mesh: Mesh, count: int | None = None) -> Mesh:
    faces = mesh.faces.copy()
    faces[:count] = faces[:count, ::-1]
    return Mesh(mesh.vertices, faces)


@pytest.mark.parametrize("boards", [door_boards(), drawer_boards()])
def test_a_part_of_exact_boards_gets_exactly_these_boxes(boards: list[Board]) -> None:
    mesh = boards_mesh(boards, T)
    shapes = make_part(mesh, CONFIG).shapes
    assert all(isinstance(s, Box) for s in shapes)
    assert len(shapes) == len(boards)
    fit = fit_of(shapes, Solid.of_mesh(mesh))
    assert fit.ratio == pytest.approx(1.0, abs=1e-6)
    assert max(fit.surface, fit.missed) < 1e-6


def test_a_knob_is_its_hull_and_a_scanned_board_its_box() -> None:
    (knob,) = make_part(round_body(0.015, 0.03), CONFIG).shapes
    assert isinstance(knob, Mesh)
    assert hull_of(knob.vertices).volume == pytest.approx(12 * 0.015**2 * np.sin(np.pi / 12) * 0.03, rel=1e-6)
    board = Board((0, 0, 0), (0.4, 0.018, 0.3))
    (box,) = make_part(scanned([board], 4), CONFIG).shapes
    assert isinstance(box, Box)
    assert np.sort(box.size) == pytest.approx(np.sort(board.size), abs=0.002)
    assert concave_share(scanned([board], 4)) > 0.4


@pytest.mark.parametrize("pose", [np.eye(4), T, T @ geo.make_pose(geo.exp_so3([0.3, 1.0, -0.4]))])
def test_coacd_splits_a_channel_exactly_wherever_it_stands(pose: np.ndarray) -> None:
    mesh = channel().transformed(pose)
    assert len(pieces_of(mesh)) == 1
    assert enclosed(mesh) == pytest.approx(0.3 * (0.2 * 0.02 + 2 * 0.18 * 0.02))
    shapes = make_part(mesh, CONFIG).shapes
    fit = fit_of(shapes, Solid.of_mesh(mesh))
    assert 3 <= len(shapes) <= 6
    assert fit.ratio == pytest.approx(1.0, abs=0.02)
    assert max(fit.surface, fit.missed) < 0.001


def test_equal_bodies_give_equal_pieces_and_winding_does_not_matter() -> None:
    mesh = channel()
    first = make_part(mesh, CONFIG).shapes
    for other in (flipped(mesh), flipped(mesh, 5)):
        again = make_part(other, CONFIG).shapes
        assert len(again) == len(first)
        assert fit_of(again, Solid.of_mesh(mesh)).ratio == pytest.approx(1.0, abs=0.02)
    for a, b in zip(first, make_part(mesh, CONFIG).shapes, strict=True):
        assert type(a) is type(b)
        assert np.array_equal(getattr(a, "size", 0), getattr(b, "size", 0))
        assert np.array_equal(getattr(a, "vertices", 0), getattr(b, "vertices", 0))


def test_without_coacd_the_surface_is_covered(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Where CoACD is killed, crashes or writes nothing, the splitter for scans takes over."""
    worker = tmp_path / "coacd_worker.py"
    worker.write_text("import sys\nsys.exit(3)\n")
    monkeypatch.setattr(closed_pieces, "__file__", str(tmp_path / "closed_pieces.py"))
    assert coacd_pieces(channel(), 0.007, 32) == []
    shapes = make_part(channel(), CONFIG).shapes
    assert 1 <= len(shapes) <= CONFIG.part_pieces
    assert fit_of(shapes, Solid.of_mesh(channel())).missed < 0.01


def test_a_coacd_that_never_ends_is_ended(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    limit = "import resource, sys\nresource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[3]),) * 2)\n"
    (tmp_path / "coacd_worker.py").write_text(limit + "while True:\n    pass\n")
    monkeypatch.setattr(closed_pieces, "__file__", str(tmp_path / "closed_pieces.py"))
    assert coacd_pieces(channel(), 0.007, 32, seconds=1) == []


def test_bodies_that_are_none_are_no_shapes_and_no_errors() -> None:
    empty = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    flat = Mesh(np.array([[0, 0, 0], [1, 0, 0], [2.0, 0, 0]]), np.array([[0, 1, 2]], np.int32))
    point = Mesh(np.full((3, 3), 0.5), np.array([[0, 1, 2], [0, 0, 1]], np.int32))
    for mesh in (empty, flat, point):
        assert make_part(mesh, CONFIG).shapes == ()
    twice = Mesh(channel().vertices, np.concatenate([channel().faces, channel().faces]))
    sheet = boards_mesh([Board((0, 0, 0), (0.3, 0.0, 0.2))], T)
    ball = ConvexHull(geo.unit(np.random.default_rng(1).normal(size=(200, 3))) * 0.05)
    unwound = Mesh(ball.points, ball.simplices.astype(np.int32))
    crossed = boards_mesh([Board((0, 0, 0), (0.3, 0.02, 0.02)), Board((0.1, -0.1, 0), (0.12, 0.1, 0.02))], T)
    for mesh in (twice, sheet, unwound, crossed):
        shapes = make_part(mesh, CONFIG).shapes
        assert 1 <= len(shapes) <= CONFIG.part_pieces
        assert all(np.isfinite(s.corners if isinstance(s, Box) else s.vertices).all() for s in shapes)
    assert outward(unwound) is not None
    assert enclosed(outward(unwound)) > 0


@pytest.mark.parametrize("most", [1, 2, 3, 4])
def test_closed_and_open_pieces_together_get_no_more_shapes_than_asked_for(most: int) -> None:
    open_front = boards_mesh([Board((0, -0.02, 0), (0.45, -0.001, 0.4))], T, cut=0)
    open_front = replace(open_front, faces=open_front.faces[2:])
    handles = [Board((x, 0.05, 0.1), (x + 0.02, 0.08, 0.3)) for x in (0.1, 0.2, 0.3)]
    mesh = joined([open_front, boards_mesh(handles, T, cut=0)])
    assert 1 <= len(make_part(mesh, replace(CONFIG, part_pieces=most)).shapes) <= most


def test_however_many_bodies_a_part_has_it_gets_no_more_than_32_shapes() -> None:
    grid = [(0.05 * i, 0.05 * j) for i in range(9) for j in range(8)]
    boards = [Board((x, 0, z), (x + 0.03, 0.03, z + 0.03)) for x, z in grid]
    made = make_part(boards_mesh([Board((0, -0.02, 0), (0.45, -0.001, 0.4)), *boards], T, cut=0), CONFIG)
    assert 8 <= len(made.shapes) <= CONFIG.part_pieces
    assert isinstance(made.shapes[0], Box)


def test_the_box_of_a_hull_is_found_however_it_lies() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        pose = geo.make_pose(geo.exp_so3(rng.normal(size=3)), rng.normal(size=3))
        size = rng.uniform(0.01, 0.5, 3)
        found = box_of(hull_of(Box(pose, size).corners))
        assert found is not None
        assert np.sort(found.size) == pytest.approx(np.sort(size), rel=1e-6)
        assert found.T_world_box[:3, 3] == pytest.approx(pose[:3, 3], abs=1e-9)
    assert box_of(hull_of(round_body(0.02, 0.1).vertices)) is None


def test_a_changed_part_leaves_the_shapes_of_the_others(tmp_path: Path) -> None:
    exact = cabinet_twin(T)
    bare = replace(
        exact,
        static=replace(exact.static, collision=()),
        parts=tuple(replace(p, collision=()) for p in exact.parts),
    )
    shaped = with_collision(bare, cache_dir=tmp_path)
    before = {f.name: f.stat().st_mtime_ns for f in tmp_path.iterdir()}
    door = bare.part("door")
    wider = replace(door, mesh=Mesh(door.mesh.vertices * [1, 1, 1.001], door.mesh.faces, door.mesh.colors))
    with_collision(replace(bare, parts=(wider, bare.part("drawer"))), cache_dir=tmp_path)
    after = {f.name: f.stat().st_mtime_ns for f in tmp_path.iterdir()}
    assert len(before) == 3
    assert len(after) == 5, "one file for the changed door, one for the twin"
    assert all(after[k] == v for k, v in before.items())
    for f in tmp_path.iterdir():
        f.write_bytes(b"broken")
    again = with_collision(bare, cache_dir=tmp_path)
    assert [len(p.collision) for p in again.parts] == [len(p.collision) for p in shaped.parts]


def test_the_report_of_an_exact_part_is_perfect_and_an_unseen_back_is_told(tmp_path: Path) -> None:
    exact = cabinet_twin(T)
    door = exact.part("door")
    corners = door.mesh.vertices[door.mesh.faces]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ T[:3, 1] < -1e-9
    front = replace(door, collision=(), mesh=Mesh(door.mesh.vertices, door.mesh.faces[facing]))
    drawer = replace(exact.part("drawer"), collision=())
    shaped = with_collision(replace(exact, parts=(front, drawer)), cache_dir=tmp_path)
    one, two = collision_reports(shaped, tmp_path)
    assert "never seen" in one.warning
    assert not one.closed
    assert two.warning == ""
    assert two.closed
    assert two.fit.ratio == pytest.approx(1.0, abs=1e-6)
    assert two.seconds is not None
    assert two.to_json()["shapes"] == len(drawer_boards())
    assert collision_reports(shaped)[0].seconds is None

"""Meshes of many faces, as scanners and careless exports leave them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh

from benchmarks.scenes.boards import boards_mesh, carcass_boards, door_boards
from twin.scene import Mesh


def fine_boards(faces: int, seed: int = 0, noise: float = 0.001) -> Mesh:
    """A door of boards with its handle, cut into about `faces` triangles whose corners are off by noise;
    coloured."""
    return _fine(boards_mesh(door_boards()), faces, seed, noise)


def fine_scene(faces: int, seed: int = 0, noise: float = 0.003) -> Mesh:
    """The cabinet around it."""
    return _fine(boards_mesh(carcass_boards()), faces, seed, noise)


def _fine(mesh: Mesh, faces: int, seed: int, noise: float) -> Mesh:
    while 2 * len(mesh.faces) <= faces:
        mesh = _mesh(trimesh.Trimesh(mesh.vertices, mesh.faces).subdivide())
    rng = np.random.default_rng(seed)
    color = rng.integers(120, 160, (len(mesh.vertices), 3), dtype=np.uint8)
    return Mesh(mesh.vertices + rng.normal(size=mesh.vertices.shape) * noise, mesh.faces, color)


def _mesh(t: trimesh.Trimesh) -> Mesh:
    return Mesh(np.array(t.vertices), np.array(t.faces))


def soup(faces: int) -> Mesh:
    """Every triangle with corners of its own, and as many corners of no face."""
    mesh = fine_boards(faces)
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    stray = np.random.default_rng(1).uniform(-9.0, 9.0, corners.shape)
    return Mesh(np.concatenate([corners, stray]), np.arange(len(corners), dtype=np.int32).reshape(-1, 3))


def shells(faces: int) -> Mesh:
    """The door's surface as small closed shells beside one another."""
    small = trimesh.creation.icosahedron()
    count = faces // len(small.faces)
    points = trimesh.sample.sample_surface(
        trimesh.Trimesh(*(lambda m: (m.vertices, m.faces))(boards_mesh(door_boards()))), count, seed=2
    )[0]
    vertices = points[:, None] + 0.003 * np.array(small.vertices)
    index = np.array(small.faces) + 12 * np.arange(count)[:, None, None]
    return Mesh(vertices.reshape(-1, 3), index.reshape(-1, 3).astype(np.int32))


def with_slivers(faces: int) -> Mesh:
    """The door with faces without area, faces given twice, and holes."""
    mesh = fine_boards(faces)
    rng = np.random.default_rng(3)
    flat = rng.integers(0, len(mesh.vertices), (faces // 20, 1)) * np.ones((1, 3), int)
    flat[:, 2] = rng.integers(0, len(mesh.vertices), len(flat))
    keep = rng.uniform(size=len(mesh.faces)) > 0.02
    twice = mesh.faces[: faces // 20]
    return Mesh(mesh.vertices, np.concatenate([mesh.faces[keep], flat, twice]), mesh.colors)


def round_body(faces: int) -> Mesh:
    """A ball of 0.3 m, convex, of about `faces` triangles."""
    side = round(np.sqrt(faces / 2))
    return _mesh(trimesh.creation.uv_sphere(radius=0.15, count=[side, side]))


def t_junctions(faces: int, noise: float = 0.0005) -> Mesh:
    """The door with most triangles cut in four again and again, but not their neighbours: cracks
    everywhere."""
    mesh, rng = boards_mesh(door_boards()), np.random.default_rng(1)
    while len(mesh.faces) < faces:
        some = np.flatnonzero(rng.uniform(size=len(mesh.faces)) < 0.7)
        cut = trimesh.remesh.subdivide(mesh.vertices, mesh.faces, face_index=some)
        mesh = Mesh(np.array(cut[0]), np.array(cut[1]))
    return Mesh(mesh.vertices + rng.normal(size=mesh.vertices.shape) * noise, mesh.faces)


def shreds(faces: int) -> Mesh:
    """Every triangle of the door by itself, a little off its neighbours."""
    mesh = soup(faces)
    return Mesh(
        mesh.vertices + np.random.default_rng(6).normal(size=mesh.vertices.shape) * 0.0003, mesh.faces
    )


def fan(faces: int) -> Mesh:
    """A cylinder whose caps are fans of slivers: a quarter of all faces meet at either middle."""
    return _mesh(trimesh.creation.cylinder(radius=0.2, height=0.4, sections=faces // 4))


def bodies(faces: int, count: int = 1000) -> Mesh:
    """Small closed boxes beside one another."""
    box = trimesh.creation.box([0.02, 0.015, 0.01])
    while 2 * len(box.faces) * count <= faces:
        box = box.subdivide()
    k = np.arange(count)
    at = np.stack([k % 10, k // 10 % 10, k // 100], axis=1) * [0.06, 0.03, 0.04]
    vertices = at[:, None] + np.array(box.vertices)
    index = np.array(box.faces) + len(box.vertices) * k[:, None, None]
    return Mesh(vertices.reshape(-1, 3), index.reshape(-1, 3).astype(np.int32))


def crossed_edges(faces: int) -> Mesh:
    """The door with a third face at many edges."""
    mesh, rng = fine_boards(faces), np.random.default_rng(0)
    edge = mesh.faces[rng.integers(0, len(mesh.faces), faces // 20)]
    edge = np.concatenate([edge[:, :2], rng.integers(0, len(mesh.vertices), (len(edge), 1))], axis=1)
    return Mesh(mesh.vertices, np.concatenate([mesh.faces, edge.astype(np.int32)]), mesh.colors)


def twice(faces: int) -> Mesh:
    """The door given twice in the same place, with corners of its own each time."""
    mesh = fine_boards(faces // 2)
    return Mesh(
        np.concatenate([mesh.vertices, mesh.vertices]),
        np.concatenate([mesh.faces, mesh.faces + len(mesh.vertices)]),
    )


def flat_front(faces: int) -> Mesh:
    """The front without noise: all corners in one plane."""
    mesh = front(faces)
    return Mesh(mesh.vertices * [1.0, 0.0, 1.0], mesh.faces)


def millimetres(faces: int) -> Mesh:
    """The door in millimetres, read as metres."""
    mesh = fine_boards(faces)
    return Mesh(1000.0 * mesh.vertices, mesh.faces, mesh.colors)


def front(faces: int) -> Mesh:
    """One side of a board, 0.6 x 0.4 m, as a camera in front of it sees it."""
    rows = round(np.sqrt(faces / 2))
    x, z = np.meshgrid(np.linspace(0, 0.6, rows + 1), np.linspace(0, 0.4, rows + 1))
    y = 0.0008 * np.random.default_rng(4).normal(size=x.shape)
    k = np.arange(x.size).reshape(x.shape)
    a, b, c, d = k[:-1, :-1].ravel(), k[:-1, 1:].ravel(), k[1:, 1:].ravel(), k[1:, :-1].ravel()
    return Mesh(
        np.stack([x, y, z], axis=-1).reshape(-1, 3),
        np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]),
    )


KINDS: dict[str, Callable[[int], Mesh]] = {
    "boards": fine_boards,
    "soup": soup,
    "shells": shells,
    "slivers": with_slivers,
    "ball": round_body,
    "front": front,
    "flat front": flat_front,
    "T-junctions": t_junctions,
    "shreds": shreds,
    "fan": fan,
    "bodies": bodies,
    "crossed edges": crossed_edges,
    "twice": twice,
    "millimetres": millimetres,
}

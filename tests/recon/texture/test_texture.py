"""Photo textures of a painted cube, seen by a ray caster in closed form: the paint comes back, and the hand
never does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from recon.contact.finish_parts import FinishedPart
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics, Recording
from recon.texture.charts import MAX_TURN, lay_out
from recon.texture.exposure import gains
from recon.texture.fill import around, over_surface
from recon.texture.photo_textures import TextureConfig, chosen, evenly, photo_textures, photographed
from recon.texture.raster import faces_at
from tests.makers.recon.judged import SHUT
from twin import geometry as geo
from twin.geometry import Array
from twin.inferred import box_mesh
from twin.scene import HAND_LABEL, STATIC_LABEL, Mesh, Motion, Prismatic, Texture, Trajectory

CAMERA = Intrinsics(240, 180, 220.0, 220.0, 119.5, 89.5)
SIDE = 0.4
FRAMES = 10
HAND = (250, 10, 10)  # no paint is as red
CONFIG = TextureConfig(texel=0.003)


def paint(points: Array) -> Array:
    """Colour (n, 3) 0..255 of points (n, 3) m of the cube: waves of 10 to 16 cm."""
    x, y, z = points.T
    waves = [
        np.sin(60 * x + 40 * z) + np.sin(50 * y),
        np.sin(55 * y - 45 * z),
        np.sin(40 * x + 50 * y + 40 * z),
    ]
    return 120.0 + np.stack(waves, axis=1) * [30, 60, 60]


def cube(cells: int = 6) -> Mesh:
    """The cube, each side cut into `cells` x `cells` squares."""
    mesh = box_mesh(np.eye(4), np.full(3, SIDE))
    vertices, faces = [], []
    t = np.linspace(0, 1, cells + 1)
    for a, b, c in mesh.vertices[mesh.faces[::2]]:  # a, b, c: three corners of a side
        lengths = [np.linalg.norm(b - a), np.linalg.norm(c - b), np.linalg.norm(a - c)]
        k = int(np.argmax(lengths))  # the diagonal: the right angle is at the corner across it
        o, p, q = [(c, a, b), (a, b, c), (b, c, a)][k]
        start = sum(len(v) for v in vertices)
        grid = o + t[:, None, None] * (p - o) + t[None, :, None] * (q - o)
        vertices.append(grid.reshape(-1, 3))
        for i in range(cells):
            for j in range(cells):
                n = start + i * (cells + 1) + j
                faces += [(n, n + cells + 1, n + 1), (n + 1, n + cells + 1, n + cells + 2)]
    return Mesh(np.concatenate(vertices), np.array(faces, np.int32))


def eyes() -> Array:
    """Camera poses (FRAMES, 4, 4) on an arc before the cube's +x and +y sides, a little above it."""
    poses = []
    for turn in np.linspace(0.35, 1.2, FRAMES):
        eye = np.array([np.cos(turn), np.sin(turn), 0.45]) * 0.85
        ahead = -eye / np.linalg.norm(eye)
        right = np.cross(ahead, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        poses.append(geo.make_pose(np.stack([right, np.cross(ahead, right), ahead], axis=1), eye))
    return np.stack(poses)


def cast(pose: Array) -> tuple[Array, NDArray[np.bool_], Array]:
    """Points (H, W, 3) where the rays of a camera meet the cube, whether they do, and their depth (H, W)
    m."""
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    ahead = CAMERA.backproject(np.stack([u, v], axis=-1).astype(float), np.ones(u.shape)) @ pose[:3, :3].T
    with np.errstate(divide="ignore"):
        ends = np.sort(np.stack([(s * SIDE / 2 - pose[:3, 3]) / ahead for s in (-1, 1)]), axis=0)
    near, far = ends[0].max(axis=-1), ends[1].min(axis=-1)
    hit = (near < far) & (near > 0)
    return pose[:3, 3] + np.where(hit, near, 0.0)[..., None] * ahead, hit, np.where(hit, near, 0.0)


class Scene:
    """Recording of the cube, its cameras and labels. shift (FRAMES,): how far it stands along y in each
    frame, m; light (FRAMES,): factors of the colours; hand: whether a red hand covers part of each frame."""

    def __init__(
        self,
        shift: Array | None = None,
        light: Array | None = None,
        hand: bool = False,
        label: int = STATIC_LABEL,
    ) -> None:
        poses = eyes()
        colors, depths, self.labels = [], [], {}
        for k, pose in enumerate(poses):
            seen = pose.copy()
            seen[1, 3] -= 0.0 if shift is None else shift[k]
            points, hit, depth = cast(seen)
            color = np.full((*hit.shape, 3), 90.0)
            color[hit] = paint(points[hit])
            color *= 1.0 if light is None else light[k]
            labels = np.where(hit, label, 0).astype(np.uint8)
            if hand:
                spot = np.s_[70:110, 90 + 6 * k : 130 + 6 * k]
                color[spot], labels[spot] = HAND, HAND_LABEL  # at the depth of the cube: depth can't tell it
            colors.append(np.clip(np.round(color), 0, 255).astype(np.uint8))
            depths.append(depth.astype(np.float32))
            self.labels[k] = labels
        times = np.arange(FRAMES) / 10.0
        self.recording = Recording(
            "cube", "test", times, CAMERA, lambda k: colors[k], lambda k: depths[k], fingerprint="0"
        )
        self.cameras = Trajectory(np.arange(FRAMES), times, poses)

    def dressed(self, mesh: Mesh | None = None, parts: tuple[FinishedPart, ...] = ()) -> dict[int, Texture]:
        return photo_textures(self.recording, self.cameras, self.labels, mesh or cube(), parts, CONFIG)


def read(mesh: Mesh, texture: Texture) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Points (n, 3) of the mesh, the texture's colours there (n, 3), and whether they were seen: the middle
    of each face and others."""
    h, w = texture.image.shape[:2]
    out = []
    for weights in ([1 / 3, 1 / 3, 1 / 3], [0.6, 0.2, 0.2], [0.2, 0.6, 0.2]):
        at = np.einsum("k,fkd->fd", weights, texture.uv.astype(float)) * [w, h]
        x, y = np.clip(at.astype(int), 0, [w - 1, h - 1]).T
        points = np.einsum("k,fkd->fd", weights, mesh.vertices[mesh.faces])
        out.append((points, texture.image[h - 1 - y, x].astype(float), texture.seen[h - 1 - y, x]))
    points, color, seen = (np.concatenate([o[k] for o in out]) for k in range(3))
    return points, color, seen


def decibel(found: Array, true: Array) -> float:
    gain = true.mean(axis=0) / found.mean(axis=0)
    return float(10 * np.log10(255**2 / np.mean((found * gain - true) ** 2)))


def test_the_paint_comes_back_where_it_was_seen_and_only_there() -> None:
    mesh = cube()
    points, color, seen = read(mesh, Scene().dressed()[STATIC_LABEL])
    shown = (points[:, 0] > 0.199) | (points[:, 1] > 0.199) | (points[:, 2] > 0.199)
    inner = np.sort(np.abs(points), axis=1)[:, 1] < 0.17  # at edges the outline hides a texel or two
    assert not seen[~shown].any()
    assert seen[shown & inner].mean() > 0.99
    assert decibel(color[seen & inner], paint(points[seen & inner])) > 36


def test_no_pixel_of_a_hand_is_used() -> None:
    texture = Scene(hand=True).dressed()[STATIC_LABEL]
    points, color, seen = read(cube(), texture)
    red = (texture.image[..., 0].astype(int) - texture.image[..., 1:].max(axis=2)) > 150
    assert not red.any()
    assert decibel(color[seen], paint(points[seen])) > 30


def test_steps_of_brightness_are_balanced() -> None:
    light = np.array([1.0, 0.8, 1.15, 0.85, 1.1, 0.75, 1.2, 0.95, 1.05, 0.9])
    points, color, seen = read(cube(), Scene(light=light).dressed()[STATIC_LABEL])
    assert decibel(color[seen], paint(points[seen])) > 38


def test_gains_of_frames_are_found_and_shadows_are_not_taken_for_them() -> None:
    rng = np.random.default_rng(0)
    true, places = rng.uniform(0.8, 1.25, (6, 3)), rng.uniform(60, 150, (500, 3))
    seen = places[:, None] * true
    seen[:80, 3] *= 0.5  # a shadow on a sixth of a frame
    weight = (rng.random((500, 6)) < 0.7).astype(float)
    found = gains([(seen, weight)], 6)
    product = found * true
    assert np.allclose(product / product.mean(axis=0), 1.0, atol=0.03)


def test_a_part_is_followed_as_it_moves() -> None:
    shift = np.linspace(0, 0.12, FRAMES)
    scene = Scene(shift=shift, label=2)
    motion = Motion(np.arange(FRAMES), scene.recording.times, shift, ((0, FRAMES - 1),), 0.001, 1.0)
    joint = Prismatic(np.array([0, 1.0, 0]), 0.0, 0.12)
    mesh = cube()
    part = FinishedPart(MovingPart(2, joint, motion), mesh, None, "tracks", SHUT)
    far = mesh.transformed(geo.make_pose(np.eye(3), [0, 0, -5.0]))
    textures = scene.dressed(far, (part,))
    points, color, seen = read(mesh, textures[2])
    assert decibel(color[seen], paint(points[seen])) > 33
    assert not textures[STATIC_LABEL].seen.any()


def test_threads_change_no_byte(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, made = Scene(hand=True), []
    for count in ("1", "3"):
        monkeypatch.setenv("OMP_NUM_THREADS", count)
        made.append(scene.dressed()[STATIC_LABEL])
    a, b = made
    assert a.image.tobytes() == b.image.tobytes()
    assert a.uv.tobytes() == b.uv.tobytes()
    assert a.seen.tobytes() == b.seen.tobytes()


def test_charts_share_no_texel_and_keep_their_size() -> None:
    """A folded strip whose two sheets would lie on each other is cut; areas on the image are those of the
    faces."""
    mesh = cube()
    second = mesh.transformed(geo.make_pose(np.eye(3), [0.0, 0.0, 0.05]))
    both = Mesh(
        np.concatenate([mesh.vertices, second.vertices]),
        np.concatenate([mesh.faces, second.faces + len(mesh.vertices)]),
    )
    layout = lay_out(both, np.full(len(both.faces), 0.004))
    uv = layout.uv
    double = np.linalg.det(np.stack([uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]], axis=1))
    area = geo.triangle_areas(both.vertices[both.faces]) / 0.004**2
    assert np.allclose(np.abs(double) / 2, area, rtol=0.01)
    assert np.allclose(layout.stretch, 1.0)
    owner = faces_at(uv, 0, *layout.size)
    held = np.bincount(owner[owner >= 0], minlength=len(uv))
    assert (held > 0.8 * area).all()  # with its margin each face holds at least what it covers


def test_texels_are_as_small_as_asked_on_what_turns_away_from_its_chart() -> None:
    """On a ball hardly a face lies in the plane of its chart."""
    shape = trimesh.creation.icosphere(4, 0.3)
    ball = Mesh(np.asarray(shape.vertices, np.float64), np.asarray(shape.faces, np.int32))
    layout = lay_out(ball, np.full(len(ball.faces), 0.004))
    corners = ball.vertices[ball.faces]
    along = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    across = np.stack([layout.uv[:, 1] - layout.uv[:, 0], layout.uv[:, 2] - layout.uv[:, 0]], axis=2)
    texel = np.linalg.svd(along @ np.linalg.inv(across), compute_uv=False)[:, 0]
    area = geo.triangle_areas(corners)
    assert area[texel > 0.004 * 1.01].sum() <= 0.06 * area.sum()
    assert texel.max() < 0.004 / MAX_TURN
    told = texel / (0.004 * layout.stretch)
    assert told.min() > 0.96  # charts are stretched to whole tiles: their texels are finer
    assert told.max() < 1.02


def test_sheets_of_one_chart_are_cut_apart() -> None:
    """A spiral ramp never turns, yet its turns lie above each other."""
    turns, steps = 2, 24
    angle = np.linspace(0, 2 * np.pi * turns, turns * steps + 1)
    rim = np.stack([np.cos(angle), np.sin(angle), 0.05 * angle], axis=1)
    vertices = np.concatenate([rim * [0.2, 0.2, 1], rim * [0.5, 0.5, 1]])
    n = len(rim)
    faces = [f for k in range(n - 1) for f in ((k, k + n, k + 1), (k + 1, k + n, k + n + 1))]
    mesh = Mesh(vertices, np.array(faces, np.int32))
    layout = lay_out(mesh, np.full(len(faces), 0.005))
    owner = faces_at(layout.uv, 0, *layout.size)
    held = np.bincount(owner[owner >= 0], minlength=len(faces))
    area = geo.triangle_areas(mesh.vertices[mesh.faces]) / layout.stretch / 0.005**2
    assert (held > 0.8 * area).all()


def test_what_nobody_saw_is_painted_from_beside_it() -> None:
    mesh = cube(4)
    line = Mesh(
        np.array([[k, j, 0.0] for k in range(5) for j in range(2)]),
        np.array([f for k in range(0, 8, 2) for f in ((k, k + 2, k + 1), (k + 1, k + 2, k + 3))]),
    )
    colors = np.zeros((10, 3), np.float32)
    colors[8:] = 200
    seen = np.zeros(10, bool)
    seen[[0, 1, 8, 9]] = True
    filled = over_surface(colors, seen, line.faces)[:, 0]
    assert np.all(np.diff(filled[::2]) > 0)
    assert np.all(
        over_surface(
            np.zeros((len(mesh.vertices), 3), np.float32), np.zeros(len(mesh.vertices), bool), mesh.faces
        )
        > 0
    )
    image = np.zeros((9, 9, 3), np.uint8)
    image[4, 2], image[4, 6] = 10, 20
    mask = image[..., 0] > 0
    spread = around(image, mask)
    assert (spread[:, :4] == 10).all()
    assert (spread[:, 5:] == 20).all()


def test_frames_left_out_are_left_out() -> None:
    left = chosen(range(0, 50, 4), TextureConfig(skip_every=12))
    assert left == [4, 8, 16, 20, 28, 32, 40, 44]
    assert evenly(left, 4) == [4, 16, 32, 44]


def test_a_part_that_few_frames_of_a_walk_show_is_photographed() -> None:
    """48 of 1,000 frames would miss what is seen for three of them."""
    image, with_part = np.ones((2, 2), np.uint8), np.full((2, 2), 2, np.uint8)
    labels = {f: with_part if 503 <= f <= 505 else image for f in range(1000)}
    moving = MovingPart(
        2, Prismatic(np.array([0.0, 0.0, 1.0])), Motion(np.zeros(0, int), np.zeros(0), np.zeros(0))
    )
    mesh = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))

    def frames(windows: tuple[tuple[int, int], ...]) -> set[int]:
        part = FinishedPart(replace(moving, windows=windows), mesh, None, "motion", SHUT)
        return set(photographed(sorted(labels), labels, [part], TextureConfig()))

    clip, walk = frames(()), frames(((480, 520),))
    assert not {503, 504, 505} & clip
    assert walk == clip | {503, 504, 505}

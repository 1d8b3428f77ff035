"""The renderer's light has closed forms, and its pictures depend on the scene alone: not on orders, threads
or frames before."""

from __future__ import annotations

import gc
import weakref
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.simulate import shading
from recon.simulate.bodies import KEPT
from recon.simulate.lighting import morton, spread_light
from recon.simulate.painters import SIZE
from recon.simulate.render import Body, Camera, Lights, Renderer, View
from recon.simulate.surfaces import Surface, box
from recon.simulate.textures import Material, make_material
from twin.geometry import Array

CAMERA = Camera(161, 120, 110.0)
ALBEDO = np.array([0.5, 0.4, 0.3])
PLAIN = Material("plain", np.full((SIZE, SIZE, 3), ALBEDO, np.float32), 1.0, 0.0)
FIELDS = ("colour", "depth", "labels", "normals", "gloss", "tone")


def lamps(*places: tuple[float, float, float], half: float = 1e-4, sky: float = 0.0) -> Lights:
    """Square lamps at `places`, so small that their shadows are sharp."""
    shapes = [np.array([p, (half, 0.0, 0.0), (0.0, half, 0.0)]) for p in places]
    return Lights(
        np.array(shapes, np.float32),
        np.full((len(places), 3), [3.0, 2.0, 1.0], np.float32),
        np.full(3, sky, np.float32),
    )


def boxes(
    *sizes_and_centres: tuple[tuple[float, float, float], Array], label: int, material: Material
) -> Body:
    surfaces = []
    for size, centre in sizes_and_centres:
        vertices, faces = box(size)
        surfaces.append(Surface("box", vertices + np.asarray(centre), faces, material))
    return Body(tuple(surfaces), label)


def floor(material: Material = PLAIN) -> Body:
    """A slab whose top is z = 0."""
    return boxes(((8.0, 8.0, 0.1), np.array([0.0, 0.0, -0.05])), label=1, material=material)


def from_above(height: float) -> Array:
    """A camera above the origin that looks straight down, image x along world x."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = height
    return pose


def rendered(renderer: Renderer, bodies: list[Body], pose: Array) -> View:
    return renderer.render(bodies, [np.eye(4)] * len(bodies), pose, np.random.default_rng(5))


def floor_points(height: float) -> Array:
    """What the pixels of a camera at `from_above(height)` see of the plane z = 0."""
    cx, cy = CAMERA.centre
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    x, y = (u - cx) / CAMERA.focal * height, -(v - cy) / CAMERA.focal * height
    return np.stack([x, y, np.zeros_like(x)], axis=-1)


def open_floor(points: Array, lights: Lights) -> Array:
    """Colour of points (..., 3) of a plain floor that sees all of each lamp and of the sky."""
    out = np.broadcast_to(lights.sky.astype(float), points.shape).copy()
    for shape, power in zip(lights.shapes.astype(float), lights.powers.astype(float), strict=True):
        to = shape[0] - points
        far = np.linalg.norm(to, axis=-1)
        cosine = to[..., 2] / far
        out += power * (cosine * np.sqrt(cosine) / (0.6 + far**2))[..., None]
    return ALBEDO * out


@pytest.mark.parametrize("pitch", [1, 2, 4])
@pytest.mark.parametrize("samples", [1, 2])
def test_an_open_floor_sees_every_lamp_and_all_of_the_sky(pitch: int, samples: int) -> None:
    lights = lamps((0.3, 0.2, 2.6), (-0.8, 0.1, 2.4), sky=0.5)
    view = rendered(Renderer(CAMERA, lights, samples, 1, 3, pitch), [floor()], from_above(2.0))
    np.testing.assert_allclose(view.colour, open_floor(floor_points(2.0), lights), rtol=2e-3)
    np.testing.assert_allclose(view.depth, 2.0, rtol=1e-6)


@pytest.mark.parametrize("pitch", [1, 2])
@pytest.mark.parametrize("corner", [0.2, 0.2047, 0.213])
def test_the_shadow_of_a_box_ends_where_the_rays_over_its_edge_land(pitch: int, corner: float) -> None:
    lights, height, top = lamps((-0.9, 0.0, 1.8)), 2.0, 0.4
    block = boxes(((0.3, 1.2, top), np.array([corner - 0.15, 0.0, top / 2.0])), label=2, material=PLAIN)
    view = rendered(Renderer(CAMERA, lights, 2, 1, 1, pitch), [floor(), block], from_above(height))
    lit = (view.colour / open_floor(floor_points(height), lights))[..., 0]
    end = -0.9 + (corner + 0.9) * 1.8 / (1.8 - top)
    column = end / height * CAMERA.focal + CAMERA.centre[0]
    for row in (52, 59, 60, 67):
        right = np.flatnonzero((view.labels[row] == 1) & (np.arange(CAMERA.width) > CAMERA.centre[0]))
        assert (
            lit[row, right[0] + 1 : int(column) - 14].max(initial=0.0) < 1e-6
        )  # 14 pixels are what is smoothed
        assert lit[row, int(column) + 16 :].min() > 0.99
        crossing = right[0] + np.interp(0.5, lit[row, right], np.arange(len(right)))
        assert crossing == pytest.approx(column, abs=1.0)


def scene(textured: bool = True) -> list[Body]:
    """A floor and three boxes that touch nothing; of several faces, in two bodies."""
    rng = np.random.default_rng(3)
    wood = make_material("wood", 1.0, rng) if textured else PLAIN
    part = boxes(((0.3, 0.2, 0.3), np.array([-0.3, 0.1, 0.31])), label=2, material=wood)
    hand = boxes(
        ((0.1, 0.1, 0.5), np.array([0.3, -0.2, 0.27])),
        ((0.4, 0.02, 0.02), np.array([0.2, 0.3, 0.6])),
        label=255,
        material=wood,
    )
    return [floor(make_material("tiles", 1.0, rng) if textured else PLAIN), part, hand]


def tilted() -> Array:
    """A camera 1.7 m from the origin that looks at it from the front."""
    eye = np.array([0.2, -1.3, 1.1])
    forward = -eye / np.linalg.norm(eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = eye
    return pose


def renderer(samples: int = 2) -> Renderer:
    return Renderer(CAMERA, lamps((-0.5, -0.4, 2.0), (0.7, 0.3, 1.9), half=0.2, sky=0.5), samples, 1, 3)


def assert_equal_views(one: View, other: View) -> None:
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field), field)


def test_bodies_in_another_order_and_surfaces_in_other_bodies_give_the_same_picture() -> None:
    bodies = scene()
    whole = rendered(renderer(), bodies, tilted())
    assert {1, 2, 255} <= set(np.unique(whole.labels).tolist())
    assert_equal_views(whole, rendered(renderer(), [bodies[2], bodies[0], bodies[1]], tilted()))
    apart = [Body((surface,), body.label) for body in bodies for surface in body.surfaces]
    split = rendered(renderer(), apart, tilted())
    for field in ("depth", "labels", "normals"):
        np.testing.assert_array_equal(getattr(whole, field), getattr(split, field))


def test_frames_prepared_ahead_and_rendered_in_threads_are_those_rendered_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Textures of later frames don't come over those of former ones, though there are more than are kept."""
    monkeypatch.setattr("recon.simulate.bodies.KEPT", 5)
    bodies, ahead, frames, later = scene(), renderer(), [], []
    for k in range(16):
        image = np.full((SIZE, SIZE, 3), 0.1 + 0.05 * k, np.float32)
        place = ((0.5, 0.5, 0.5), np.array([0.0, 0.1, 0.3]))
        frames.append([*bodies, boxes(place, label=7, material=Material("g", image, 1.0, 0.1))])
        poses = [np.eye(4)] * len(frames[k])
        prepared = ahead.prepared(frames[k], poses, tilted(), np.random.default_rng(5))
        later.append(prepared if k % 4 == 1 else None)
    chosen = [(frame, view) for frame, view in zip(frames, later, strict=True) if view is not None]
    with ThreadPoolExecutor(2) as pool:
        views = list(pool.map(lambda pair: pair[1](), chosen))
    for (frame, _), view in zip(chosen, views, strict=True):
        assert_equal_views(view, rendered(renderer(), frame, tilted()))


def test_samples_inside_a_face_are_as_if_they_were_cast(monkeypatch: pytest.MonkeyPatch) -> None:
    bodies = scene()
    some = rendered(renderer(), bodies, tilted()).colour
    monkeypatch.setattr(shading, "crossed", lambda body, _: np.ones(body.shape, bool))
    all_cast = rendered(renderer(), bodies, tilted()).colour
    error = np.abs(
        some - all_cast
    )  # in penumbras: cast samples take their light from the neighbour at the nearest depth
    assert np.percentile(error, 90.0) < 0.01 * all_cast.mean()
    assert error.max() < 0.15 * all_cast.mean()
    assert abs(np.mean(some - all_cast)) < 5e-4 * all_cast.mean()


def test_a_frame_does_not_depend_on_those_before_and_bodies_gone_are_forgotten() -> None:
    camera = Camera(32, 24, 22.0)

    def guest(k: int) -> Body:
        image = np.full((SIZE, SIZE, 3), 0.1 + 0.035 * k, np.float32)
        return boxes(
            ((0.5, 0.5, 0.5), np.array([0.0, 0.1, 0.3])), label=7, material=Material("g", image, 1.0, 0.1)
        )

    def fresh() -> Renderer:
        return Renderer(camera, lamps((-0.5, -0.4, 2.0), half=0.2, sky=0.5), 2, 1, 3)

    bodies, used, gone = scene(), fresh(), []
    held: list[int] = []
    recent: list[Body] = []
    for k in range(KEPT + 5):
        visitor = guest(k)
        gone.append(weakref.ref(visitor))
        recent = [*recent[-2:], visitor]
        last = rendered(used, [*bodies, visitor] if k % 3 else [visitor, *bodies], tilted())
        held.append(sum(r() is not None for r in gone))
    for guest_again in recent:
        with_guest = [guest_again, *bodies]
        assert_equal_views(rendered(used, with_guest, tilted()), rendered(fresh(), with_guest, tilted()))
    assert_equal_views(rendered(used, bodies, tilted()), rendered(fresh(), bodies, tilted()))
    gc.collect()
    assert max(held) <= KEPT
    assert (
        last.colour[last.labels == 7].mean()
        > 1.5 * rendered(used, [*bodies, guest(0)], tilted()).colour[last.labels == 7].mean()
    )


def spread(
    body: NDArray[np.int32], grid: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    normals = np.zeros((*body.shape, 3), np.float32)
    normals[..., 2] = 1.0
    return spread_light(grid, np.ones(body.shape, np.float32), normals, body, 2)


def test_light_is_spread_linearly_and_never_over_an_edge() -> None:
    v, u = np.mgrid[0:20, 0:30].astype(np.float32)
    body = np.zeros((20, 30), np.int32)
    ramp = np.stack([0.01 * u + 0.02 * v, 1.0 - 0.01 * v], axis=-1)
    out, alone = spread(body, np.ascontiguousarray(ramp[::2, ::2]))
    assert not alone.any()
    np.testing.assert_allclose(out[:19, :29], ramp[:19, :29], atol=1e-6)
    body[:, 13:] = 1
    body[7:14, 5] = 2  # between two columns of the grid
    body[0, :] = -1
    out, alone = spread(body, np.ascontiguousarray((body[::2, ::2, None] == 1).astype(np.float32)))
    np.testing.assert_array_equal(alone, body == 2)
    np.testing.assert_array_equal(out[..., 0], body == 1)


def test_a_square_of_the_z_curve_is_one_run() -> None:
    v, u = np.mgrid[0:64, 0:64]
    order = morton(v.reshape(-1), u.reshape(-1)).reshape(64, 64)
    np.testing.assert_array_equal(np.sort(order.reshape(-1)), np.arange(64 * 64))
    for side in (2, 8, 32):
        square = order[side : 2 * side, :side]
        assert np.ptp(square) == side * side - 1

"""Simulated cameras have the errors that were published for the real ones, and keep over a recording what
real ones keep."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.simulate import SimulateConfig
from recon.simulate.config import Faults, Staging
from recon.simulate.picture import Picture, exposure_jumps
from recon.simulate.render import Camera, View
from recon.simulate.sensors.colour import colour_image, exposure
from recon.simulate.sensors.depth_camera import SENSORS, DepthCamera
from recon.simulate.sensors.fields import cosines, drifting_noise, wide_noise
from recon.simulate.sensors.frame import Frame
from recon.simulate.sensors.multipath import multipath
from recon.simulate.sensors.phone_lidar import PhoneLidar
from recon.simulate.sensors.stereo import shadow, texture_pattern
from recon.simulate.sensors.time_of_flight import WIGGLE_PERIOD, TimeOfFlight
from recon.simulate.shutter import shifted
from recon.simulate.simulator import opening
from recon.simulate.stage import Stage
from twin.errors import ConfigError
from twin.geometry import Array

CAMERA = Camera.of(320, 240, 74.6)
SMALL = Camera.of(160, 120, 74.6)
MIDDLE = Camera(160, 120, CAMERA.focal)  # a quarter of it, where surfaces are seen straight
DISTANCES = (0.7, 2.1, 3.2)
SCENES = Path(__file__).parents[3] / "assets" / "scenes"


def rays_of(camera: Camera) -> Array:
    """Viewing directions of a camera at the world's origin that looks along z."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    cx, cy = camera.centre
    local = np.stack([(u - cx) / camera.focal, (v - cy) / camera.focal, np.ones(u.shape)], axis=-1)
    return local / np.linalg.norm(local, axis=-1, keepdims=True)


def speckle(shape: tuple[int, ...], seed: int = 0) -> NDArray[np.uint8]:
    """A picture with texture everywhere."""
    grey = 128 + 40 * wide_noise(*shape, 1.5, np.random.default_rng(seed))
    return np.repeat(np.clip(grey, 0, 255).astype(np.uint8)[..., None], 3, axis=-1)


def frame_of(
    depth: Array, camera: Camera = CAMERA, tone: float = 0.5, index: int = 0, normals: Array | None = None
) -> Frame:
    """Surfaces that face the camera, textured; other frames draw other noise."""
    shape = depth.shape
    if normals is None:
        normals = np.zeros((*shape, 3), np.float32)
        normals[..., 2] = -1.0
    view = View(
        np.full((*shape, 3), 0.3, np.float32),
        depth.astype(np.float32),
        np.ones(shape, np.uint8),
        normals,
        np.zeros(shape, np.float32),
        np.full(shape, tone, np.float32),
        np.zeros(shape, np.int32),
    )
    return Frame(view, rays_of(camera), speckle(shape, index), index, np.random.default_rng(1000 + index))


def plane(z: float, camera: Camera = MIDDLE, tone: float = 0.5, index: int = 0) -> Frame:
    return frame_of(np.full((camera.height, camera.width), z), camera, tone, index)


def step(near: float, far: float) -> Array:
    """A near surface in the middle third of the picture before a far one."""
    depth = np.full((240, 320), far)
    depth[:, 120:200] = near
    return depth


def error_mm(name: str, z: float, seeds: range, index: int = 0) -> Array:
    """Errors (n, 120, 160) in mm, NaN where nothing is known."""
    out = []
    for seed in seeds:
        image = DepthCamera(name, MIDDLE, 1.0, seed).image(plane(z, index=index + seed)).astype(float)
        out.append(np.where(image > 0, image - 1000.0 * z, np.nan))
    return np.stack(out)


def rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def test_a_plane_is_measured_as_well_as_the_published_figures_say() -> None:
    # Nguyen, Izadi, Lovell 2012
    for z in DISTANCES:
        expected = 1.2 + 1.9 * (z - 0.4) ** 2
        assert rms(error_mm("structured_light", z, range(1))) == pytest.approx(expected, rel=0.08)
    # a RealSense D435 that was measured; Intel's formula gives 1.6, 14.6 and 33.8 mm
    for z, measured in zip(DISTANCES, (1.5, 15.0, 31.0), strict=True):
        assert rms(error_mm("stereo", z, range(4))) == pytest.approx(measured, rel=0.2)
    # Apple's LiDAR, +-1 cm (Luetzenburg et al. 2021)
    errors = [rms(error_mm("phone_lidar", z, range(12))) for z in DISTANCES]
    assert 4.0 < errors[0] < errors[1] < errors[2] < 16.0
    assert errors[1] == pytest.approx(10.0, rel=0.25)


def test_time_of_flight_stays_within_its_specification() -> None:
    """Random error at most 17 mm at 15 to 95 % reflectivity, systematic error below 11 mm + 0.1 % (Azure
    Kinect DK)."""
    for z, tone in ((0.7, 0.95), (2.1, 0.5), (3.2, 0.15)):
        camera = DepthCamera("time_of_flight", MIDDLE, 1.0, 5)
        images = np.stack([camera.image(plane(z, tone=tone, index=i)) for i in range(5)])
        known = images[:, (images > 0).all(axis=0)].astype(float)
        assert known.shape[1] > 0.5 * 120 * 160
        random = float(np.sqrt(known.var(axis=0, ddof=1).mean()))
        assert 0.5 * z < random < 17.0
        systematic = np.abs(known.mean(axis=0) - 1000.0 * z)
        assert np.quantile(systematic, 0.5) > 0.5
        assert systematic.max() < 11.0 + z + 4.8 * random / np.sqrt(5)


@pytest.mark.parametrize("name", ["time_of_flight", "phone_lidar", "stereo"])
def test_part_of_the_error_stays_through_a_recording(name: str) -> None:
    """Frames far apart share the camera's own error, and another recording's camera has another."""

    def mean_error(seed: int, first: int) -> Array:
        camera = DepthCamera(name, SMALL, 1.0, seed)
        frames = range(first, first + 5 * 20, 20)  # texture and slow drift are others in each
        images = [camera.image(plane(1.5, SMALL, index=i)).astype(float) - 1500 for i in frames]
        return np.median(images, axis=0)

    one, later = (np.stack([mean_error(seed, first) for seed in range(1, 6)]) for first in (0, 1000))
    assert np.mean(one * later) / np.mean(one**2) > 0.4
    assert abs(np.mean(one * np.roll(later, 1, axis=0))) / np.mean(one**2) < 0.35


def test_drifting_noise_keeps_its_deviation_and_forgets() -> None:
    fields = np.stack([drifting_noise(90, 120, 4.0, 7, i, 10.0) for i in (0, 1, 5, 10, 25)])
    np.testing.assert_allclose(fields.std(axis=(1, 2)), 1.0, atol=0.15)
    alike = [np.corrcoef(fields[0].ravel(), f.ravel())[0, 1] for f in fields]
    assert alike[1] > 0.95
    assert alike[2] == pytest.approx(np.cos(np.pi / 4), abs=0.1)
    assert max(abs(alike[3]), abs(alike[4])) < 0.2


@pytest.mark.parametrize("sigma", [1.0, 4.0, 25.0])
def test_noise_has_unit_deviation_up_to_the_border(sigma: float) -> None:
    fields = np.stack([wide_noise(60, 80, sigma, np.random.default_rng(s)) for s in range(100)])
    each = fields.std(axis=0)
    assert each.mean() == pytest.approx(1.0, abs=0.06)
    for border in (each[0], each[-1], each[:, 0], each[:, -1]) if sigma >= 3.0 else ():
        assert border.mean() == pytest.approx(1.0, abs=0.12)


def test_flying_pixels_lie_between_foreground_and_background() -> None:
    depth = step(1.0, 2.0)
    image = DepthCamera("time_of_flight", CAMERA, 1.0, 3).image(frame_of(depth)) / 1000.0
    edge = np.zeros(depth.shape, bool)
    edge[:, [118, 119, 120, 121, 198, 199, 200, 201]] = True
    flying = (image > 1.06) & (image < 1.94)
    assert 0.1 < flying[edge].mean() < 0.8
    assert not flying[:, 130:190].any()
    assert not flying[:, :110].any()
    known = image[image > 0]
    assert known.min() > 0.95
    assert known.max() < 2.07
    assert (image[edge] == 0).mean() > 0.05  # some are noticed


def test_concave_corners_look_farther_and_convex_ones_do_not() -> None:
    rays, along = rays_of(CAMERA), cosines(CAMERA)
    np.testing.assert_allclose(along, rays[..., 2], atol=1e-12)
    tone = np.full((240, 320), 0.6)
    for sign in (
        1.0,
        -1.0,
    ):  # two walls at right angles, z = 2 - |x| (corner away from the camera) or z = 1 + |x|
        slope = rays[..., 0] / rays[..., 2]
        z = 2.0 / (1.0 + np.abs(slope)) if sign > 0 else 1.0 / (1.0 - np.clip(np.abs(slope), 0, 0.8))
        normals = np.zeros((240, 320, 3), np.float32)
        normals[..., 0], normals[..., 2] = -sign * np.sign(slope) * np.sqrt(0.5), -np.sqrt(0.5)
        excess = multipath(z, rays, normals, tone, along)
        if sign < 0:
            assert np.abs(excess[:, 8:-8]).max() < 1e-9
        else:
            at = [excess[120, 160 + k] for k in (6, 40, 120)]
            assert 0.003 < at[0] < 0.06
            assert at[0] > 3.0 * max(map(abs, at[1:]))
    for flat in (np.full((240, 320), 1.5), step(1.0, 2.0)):  # nothing faces anything else
        assert np.abs(multipath(flat, rays, plane(1.5, CAMERA).view.normals, tone, along)).max() < 1e-9


def test_wiggling_repeats_over_the_distance_and_dark_surfaces_are_lost() -> None:
    sensor = TimeOfFlight(CAMERA, 1.0, 4)
    tone = np.full((240, 320), 0.5)
    errors = [sensor.systematic(np.full(tone.shape, 1.2 + k * WIGGLE_PERIOD), tone) for k in (0.0, 0.5, 1.0)]
    np.testing.assert_allclose(errors[0], errors[2], atol=1e-12)
    assert np.abs(errors[0] - errors[1]).max() > 1e-4
    camera = DepthCamera("time_of_flight", MIDDLE, 1.0, 4)
    zeros = [np.mean(camera.image(plane(z, tone=t)) == 0) for z, t in ((2.1, 0.5), (3.2, 0.15), (3.2, 0.04))]
    assert zeros[0] < 0.001
    assert zeros[0] <= zeros[1] < 0.2  # promised by the specification
    assert zeros[2] > 0.95


def test_the_lidar_is_dense_coarse_and_ends_at_five_metres() -> None:
    camera = Camera.of(640, 480, 74.6)
    depth = np.full((480, 640), 1.7)
    depth[:100], depth[100:200, :50] = 8.0, 0.0
    image = DepthCamera("phone_lidar", camera, 1.0, 2).image(frame_of(depth, camera))
    assert image.min() > 0
    assert image.max() == 5000
    flat = DepthCamera("phone_lidar", camera, 1.0, 2).image(frame_of(np.full((480, 640), 1.7), camera))
    singular = np.linalg.svd(flat.astype(float) - flat.mean(), compute_uv=False)
    rounding = np.linalg.svd(np.random.default_rng(0).uniform(-0.5, 0.5, flat.shape), compute_uv=False)
    assert singular[192] < 1.2 * rounding[0]  # no more than 192 independent rows
    edge = DepthCamera("phone_lidar", camera, 1.0, 2).image(
        frame_of(np.where(np.arange(640) < 320, 1.0, 2.0) * np.ones((480, 1)), camera)
    )
    smeared = ((edge > 1100) & (edge < 1900)).sum(axis=1)
    assert 4 <= np.median(smeared) <= 12
    assert PhoneLidar(camera, 1.0, 2).samples(frame_of(depth, camera)).shape == (192, 256)


def test_stereo_needs_two_views_and_texture() -> None:
    depth = step(0.8, 2.0)
    parallax = CAMERA.focal * 0.05
    hidden = shadow(depth, parallax)
    width = parallax / 0.8 - parallax / 2.0
    assert hidden[:, 100:120].sum(axis=1) == pytest.approx(width, abs=1.0)
    assert not hidden[:, 120:].any()
    assert not hidden[:, :100].any()
    frame = plane(1.2, CAMERA)
    camera = DepthCamera("stereo", CAMERA, 1.0, 3)
    assert np.mean(camera.image(frame) == 0) < 0.02
    half = frame.colour.copy()
    half[:, 160:] = 130
    image = camera.image(replace(frame, colour=half))
    assert np.mean(image[:, 180:] == 0) > 0.98
    assert np.mean(image[:, :145] == 0) < 0.02
    level = np.zeros((240, 320, 3), np.float32)
    level[..., 1] = -1.0  # a surface seen from the side, more so towards the middle row
    image = camera.image(frame_of(np.full((240, 320), 1.2), normals=level))
    assert np.mean(image[115:125] == 0) > 0.98
    assert np.mean(image[:40] == 0) < 0.1


def test_the_error_of_texture_moves_with_the_surface() -> None:
    grey = speckle((120, 160)).mean(axis=-1)
    moved = texture_pattern(np.roll(grey, 17, axis=1), 3.5)
    still = texture_pattern(grey, 3.5)
    np.testing.assert_allclose(moved[:, 70:120], still[:, 53:103], atol=0.01)
    assert still.std() == pytest.approx(1.0, abs=0.1)


@cache
def cabinet() -> tuple[Stage, View, NDArray[np.uint8]]:
    """A furnished room, seen once."""
    config = Staging(width=256, height=192, samples=1, ambient_samples=1, seed=3)
    stage = opening(SCENES / "base_cabinet.xml", "door_left_hinged", config)
    view = stage.render(45)
    return stage, view, colour_image(view.colour, exposure(view.colour), 1.0, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("ideal", 0.0, 0.0),
        ("structured_light", 0.01, 0.12),
        ("time_of_flight", 0.005, 0.12),
        ("phone_lidar", 0.0, 0.0),
        ("stereo", 0.05, 0.17),  # 10 % were measured
    ],
)
def test_a_furnished_room_has_holes_as_the_real_camera_leaves(name: str, low: float, high: float) -> None:
    stage, view, colour = cabinet()
    camera = DepthCamera(name, stage.camera, 1.0, 3)
    image = camera.image(Frame(view, stage.view_directions(45), colour, 45, np.random.default_rng(0)))
    assert image.dtype == np.uint16
    assert low <= np.mean(image == 0) <= high
    error = np.abs(image - 1000.0 * view.depth)[image > 0]
    assert np.median(error) < 12.0
    again = DepthCamera(name, stage.camera, 1.0, 3)
    again.image(Frame(view, stage.view_directions(45), colour, 3, np.random.default_rng(9)))
    frame = Frame(view, stage.view_directions(45), colour, 45, np.random.default_rng(0))
    np.testing.assert_array_equal(again.image(frame), image)  # in whatever order frames are made


@pytest.mark.parametrize("name", SENSORS)
def test_ideal_depth_and_scale_zero_are_exact(name: str) -> None:
    depth = step(0.83, 2.4567)
    image = DepthCamera(name, CAMERA, 0.0, 0).image(frame_of(depth))
    assert np.abs(image - 1000.0 * depth).max() <= 0.5
    if name == "ideal":
        image = DepthCamera(name, CAMERA, 3.0, 0).image(frame_of(depth))
        assert np.abs(image - 1000.0 * depth).max() <= 0.5


def test_structured_light_and_colour_are_what_they_were() -> None:
    """Values of an independent run: recordings that were made before there were other sensors can be made
    again."""
    y, x = np.mgrid[0:60, 0:80]
    depth = np.where(x < 40, 0.9, 1.6 + 0.004 * y)
    rays = np.stack([(x - 39.5) / 60, (y - 29.5) / 60, np.ones(x.shape)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    linear = (0.2 + 0.3 * ((x // 5 + y // 5) % 2)[..., None] * np.ones(3)).astype(np.float32)
    rng = np.random.default_rng(5)
    colour = colour_image(linear, 1.1, 1.0, rng)
    view = replace(frame_of(depth, tone=0.12).view, gloss=np.full((60, 80), 0.3, np.float32))
    image = DepthCamera("structured_light", CAMERA, 1.0, 0).image(Frame(view, rays, colour, 0, rng))
    greys = [
        [118, 187.67, 124.67, 190, 123],
        [123, 191.33, 126, 192, 124.67],
        [122, 189.33, 129, 194.33, 125],
    ]
    np.testing.assert_allclose(colour[::20, ::16].mean(axis=-1), greys, atol=0.7)
    expected = [
        [900, 901, 900, 900, 902, 1598, 1595, 1596],
        [898, 898, 901, 897, 1650, 1642, 1646, 1651],
        [901, 898, 900, 901, 0, 1692, 1694, 1696],
        [0, 899, 901, 905, 899, 1740, 1738, 1745],
        [900, 897, 899, 902, 0, 1798, 1791, 1786],
    ]
    np.testing.assert_allclose(image[::12, ::10].astype(int), expected, atol=1)
    assert abs(int((image == 0).sum()) - 259) <= 2


def test_another_name_is_refused_with_the_list() -> None:
    with pytest.raises(
        ConfigError, match=r"no sensor 'kinect'.*structured_light, ideal, time_of_flight, phone_lidar, stereo"
    ):
        DepthCamera("kinect", CAMERA, 1.0, 0)
    with pytest.raises(ConfigError, match=r"sensor = 'kinect' must be one of 'structured_light', 'ideal'"):
        SimulateConfig(sensor="kinect")


def test_the_rendered_picture_moves_as_the_next_one_shows() -> None:
    """Cabinet, door, hand and arm, carried to the next frame, lie where the next rendering has them."""
    stage, _, _ = cabinet()
    for index, bodies in ((29, (2,)), (60, (1, 3))):  # the hand comes in, door and arm move together
        now, then = stage.render(index), stage.render(index + 1)
        flow = stage.flow(index, now)
        for body in bodies:
            mask = np.repeat((now.body == body)[..., None], 3, axis=-1).astype(np.float32)
            true = then.body == body
            carried, left = (
                np.sum(m & true) / np.sum(m | true)
                for m in (shifted(mask, flow, np.ones(192))[..., 0] > 0.5, mask[..., 0] > 0.5)
            )
            assert carried > 0.9
            assert 1.0 - carried < 0.3 * (1.0 - left)
    moved = shifted(now.colour, flow, np.ones(192))
    assert np.mean((moved - then.colour) ** 2) < 0.2 * np.mean((now.colour - then.colour) ** 2)


def test_a_third_of_the_light_is_as_bright_and_noisier() -> None:
    linear = np.full((200, 200, 3), 0.3, np.float32)
    pictures = [colour_image(linear, 1.0, 1.0, np.random.default_rng(0), light) for light in (1.0, 1 / 3)]
    middle = [((p[80:120, 80:120] / 255.0) ** 2.2) for p in pictures]
    assert middle[0].mean() == pytest.approx(middle[1].mean(), rel=0.01)
    assert np.sqrt(3) < middle[1].std() / middle[0].std() < 3.0  # shot noise alone, read noise alone


def brightness(frames: int = 60, fps: float = 15.0, **faults: float) -> Array:
    """Factors (frames, rows) on the colour pictures."""
    config = Staging(width=64, height=48, fps=fps, picture=Faults(**faults), seed=1)
    picture = Picture(config, Camera.of(64, 48, 60.0), frames)
    return np.stack([picture.brightness(i)[:, 0, 0] for i in range(frames)])


def test_lamps_beat_with_the_frames_and_a_whole_period_averages_them_out() -> None:
    np.testing.assert_array_equal(brightness(), 1.0)
    flicker = brightness(flicker=0.2)
    assert flicker.min() == pytest.approx(0.8, abs=0.02)
    assert flicker.max() == pytest.approx(1.2, abs=0.02)
    np.testing.assert_allclose(
        flicker[:3].mean(), 1.0, atol=0.01
    )  # 100 Hz at 15 frames a second: thirds of a period
    assert np.ptp(flicker, axis=1).max() == 0.0
    rolling = brightness(flicker=0.2, rolling_shutter_s=0.02)  # two periods from the first row to the last
    assert np.ptp(rolling, axis=1).min() > 0.35
    assert np.ptp(brightness(flicker=0.2, shutter=0.15)) < 0.002  # 0.15 / 15 s: one period


def test_exposure_steps_up_and_down_and_comes_back() -> None:
    levels = exposure_jumps(90, 15.0, 0.25, np.random.default_rng(2))
    assert levels[0] == 1.0
    assert set(np.round(levels, 6)) <= {0.8, 1.0, 1.25}
    assert len(set(levels)) > 1
    np.testing.assert_array_equal(exposure_jumps(90, 15.0, 0.0, np.random.default_rng(2)), 1.0)

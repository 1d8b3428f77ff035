"""Pictures at other times: edges are as wide, as slanted and as late as the image's motion says."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from recon.simulate import simulate
from recon.simulate.config import Faults, Staging
from recon.simulate.picture import Picture
from recon.simulate.record import write_frame
from recon.simulate.render import Camera
from recon.simulate.sensors.colour import colour_image, exposure
from recon.simulate.shutter import Flow, exposed, image_motion, poses_around, shifted
from recon.simulate.simulator import opening
from twin.errors import ConfigError
from twin.geometry import Array, exp_so3, invert_pose, make_pose, transform

SIZE = (60, 120)
CAMERA = Camera.of(SIZE[1], SIZE[0], 70.0)
SCENE = Path(__file__).parents[3] / "assets" / "scenes" / "base_cabinet.xml"


def uniform(speed: tuple[float, float]) -> Flow:
    """The whole picture moves alike."""
    velocity = np.broadcast_to(np.array(speed), (*SIZE, 2))
    return Flow.of(velocity, np.zeros((*SIZE, 2)), np.ones(SIZE))


def edge_at(column: float) -> Array:
    """Dark left of a column, bright from it on, with the edge pixel mixed."""
    row = np.clip(np.arange(SIZE[1]) - column + 0.5, 0.0, 1.0)
    return np.broadcast_to(row[None, :, None], (*SIZE, 3)).astype(np.float32)


def columns(picture: Array) -> Array:
    """Where each row goes from dark to bright."""
    return SIZE[1] - picture[..., 0].sum(axis=1)


def test_no_time_is_the_identity() -> None:
    colour = np.random.default_rng(0).random((*SIZE, 3), dtype=np.float32)
    fast = uniform((7.3, -2.0))
    assert shifted(colour, fast, np.zeros(SIZE[0])) is colour
    assert exposed(colour, fast, np.zeros(SIZE[0]), 0.0) is colour
    np.testing.assert_array_equal(shifted(colour, uniform((0.0, 0.0)), np.full(SIZE[0], 0.8)), colour)
    np.testing.assert_allclose(
        exposed(colour, uniform((0.0, 0.0)), np.zeros(SIZE[0]), 0.5), colour, atol=1e-6
    )


def test_a_delay_moves_an_edge_by_its_speed() -> None:
    for speed, delay in ((8.0, 0.5), (5.0, -0.3), (-4.5, 0.5)):
        moved = shifted(edge_at(60.0), uniform((speed, 0.0)), np.full(SIZE[0], delay))
        np.testing.assert_allclose(columns(moved), columns(edge_at(60.0)) + speed * delay, atol=0.05)


def test_an_open_shutter_makes_an_edge_as_wide_as_the_way() -> None:
    for speed, opened in ((10.0, 0.5), (16.0, 0.9), (6.0, 1.0)):
        row = exposed(edge_at(60.0), uniform((speed, 0.0)), np.zeros(SIZE[0]), opened)[30, :, 0]
        position = np.arange(SIZE[1])
        share = np.diff(row)
        width = np.sqrt(
            12.0
            * (np.average((position[1:]) ** 2, weights=share) - np.average(position[1:], weights=share) ** 2)
        )
        assert width == pytest.approx(
            np.hypot(speed * opened, 1.0), rel=0.07
        )  # a box of that width, and the pixel's own
        assert np.average(position[1:] - 0.5, weights=share) == pytest.approx(60.0, abs=0.1)
        assert (np.diff(row) >= -1e-6).all()


def test_a_rolling_shutter_shears_a_vertical_edge() -> None:
    readout, speed = 0.4, 10.0  # frames, px a frame
    rows = readout * np.linspace(-0.5, 0.5, SIZE[0])
    found = columns(shifted(edge_at(60.0), uniform((speed, 0.0)), rows))
    assert found[-1] - found[0] == pytest.approx(speed * readout, abs=0.1)
    np.testing.assert_allclose(found, columns(edge_at(60.0)) + speed * rows, atol=0.06)


def test_times_in_seconds_are_held_against_the_frame_rate() -> None:
    """40 ms at 25 frames a second are one frame."""
    for faults, first, last in (
        (Faults(colour_delay_s=0.02), 0.5, 0.5),
        (Faults(rolling_shutter_s=0.04), -0.5, 0.5),
        (Faults(rolling_shutter_s=0.04, colour_delay_s=-0.01, shutter=0.4), -0.75, 0.25),
    ):
        picture = Picture(Staging(fps=25.0, picture=faults), CAMERA, 5)
        assert picture.moves
        found = columns(picture.exposed(edge_at(60.0), uniform((8.0, 0.0)))) - columns(edge_at(60.0))
        np.testing.assert_allclose(found[[0, -1]], [8.0 * first, 8.0 * last], atol=0.1)
    assert not Picture(Staging(), CAMERA, 5).moves


def test_a_rolling_shutter_stretches_what_falls_with_it() -> None:
    """A point is seen when the row is read that it has come to, not the row that it came from."""
    down, readout = 20.0, 0.5
    rows = readout * np.linspace(-0.5, 0.5, SIZE[0])
    stripe = np.zeros((*SIZE, 3), np.float32)
    stripe[10] = 1.0
    seen = shifted(stripe, uniform((0.0, down)), rows)[:, 60, 0]
    at = float(np.average(np.arange(SIZE[0]), weights=seen))
    # y = 10 + down t and t = readout (y / (H - 1) - 1/2)
    slope = down * readout / (SIZE[0] - 1)
    assert at == pytest.approx((10.0 - 0.5 * down * readout) / (1.0 - slope), abs=0.3)


def box_before_wall(way: float) -> tuple[Array, Flow]:
    """A bright box 40 to 60 before a dark, still wall with stripes, which moves by `way` px a frame."""
    inside = np.zeros(SIZE, bool)
    inside[20:40, 40:60] = True
    wall = 0.1 + 0.1 * (np.arange(SIZE[1]) // 4 % 2)
    colour = np.where(inside, 1.0, wall)[..., None] * np.ones(3)
    velocity = np.where(inside[..., None], [way, 0.0], 0.0)
    return colour.astype(np.float32), Flow.of(velocity, np.zeros((*SIZE, 2)), np.where(inside, 1.0, 2.0))


def test_ground_that_comes_into_the_open_takes_the_background() -> None:
    for way in (7.0, -7.0):
        colour, flow = box_before_wall(way)
        moved = shifted(colour, flow, np.ones(SIZE[0]))[30, :, 0]
        np.testing.assert_allclose(moved[40 + int(way) : 60 + int(way)], 1.0)
        assert (moved > 0.5).sum() == 20  # no shred of the box is left behind
        free = np.r_[0:32, 68:120]
        np.testing.assert_array_equal(moved[free], colour[30, free, 0])
        assert moved.min() >= 0.1 - 1e-6


def test_a_surface_that_comes_nearer_has_no_cracks() -> None:
    v, u = np.mgrid[0 : SIZE[0], 0 : SIZE[1]].astype(float)
    inside = (np.abs(u - 60) < 30) & (np.abs(v - 30) < 20)
    grow = 0.25 * np.stack([u - 60, v - 30], axis=-1) * inside[..., None]
    colour = np.where(inside, 1.0, 0.0)[..., None].astype(np.float32) * np.ones(3, np.float32)
    moved = shifted(colour, Flow.of(grow, 0.0 * grow, np.where(inside, 1.0, 3.0)), np.ones(SIZE[0]))
    np.testing.assert_array_equal(moved[10:50, 30:90], 1.0)


def test_motion_passes_through_the_true_places_before_and_after() -> None:
    """A door that turns and a wall, seen by a camera that moves and turns: where pixels go is where their
    points are seen."""
    _, u = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
    depth = np.where(u < 60, 1.0, 2.5).astype(np.float32)
    body = np.where(u < 60, 1, 0).astype(np.int32)
    body[:5], depth[:5] = -1, 0.0
    cameras = np.stack(
        [make_pose(exp_so3([0.0, 0.02 * t, 0.01 * t]), [0.03 * t, 0.0, 0.01 * t**2]) for t in (-1, 0, 1)]
    )
    door = np.stack([make_pose(exp_so3([0.0, 0.3 + 0.08 * t, 0.0]), [0.1, 0.0, 0.5]) for t in (-1, 0, 1)])
    wall = np.stack([np.eye(4)] * 3)
    flow = image_motion(depth, body, CAMERA, cameras, [wall, door])
    cx, cy = CAMERA.centre
    for y, x in ((30, 20), (50, 40), (12, 90), (40, 70)):
        z = float(depth[y, x])
        point = transform(cameras[1], [[(x - cx) / CAMERA.focal * z, (y - cy) / CAMERA.focal * z, z]])
        poses = door if x < 60 else wall
        for side in (-1, 1):
            moved = transform(poses[1 + side] @ invert_pose(poses[1]), point)
            seen = CAMERA.project(transform(invert_pose(cameras[1 + side]), moved))[0]
            way = (side * (flow.velocity + 0.5 * side * flow.acceleration))[y, x]
            np.testing.assert_allclose([x, y] + way, seen, atol=1e-3)
    np.testing.assert_array_equal(flow.velocity[:4], 0.0)


def test_motion_goes_on_at_the_ends_and_where_a_body_comes_in() -> None:
    twist = make_pose(exp_so3([0.0, 0.1, 0.0]), [0.02, 0.0, 0.01])
    poses = np.stack([np.linalg.matrix_power(twist, k) for k in range(6)])
    for i in (0, 3, 5):
        before, now, after = poses_around(poses, i)
        np.testing.assert_allclose(invert_pose(before) @ now, twist, atol=1e-12)
        np.testing.assert_allclose(invert_pose(now) @ after, twist, atol=1e-12)
    poses[1, :3, 3] = 9.0  # where it is not there, its pose means nothing
    present = np.array([False, False, True, True, True, True])
    np.testing.assert_allclose(invert_pose(poses_around(poses, 2, present)[0]) @ poses[2], twist, atol=1e-12)
    alone = poses_around(poses, 2, np.array([False, False, True, False, False, False]))
    np.testing.assert_array_equal(alone, np.stack([poses[2]] * 3))


def test_a_picture_that_leaves_itself_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"moves by more than its own size.*shutter"):
        shifted(edge_at(60.0), uniform((500.0, 0.0)), np.ones(SIZE[0]))


def test_a_recording_with_every_fault_keeps_its_truth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Depth and labels are those of the exact rendering at the frame's time; the true intrinsics are kept
    beside the wrong ones."""
    faults = Faults(0.02, 0.6, 0.02, 0.02, 100, 0.15, 0.25, 0.01, 4.0)
    config = Staging(
        width=64,
        height=48,
        frames=24,
        samples=1,
        ambient_samples=1,
        room=False,
        sensor="ideal",
        picture=faults,
    )
    stage = opening(SCENE, "door_left_hinged", config)
    monkeypatch.setattr("recon.simulate.simulator.opening", lambda *_: stage)
    out = simulate(SCENE, "door_left_hinged", tmp_path / "faulty", config)
    view = stage.render(12)
    depth, labels, colour = (
        cv2.imread(str(out / name), cv2.IMREAD_UNCHANGED)
        for name in ("depth/000012.png", "truth/labels/000012.png", "color/000012.jpg")
    )
    np.testing.assert_array_equal(depth, np.round(1000.0 * view.depth.astype(np.float64)))
    np.testing.assert_array_equal(labels, view.labels)
    clean = colour_image(view.colour, exposure(view.colour), 1.0, np.random.default_rng(0))
    grain = [np.std(p - cv2.blur(p, (3, 3))) for p in (clean.astype(float), colour.astype(float))]
    assert grain[1] > 1.2 * grain[0]  # in 2 % of the light
    usual = len(cv2.imencode(".jpg", colour, [cv2.IMWRITE_JPEG_QUALITY, 93])[1])
    assert (out / "color" / "000012.jpg").stat().st_size > 1.3 * usual
    written, true = (
        json.loads((out / name).read_text())["intrinsic_matrix"]
        for name in ("intrinsic.json", "truth/intrinsic.json")
    )
    assert true[0] == stage.camera.focal
    assert written[0] == written[4] == pytest.approx(1.01 * true[0])
    assert written[6:8] == [true[6] + 4.0, true[7]]


def test_values_become_levels_by_the_gamma() -> None:
    """Without noise, below the shoulder, in the middle where no light is lost; the least value is the least
    level's border."""
    values = np.r_[0.0, np.geomspace(1e-7, 0.6, 2000)].astype(np.float32)
    one = np.random.default_rng(0)
    levels = [colour_image(np.full((2, 2, 3), v), 1.0, 0.0, one)[1, 1, 0] for v in values]
    np.testing.assert_array_equal(levels, np.round(255.0 * values.astype(float) ** (1.0 / 2.2)))


def test_threads_do_not_change_a_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    faults = Faults(shutter=0.5, rolling_shutter_s=0.02)
    config = Staging(
        width=64,
        height=48,
        frames=30,
        samples=1,
        ambient_samples=1,
        room=False,
        sensor="stereo",
        picture=faults,
    )
    made = []
    for count in ("1", "3"):
        monkeypatch.setenv("OMP_NUM_THREADS", count)
        out = simulate(SCENE, "door_left_hinged", tmp_path / count, config)
        made.append({f.relative_to(out): f.read_bytes() for f in sorted(out.rglob("*")) if f.is_file()})
    assert made[0] == made[1]
    assert len(made[0]) > 3 * 30


def test_pictures_are_packed_as_asked(tmp_path: Path) -> None:
    for folder in ("color", "depth", "truth/labels"):
        (tmp_path / folder).mkdir(parents=True)
    grey = np.random.default_rng(0).integers(0, 255, (*SIZE, 3), np.uint8)
    blank = np.zeros(SIZE, np.uint8)
    for index, quality in enumerate((30, 93)):
        write_frame(tmp_path, index, grey, blank.astype(np.uint16), blank, quality)
    coarse, fine = ((tmp_path / "color" / f"00000{i}.jpg").stat().st_size for i in (0, 1))
    assert coarse < 0.5 * fine

"""The one finder of handles: faces under noise and before inner walls, what stands off, bars and knobs, in
any place."""

from __future__ import annotations

import numpy as np
import pytest

from tests.laws import random_pose
from twin import geometry as geo
from twin.geometry import Array
from twin.handles import STANDS_OFF, TALLEST, frame_of, is_bar, long_side, outermost_face, split, upright

UP = np.array([0.0, 0.0, 1.0])


def block(rng: np.random.Generator, low: Array, high: Array, count: int) -> Array:
    return rng.uniform(low, high, (count, 3))


def panel(rng: np.random.Generator, noise: float = 0.0, height: float = 0.0) -> Array:
    points = block(rng, np.array([-0.3, -0.2, height]), np.array([0.3, 0.2, height]), 20_000)
    return points + [0, 0, 1] * rng.normal(0, noise, (len(points), 1)) if noise else points


@pytest.mark.parametrize("noise", [0.0005, 0.002, 0.005])
@pytest.mark.parametrize("seed", range(4))
def test_a_face_is_found_under_the_noise_of_a_scan_and_tells_it(noise: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    T = random_pose(rng)
    points = geo.transform(T, panel(rng, noise))
    guess = geo.rotate(T, geo.unit([0.05, -0.08, 1.0]))
    face = outermost_face(points, guess, one_sided=True)
    assert np.degrees(geo.angle_between(face.normal, T[:3, 2])) < 0.3
    assert abs(float(face.height(T[:3, 3]))) < 0.1 * noise
    assert face.noise == pytest.approx(noise, rel=0.1)
    assert (np.abs(face.height(points)) < face.skin).mean() > 0.98


def test_an_inner_wall_does_not_win_over_the_front() -> None:
    rng = np.random.default_rng(0)
    front, inner = panel(rng, 0.001), panel(rng, 0.001, height=-0.1)
    face = outermost_face(np.concatenate([front[::2], inner]), UP)  # the wall holds twice as many points
    assert abs(face.offset) < 0.001
    assert (
        abs(outermost_face(np.concatenate([front[::20], inner]), UP).offset + 0.1) < 0.001
    )  # shreds are no face


@pytest.mark.parametrize("thickness", [0.012, 0.018])
def test_the_back_of_a_thin_panel_is_no_part_of_its_face(thickness: float) -> None:
    rng = np.random.default_rng(4)
    both = np.concatenate(
        [panel(rng, 0.001), panel(rng, 0.001, height=-thickness), panel(rng, 0.001, height=-thickness)]
    )
    face = outermost_face(both, UP)
    assert abs(face.offset) < 0.001
    assert face.noise == pytest.approx(0.001, rel=0.1)


def test_what_stands_off_is_neither_the_face_nor_its_noise() -> None:
    rng = np.random.default_rng(1)
    smooth, rough = (
        outermost_face(panel(rng, 0.0005), UP),
        outermost_face(panel(rng, 0.005), UP, one_sided=True),
    )
    heights = np.array([[0.0, 0, z] for z in (0.0, 0.9 * STANDS_OFF, 1.2 * STANDS_OFF, 0.03)])
    assert smooth.stands_off(heights).tolist() == [False, False, True, True]
    assert rough.stands_off(heights).tolist() == [False, False, False, True]
    assert smooth.low_enough(np.array([[0, 0, 0.9 * TALLEST]]))
    assert not smooth.low_enough(np.array([[0, 0, 0.01], [0, 0, 1.1 * TALLEST]]))


def test_a_bar_on_two_posts_is_one_piece_whose_outer_half_is_the_bar() -> None:
    rng = np.random.default_rng(2)
    bar = block(rng, np.array([-0.08, -0.007, 0.03]), np.array([0.08, 0.007, 0.044]), 2000)
    posts = [
        block(rng, np.array([x - 0.005, -0.005, 0.012]), np.array([x + 0.005, 0.005, 0.03]), 300)
        for x in (-0.07, 0.07)
    ]
    knob = block(rng, np.array([0.2, -0.015, 0.012]), np.array([0.23, 0.015, 0.04]), 800)
    face = outermost_face(panel(rng, 0.0005), UP)
    points = np.concatenate([panel(rng, 0.0005), bar, *posts, knob])
    pieces = sorted(split(points[face.stands_off(points)]), key=len)
    assert len(pieces) == 2
    outer, top = face.outer_half(pieces[1])
    assert top == pytest.approx(0.0436, abs=0.001)
    along, length, width = long_side(outer, face.normal)
    assert np.degrees(geo.line_angle(along, [1, 0, 0])) < 1.0
    assert length == pytest.approx(0.96 * 0.16, abs=0.002)
    assert width == pytest.approx(0.96 * 0.014, abs=0.001)
    assert is_bar(length, width)
    assert not is_bar(*long_side(face.outer_half(pieces[0])[0], face.normal)[1:])


@pytest.mark.parametrize("seed", range(5))
def test_pieces_and_sides_turn_with_the_world(seed: int) -> None:
    rng = np.random.default_rng(seed)
    T = random_pose(rng)
    parts = [block(rng, np.array([x, 0, 0]), np.array([x + 0.1, 0.02, 0.02]), 3000) for x in (0.0, 0.15, 0.3)]
    found = split(geo.transform(T, rng.permutation(np.concatenate(parts))))
    assert sorted(map(len, found)) == [3000] * 3
    along, length, width = long_side(found[0], T[:3, 2], outliers=0.0)
    assert np.degrees(geo.line_angle(along, T[:3, 0])) < 1.0
    assert (length, width) == (pytest.approx(0.1, abs=0.002), pytest.approx(0.02, abs=0.002))
    assert split(np.zeros((0, 3))) == []


def test_a_knob_is_held_along_the_hinge_else_upright() -> None:
    front = np.array([0.0, -1.0, 0.0])
    np.testing.assert_allclose(upright(front), UP)
    np.testing.assert_allclose(upright(front, np.array([1.0, 0, 0])), [1, 0, 0])
    np.testing.assert_allclose(upright(front, front), UP)  # a hinge that points out of the face says nothing
    np.testing.assert_allclose(upright(UP), [1, 0, 0])
    rng = np.random.default_rng(0)
    for normal in geo.unit(rng.normal(size=(20, 3))):
        R = frame_of(upright(normal), normal)
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) == pytest.approx(1.0)

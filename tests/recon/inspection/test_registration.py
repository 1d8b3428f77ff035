"""Where edges of depth meet edges of colour, told by profiles beside them."""

from __future__ import annotations

import numpy as np
import pytest

from recon.inspection.registration import REACH, EdgeTable, offset
from twin.geometry import Array

FRAMES = 12


def table(places: Array, height: float = 30.0) -> EdgeTable:
    """A table with peaks at places (axis, side, third), px, and about so high in sigmas of the noise."""
    at = np.arange(-REACH, REACH + 1)
    noise = 0.01 * np.sin(at**2)
    size = height * 0.01
    bump = size * np.exp(-0.5 * (at - places[..., None]) ** 2)
    profile = np.broadcast_to(1.0 + noise + bump, (FRAMES, 2, 2, 2, 3, 2 * REACH + 1)).copy()
    count = np.full(profile.shape[:-1], 200.0)
    return EdgeTable(profile * count[..., None], count)


def everywhere(place: float) -> Array:
    return np.full((2, 2, 3), place)


@pytest.mark.parametrize("place", [0.0, -4.0, 7.0])
def test_a_shift_is_told_where_both_sides_of_objects_show_it(place: float) -> None:
    where = offset(table(everywhere(place)))
    np.testing.assert_allclose(where.shift, place, atol=0.5)
    assert not where.nowhere


def test_a_scale_is_told_by_both_borders_of_the_picture() -> None:
    places = everywhere(0.0)
    places[0, :, 0], places[0, :, 2] = -4.0, 4.0
    where = offset(table(places))
    np.testing.assert_allclose(where.border, 6.0, atol=0.7)
    assert where.sigma[2] < 0.1


def test_a_scale_that_few_of_the_times_show_is_not_known() -> None:
    places = everywhere(0.0)
    places[0, :, 0], places[0, :, 2] = -4.0, 4.0
    told = table(places)
    told.count[FRAMES // 4 :, :, 0, :, 2] = 0.0
    told.score[FRAMES // 4 :, :, 0, :, 2] = 0.0
    assert not np.isfinite(offset(told).sigma[2])


@pytest.mark.parametrize(("apart", "told"), [(-3.0, False), (-0.5, True), (2.0, True), (9.0, False)])
def test_objects_that_a_sensor_widens_tell_the_shift_and_others_do_not(apart: float, told: bool) -> None:
    """A shadow before an object moves one of its sides."""
    places = everywhere(0.0)
    places[0, 0] -= apart / 2
    places[0, 1] += apart / 2
    assert np.isfinite(offset(table(places)).shift[0]).all() == told


def test_sides_that_meet_different_edges_tell_no_scale() -> None:
    """A shadow 10 px beside an object at the left border, on one of its sides."""
    places = everywhere(0.0)
    places[0, 1, 0] = -10.0
    where = offset(table(places))
    assert np.isnan(where.border).all()


def test_depth_meets_colour_nowhere_where_one_axis_shows_no_place() -> None:
    mirrored = table(everywhere(0.0))
    mirrored.score[:, :, 0] = table(everywhere(0.0), height=0.0).score[:, :, 0]
    assert offset(mirrored).nowhere


def test_weak_edges_that_meet_are_not_nowhere() -> None:
    where = offset(table(everywhere(0.0), height=3.0))
    assert np.isnan(where.shift).all()
    assert not where.nowhere

"""Tracks as people have them: no visibility, another order of the axes."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from benchmarks.scenes.tracks import TrackScene, track_scene
from recon import fit_motion
from recon.interaction.joints.track_axes import first_axis
from tests.laws import axis_error_deg
from twin.errors import InputError
from twin.geometry import Array

OUTLIERS = ("none", "static", "drift", "mixed", "obs")


def scene(part: str = "door", outliers: str = "mixed", seed: int = 0) -> TrackScene:
    return track_scene(part, outliers, seed=seed)  # type: ignore[arg-type]


def sorted_by_height(points: Array) -> Array:
    return points[:, np.argsort(np.nan_to_num(np.nanmedian(points[..., 2], axis=0)))]


def test_visibility_is_taken_from_nan_when_it_is_not_given() -> None:
    s = scene()
    assert not s.visible.all()
    hidden = np.where(s.visible[..., None], s.points, np.nan)
    given, taken = fit_motion(hidden, s.visible), fit_motion(hidden)
    np.testing.assert_array_equal(given.joint.axis, taken.joint.axis)
    np.testing.assert_array_equal(given.state, taken.state)
    np.testing.assert_array_equal(given.track_inliers, taken.track_inliers)


@pytest.mark.parametrize("outliers", OUTLIERS)
@pytest.mark.parametrize("part", ["door", "drawer"])
def test_the_axis_that_counts_frames_is_recognised(part: str, outliers: str) -> None:
    for seed in range(3):
        points = scene(part, outliers, seed).points
        assert first_axis(points) == "frames"
        assert first_axis(points.swapaxes(0, 1)) == "tracks"
        dense = sorted_by_height(points)
        assert first_axis(dense) == "frames"
        assert first_axis(dense.swapaxes(0, 1)) in ("tracks", "unclear")
        assert first_axis(points[::8]) == "frames"  # five frames, far apart in time
        assert first_axis(points[::-1]) == "frames"


def test_tracks_first_give_the_same_fit_with_a_warning() -> None:
    s = scene("drawer")
    weight = np.linspace(0.5, 1.0, s.visible.size).reshape(s.visible.shape)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        expected = fit_motion(s.points, s.visible, confidence=weight)
    with pytest.warns(
        UserWarning, match=r"\(200, 40, 3\) have their tracks first: taken as 40 frames of 200"
    ):
        found = fit_motion(s.points.swapaxes(0, 1), s.visible.T, confidence=weight.T)
    np.testing.assert_array_equal(found.joint.axis, expected.joint.axis)
    np.testing.assert_array_equal(found.frames, expected.frames)
    np.testing.assert_array_equal(found.state, expected.state)
    np.testing.assert_array_equal(found.track_inliers, expected.track_inliers)
    hidden = np.where(s.visible[..., None], s.points, np.nan)
    with pytest.warns(UserWarning, match="tracks first"):
        assert axis_error_deg(fit_motion(hidden.swapaxes(0, 1)).joint, s.joint) < 0.5


def test_an_order_that_can_not_be_told_is_refused_with_both_ways_out() -> None:
    """A door's tracks sorted by height and given first: each neighbour is as near as a frame of a fast
    motion."""
    s = scene("door", "none")
    points = sorted_by_height(s.points).swapaxes(0, 1)
    assert first_axis(points) == "unclear"
    with pytest.raises(InputError, match="may be frames of tracks or tracks of frames") as caught:
        fit_motion(points)
    assert "np.isfinite(points).all(-1)" in caught.value.remedy
    assert "points.swapaxes(0, 1)" in caught.value.remedy
    assert axis_error_deg(fit_motion(points.swapaxes(0, 1)).joint, s.joint) < 0.5


def test_a_fast_motion_of_dense_tracks_is_taken_as_said() -> None:
    """Frames first, 4 cm a frame, tracks 2 mm apart in a row: frames come first when visible says so."""
    t, k = np.arange(12), np.arange(60)
    points = np.zeros((12, 60, 3))
    points[..., 0], points[..., 1] = 0.04 * t[:, None], 0.002 * k
    points[..., 2] = 0.1 * (k % 2)
    points += np.random.default_rng(0).normal(0, 1e-3, points.shape)
    row = points[:, ::2]
    assert first_axis(row) == "unclear"
    found = fit_motion(row, np.isfinite(row).all(-1), joint_type="prismatic")
    assert abs(found.joint.axis[0]) > 0.99
    assert found.joint.upper == pytest.approx(0.44, abs=0.02)


@pytest.mark.parametrize(
    ("order", "told"),
    [
        ((2, 0, 1), "np.moveaxis(points, 0, -1)"),
        ((0, 2, 1), "np.moveaxis(points, 1, -1)"),
    ],
)
def test_coordinates_that_are_not_last_are_named(order: tuple[int, int, int], told: str) -> None:
    with pytest.raises(InputError) as caught:
        fit_motion(np.transpose(scene().points, order))
    assert told in str(caught.value)


def test_shapes_that_do_not_match_are_named() -> None:
    s = scene()
    with pytest.raises(InputError, match=r"\(40, 200, 3\) and \(200, 40\); turn one of them"):
        fit_motion(s.points, s.visible.T)
    with pytest.raises(InputError, match="put frames first, tracks second"):
        fit_motion(s.points, s.visible[:-1])
    with pytest.raises(InputError, match=r"points \(T, K, 3\), got \(40, 3\)"):
        fit_motion(s.points[:, 0])


def test_too_few_frames_or_tracks_say_nothing_about_their_order() -> None:
    points = scene("drawer", "none").points
    assert first_axis(points.swapaxes(0, 1)[:7]) == "frames"
    assert first_axis(points[:7].swapaxes(0, 1)) == "frames"
    assert first_axis(np.full((20, 20, 3), np.nan)) == "frames"

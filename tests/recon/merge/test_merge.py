"""Parts of several visits: the same one is found again, neighbours stay apart, states go on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.merge.merge import as_merged, combined, merge
from recon.merge.same_part import Surface
from tests.makers.recon.cabinets import make_clip
from tests.makers.recon.visits import COVARIANCE, Visit, aside, visits_of
from twin import geometry as geo
from twin.scene import Joint, Prismatic, Revolute


@pytest.mark.parametrize("kind", ["door", "drawer"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_opened_and_later_closed_is_one_part(kind: str, sign: float) -> None:
    clip = make_clip(kind)
    recording, cameras, found = visits_of([Visit(clip), Visit(clip, back=True, sign=sign)], gap=8)
    merged = merge(recording, cameras, found)
    (part,), (shares,) = merged.parts, merged.shares
    assert [s.interaction for s in shares] == [0, 1]
    assert shares[1].as_left
    n = len(clip.recording)
    travel = clip.part.motion.state
    np.testing.assert_allclose(part.motion.state[:n], travel, atol=1e-9)
    np.testing.assert_allclose(part.motion.state[n : n + 8], travel[-1])  # held while nobody looks
    np.testing.assert_allclose(part.motion.state[n + 8 : 2 * n + 8], travel[::-1], atol=1e-6)
    assert len(part.motion.intervals) == 2 * len(clip.part.motion.intervals)


def test_the_pose_of_the_part_is_that_of_each_interaction() -> None:
    clip = make_clip("door")
    recording, cameras, found = visits_of([Visit(clip), Visit(clip, back=True, sign=-1.0)])
    (part,) = merge(recording, cameras, found).parts
    point = clip.mesh.vertices[:1]
    for frame in range(len(recording)):
        which = found[frame // len(clip.recording)]
        local = which.parts[0].pose(frame - which.window.first)
        start = clip.part.joint.pose(float(clip.part.motion.state[-1])) if which.window.first else np.eye(4)
        there = part.pose(frame)
        assert local is not None
        assert there is not None
        np.testing.assert_allclose(
            geo.transform(there, point), geo.transform(local @ start, point), atol=1e-6
        )


@pytest.mark.parametrize(
    ("kind", "away"), [("drawer", (0.0, 0.0, 0.22)), ("drawer", (0.62, 0.0, 0.0)), ("door", (0.62, 0.0, 0.0))]
)
def test_equal_fronts_of_a_row_stay_apart(kind: str, away: tuple[float, float, float]) -> None:
    clip = make_clip(kind)
    recording, cameras, found = visits_of([Visit(clip), Visit(clip, T=aside(np.array(away)))])
    merged = merge(recording, cameras, found)
    assert len(merged.parts) == 2
    assert [p.id for p in merged.parts] == [2, 3]


def test_what_somebody_closed_meanwhile_is_one_part_with_a_gap() -> None:
    clip = make_clip("drawer")
    recording, cameras, found = visits_of([Visit(clip), Visit(clip)], gap=8, dark=True)
    merged = merge(recording, cameras, found)
    (part,), (shares,) = merged.parts, merged.shares
    assert not shares[1].as_left
    assert shares[1].offset == pytest.approx(0.0, abs=0.011)
    n = len(clip.recording)
    assert part.state(n - 1) is not None
    assert all(part.state(f) is None for f in range(n, n + 8))
    assert part.state(n + 8) == pytest.approx(0.0, abs=0.011)


def test_a_part_handled_once_has_a_state_in_every_frame_of_the_recording() -> None:
    clip = make_clip("drawer")
    recording, cameras, found = visits_of([Visit(clip)], gap=8)
    (part,) = merge(recording, cameras, found).parts
    np.testing.assert_array_equal(part.motion.frames, np.arange(len(recording)))
    np.testing.assert_allclose(part.motion.state[-8:], clip.part.motion.state[-1])
    assert part.windows == ((0, len(clip.recording) - 1),)


def test_the_order_of_ids_is_that_of_the_recording_and_one_interaction_stays_as_it_is() -> None:
    clip = make_clip("door")
    recording, cameras, found = visits_of([Visit(clip)])
    merged = merge(recording, cameras, found)
    assert merged.parts == found[0].parts
    assert as_merged(found[0], 0, merged) is found[0]


def test_labels_and_tracks_get_the_ids_of_the_merged_parts() -> None:
    clip = make_clip("drawer")
    recording, cameras, found = visits_of([Visit(clip), Visit(clip, T=aside(np.array([0.7, 0, 0])))])
    second = as_merged(found[1], 1, merge(recording, cameras, found))
    assert [p.id for p in second.parts] == [3]
    assert [t.part.id for t in second.found.parts] == [3]
    for frame, image in found[1].labels.items():
        np.testing.assert_array_equal(second.labels[frame] == 3, image == 2)


@pytest.mark.parametrize(
    "joint",
    [
        Prismatic(np.array([0.0, -1.0, 0.0])),
        Revolute(np.array([0.0, 0.0, 1.0]), pivot=np.array([0.3, 0, 1.0])),
    ],
)
def test_joints_are_combined_by_their_information(joint: Joint) -> None:
    """Of two equally good the middle, of a good and a poor one nearly the good one; both know more."""
    surface = Surface(np.array([[0.1, 0.2, 1.1]]))
    cov = COVARIANCE[: joint.dof, : joint.dof]
    shift = np.array([0.02, -0.01, 0.004, 0.002])[: joint.dof]
    mine = replace(joint, covariance=cov)
    other = mine.plus(shift)
    middle = combined(mine, other, surface)
    np.testing.assert_allclose(
        geo.line_angle(middle.axis, mine.axis),
        geo.line_angle(middle.axis, other.axis),
        rtol=0.2,  # a hinge's place matters, too
    )
    assert middle.covariance is not None
    assert np.trace(middle.covariance) == pytest.approx(
        0.5 * np.trace(mine.with_pivot(surface.points[0]).covariance), rel=0.05
    )
    poor = replace(other, covariance=1e4 * cov)
    near = combined(mine, poor, surface)
    assert geo.line_angle(near.axis, mine.axis) < 1e-3 * geo.line_angle(other.axis, mine.axis)


@pytest.mark.parametrize("smaller_first", [True, False])
def test_the_smaller_surface_lies_on_the_larger_one_whichever_is_moved(smaller_first: bool) -> None:
    """A part seen half in one visit and whole in another."""
    y, z = np.meshgrid(np.arange(0.0, 0.6, 0.015), np.arange(0.0, 0.6, 0.015))
    whole = np.stack([np.zeros(y.size), y.ravel(), z.ravel()], axis=-1)
    half = whole[whole[:, 1] < 0.2]
    pose = geo.make_pose(translation=[0.3, 0.0, 0.0])
    first, second = (half, whole) if smaller_first else (whole, half)
    share, away = Surface(first).lies_on(Surface(geo.transform(pose, second)), pose)
    assert share == 1.0
    assert away < 1e-9

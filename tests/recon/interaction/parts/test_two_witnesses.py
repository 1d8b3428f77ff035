"""Parts by two witnesses, tracks and depth: which of them is believed where they differ, on cabinets of
closed form."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from recon.interaction.boards.proposals import Proposed
from recon.interaction.boards.search import DepthPart
from recon.interaction.motion.movers import Movers
from recon.interaction.parts import compete, two_witnesses
from recon.interaction.parts.compete import Witnessed, witnessed
from recon.interaction.parts.found import PartTracks
from recon.interaction.parts.moving_part import MovingPart
from recon.interaction.parts.two_witnesses import _goes_along, reconciled_parts
from recon.recording import Recording
from tests.makers.recon.cabinets import Clip, Kind, make_clip
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import JointSigma, Prismatic, Revolute, Trajectory


@pytest.fixture(scope="module", params=["door", "drawer", "slide"])
def clip(request: pytest.FixtureRequest) -> Clip:
    kind: Kind = request.param
    return make_clip(kind)


@pytest.fixture(scope="module", autouse=True)
def _searched_once() -> Iterator[None]:
    """What depth tells of a recording and of the joints that are proposed is searched once for all tests."""
    search, known = compete.parts_by_depth, dict[object, tuple[Recording, list[DepthPart]]]()

    def kept(recording: Recording, cameras: Trajectory, joints: Sequence[Proposed] = ()) -> list[DepthPart]:
        key = id(recording), tuple((j.kind, j.axis.tobytes(), j.pivot.tobytes()) for j in joints)
        if key not in known:
            known[key] = recording, search(recording, cameras, joints)
        return known[key][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compete, "parts_by_depth", kept)
        yield


def movers(count: int = 0) -> Movers:
    none = np.zeros(count, bool)
    return Movers(np.zeros((26, count, 3)), np.zeros((26, count), bool), none, none)


def test_a_true_joint_that_tracks_tell_is_known_again_and_a_wrong_one_is_not(clip: Clip) -> None:
    true = clip.part.joint
    wrong = replace(clip.part, joint=Prismatic(geo.unit(np.array([0.3, 0.2, 1.0]))))
    (found,) = witnessed(clip.recording, clip.cameras, movers(), [wrong, clip.part])
    assert found.by_tracks == 1
    (alone,) = witnessed(clip.recording, clip.cameras, movers(), [wrong])
    assert alone.by_tracks is None
    assert alone.joint.kind == true.kind
    assert len(alone.state) == len(clip.cameras.frames)


def test_tracks_that_follow_a_joint_are_its_and_others_are_not() -> None:
    clip = make_clip("door")
    rng = np.random.default_rng(0)
    on_part = clip.mesh.vertices[rng.integers(0, len(clip.mesh.vertices), 20)]
    poses = clip.part.joint.poses(clip.part.motion.state)
    riding = np.einsum("tij,kj->tki", poses[:, :3, :3], on_part) + poses[:, None, :3, 3]
    drifting = rng.uniform(-0.3, 0.3, (1, 20, 3)) + np.linspace(0, 0.2, 26)[:, None, None]
    points = np.concatenate([riding, drifting], axis=1)
    every = np.ones(40, bool)
    seen = Movers(points, np.ones((26, 40), bool), every, every)
    (found,) = witnessed(clip.recording, clip.cameras, seen, [])
    assert found.followers[:20].mean() > 0.8
    assert not found.followers[20:].any()


def test_a_joint_of_tracks_that_depth_does_not_confirm_gives_way_to_depths(clip: Clip) -> None:
    none = np.zeros(0, bool)
    wrong = replace(clip.part, joint=Prismatic(geo.unit(np.array([0.3, 0.2, 1.0]))))
    told = [PartTracks(wrong, none, "motion"), PartTracks(clip.part, none, "motion")]
    (kept,) = reconciled_parts(told, clip.recording, clip.cameras, movers(), 8)
    assert kept.type_source == "motion"
    assert kept.part.joint is clip.part.joint
    (other,) = reconciled_parts(told[:1], clip.recording, clip.cameras, movers(), 8)
    assert other.type_source == "depth"
    assert other.part.joint.kind == clip.part.joint.kind
    assert other.part.motion.inliers == 0.0  # no track follows it


def firmly(part: MovingPart, tracks: int, degrees: float) -> PartTracks:
    """A part of so many tracks that know its axis so well."""
    joint = replace(part.joint, sigma=JointSigma(np.radians(degrees), 0.002, 0.005))
    return PartTracks(replace(part, joint=joint), np.ones(tracks, bool), "motion")


def test_many_tracks_that_know_their_axis_need_no_other_witness(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where depth hardly sees a door turn about another line; where it sees that well, tracks give way. What
    moves at another time is another part."""
    clip = make_clip("door")
    hinge = cast("Revolute", clip.part.joint)
    elsewhere = replace(clip.part, joint=replace(hinge, pivot=hinge.pivot + [0.4, 0.3, 0.0]))

    def told(part: MovingPart, tracks: int, degrees: float, strength: float = 1.0) -> tuple[PartTracks, ...]:
        firm = [firmly(part, tracks, degrees)]
        seen = [
            replace(w, strength=strength)
            for w in witnessed(clip.recording, clip.cameras, movers(tracks), [part])
        ]
        monkeypatch.setattr(two_witnesses, "witnessed", lambda *_: seen)
        return reconciled_parts(firm, clip.recording, clip.cameras, movers(tracks), 8)

    for tracks, degrees, strength, kept in (
        (200, 0.2, 0.05, True),
        (50, 0.2, 0.05, False),
        (200, 2.0, 0.05, False),
        (200, 0.2, 0.5, False),
    ):
        (part,) = told(elsewhere, tracks, degrees, strength)
        assert (part.type_source == "motion") == kept
    motion = elsewhere.motion
    later = replace(elsewhere, motion=replace(motion, state=np.interp(np.arange(26), [23, 25], [0.0, 1.0])))
    parts = told(later, 200, 0.2)
    assert [p.type_source for p in parts] == ["depth", "motion"]
    assert [p.part.id for p in parts] == [2, 3]


def with_states(clip: Clip, state: Array) -> MovingPart:
    return replace(clip.part, motion=replace(clip.part.motion, state=state))


NEAR = {"revolute": np.radians(4.0), "prismatic": 0.02}  # rad or m: the grid of depth's states, and its noise


def test_states_of_tracks_that_depth_contradicts_give_way_to_depths(clip: Clip) -> None:
    """Tracks that slip along a part go too short a way, a hand that comes along the part's axis sets out too
    early."""
    none, true = np.zeros(0, bool), clip.part.motion.state
    early = np.interp(np.arange(26) + 5, np.arange(26), true)
    for state in (0.1 * true, 0.4 * true, early, true):
        told = [PartTracks(with_states(clip, state), none, "motion")]
        (part,) = reconciled_parts(told, clip.recording, clip.cameras, movers(), 8)
        assert part.type_source == "motion"
        assert part.part.motion.state == pytest.approx(true, abs=NEAR[clip.part.joint.kind])
    np.testing.assert_array_equal(part.part.motion.state, true)


def test_where_tracks_slip_for_a_part_of_the_way_states_are_depths(clip: Clip) -> None:
    """At the end they lie on the hand that lets go and goes back by a sixth of the way."""
    none, true = np.zeros(0, bool), clip.part.motion.state
    back = np.where(np.arange(26) >= 24, true - true[-1] / 6, true)
    told = [PartTracks(with_states(clip, back), none, "motion")]
    (part,) = reconciled_parts(told, clip.recording, clip.cameras, movers(), 8)
    assert part.type_source == "motion"
    near = NEAR[clip.part.joint.kind]
    assert part.part.motion.state[24:] == pytest.approx(true[24:], abs=near)
    np.testing.assert_array_equal(part.part.motion.state[:24], back[:24])
    assert part.part.joint.upper == pytest.approx(true.max(), abs=near)


def test_states_that_run_on_out_of_view_are_none_of_the_part() -> None:
    """In the first frames no depth is known, so that all other frames agree with whatever the tracks say of
    them."""
    clip = make_clip("drawer")
    read, true = clip.recording.read_depth, clip.part.motion.state
    blind = replace(clip.recording, read_depth=lambda f: read(f) * np.float32(f >= 4))
    for run_on, known in ((0.0, True), (0.1, True), (0.2, False)):
        told = with_states(clip, np.where(np.arange(26) < 4, true - run_on, true))
        (found,) = witnessed(blind, clip.cameras, movers(), [told])
        assert (found.mended is None) == known


def test_right_states_of_tracks_stay_as_they_are(clip: Clip) -> None:
    """Those that are a third too short are mended."""
    true = clip.part.motion.state
    (right,) = witnessed(clip.recording, clip.cameras, movers(), [with_states(clip, true)])
    assert right.mended is None
    assert right.as_well > 0.8
    (short,) = witnessed(clip.recording, clip.cameras, movers(), [with_states(clip, true * 2 / 3)])
    assert short.mended is not None
    assert short.mended == pytest.approx(true, abs=NEAR[clip.part.joint.kind])


def test_a_hand_that_goes_along_with_a_part_is_none_and_a_second_drawer_is_one(clip: Clip) -> None:
    """All by the same axis: the drawer agrees with the tracks; the hand goes as far while the drawer does,
    and farther before; the second drawer moves at another time."""
    time, axis = np.arange(100), clip.part.joint
    none, board = np.zeros(0, bool), np.zeros((0, 3))
    drawer = Witnessed(axis, np.interp(time, [40, 60], [0.0, 0.3]), none, board, 0, 0.9)
    hand = Witnessed(axis, np.interp(time, [10, 25, 40, 60], [0.0, 0.5, 0.5, 0.8]), none, board, 0, 0.0)
    second = Witnessed(axis, np.interp(time, [70, 90], [0.0, 0.3]), none, board, 0, 0.0)
    seen = [hand, drawer, second]
    assert [_goes_along(w, seen) for w in seen] == [True, False, False]
    backwards = replace(hand, joint=replace(axis, axis=-axis.axis), state=-hand.state)
    assert _goes_along(backwards, [backwards, drawer])
    assert not _goes_along(replace(hand, by_tracks=None), seen)


def test_tracks_of_two_drawers_side_by_side_give_way_to_depths_two(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their ways are parallel, so that tracks of both follow one slide, as far as both go."""
    clip = make_clip("drawer")
    time, none = np.arange(26), np.zeros(0, bool)
    first, second = (np.interp(time, span, [0.0, 0.2]) for span in ([4, 9], [14, 20]))
    both = PartTracks(with_states(clip, first + second), none, "motion")
    seen = [Witnessed(clip.part.joint, state, none, np.zeros((0, 3)), 0, 0.9) for state in (first, second)]
    monkeypatch.setattr(two_witnesses, "witnessed", lambda *_: seen)
    parts = reconciled_parts([both], clip.recording, clip.cameras, movers(), 8)
    assert [p.type_source for p in parts] == ["depth", "depth"]
    for part, state in zip(parts, (first, second), strict=True):
        np.testing.assert_allclose(part.part.motion.state, state)
    monkeypatch.setattr(two_witnesses, "witnessed", lambda *_: [seen[0], seen[0]])
    (one,) = reconciled_parts([both], clip.recording, clip.cameras, movers(), 8)
    assert one.type_source == "motion"

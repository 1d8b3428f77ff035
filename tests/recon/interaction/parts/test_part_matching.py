"""Which fits are a further part, which are one that is known already, and what surely rests: one test for
every condition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scenes.tracks import minimum_jerk
from recon.interaction.joints.result import MotionFit
from recon.interaction.joints.type_selection import TypeEvidence
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.config import (
    MAX_AXIS_SIGMA,
    MAX_LOOSENESS,
    MAX_RESIDUAL,
    MIN_TRACKS,
    MIN_TRAVEL,
    REST_TOLERANCE,
    SAME_AXIS,
    SAME_PIVOT,
)
from recon.interaction.parts.moving_part import MovingPart
from recon.interaction.parts.part_matching import is_another_part, same_part
from recon.interaction.parts.static_spans import (
    REST_MARGIN,
    known_rest_spans,
    moving_spans,
    rest_spans,
    restless,
)
from twin import geometry as geo
from twin.geometry import Array
from twin.joint import JointSigma, Prismatic, Revolute
from twin.scene import Motion

FRAMES, TRACKS = 120, 20
# At rest for 40 frames, opened in 40, at rest again.
STATE = np.concatenate([np.zeros(40), minimum_jerk(40), np.ones(40)])
SURE = JointSigma(np.radians(0.2), 0.002, 0.001)
DRAWER = Prismatic(np.array([0.0, 1.0, 0.0]), upper=0.3, sigma=SURE)
DOOR = Revolute(np.array([0.0, 0.0, 1.0]), upper=1.2, sigma=SURE, pivot=np.array([0.4, 0.0, 0.0]))


def fit_of(joint: Prismatic | Revolute = DRAWER, state: Array = STATE, **changes: object) -> MotionFit:
    """A clean fit: `state` is a share of the range."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.2, 0.2, (TRACKS, 3))
    known = MotionFit(
        joint, np.arange(len(state)), joint.upper * state, np.full(len(state), 0.001), 0.002, 0.9,
        np.ones(TRACKS, bool), points, TypeEvidence(0.0, 0.0, 0.0), "motion",
    )  # fmt: skip
    return replace(known, **changes)


def movers_of(fit: MotionFit, rested: bool = True) -> Movers:
    """The tracks that the fit describes exactly."""
    points = geo.transform(fit.joint.poses(fit.state), fit.landmarks)
    seen = np.ones(points.shape[:2], bool)
    return Movers(points, seen, seen[0].copy(), np.full(TRACKS, rested))


def another(fit: MotionFit, members: int = TRACKS, first: MotionFit | None = None, **changes: object) -> bool:
    mask = np.arange(TRACKS) < members
    movers = replace(movers_of(fit), **changes)
    return is_another_part(fit, mask, movers, first or fit_of(), np.ones(TRACKS, bool))


def test_a_clean_motion_from_rest_to_rest_is_another_part() -> None:
    assert another(fit_of())
    assert another(fit_of(DOOR))


def test_another_part_has_enough_tracks() -> None:
    assert another(fit_of(), members=MIN_TRACKS)
    assert not another(fit_of(), members=MIN_TRACKS - 1)
    many = np.ones(400, bool)  # a tenth of the first part's is more than the least number
    fit, few = fit_of(), np.arange(TRACKS) < 20
    assert not is_another_part(fit, few, movers_of(fit), fit, many)


@pytest.mark.parametrize("joint", [DRAWER, DOOR])
def test_another_part_moves_far(joint: Prismatic | Revolute) -> None:
    near = fit_of(joint)
    lever = float(np.linalg.norm(joint.velocity(0.0, np.median(near.landmarks, axis=0))))
    for share, said in ((1.1, True), (0.9, False)):
        upper = share * MIN_TRAVEL / lever
        assert another(fit_of(replace(joint, upper=upper))) is said


def test_another_part_rests() -> None:
    assert not another(fit_of(), rested=np.zeros(TRACKS, bool)), "none of its tracks was seen at rest"
    always = np.linspace(0.0, 1.0, FRAMES)
    assert not another(fit_of(state=always)), "it moves all the time"
    assert not another(fit_of(state=np.zeros(FRAMES))), "it never moves"


def test_another_part_is_sure_of_its_axis() -> None:
    for share, said in ((0.99, True), (1.01, False)):
        sigma = replace(SURE, axis=share * MAX_AXIS_SIGMA)
        assert another(fit_of(replace(DRAWER, sigma=sigma))) is said
    assert not another(fit_of(replace(DRAWER, sigma=None)))


def test_another_part_is_rigid() -> None:
    first = fit_of(residual=0.01)
    assert another(fit_of(residual=0.99 * MAX_RESIDUAL), first=first)
    assert not another(fit_of(residual=1.01 * MAX_RESIDUAL), first=first)
    precise = fit_of(residual=0.001)  # the same camera: what leaves much more is no part
    assert another(fit_of(residual=0.99 * MAX_LOOSENESS * 0.001), first=precise)
    assert not another(fit_of(residual=1.01 * MAX_LOOSENESS * 0.001), first=precise)


def part_of(fit: MotionFit) -> MovingPart:
    spans = tuple((i.first, i.last) for i in moving_spans(fit))
    return MovingPart(2, fit.joint, fit.motion(np.arange(FRAMES) / 15.0, spans))


def found(fit: MotionFit, movers: Movers, known: MotionFit) -> int | None:
    return same_part(fit, np.ones(TRACKS, bool), movers, [part_of(known)])


def test_tracks_that_a_known_part_carries_are_its_own() -> None:
    known = fit_of(DOOR)
    other = fit_of(DRAWER)  # whatever joint was fitted to them
    assert found(other, movers_of(known), known) == 0


def test_the_same_joint_at_the_same_time_is_the_same_part() -> None:
    """Tracks on the other face, of which the known states carry none: they drift."""
    known = fit_of(DOOR)
    drifting = movers_of(known)
    rng = np.random.default_rng(1)
    drifting = replace(
        drifting, points_world=drifting.points_world + rng.normal(0, 0.1, drifting.points_world.shape)
    )
    assert found(known, drifting, known) == 0
    tilted = replace(DOOR, axis=geo.unit(geo.exp_so3([1.2 * SAME_AXIS, 0, 0]) @ DOOR.axis))
    assert found(fit_of(tilted), drifting, known) is None, "another axis"
    moved = replace(DOOR, pivot=DOOR.pivot + [1.2 * SAME_PIVOT, 0, 0])
    assert found(fit_of(moved), drifting, known) is None, "another hinge"
    along = replace(DOOR, pivot=DOOR.pivot + [0, 0, 0.7])
    assert found(fit_of(along), drifting, known) == 0, "the same line, another point of it"
    assert found(fit_of(replace(DRAWER, axis=DOOR.axis)), drifting, known) is None, "another kind"


def test_the_same_joint_at_another_time_is_another_part() -> None:
    early = np.concatenate([minimum_jerk(20), np.ones(FRAMES - 20)])
    late = np.concatenate([np.zeros(FRAMES - 20), minimum_jerk(20)])
    known, fit = fit_of(DOOR, early), fit_of(DOOR, late)
    movers = movers_of(fit)
    seen = movers.visible.copy()
    seen[: FRAMES - 10] = False  # tracks of the late motion alone: at rest, any state carries them
    assert found(fit, replace(movers, visible=seen), known) is None
    assert found(known, movers_of(known), known) == 0


@pytest.mark.parametrize("later", [True, False], ids=["after", "before"])
def test_the_same_joint_right_before_or_after_is_the_same_part(later: bool) -> None:
    """Twice the margin of rest lies between two motions at most; what moves a frame later is another part."""
    known = fit_of(DOOR, minimum_jerk(FRAMES, 20, 50))
    ((first, last),) = [(i.first, i.last) for i in moving_spans(known)]
    drifting = movers_of(known)
    noise = np.random.default_rng(1).normal(0, 0.1, drifting.points_world.shape)
    drifting = replace(drifting, points_world=drifting.points_world + noise)
    for gap, same in ((2 * REST_MARGIN, 0), (2 * REST_MARGIN + 1, None)):
        start = 20 + last + gap - first
        other = fit_of(DOOR, minimum_jerk(FRAMES, start, start + 30))
        earlier_fit, later_fit = (known, other) if later else (other, known)
        assert found(later_fit, drifting, earlier_fit) == same


def test_rest_spans_keep_away_from_the_motion() -> None:
    fit = fit_of()
    ((first, last),) = [(i.first, i.last) for i in moving_spans(fit)]
    assert 40 <= first < last <= 80
    before, after = rest_spans(fit, FRAMES)
    assert before == (0, first - REST_MARGIN)
    assert after[0] == last + REST_MARGIN
    assert FRAMES - REST_MARGIN <= after[1] < FRAMES


def test_rest_is_known_only_where_the_state_is() -> None:
    whole = fit_of()
    kept = slice(0, 95)
    cut = replace(
        whole, frames=whole.frames[kept], state=whole.state[kept], state_sigma=whole.state_sigma[kept]
    )
    assert rest_spans(cut, FRAMES)[-1][1] > 94
    assert known_rest_spans(cut, FRAMES)[-1][1] == 94
    short = slice(0, moving_spans(whole)[0].last + REST_MARGIN + 2)
    cut = replace(
        whole, frames=whole.frames[short], state=whole.state[short], state_sigma=whole.state_sigma[short]
    )
    assert len(known_rest_spans(cut, FRAMES)) == 1, "too few known frames of rest at the end"
    none = slice(0, moving_spans(whole)[0].last)
    cut = replace(
        whole, frames=whole.frames[none], state=whole.state[none], state_sigma=whole.state_sigma[none]
    )
    assert len(rest_spans(cut, FRAMES)) == 2
    assert len(known_rest_spans(cut, FRAMES)) == 1, "no known frame of rest at the end"


def test_what_moves_while_the_part_rests_is_restless() -> None:
    fit = fit_of()
    movers = movers_of(fit)
    points = movers.points_world.copy()
    points[:38, 3] += np.linspace(0.1, 0.0, 38)[:, None]  # a hand that approaches
    points[:38, 4] += 0.5 * REST_TOLERANCE * np.sin(np.arange(38))[:, None] / np.sqrt(3)  # noise
    points[55:65, 5] += 0.2  # off, but only while the part moves
    movers = replace(movers, points_world=points)
    chosen = np.ones(TRACKS, bool)
    chosen[6] = False
    points[:38, 6] += 1.0 * np.linspace(1, 0, 38)[:, None]  # not asked about
    out = restless(movers, chosen, rest_spans(fit, FRAMES))
    assert np.flatnonzero(out).tolist() == [3]
    seen = movers.visible.copy()
    seen[:35, 3] = False  # five frames of it are too few to tell
    out = restless(replace(movers, visible=seen), chosen, [(0, 37)])
    assert not out.any()


def test_motion_of_a_fit_is_given_in_seconds() -> None:
    motion = fit_of().motion(np.arange(FRAMES) / 15.0, ((40, 79),))
    assert isinstance(motion, Motion)
    assert motion.times[30] == pytest.approx(2.0)

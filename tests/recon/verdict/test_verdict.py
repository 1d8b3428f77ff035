"""Evidence on both sides of its limits, and twins of what is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from recon.contact.closed_end import ClosedEnd
from recon.contact.finish_parts import FinishedPart
from recon.fusion.fuse import FusedScene
from recon.interaction.motion.movers import Movers
from recon.interaction.refine.refine_parts import polish_parts, refine_found
from recon.verdict import of_parts
from recon.verdict.assemble import assemble
from recon.verdict.doubt import SURELY, Doubt
from recon.verdict.evidence import PartEvidence
from recon.verdict.explained import other_depth
from recon.verdict.judge import judge
from recon.verdict.of_scenes import free_things
from recon.verdict.posterior import probability
from tests.makers.recon.altered import (
    backed_off,
    ranging,
    with_border,
    with_known,
    with_places,
    with_sigma,
)
from tests.makers.recon.cabinets import Clip
from tests.makers.recon.judged import SHUT, SPAN, as_one, found_in
from twin.scene import STATIC_LABEL, Mesh, Prismatic

EMPTY = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))


def test_a_door_that_is_known_well_is_trusted(evidence: PartEvidence) -> None:
    assert [ask(evidence) for ask in of_parts.OF_PARTS] == [None] * len(of_parts.OF_PARTS)


def scaled(mesh: Mesh, area: float) -> Mesh:
    return Mesh(mesh.vertices * np.sqrt(area / mesh.area), mesh.faces)


def known_to(e: PartEvidence, state: float) -> PartEvidence:
    """A part whose tracks alone would know its state so well (rad or m)."""
    return with_sigma(e, state=state)


def closed(e: PartEvidence, **told: float) -> PartEvidence:
    """A part whose closed end is known so well, with so much furniture beside it there."""
    return replace(e, closed=ClosedEnd(0.0, 1, "", **told))


LIMITS: dict[str, tuple[Callable[[PartEvidence], Doubt | None], Callable[..., PartEvidence], float, str]] = {
    # name: (evidence, change, its limit, "up" where more is worse)
    "axis": (of_parts.axis, lambda e, _, x: with_sigma(e, axis=np.radians(x)), of_parts.AXIS, "up"),
    "pivot": (of_parts.pivot, lambda e, _, x: with_sigma(e, pivot=x), of_parts.PIVOT, "up"),
    "range": (of_parts.travelled, lambda e, _, x: with_sigma(e, state=SPAN / x), of_parts.RANGE, "down"),
    "surface": (of_parts.large_enough, lambda e, c, x: replace(e, mesh=scaled(c.mesh, x)), of_parts.SMALL, "down"),
    "moved": (of_parts.seen_to_move, lambda e, _, x: with_places(e, witnessed=x), of_parts.MOVED, "down"),
    "border": (of_parts.ends_at_edges, lambda e, _, x: with_border(e, x), of_parts.BARE, "up"),
    "turn": (of_parts.travelled, lambda e, _, x: known_to(ranging(e, x), 1e-6), np.radians(6.0), "down"),
    "way": (of_parts.travelled, lambda e, _, x: known_to(ranging(e, x, Prismatic), 1e-6), 0.02, "down"),
    "closed end": (of_parts.closed_end, lambda e, _, x: closed(e, probability=1 - x), 1 - of_parts.CLOSED, "up"),
    "beside": (of_parts.adjoined, lambda e, _, x: closed(e, adjoined=x), of_parts.ADJOINED, "down"),
    "video": (of_parts.explained, lambda e, _, x: with_known(e, unexplained=(3, x)), of_parts.UNEXPLAINED, "up"),
}  # fmt: skip


@pytest.mark.parametrize("name", LIMITS)
def test_evidence_tells_on_which_side_of_its_limit_a_number_is(
    name: str, evidence: PartEvidence, clip: Clip
) -> None:
    ask, change, limit, worse = LIMITS[name]
    step = 1.1 if worse == "up" else 1 / 1.1
    beyond, within = (ask(change(evidence, clip, x)) for x in (limit * step, limit / step))
    assert beyond is not None
    assert beyond.times > 1.0
    assert beyond.reason.level == "doubtful"
    assert within is None


@pytest.mark.parametrize("name", LIMITS)
def test_what_is_farther_beyond_its_limit_is_doubted_more(
    name: str, evidence: PartEvidence, clip: Clip
) -> None:
    ask, change, limit, worse = LIMITS[name]
    near, far = (x if worse == "up" else 1 / x for x in (1.05, 1.1))
    less, more = (ask(change(evidence, clip, limit * x)) for x in (near, far))
    assert less is not None
    assert more is not None
    assert less.times < more.times
    assert probability([less]) > probability([more])


@pytest.mark.parametrize("away", [of_parts.CAMERAS / 2, of_parts.CAMERAS * 1.5, of_parts.CAMERAS_LOST * 1.5])
def test_a_path_that_sees_the_room_in_two_places_is_told(away: float, evidence: PartEvidence) -> None:
    doubt = of_parts.cameras(backed_off(evidence, away))
    if away < of_parts.CAMERAS:
        assert doubt is None
        return
    numbers = doubt.reason.numbers
    assert doubt.reason.type == "CamerasDrift"
    assert (doubt.times == SURELY) == (away > of_parts.CAMERAS_LOST)
    assert numbers["off_m"] == pytest.approx(away, rel=0.25)
    half = len(evidence.scene.cameras.frames) // 2
    assert numbers["frame"] < half <= numbers["other"]


def test_frames_that_look_elsewhere_say_nothing_about_the_path(evidence: PartEvidence) -> None:
    """Those of the second half look at another floor."""
    poses = evidence.scene.cameras.T_world_cam.copy()
    half = len(poses) // 2
    poses[half:, 2, 3] += 50.0
    apart = replace(evidence.scene, cameras=replace(evidence.scene.cameras, T_world_cam=poses))
    assert of_parts.cameras(replace(evidence, scene=apart)) is None


def test_a_hinge_matters_as_far_as_it_takes_the_path_aside(evidence: PartEvidence) -> None:
    """Over 20 deg by a third of itself; over more than 60 deg by all of it."""
    ajar = ranging(evidence, np.radians(20.0))
    limit = of_parts.PIVOT / (2 * np.sin(np.radians(10.0)))
    assert of_parts.pivot(with_sigma(ajar, pivot=0.97 * limit)) is None
    told = of_parts.pivot(with_sigma(ajar, pivot=1.03 * limit))
    assert told.reason.type == "PivotUnsure"
    np.testing.assert_allclose(told.reason.numbers["limit_m"], limit)
    wide = with_sigma(ranging(evidence, np.radians(70.0)), pivot=1.03 * of_parts.PIVOT)
    assert of_parts.pivot(wide) is not None


def test_what_can_not_be_told_gives_no_reason_but_a_joint_without_sigma_does(evidence: PartEvidence) -> None:
    bare = replace(evidence, part=replace(evidence.part, joint=replace(evidence.part.joint, sigma=None)))
    assert of_parts.uncertainty(bare).times == SURELY  # type: ignore[union-attr]
    assert [of_parts.axis(bare), of_parts.pivot(bare), of_parts.travelled(bare)] == [None] * 3
    for mesh in (None, EMPTY):
        unseen = replace(evidence, mesh=mesh)
        assert of_parts.surface(unseen).times == SURELY  # type: ignore[union-attr]
        assert [of_parts.seen_to_move(unseen), of_parts.seen_through(unseen)] == [None] * 2


def test_things_are_counted_by_what_goes_far_together() -> None:
    rng = np.random.default_rng(1)
    groups = [c + rng.uniform(-0.03, 0.03, (n, 3)) for c, n in ((0.0, 20), (1.0, 20), (2.0, 3), (3.0, 20))]
    start = np.concatenate(groups)
    way = np.linspace(0, 1, 30)[:, None, None] * np.array([0.3, 0, 0])
    way = way * np.where(np.arange(len(start)) < 43, 1.0, 0.1)[None, :, None]  # the last one drifts by 3 cm
    points = start + way
    every = np.ones(len(start), bool)
    seen = np.ones(points.shape[:2], bool)
    assert free_things(Movers(points, seen, every, every)) == 2  # three tracks are no thing
    assert free_things(Movers(points, seen, ~every, every)) == 0


def judged_twin(clip: Clip, evidence: PartEvidence, sigma: float, cut: bool = False) -> Any:
    """A twin of the clip, whose axis has this sigma (deg); cut: without a surface."""
    part = with_sigma(evidence, axis=np.radians(sigma), state=SPAN * sigma / 90).part
    labels = dict(evidence.scene.labels)
    finished = () if cut else (FinishedPart(part, clip.mesh, None, "motion", SHUT),)
    fused = FusedScene(clip.static, {} if cut else {part.id: clip.mesh})
    verdict = judge(
        clip.recording, clip.cameras, labels, as_one(clip.recording, found_in(clip)), (part,), fused, finished
    )
    return assemble(
        clip.recording, clip.cameras, clip.static, finished, labels, {"made": 1}, verdict, (part,), {}, {}
    )


def test_a_trusted_or_doubtful_part_is_written(clip: Clip, evidence: PartEvidence) -> None:
    for share, level in ((0.9, "trusted"), (3.0, "doubtful")):
        twin = judged_twin(clip, evidence, share * of_parts.AXIS)
        assert [p.verdict.level for p in twin.parts] == [level]
        assert twin.verdict.level == level
        assert twin.provenance == {"made": 1}
        assert twin.labels[0].max() == 2


@pytest.mark.parametrize(("sigma", "cut", "why"), [(60.0, False, "AxisUnsure"), (0.1, True, "NoSurface")])
def test_a_refused_part_is_told_but_not_written(
    sigma: float, cut: bool, why: str, clip: Clip, evidence: PartEvidence
) -> None:
    twin = judged_twin(clip, evidence, sigma, cut)
    assert twin.parts == ()
    assert twin.verdict.level == "refused"
    nothing, *more = twin.verdict.reasons
    told = next(r for r in more if r.type == "OfPart" and r.numbers["of"] == why)
    assert nothing.type == "NothingArticulated"
    assert (told.numbers["part"], told.numbers["written"]) == ("door", False)
    (left_out,) = twin.provenance["refused"]
    assert (left_out["name"], left_out["verdict"]["level"]) == ("door", "refused")
    assert {int(v) for f in twin.labels for v in np.unique(twin.labels[f])} == {0, STATIC_LABEL}
    assert evidence.scene.labels[0].max() == 2  # the stage's own images stay


def test_refinement_of_no_part_is_none(clip: Clip) -> None:
    none = replace(found_in(clip), parts=())
    nothing: Any = None
    assert refine_found(clip.recording, clip.cameras, none, nothing, nothing) == ()
    assert polish_parts(clip.recording, clip.cameras, {}, none, (), nothing) == ()


def test_a_twin_with_the_part_explains_the_rests_and_one_without_does_not(
    evidence: PartEvidence, clip: Clip
) -> None:
    frame, share = evidence.scene.unexplained
    assert share <= of_parts.UNEXPLAINED / 2
    speck = Mesh(1e-3 * clip.mesh.vertices, clip.mesh.faces)
    for mesh in (None, speck):
        missed = replace(evidence.scene, parts=((evidence.part, mesh),))
        frame, share = missed.unexplained
        assert share > 2 * of_parts.UNEXPLAINED
        doubt = of_parts.explained(replace(evidence, scene=missed))
        assert doubt.reason.type == "Unexplained"
        assert doubt.reason.numbers["frame"] == frame
    turned = replace(evidence.part, joint=evidence.part.joint.reversed())
    assert replace(evidence.scene, parts=((turned, clip.mesh),)).unexplained[1] > 2 * of_parts.UNEXPLAINED


def test_what_never_moves_is_not_seen_through_but_what_was_missed_is(
    evidence: PartEvidence, clip: Clip
) -> None:
    """The closed door in the static scene, as where it was missed: it opens in the middle of the
    recording."""
    assert evidence.scene.static_seen_through[1] < of_parts.STATIC_THROUGH / 2
    assert of_parts.static_stays(evidence) is None
    room, door = clip.static, clip.mesh
    both = Mesh(
        np.concatenate([room.vertices, door.vertices]),
        np.concatenate([room.faces, door.faces + len(room.vertices)]),
    )
    missed = replace(evidence.scene, static=both, parts=())
    reason = of_parts.static_stays(replace(evidence, scene=missed)).reason  # type: ignore[union-attr]
    assert reason.type == "StaticSeenThrough"
    assert reason.numbers["share"] == missed.static_seen_through[1]
    first = evidence.part.motion.intervals[0][0]
    assert first < reason.numbers["frame"]


def test_a_half_labelled_part_does_not_explain_the_rests(evidence: PartEvidence, clip: Clip) -> None:
    faces = clip.mesh.faces
    across = clip.mesh.vertices[faces].mean(axis=1)[:, 0]
    half = Mesh(clip.mesh.vertices, faces[across > np.median(across)])
    scene = replace(evidence.scene, parts=((evidence.part, half),))
    assert of_parts.explained(replace(evidence, scene=scene, mesh=half)).reason.type == "Unexplained"


def test_noise_holes_and_edges_are_not_another_depth() -> None:
    rng = np.random.default_rng(0)
    expected = np.full((60, 80), 2.0, np.float32)
    expected[:, 40:] = 1.0
    seen = (expected + rng.normal(0.0, 0.02, expected.shape)).astype(np.float32)
    seen[10:20, 5:30] = 0.0
    seen[:, 39] = 1.5
    assert other_depth(seen, expected).mean() < 0.001
    seen[30:45, 5:25] -= 0.5
    np.testing.assert_allclose(other_depth(seen, expected)[30:45, 5:25].mean(), 1.0, atol=0.05)
    expected[30:45, 5:25] = 0.0
    assert other_depth(seen, expected).mean() < 0.001

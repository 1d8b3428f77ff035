"""Evidence on both sides of its limits, and twins of what is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from recon.contact.finish_parts import FinishedPart
from recon.fusion.fuse import FusedScene
from recon.interaction.motion.movers import Movers
from recon.interaction.refine.refine_parts import polish_parts, refine_found
from recon.verdict import of_parts, of_video
from recon.verdict.assemble import assemble
from recon.verdict.evidence import PartEvidence
from recon.verdict.explained import other_depth
from recon.verdict.judge import judge
from recon.verdict.of_scenes import free_things
from tests.makers.recon.altered import (
    backed_off,
    drifting,
    moving_during,
    ranging,
    scaled,
    shown_in,
    with_border,
    with_known,
    with_motion,
    with_places,
    with_sigma,
)
from tests.makers.recon.cabinets import Clip
from tests.makers.recon.judged import SPAN, as_one
from twin import geometry as geo
from twin.scene import STATIC_LABEL, Joint, Mesh, Motion, Prismatic, Revolute
from twin.verdict import Reason, Verdict

EMPTY = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))


def test_a_door_that_is_known_well_is_trusted(evidence: PartEvidence) -> None:
    assert [ask(evidence) for ask in of_parts.OF_PARTS] == [None] * len(of_parts.OF_PARTS)


LIMITS: dict[str, tuple[Callable[[PartEvidence], Reason | None], Callable[..., PartEvidence], float, str, str | None]] = {
    # name: (evidence, change, its limit, "up" where more is worse, level beyond)
    "axis": (of_parts.axis, lambda e, _, x: with_sigma(e, axis=np.radians(x)), of_parts.AXIS_DOUBTFUL, "up", "doubtful"),
    "axis, wide": (of_parts.axis, lambda e, _, x: with_sigma(e, axis=np.radians(x)), of_parts.AXIS_REFUSED, "up", "refused"),
    "pivot": (of_parts.pivot, lambda e, _, x: with_sigma(e, pivot=x), of_parts.PIVOT_DOUBTFUL, "up", "doubtful"),
    "pivot, wide": (of_parts.pivot, lambda e, _, x: with_sigma(e, pivot=x), of_parts.PIVOT_REFUSED, "up", "refused"),
    "range": (of_parts.travelled, lambda e, _, x: with_sigma(e, state=SPAN / x), of_parts.RANGE_DOUBTFUL, "down", "doubtful"),
    "range, none": (of_parts.travelled, lambda e, _, x: with_places(with_sigma(e, state=SPAN / x), witnessed=0.2), of_parts.RANGE_REFUSED, "down", "refused"),
    "drift": (of_parts.drift, lambda e, c, x: drifting(e, c, 1 / x), of_parts.DRIFT_DOUBTFUL, "down", "doubtful"),
    "drift, all": (of_parts.drift, lambda e, c, x: drifting(e, c, 1 / x), of_parts.DRIFT_REFUSED, "down", "refused"),
    "rest": (of_parts.rests, lambda e, _, x: moving_during(e, x), of_parts.RESTLESS, "up", "doubtful"),
    "surface": (of_parts.surface, lambda e, c, x: replace(e, mesh=scaled(c.mesh, x)), of_parts.SMALL, "down", "doubtful"),
    "moved": (of_video.seen_to_move, lambda e, _, x: with_places(e, witnessed=x), of_video.MOVED, "down", "doubtful"),
    "moved, none": (of_video.seen_to_move, lambda e, _, x: with_places(e, witnessed=x, followed=0.1), of_video.MOVED_REFUSED, "down", "refused"),
    "motion": (of_video.motion_seen, lambda e, _, x: with_motion(e, x, witnessed=0.5), of_video.WITNESSED, "down", "doubtful"),
    "motion, none": (of_video.motion_seen, lambda e, _, x: with_motion(e, x, witnessed=0.0), of_video.WITNESSED_REFUSED, "down", "refused"),
    "motion, but moved": (of_video.motion_seen, lambda e, _, x: with_motion(e, 0.0, witnessed=x), of_video.MOVED_REFUSED, "down", "refused"),
    "followed": (of_video.seen_to_move, lambda e, _, x: with_places(e, witnessed=0.0, followed=x), of_video.FOLLOWED, "down", "refused"),
    "contradicted": (of_video.contradicted, lambda e, _, x: with_places(e, contradicted=x), of_video.CONTRADICTED, "up", "doubtful"),
    "contradicted, most": (of_video.contradicted, lambda e, _, x: with_places(e, contradicted=x), of_video.CONTRADICTED_REFUSED, "up", "refused"),
    "border": (of_video.ends_at_edges, lambda e, _, x: with_border(e, x), of_video.BARE, "up", "doubtful"),
    "turn": (of_parts.far_enough, lambda e, _, x: ranging(e, x), of_parts.TURN_DOUBTFUL, "down", "doubtful"),
    "turn, none": (of_parts.far_enough, lambda e, _, x: ranging(e, x), of_parts.TURN_REFUSED, "down", "refused"),
    "way": (of_parts.far_enough, lambda e, _, x: ranging(e, x, Prismatic), of_parts.SLIDE_DOUBTFUL, "down", "doubtful"),
    "way, none": (of_parts.far_enough, lambda e, _, x: ranging(e, x, Prismatic), of_parts.SLIDE_REFUSED, "down", "refused"),
    "closed end": (of_parts.closed_end, lambda e, _, x: replace(e, closed_margin=x), of_parts.CLOSED_END, "down", "doubtful"),
    "video": (of_parts.explained, lambda e, _, x: with_known(e, unexplained=(3, x)), of_parts.UNEXPLAINED, "up", "doubtful"),
    "video, wide": (of_parts.explained, lambda e, _, x: with_known(e, unexplained=(3, x)), of_parts.UNEXPLAINED_REFUSED, "up", "refused"),
    "labels": (of_parts.labelled, lambda e, _, x: shown_in(e, round(x)), of_parts.FEWEST_LABELS - 0.5, "down", "doubtful"),
    "no labels": (of_parts.labelled, lambda e, _, x: shown_in(e, round(x)), 0.5, "down", "refused"),
}  # fmt: skip
MILDER = {"refused": ("doubtful", "trusted"), "doubtful": ("trusted",)}


@pytest.mark.parametrize("name", LIMITS)
def test_evidence_tells_on_which_side_of_its_limit_a_number_is(
    name: str, evidence: PartEvidence, clip: Clip
) -> None:
    ask, change, limit, worse, level = LIMITS[name]
    step = 1.1 if worse == "up" else 1 / 1.1
    beyond, within = (ask(change(evidence, clip, x)) for x in (limit * step, limit / step))
    assert beyond is not None
    assert beyond.level == level
    assert Verdict(() if within is None else (within,)).level in MILDER[str(level)]


@pytest.mark.parametrize(
    ("away", "level"),
    [
        (of_parts.CAMERAS_DOUBTFUL / 2, None),
        (of_parts.CAMERAS_DOUBTFUL * 1.5, "doubtful"),
        (of_parts.CAMERAS_REFUSED * 1.5, "refused"),
    ],
)
def test_a_path_that_sees_the_room_in_two_places_is_told(
    away: float, level: str | None, evidence: PartEvidence
) -> None:
    reason = of_parts.cameras(backed_off(evidence, away))
    if level is None:
        assert reason is None
        return
    assert reason.type == "CamerasDrift"
    assert reason.level == level
    assert reason.numbers["off_m"] == pytest.approx(away, rel=0.25)
    half = len(evidence.scene.cameras.frames) // 2
    assert reason.numbers["frame"] < half <= reason.numbers["other"]


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
    limit = of_parts.PIVOT_DOUBTFUL / (2 * np.sin(np.radians(10.0)))
    assert of_parts.pivot(with_sigma(ajar, pivot=0.97 * limit)) is None
    told = of_parts.pivot(with_sigma(ajar, pivot=1.03 * limit))
    assert told.type == "PivotUnsure"
    np.testing.assert_allclose(told.numbers["limit_m"], limit)
    wide = with_sigma(ranging(evidence, np.radians(70.0)), pivot=1.03 * of_parts.PIVOT_DOUBTFUL)
    assert of_parts.pivot(wide) is not None


def test_a_half_sure_axis_with_a_half_sure_range_is_refused(evidence: PartEvidence) -> None:
    unsure = with_sigma(evidence, axis=np.radians(1.1 * of_parts.AXIS_HALF_SURE))
    assert of_parts.axis(unsure) is None
    both = with_places(with_sigma(unsure, state=1.1 * SPAN / of_parts.RANGE_DOUBTFUL), witnessed=0.2)
    assert of_parts.axis(both).level == "refused"  # type: ignore[union-attr]


def test_a_surface_that_is_seen_to_move_is_a_part_however_unsure_its_range(evidence: PartEvidence) -> None:
    """Then range and half-sure axis only doubt it; one of these signs alone is not enough, and an axis that
    is not known at all refuses."""
    unsure = with_sigma(evidence, axis=np.radians(1.1 * of_parts.AXIS_DOUBTFUL), state=SPAN / 5)

    def levels(e: PartEvidence) -> list[str | None]:
        return [None if r is None else r.level for r in (of_parts.axis(e), of_parts.travelled(e))]

    assert levels(with_motion(unsure, 0.06, witnessed=0.31)) == ["doubtful", "doubtful"]
    for told in (
        with_motion(unsure, 0.04, witnessed=0.8),
        with_motion(unsure, 0.5, witnessed=0.29),
        with_motion(unsure, 0.5, contradicted=0.11),
        with_motion(unsure, 0.5, far=0.2),
    ):
        assert levels(told) == ["refused", "refused"]
    lost = with_sigma(evidence, axis=np.radians(1.1 * of_parts.AXIS_REFUSED), state=SPAN / 5)
    assert levels(with_motion(lost, 0.5)) == ["refused", "doubtful"]


def test_what_can_not_be_told_gives_no_reason_but_a_joint_without_sigma_does(evidence: PartEvidence) -> None:
    bare = replace(evidence, part=replace(evidence.part, joint=replace(evidence.part.joint, sigma=None)))
    assert of_parts.uncertainty(bare).level == "refused"  # type: ignore[union-attr]
    assert [of_parts.axis(bare), of_parts.pivot(bare), of_parts.travelled(bare)] == [None] * 3
    for mesh in (None, EMPTY):
        unseen = replace(evidence, mesh=mesh)
        assert of_parts.surface(unseen).level == "refused"  # type: ignore[union-attr]
        assert [of_video.seen_to_move(unseen), of_video.contradicted(unseen), of_parts.drift(unseen)] == [
            None
        ] * 3


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
    part = with_sigma(evidence, axis=np.radians(sigma)).part
    found, labels = evidence.scene.found, dict(evidence.scene.labels)
    finished = () if cut else (FinishedPart(part, clip.mesh, None, "motion", "rest", 1.0),)
    fused = FusedScene(clip.static, {} if cut else {part.id: clip.mesh})
    verdict = judge(
        clip.recording, clip.cameras, labels, as_one(clip.recording, found), (part,), fused, finished
    )
    return assemble(
        clip.recording, clip.cameras, clip.static, finished, labels, {"made": 1}, verdict, (part,), {}, {}
    )


def test_a_trusted_or_doubtful_part_is_written(clip: Clip, evidence: PartEvidence) -> None:
    for share, level in ((0.9, "trusted"), (1.2, "doubtful")):
        twin = judged_twin(clip, evidence, share * of_parts.AXIS_DOUBTFUL)
        assert [p.verdict.level for p in twin.parts] == [level]
        assert twin.verdict.level == level
        assert twin.provenance == {"made": 1}
        assert twin.labels[0].max() == 2


@pytest.mark.parametrize(("sigma", "cut", "why"), [(30.0, False, "AxisUnsure"), (0.1, True, "NoSurface")])
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


def test_refinement_of_no_part_is_none(clip: Clip, evidence: PartEvidence) -> None:
    none = replace(evidence.scene.found, parts=())
    nothing: Any = None
    assert refine_found(clip.recording, clip.cameras, none, nothing, nothing) == ()
    assert polish_parts(clip.recording, clip.cameras, {}, none, (), nothing) == ()


def test_motion_without_frames_never_rests_nor_moves(evidence: PartEvidence) -> None:
    empty = Motion(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    assert of_parts.rests(replace(evidence, part=replace(evidence.part, motion=empty))) is None


def test_a_twin_with_the_part_explains_the_rests_and_one_without_does_not(
    evidence: PartEvidence, clip: Clip
) -> None:
    frame, share = evidence.scene.unexplained
    assert share <= of_parts.UNEXPLAINED / 2
    for mesh in (None, scaled(clip.mesh, 1e-6)):
        missed = replace(evidence.scene, parts=((evidence.part, mesh),))
        frame, share = missed.unexplained
        assert share > 2 * of_parts.UNEXPLAINED
        reason = of_parts.explained(replace(evidence, scene=missed))
        assert reason.type == "Unexplained"
        assert (reason.numbers["frame"], reason.level) == (frame, "refused")
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
    reason = of_parts.static_stays(replace(evidence, scene=missed))
    assert reason.type == "StaticSeenThrough"
    assert reason.level == "doubtful"
    assert reason.numbers["share"] == missed.static_seen_through[1]
    first = evidence.part.motion.intervals[0][0]
    assert first < reason.numbers["frame"]


def test_a_half_labelled_part_does_not_explain_the_rests(evidence: PartEvidence, clip: Clip) -> None:
    faces = clip.mesh.faces
    across = clip.mesh.vertices[faces].mean(axis=1)[:, 0]
    half = Mesh(clip.mesh.vertices, faces[across > np.median(across)])
    scene = replace(evidence.scene, parts=((evidence.part, half),))
    assert of_parts.explained(replace(evidence, scene=scene, mesh=half)).type == "Unexplained"


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


@pytest.mark.parametrize(("span", "told"), [(0.17, True), (0.2, False)])
def test_a_short_slide_told_by_depth_may_lean_aside(span: float, told: bool, evidence: PartEvidence) -> None:
    """8 mm aside are 2.7 deg of the one and 2.3 of the other."""
    short = ranging(evidence, span, Prismatic)
    assert of_parts.axis(short) is None
    by_depth = replace(short, tracks=replace(short.tracks, type_source="depth"))
    assert (of_parts.axis(by_depth) is not None) == told
    lost = of_parts.axis(with_sigma(by_depth, axis=np.radians(2 * of_parts.AXIS_REFUSED)))
    assert lost is not None
    assert lost.level == "refused"
    hinge = ranging(evidence, span)
    assert of_parts.axis(replace(hinge, tracks=replace(hinge.tracks, type_source="depth"))) is None


def test_a_short_drawer_is_square_to_its_front(evidence: PartEvidence, clip: Clip) -> None:
    """What the borders leave open its front tells, unless the axis leaves the normal or the surface is mostly
    something else."""
    short = ranging(evidence, 0.1, Prismatic)
    by_depth = replace(short, tracks=replace(short.tracks, type_source="depth"))
    normals, area = geo.triangle_normals(clip.mesh.vertices[clip.mesh.faces])
    normal = geo.unit(normals[int(np.argmax(area))])
    aside = geo.orthogonal_basis(normal)[:, 0]

    def told(degrees: float) -> bool:
        axis = np.cos(np.radians(degrees)) * normal + np.sin(np.radians(degrees)) * aside
        joint = replace(by_depth.part.joint, axis=axis)
        return of_parts.axis(replace(by_depth, part=replace(by_depth.part, joint=joint))) is not None

    assert [told(d) for d in (0.0, 2.0, 4.0, 90.0)] == [False, False, True, True]


@pytest.mark.parametrize(("kind", "limit"), [(Revolute, np.radians(2.5)), (Prismatic, 0.01)])
def test_a_state_that_changes_while_the_part_rests_is_doubted(
    kind: type[Joint], limit: float, evidence: PartEvidence
) -> None:
    e = ranging(evidence, SPAN, kind)
    motion = e.part.motion
    second = (motion.frames < motion.intervals[0][0]) & (motion.frames % 2 == 1)
    for share, told in ((0.8, False), (1.2, True)):
        creep = np.where(second, share * limit, 0.0)
        crept = replace(e, part=replace(e.part, motion=replace(motion, state=motion.state + creep)))
        reason = of_parts.rests_still(crept)
        assert (reason is not None) == told

"""What reasons add up to, and what one part's verdict says of another."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from recon.contact.finish_parts import FinishedPart
from recon.fusion.fuse import FusedScene
from recon.interaction.parts.find_parts import PartTracks
from recon.verdict.evidence import PartEvidence
from recon.verdict.judge import OF_THE_FIT, OF_THE_SCENE, Judged, _beside_doubted, judge, of_looks, verdict_on
from tests.makers.recon.cabinets import Clip
from tests.makers.recon.judged import as_one, perfect
from twin.verdict import Level, Verdict, reason


def doubted(clip: Clip, times: int) -> PartEvidence:
    """A door with so many doubts: hinge, time at rest, closed end, labels."""
    e = perfect(clip)
    sigma: Any = e.part.joint.sigma
    if times > 0:
        e = replace(e, part=replace(e.part, joint=replace(e.part.joint, sigma=replace(sigma, pivot=0.02))))
    if times > 1:
        e = replace(e, closed_margin=0.0)
    if times > 2:
        one = {0: e.scene.labels[0]}
        e = replace(e, scene=replace(e.scene, labels=one))
    if times > 3:
        every = ((int(e.part.motion.frames[0]), int(e.part.motion.frames[-1])),)
        e = replace(e, part=replace(e.part, motion=replace(e.part.motion, intervals=every)))
    return e


@pytest.mark.parametrize(
    ("times", "level"), [(0, "trusted"), (1, "doubtful"), (3, "doubtful"), (4, "refused")]
)
def test_three_doubts_are_doubts_and_four_refuse(times: int, level: str, clip: Clip) -> None:
    verdict = verdict_on(doubted(clip, times))
    assert verdict.level == level
    assert sum(r.level == "doubtful" for r in verdict.reasons) == times
    if level == "refused":
        main = verdict.main
        assert main.type == "ManyDoubts"
        assert main.numbers["count"] == times
        assert verdict.reasons[1].text in main.text
        assert main.help == verdict.reasons[1].help


def test_what_two_interactions_show_is_not_refused_for_its_doubts(clip: Clip) -> None:
    """Nor is it where one of them shows it well; where one refuses it for itself the other one is alone."""
    many, few = verdict_on(doubted(clip, 4)), verdict_on(doubted(clip, 1))
    alone = verdict_on(replace(doubted(clip, 4), mesh=None))
    assert alone.level == "refused"
    assert of_looks([many]) is many
    both = of_looks([many, many])
    assert both.level == "doubtful"
    assert both.reasons == many.reasons[1:]
    assert of_looks([many, few]) is few
    assert of_looks([many, alone]) == many


def test_what_is_refused_for_itself_is_not_refused_for_its_doubts(clip: Clip) -> None:
    reasons = verdict_on(replace(doubted(clip, 4), mesh=None)).reasons
    assert not any(r.type == "ManyDoubts" for r in reasons)


def test_what_a_missed_part_makes_wrong_is_one_doubt(clip: Clip) -> None:
    """Resting hand, idle hand, another depth at rest and a static scene that is seen through; together with
    two doubts they don't refuse."""
    for times, level in ((2, "doubtful"), (3, "refused")):
        e = doubted(clip, times)
        scene = copy(e.scene)
        told = {
            "resting_hand": (3, 0.1),
            "idle_visit": (3, 9),
            "unexplained": (3, 0.01),
            "static_seen_through": (3, 0.1),
        }
        scene.__dict__.update(told)
        verdict = verdict_on(replace(e, scene=scene))
        assert sum(r.type in OF_THE_SCENE for r in verdict.reasons) == len(told)
        assert verdict.level == level
    assert verdict.main.type == "ManyDoubts"
    assert verdict.main.numbers["count"] == times + 1


def test_what_a_short_motion_leaves_unsure_is_one_doubt(clip: Clip) -> None:
    """Axis, hinge and range by one fit; with two other doubts they don't refuse, with three they do."""
    for times, level in ((3, "doubtful"), (4, "refused")):
        e = doubted(clip, times)
        sigma: Any = e.part.joint.sigma
        sigma = replace(sigma, axis=np.radians(1.5), state=(e.part.joint.upper - e.part.joint.lower) / 30)
        e = replace(e, part=replace(e.part, joint=replace(e.part.joint, sigma=sigma)))
        verdict = verdict_on(e)
        assert sum(r.type in OF_THE_FIT for r in verdict.reasons) == 3
        assert verdict.level == level
    assert verdict.main.type == "ManyDoubts"
    assert verdict.main.numbers["count"] == 4


def judged_beside(clip: Clip, frames: int) -> Judged:
    """A door judged beside a part without a surface, which moves when it does for all but so many frames."""
    e = perfect(clip)
    (first, last), *_ = e.part.motion.intervals
    motion = replace(e.part.motion, intervals=((first + frames, last + frames),))
    other = replace(e.part, id=e.part.id + 1, motion=motion)
    tracks = (e.tracks, PartTracks(other, e.tracks.members, "motion"))
    finished = (FinishedPart(e.part, clip.mesh, None, "motion", "rest", 1.0),)
    fused = FusedScene(clip.static, {e.part.id: clip.mesh})
    found = replace(e.scene.found, parts=tracks)
    return judge(
        clip.recording,
        clip.cameras,
        clip.labels,
        as_one(clip.recording, found),
        (e.part, other),
        fused,
        finished,
    )


def test_what_moves_together_with_what_was_refused_is_doubtful(clip: Clip) -> None:
    """Each frame of difference is one less in common and one more of either."""
    span = clip.part.motion.intervals[0]
    length = span[1] - span[0] + 1
    few, many = 1, length // 2
    assert (length - few) / (length + few) > 0.5 > (length - many) / (length + many)
    told = judged_beside(clip, few)
    assert told.parts[clip.part.id + 1].level == "refused"
    (doubt,) = told.parts[clip.part.id].reasons
    assert doubt.type == "MovesWithDoubted"
    assert doubt.numbers["share"] == pytest.approx((length - few) / (length + few))
    assert told.parts[clip.part.id].level == "doubtful"
    assert judged_beside(clip, many).parts[clip.part.id].level == "trusted"


@pytest.mark.parametrize("level", ["trusted", "doubtful", "refused"])
def test_what_moves_together_with_a_doubtful_part_is_doubtful(level: Level, clip: Clip) -> None:
    """As where one door was found as two, each with half of its motion. Two that are trusted may move
    together: a person has two hands."""
    one, other = clip.part, replace(clip.part, id=clip.part.id + 1)
    doubt = () if level == "trusted" else (reason("ClosedEndUnsure", level, 0.0, 0.25),)
    verdicts = _beside_doubted((one, other), {one.id: Verdict(()), other.id: Verdict(doubt)})
    assert verdicts[one.id].level == ("trusted" if level == "trusted" else "doubtful")
    assert verdicts[other.id] == Verdict(doubt)


def test_a_part_whose_state_nobody_knows_in_a_window_stands_nowhere_there(clip: Clip) -> None:
    """It was moved in a time that could not be solved: what is handled meanwhile is judged without it."""
    e = perfect(clip)
    lost = replace(
        e.part.motion, frames=np.zeros(0, np.int64), times=np.zeros(0), state=np.zeros(0), intervals=()
    )
    other = replace(e.part, id=e.part.id + 1, motion=lost)
    done = (
        FinishedPart(e.part, clip.mesh, None, "motion", "rest", 1.0),
        FinishedPart(other, clip.mesh, None, "motion", "rest", 1.0),
    )
    fused = FusedScene(clip.static, {e.part.id: clip.mesh, other.id: clip.mesh})
    (interaction,) = as_one(clip.recording, e.scene.found)
    verdict = judge(
        clip.recording, clip.cameras, dict(e.scene.labels), (interaction,), (e.part, other), fused, done
    )
    assert verdict.parts[e.part.id].level == "trusted"

"""What reasons add up to, and what one part's verdict says of another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.contact.finish_parts import FinishedPart
from recon.fusion.fuse import FusedScene
from recon.interaction.parts.find_parts import PartTracks
from recon.verdict import posterior
from recon.verdict.doubt import SURELY, Doubt
from recon.verdict.judge import Judged, beside_doubted, clearest, doubts_about, judge, of_looks
from recon.verdict.posterior import QUESTIONS, WEIGHTS, probability, verdict_of
from tests.makers.recon.cabinets import Clip
from tests.makers.recon.judged import SHUT, as_one, found_in, perfect
from twin.verdict import reason
from twin.verdict.reasons import REASONS

TYPES = [t for types in QUESTIONS.values() for t in types]


def doubts(*types: str, times: float = 1.3) -> tuple[Doubt, ...]:
    """Doubts of these types, each so far beyond its limit."""
    return tuple(Doubt(reason(t, "doubtful", *[0.1] * len(REASONS[t].numbers.split())), times) for t in types)


ONE, FEW, MANY = (
    ("BareBorder",),
    ("BareBorder", "AxisUnsure"),
    ("BareBorder", "AxisUnsure", "SeenThrough", "SurfaceUnseen"),
)


def test_doubts_add_up_to_a_level() -> None:
    none, few, many = (verdict_of(doubts(*types)) for types in ((), FEW, MANY))
    assert (none.level, few.level, many.level) == ("trusted", "doubtful", "refused")
    assert none.probability > few.probability > many.probability  # type: ignore[operator]
    assert {r.type for r in many.reasons} == set(MANY)
    assert many.main.level == "refused"  # type: ignore[union-attr]


@pytest.mark.parametrize("type", TYPES)
def test_each_doubt_takes_from_the_probability_and_the_more_the_farther(type: str) -> None:
    """None speaks for a part."""
    odds = [probability([]), *(probability(doubts(type, times=t)) for t in (1.01, 3.0, 1e6))]
    assert sorted(odds, reverse=True) == odds
    assert len(set(odds)) == len(odds)


@pytest.mark.parametrize(("one", "other"), [("AxisUnsure", "RangeUnsure"), ("SeenThrough", "Unexplained")])
def test_doubts_that_answer_one_question_count_once_by_the_worse(one: str, other: str) -> None:
    """What a wrong axis shows in its sigma and in its range is one fault."""
    (worse,), (less,) = doubts(one, times=3.0), doubts(other, times=2.0)
    assert probability([worse, less]) == probability([less, worse]) == probability([worse])
    elsewhere = doubts("ClosedEndUnsure", times=2.0)
    assert probability([worse, *elsewhere]) < probability([worse])
    assert {r.type for r in verdict_of([worse, less, *elsewhere]).reasons} == {one, other, "ClosedEndUnsure"}


def test_every_doubt_answers_one_question() -> None:
    told = {*REASONS} - {
        "NoUncertainty",
        "NoSurface",
        "HandMovesNothing",
        "NothingArticulated",
        "UpUnsure",
        "OfPart",
        "OfRecording",
    }
    assert sorted(TYPES) == sorted(told)
    assert set(WEIGHTS) == set(QUESTIONS)


def test_what_is_trusted_all_the_same_keeps_no_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(posterior, "SOUND", 6.0)
    barely = verdict_of(doubts("Unexplained", times=1.01))
    assert barely.level == "trusted"
    assert barely.reasons == ()
    assert 0.95 <= barely.probability < probability([])  # type: ignore[operator]


def test_what_surely_refuses_does_whatever_else_is_told(clip: Clip) -> None:
    told = verdict_of(doubts_about(replace(perfect(clip), mesh=None)))
    assert told.level == "refused"
    assert told.probability == 0.0
    assert told.main.type == "NoSurface"  # type: ignore[union-attr]


def test_the_weightiest_reason_comes_first() -> None:
    near, far = doubts("BareBorder", times=1.1), doubts("AxisUnsure", times=30.0)
    assert [r.type for r in verdict_of((*near, *far)).reasons] == ["AxisUnsure", "BareBorder"]


def test_what_two_interactions_show_is_not_left_out_for_its_doubts() -> None:
    """Nor is it doubted where one of them shows it well; what one refuses for itself is worth the other."""
    many, few = doubts(*MANY, times=2.0), doubts(*ONE)
    alone = [Doubt(reason("NoSurface", "refused"), SURELY)]
    assert of_looks([many]).level == "refused"
    both = of_looks([many, many])
    assert both.level == "doubtful"
    assert [r.type for r in both.reasons] == [r.type for r in verdict_of(many).reasons]
    assert of_looks([many, few]) == verdict_of(few)
    assert of_looks([many, alone]) == verdict_of(many)
    assert of_looks([alone, alone]).level == "refused"
    assert clearest([alone, many, few]) is few


def judged_beside(clip: Clip, frames: int) -> Judged:
    """A door judged beside a part without a surface, which moves when it does for all but so many frames."""
    e = perfect(clip)
    (first, last), *_ = e.part.motion.intervals
    motion = replace(e.part.motion, intervals=((first + frames, last + frames),))
    other = replace(e.part, id=e.part.id + 1, motion=motion)
    (tracks,) = found_in(clip).parts
    finished = (FinishedPart(e.part, clip.mesh, None, "motion", SHUT),)
    fused = FusedScene(clip.static, {e.part.id: clip.mesh})
    found = replace(found_in(clip), parts=(tracks, PartTracks(other, tracks.members, "motion")))
    return judge(
        clip.recording,
        clip.cameras,
        clip.labels,
        as_one(clip.recording, found),
        (e.part, other),
        fused,
        finished,
    )


def test_what_moves_together_with_what_was_refused_is_doubted(clip: Clip) -> None:
    """Each frame of difference is one less in common and one more of either."""
    span = clip.part.motion.intervals[0]
    length = span[1] - span[0] + 1
    few, many = length // 3, length * 2 // 3
    assert (length - few) / (length + few) > 0.3 > (length - many) / (length + many)
    told = judged_beside(clip, few)
    assert told.parts[clip.part.id + 1].level == "refused"
    beside, apart = (judged_beside(clip, k).parts[clip.part.id] for k in (few, many))
    assert beside.probability < apart.probability  # type: ignore[operator]
    assert apart.level == "trusted"


@pytest.mark.parametrize(("types", "told"), [((), False), (FEW, True), (MANY, True)])
def test_what_moves_together_with_a_doubtful_part_is_doubted(
    types: tuple[str, ...], told: bool, clip: Clip
) -> None:
    """As where one door was found as two, each with half of its motion. Two that are trusted may move
    together: a person has two hands."""
    one, other = clip.part, replace(clip.part, id=clip.part.id + 1)
    its = doubts(*types, times=2.0)
    out = beside_doubted((one, other), {one.id: (), other.id: its})
    assert [d.reason.type for d in out[one.id]] == (["MovesWithDoubted"] if told else [])
    assert out[other.id] == its


def test_a_part_whose_state_nobody_knows_in_a_window_stands_nowhere_there(clip: Clip) -> None:
    """It was moved in a time that could not be solved: what is handled meanwhile is judged without it."""
    e = perfect(clip)
    lost = replace(
        e.part.motion, frames=np.zeros(0, np.int64), times=np.zeros(0), state=np.zeros(0), intervals=()
    )
    other = replace(e.part, id=e.part.id + 1, motion=lost)
    done = (
        FinishedPart(e.part, clip.mesh, None, "motion", SHUT),
        FinishedPart(other, clip.mesh, None, "motion", SHUT),
    )
    fused = FusedScene(clip.static, {e.part.id: clip.mesh, other.id: clip.mesh})
    (interaction,) = as_one(clip.recording, found_in(clip))
    verdict = judge(
        clip.recording, clip.cameras, dict(e.scene.labels), (interaction,), (e.part, other), fused, done
    )
    assert verdict.parts[e.part.id].level == "trusted"

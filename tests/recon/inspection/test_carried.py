"""What is wrong with a recording is carried into the verdict on what is made of it, before all that follows
from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.contact.finish_parts import FinishedPart
from recon.fusion.fuse import FusedScene
from recon.inspection.findings import as_reason, doubts, finding, only_after
from recon.interaction.interaction import Interaction
from recon.verdict.judge import Fault, Judged, judge
from recon.windows.windows import Window
from tests.makers.recon.cabinets import Clip, make_clip
from tests.makers.recon.judged import SHUT, as_one, found_in, perfect
from twin.scene import HAND_LABEL
from twin.verdict import Reason, of_twin, verdict_document, verdict_from

LATE = finding("DepthDelayed", 2, 0.133, 0.002)
CUT = finding("Cut", 108, 1)


@pytest.fixture(scope="module")
def clip() -> Clip:
    return make_clip("door")


def judged(clip: Clip, faults: tuple[Reason, ...], surface: bool = True) -> Judged:
    """A door about which nothing else is doubtful; without a surface it is refused."""
    e = perfect(clip)
    finished = (FinishedPart(e.part, clip.mesh, None, "motion", SHUT),) if surface else ()
    fused = FusedScene(clip.static, {e.part.id: clip.mesh})
    return judge(
        clip.recording,
        clip.cameras,
        clip.labels,
        as_one(clip.recording, found_in(clip)),
        (e.part,),
        fused,
        finished,
        [Fault(f) for f in faults],
    )


def test_late_depth_doubts_every_part_and_is_the_first_reason(clip: Clip) -> None:
    found = judged(clip, (as_reason(LATE),))
    verdict = found.parts[clip.part.id]
    assert (verdict.level, verdict.main) == ("doubtful", as_reason(LATE))
    whole = of_twin({"door": verdict}, own=found.scene)
    assert whole.text.startswith(
        "doubtful: depth and colour of different times: depth lags 2 frames (133 ± 2 ms) behind colour; "
        "open it with --depth-delay 2"
    )
    assert verdict_from(verdict_document(whole) or {}) == whole
    assert judged(clip, ()).parts[clip.part.id].level == "trusted"


def test_where_nothing_was_found_late_depth_is_why(clip: Clip) -> None:
    found = judged(clip, (as_reason(LATE),), surface=False)
    late, nothing = found.scene
    assert late.type == "OfRecording"
    assert nothing.type == "NothingArticulated"
    assert of_twin({}, {"door": found.parts[clip.part.id]}, found.scene).text.startswith(
        "refused: depth and colour of different times: depth lags 2 frames"
    )


def test_a_cut_is_named_before_what_follows_from_it(clip: Clip) -> None:
    verdict = of_twin({"door": judged(clip, (as_reason(CUT),)).parts[clip.part.id]}, own=(as_reason(CUT),))
    assert verdict.text.startswith("doubtful: the video is cut: between frames 108 and 109; take the piece")


def test_one_cut_is_charged_to_the_windows_that_it_lies_in(clip: Clip) -> None:
    """A part that was handled in other minutes is not doubted for it; of several cuts any may be."""
    assert (only_after(CUT), only_after(finding("Cut", 108, 2)), only_after(LATE)) == (108, None, None)
    cut = Fault(as_reason(CUT), only_after(CUT))
    assert not cut.touches([(0, 108), (109, 200)])  # it lies between the two frames
    assert cut.touches([(300, 400), (50, 109)])
    assert cut.touches([])
    assert Fault(as_reason(LATE)).touches([(0, 10)])


def test_what_only_makes_a_recording_worse_doubts_nothing() -> None:
    assert doubts(LATE)
    assert doubts(CUT)
    assert not doubts(finding("DepthDelayed", 0, 0.03, 0.002))
    assert not doubts(finding("Blurred", 0.5, 3, 2.0, "horizontal"))


def test_a_window_in_which_no_part_was_found_doubts_the_scene(clip: Clip) -> None:
    e = perfect(clip)
    finished = (FinishedPart(e.part, clip.mesh, None, "motion", SHUT),)
    fused = FusedScene(clip.static, {e.part.id: clip.mesh})
    (one,) = as_one(clip.recording, found_in(clip))
    last = len(clip.recording) - 1
    empty = Interaction(Window(0, last, (3, 9)), replace(found_in(clip), parts=()), (), {})

    def told(*interactions: Interaction) -> Judged:
        return judge(clip.recording, clip.cameras, clip.labels, interactions, (e.part,), fused, finished)

    assert told(one).scene == ()
    (doubt,) = told(one, empty).scene
    assert (doubt.type, doubt.level) == ("HandMovesNothing", "doubtful")
    assert (doubt.numbers["first"], doubt.numbers["last"]) == (3, 9)
    assert (
        of_twin({"door": told(one, empty).parts[e.part.id]}, own=told(one, empty).scene).level == "doubtful"
    )


def test_a_hand_that_moves_nothing_doubts_the_scene_and_no_part(clip: Clip) -> None:
    """Its window begins at frame 4 of the recording; the part itself is as good as ever."""
    e = perfect(clip)
    finished = (FinishedPart(e.part, clip.mesh, None, "motion", SHUT),)
    fused = FusedScene(clip.static, {e.part.id: clip.mesh})
    (one,) = as_one(clip.recording, found_in(clip))
    late = replace(one, window=Window(4, len(clip.recording) - 1))
    visit = (17, 23)  # after the motion, in a part of the picture that the twin explains
    hand = np.full_like(clip.labels[0], HAND_LABEL)
    labels = {f: hand if visit[0] <= f <= visit[1] else image for f, image in clip.labels.items()}
    slow = replace(clip.recording, times=10.0 * clip.recording.times)
    told = judge(slow, clip.cameras, labels, (late,), (e.part,), fused, finished)
    reasons = [r for r in told.scene if r.type == "HandMovesNothing"]
    assert [r.level for r in reasons] == ["doubtful"]
    assert reasons[0].numbers["last"] == max(f for f in labels if f <= visit[1])

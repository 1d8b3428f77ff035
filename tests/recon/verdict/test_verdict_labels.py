"""Labels against the twin at both ends of a part's travel."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from recon.verdict import of_video
from recon.verdict.evidence import PartEvidence
from tests.makers.recon.altered import with_labels
from tests.makers.recon.cabinets import Clip
from twin.scene import HAND_LABEL, STATIC_LABEL


def labelled_there(e: PartEvidence, clip: Clip, end: int, label: int) -> dict[int, NDArray[np.uint8]]:
    """The labels, with another one (`label`) for the part at one end of its travel: 0 or -1."""
    near = np.abs(clip.opening - clip.opening[end]) < 0.1 * np.ptp(clip.opening)
    return {
        f: np.where((image == e.part.id) & near[f], label, image).astype(np.uint8)
        for f, image in e.scene.labels.items()
    }


@pytest.mark.parametrize("end", [0, -1], ids=["closed", "open"])
def test_a_part_is_labelled_wherever_the_twin_brings_it(evidence: PartEvidence, clip: Clip, end: int) -> None:
    """At one end it is labelled static, as where it went elsewhere."""
    assert evidence.least_labelled is not None
    assert evidence.least_labelled[1] > 0.95
    assert of_video.labelled_at_ends(evidence) is None
    lost = labelled_there(evidence, clip, end, STATIC_LABEL)
    reason = of_video.labelled_at_ends(with_labels(evidence, lost))
    assert reason.reason.type == "LabelledElsewhere"
    assert reason.reason.level == "doubtful"
    assert reason.reason.numbers["share"] == 0.0
    assert clip.opening[reason.reason.numbers["frame"]] == pytest.approx(
        clip.opening[end], abs=0.1 * np.ptp(clip.opening)
    )


def test_a_part_whose_rim_is_labelled_static_is_labelled(evidence: PartEvidence) -> None:
    """At its rim labels are off by a pixel of the thinned pictures that are compared."""
    posed, thinner = evidence.scene.posed, {}
    for f, image in evidence.scene.labels.items():
        shown = (posed.expected(f).owner == evidence.part.id).astype(np.uint8)
        rim = (shown > 0) & (cv2.erode(shown, np.ones((3, 3), np.uint8)) == 0)
        wide = cv2.resize(rim.astype(np.uint8), image.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
        thinner[f] = np.where(wide, STATIC_LABEL, image).astype(np.uint8)
    again = with_labels(evidence, thinner)
    assert again.least_labelled is not None
    assert again.least_labelled[1] > 1.05 * of_video.LABELLED
    assert of_video.labelled_at_ends(again) is None


def test_a_part_that_is_labelled_hand_where_it_is_open_is_labelled_elsewhere(
    evidence: PartEvidence, clip: Clip
) -> None:
    """Nothing is in front of it there, as an arm would be."""
    taken = labelled_there(evidence, clip, -1, HAND_LABEL)
    reason = of_video.labelled_at_ends(with_labels(evidence, taken))
    assert reason.reason.type == "LabelledElsewhere"
    assert reason.reason.numbers["share"] < 0.1

"""What is pointed at and has no track: the board at that pixel is the part."""

from __future__ import annotations

import warnings
from typing import Literal

import numpy as np
import pytest

from recon.interaction.boards.search import part_at
from recon.interaction.parts.find_parts import FoundParts
from recon.recording.said import Said, Word
from recon.tracking.tracks import Tracks
from tests.makers.recon.cabinets import Clip, Kind, make_clip
from tests.makers.recon.said import parts_with
from twin import geometry as geo
from twin.scene import STATIC_LABEL

KINDS: tuple[Kind, ...] = ("door", "drawer")


def without_tracks(clip: Clip) -> Tracks:
    n = len(clip.recording)
    return Tracks(np.zeros((n, 0, 3)), np.zeros((n, 0, 2)), np.zeros((n, 0), bool))


def pixel(clip: Clip, frame: int, label: int) -> tuple[int, int, int]:
    """A pixel amid those of a label."""
    y, x = np.nonzero((clip.labels[frame] == label) & (clip.recording.depth(frame) > 0))
    k = int(np.argmin(np.hypot(x - np.median(x), y - np.median(y))))
    return int(x[k]), int(y[k]), frame


def at(point: tuple[int, int, int], kind: Literal["hinge", "slide"] | None = None) -> Said:
    return Said(parts=(str(Word(point, type=kind)),))


def found(clip: Clip, said: Said) -> FoundParts:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return parts_with(clip.recording, without_tracks(clip), clip.cameras, said)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("frame", [0, 24])
def test_the_board_that_is_pointed_at_is_found_in_any_frame(kind: Kind, frame: int) -> None:
    clip = make_clip(kind)
    (part,) = found(clip, at(pixel(clip, frame, 2))).parts
    assert part.type_source == "depth"
    assert part.part.joint.kind == clip.part.joint.kind
    assert np.degrees(geo.line_angle(part.part.joint.axis, clip.part.joint.axis)) < 4.0
    assert np.ptp(part.part.motion.state) > 0.85 * np.ptp(clip.part.motion.state)


def test_what_stands_still_is_no_part_where_it_is_pointed_at() -> None:
    clip = make_clip("drawer")
    y, x = 20, 185  # a neighbour's front
    assert clip.labels[0][y, x] == STATIC_LABEL
    assert part_at(clip.recording, clip.cameras, (x, y, 0)) is None
    with pytest.warns(UserWarning, match="no part was found for --at 185,20@0"):
        (part,) = parts_with(clip.recording, without_tracks(clip), clip.cameras, at((x, y, 0))).parts
    assert part.part.joint.kind == clip.part.joint.kind, "the drawer, which is found without a word"


@pytest.mark.parametrize(("word", "kind"), [("hinge", "revolute"), ("slide", "prismatic")])
def test_the_type_that_is_said_holds(word: Literal["hinge", "slide"], kind: str) -> None:
    clip = make_clip("door")
    (part,) = found(clip, at(pixel(clip, 24, 2), word)).parts
    assert part.part.joint.kind == kind
    assert part.type_source == "said by the user"

"""The shipped recording with its true cameras, and marks that a person made on its pictures."""

from __future__ import annotations

import pytest

from recon import open_recording
from recon.annotation.marks import Mark
from recon.annotation.seen import Seen
from recon.dense.noise import GOOD_SENSOR
from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from recon.tracking.follow import track_points
from twin.files.assets import asset

MARKS = (
    Mark("drawer", "part", "slide"),
    Mark("drawer", "outline", "15: 191,170 330,163 324,203 194,208"),
    Mark("drawer", "outline", "70: 164,164 323,168 318,209 169,209"),
    Mark("drawer", "moves", "34:61"),
)


@pytest.fixture(scope="module")
def seen(true: Truth) -> Seen:
    recording = open_recording(asset("recordings/cabinet_drawer"))
    assert true.cameras is not None
    return Seen(recording, track_points(recording), true.cameras, GOOD_SENSOR)


@pytest.fixture(scope="module")
def true() -> Truth:
    return load_truth(asset("recordings/cabinet_drawer") / "truth")

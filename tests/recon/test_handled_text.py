"""When a part was handled, as the command line tells it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.scenes.boards import cabinet_twin
from recon.verbs.twins import handled_text
from twin.scene import Motion


def test_times_are_minutes_and_seconds_from_the_first_frame() -> None:
    part = cabinet_twin().parts[0]
    frames = np.arange(0, 2000, 10)  # every tenth has a state
    motion = Motion(frames, 1000.0 + frames / 15.0, np.zeros(len(frames)), ((150, 180), (1075, 1085)))
    assert handled_text(replace(part, motion=motion)) == "0:10-0:12 1:12-1:12"
    assert handled_text(replace(part, motion=replace(motion, intervals=()))) == ""

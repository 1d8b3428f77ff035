"""What the command line tells of a walk."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import recon.pipeline
from benchmarks.scenes.boards import cabinet_twin
from recon.inspection.findings import as_reason, finding
from recon.verbs.of_walk import NO_CAMERA, handled_text, moved_unseen, notes, unsolved_rows
from recon.windows.windows import Window
from twin.scene import Motion, Trajectory
from twin.verdict import Verdict, reason


def test_times_are_minutes_and_seconds_from_the_first_frame() -> None:
    part = cabinet_twin().parts[0]
    frames = np.arange(0, 2000, 10)  # every tenth has a state
    motion = Motion(frames, 1000.0 + frames / 15.0, np.zeros(len(frames)), ((150, 180), (1075, 1085)))
    assert handled_text(replace(part, motion=motion)) == "0:10-0:12 1:12-1:12"
    assert handled_text(replace(part, motion=replace(motion, intervals=()))) == ""


WALK: Any = SimpleNamespace(times=1000.0 + np.arange(1200) / 15.0)
# a drawer is opened, a door is refused, something is carried, and somebody stands by
WINDOWS = (
    Window(150, 260, (180, 230)),
    Window(300, 400, (330, 370)),
    Window(500, 600, (530, 570)),
    Window(700, 800),
)


def test_a_window_without_a_part_is_told_by_its_time_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    axis, tiny = reason("AxisUnsure", "refused", 40.0, 0.9), reason("NoSurface", "refused")
    cut = as_reason(finding("Cut", 108, 1))  # doubts what it touches and refuses nothing
    stages = {
        "windows": WINDOWS,
        "merge": SimpleNamespace(
            parts=[
                SimpleNamespace(id=2, windows=((150, 260),)),
                SimpleNamespace(id=3, windows=((300, 400),)),
            ]
        ),
        "verdict": SimpleNamespace(parts={2: Verdict(), 3: Verdict((cut, axis, tiny))}),
    }
    monkeypatch.setattr(recon.pipeline, "read_stage", lambda _, name: stages[name])
    part = cabinet_twin().parts[0]
    motion = replace(part.motion, intervals=((190, 220),))
    twin = replace(cabinet_twin(), cameras=None, parts=(replace(part, motion=motion),))
    door, carried = unsolved_rows(Path("run"), twin, WALK)
    assert door == ["0:22", "0:25", axis.text, axis.help]
    assert carried[:2] == ["0:35", "0:38"]
    assert "a hand is in view from frame 530 to 570, and nothing in the twin moves" in carried[2]
    stages["windows"] = (Window(0, 1199, (180, 230)),)
    assert unsolved_rows(Path("run"), replace(twin, parts=()), WALK) == []  # of a clip the verdict tells it


def test_a_stretch_without_cameras_is_told_by_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of half a second and more; a single frame stands in a warning alone."""
    monkeypatch.setattr(recon.pipeline, "read_stage", lambda *_: (WINDOWS[0],))
    lost = np.r_[300:346, 700]
    frames = np.setdiff1d(np.arange(1200), lost)
    cameras = Trajectory(frames, np.asarray(WALK.times)[frames], np.tile(np.eye(4), (len(frames), 1, 1)))
    assert cameras.gaps(1200) == ((300, 345), (700, 700))
    assert cameras.gaps(1202) == ((300, 345), (700, 700), (1200, 1201))
    (row,) = unsolved_rows(Path("run"), replace(cabinet_twin(), cameras=cameras), WALK)
    assert row == ["0:20", "0:23", *NO_CAMERA]


def test_what_was_moved_out_of_view_is_told_with_its_time() -> None:
    """Between two visits; not before the first state, nor for a moment."""
    frames = np.arange(1200)
    cameras = Trajectory(frames, np.asarray(WALK.times), np.tile(np.eye(4), (1200, 1, 1)))
    known = np.r_[30:300, 600:900, 902:1200]
    part = cabinet_twin().parts[0]
    motion = Motion(known, np.asarray(WALK.times)[known], np.zeros(len(known)), ((60, 90),))
    twin = replace(cabinet_twin(), cameras=cameras, parts=(replace(part, motion=motion),))
    (told,) = moved_unseen(twin, WALK)
    assert told.startswith(f"0:20-0:40: {part.name} stood otherwise than it was left")


def test_warnings_of_a_window_have_its_time_and_each_stands_once() -> None:
    stages = [
        {"name": "up", "warnings": ["up is a guess"]},
        {"name": "labels/000150-000260", "warnings": ["no frame is free of the hand"] * 2},
        {"name": "labels/000300-000400", "warnings": ["no frame is free of the hand"]},
    ]
    assert notes(stages, WALK) == [
        "up is a guess",
        "0:10-0:17: no frame is free of the hand",
        "0:20-0:27: no frame is free of the hand",
    ]


def test_of_a_window_that_was_solved_again_the_second_time_is_told() -> None:
    stages = [
        {"name": "motion/000150-000260", "warnings": ["no part was found"]},
        {"name": "labels/000150-000260-again", "warnings": ["no frame is free of the hand"]},
        {"name": "motion/000300-000400", "warnings": ["no part was found"]},
    ]
    assert notes(stages, WALK) == ["0:10-0:17: no frame is free of the hand", "0:20-0:27: no part was found"]

"""Parts found among tracks of rendered recordings: how many, which joints, when."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recon.cameras import estimate_cameras
from recon.motion import FoundParts, MotionConfig, find_parts
from recon.recording import Recording, open_recording
from recon.tracks import track_points
from tests.recon import tiny
from twin import geometry as geo
from twin.errors import ConfigError, ReconstructionError
from twin.scene import Revolute

FRAMES = 120


def _found(folder: Path) -> tuple[Recording, FoundParts, np.ndarray]:
    recording = open_recording(folder)
    tracks = track_points(recording)
    cameras = estimate_cameras(tracks, recording.times, recording.intrinsics.fx)
    T_world_start = tiny.cameras(FRAMES)[0]
    return recording, find_parts(recording, tracks, cameras.transformed(T_world_start)), T_world_start


def test_two_parts_that_move_one_after_the_other(tmp_path: Path) -> None:
    folder = tiny.write_recording(tmp_path / "two", ("door", "drawer"), frames=FRAMES, scale=5, pattern=47.0)
    _, found, _ = _found(folder)
    assert {p.part.joint.kind for p in found.parts} == {"revolute", "prismatic"}
    assert len(found.parts) == 2
    for part in found.parts:
        joint = part.part.joint
        truth, _, _ = tiny.JOINTS["door" if joint.kind == "revolute" else "drawer"]
        assert np.degrees(geo.line_angle(joint.axis, truth.axis)) < 3.0  # before refinement
        if isinstance(joint, Revolute) and isinstance(truth, Revolute):
            assert geo.line_distance(joint.pivot, joint.axis, truth.pivot, truth.axis) < 0.03
        (interval,) = part.part.motion.intervals
        first = FRAMES // 8 if joint.kind == "revolute" else FRAMES // 2 + FRAMES // 8
        last = 3 * FRAMES // 8 if joint.kind == "revolute" else FRAMES // 2 + 3 * FRAMES // 8
        assert first - 2 <= interval[0] < interval[1] <= last + 2


def test_nothing_moves(tmp_path: Path) -> None:
    folder = tiny.write_recording(
        tmp_path / "still", ("drawer",), frames=FRAMES, scale=2, pattern=47.0, still=True
    )
    with pytest.raises(ReconstructionError, match="moves"):
        _found(folder)


def test_settings_are_checked() -> None:
    with pytest.raises(ConfigError):
        MotionConfig(far_share=1.5)

"""The report's timeline: bars where parts move, curves as high as they are open, gaps of unknown states."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin.report.timeline import timeline
from twin.scene import Motion, Trajectory, Twin

SECONDS, RATE = 60.0, 15.0


def walk(known: np.ndarray) -> Twin:
    """A cabinet whose parts open half-way from 20 to 25 s, with states in some frames of a minute."""
    twin = cabinet_twin()
    frames = np.arange(int(SECONDS * RATE) + 1)
    cameras = Trajectory(frames, frames / RATE, np.tile(np.eye(4), (len(frames), 1, 1)))
    parts = []
    for part in twin.parts:
        half = 0.5 * (part.joint.upper - part.joint.lower)
        state = part.joint.lower + half * np.clip((frames / RATE - 20.0) / 5.0, 0.0, 1.0)
        kept = frames[known[: len(frames)]]
        motion = Motion(kept, kept / RATE, state[kept], ((300, 375),))
        parts.append(dataclasses.replace(part, motion=motion))
    return dataclasses.replace(twin, cameras=cameras, parts=tuple(parts))


def drawn(twin: Twin) -> ET.Element:
    return ET.fromstring(timeline(twin))  # noqa: S314 (of our own making)


def test_bars_stand_where_parts_move() -> None:
    twin = walk(np.ones(901, bool))
    bars = drawn(twin).findall("rect")
    assert len(bars) == len(twin.parts)
    width = 1000 - 170
    for bar in bars:
        assert float(bar.attrib["x"]) == pytest.approx(170 + width * 20 / 60, abs=0.2)
        assert float(bar.attrib["width"]) == pytest.approx(width * 5 / 60, abs=0.2)


def test_a_curve_is_as_high_as_a_part_is_open() -> None:
    (first, *_) = drawn(walk(np.ones(901, bool))).findall("polygon")
    heights = [float(p.split(",")[1]) for p in first.attrib["points"].split()]
    assert (max(heights) - min(heights)) == pytest.approx(0.5 * (34 - 12), abs=0.11)


def test_frames_without_a_state_are_a_gap() -> None:
    known = np.ones(901, bool)
    known[500:600] = False
    twin = walk(known)
    assert len(drawn(twin).findall("polygon")) == 2 * len(twin.parts)


def test_rows_are_named_and_clips_have_no_timeline() -> None:
    twin = walk(np.ones(901, bool))
    assert all(part.name in timeline(twin) for part in twin.parts)
    assert twin.cameras is not None
    cameras = dataclasses.replace(twin.cameras, times=twin.cameras.times / 10.0)
    assert timeline(dataclasses.replace(twin, cameras=cameras)) == ""
    assert timeline(dataclasses.replace(twin, parts=())) == ""

"""The report's timeline: bars where parts move, curves as high as they are open, gaps of unknown states."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin import geometry as geo
from twin.page import page
from twin.report import meshes, views
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


def test_a_room_has_a_map_and_each_of_its_parts_opens_by_itself() -> None:
    twin = walk(np.ones(901, bool))
    pictures = page._pictures(twin)
    assert pictures["plan"]
    assert not pictures["opening"]
    for part in twin.parts:
        closed, opened = pictures[f"opening {part.id}"]
        assert closed != opened
    of_clip = page._pictures(cabinet_twin())
    assert set(of_clip) == {"opening", "dollhouse", "plan"}
    assert not of_clip["plan"]


def test_the_map_looks_straight_down_and_holds_path_and_parts() -> None:
    twin = walk(np.ones(901, bool))
    view = views.above(twin, 300, 200)
    np.testing.assert_allclose(view.T_world_cam[:3, 2], [0, 0, -1], atol=1e-12)
    points = np.concatenate([m.vertices for m in views.placed(twin, 1.0)] + [np.zeros((1, 3))])
    x, y, z = view.matrix @ geo.transform(geo.invert_pose(view.T_world_cam), points).T
    assert 0 < (x / z).min() < (x / z).max() < 299
    assert 0 < (y / z).min() < (y / z).max() < 199
    contact = next(p.contact for p in twin.parts if p.contact is not None)
    outward = view.T_world_cam[:3, :3].T @ contact.rotation[:, 2]
    assert outward[1] > 0.9  # it opens towards the lower edge


def test_one_part_opens_where_the_person_stood_while_it_moved() -> None:
    """The others stay closed: pixels change where this part goes."""
    twin = walk(np.ones(901, bool))
    assert twin.cameras is not None
    poses = twin.cameras.T_world_cam.copy()
    poses[300:376, :3, 3] = [0.3, -2.0, 1.2]
    twin = dataclasses.replace(twin, cameras=dataclasses.replace(twin.cameras, T_world_cam=poses))
    part = twin.parts[0]
    view = views.part_view(twin, [part], 160, 120)
    np.testing.assert_allclose(view.T_world_cam[:3, 3], [0.3, -2.0, 1.2])
    closed, opened = meshes.opening(twin, 2, 160, 120, only=part)
    both = meshes.opening(twin, 2, 160, 120)
    assert 0.01 < (closed != opened).any(-1).mean() < 0.9
    assert not np.array_equal(both[1], opened)

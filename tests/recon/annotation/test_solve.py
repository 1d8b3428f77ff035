"""What follows from the marks: the true joint and states, and a folder that can be evaluated against."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recon.annotation.marks import Mark, Marks, marks_of
from recon.annotation.overlay import overlay
from recon.annotation.seen import Seen
from recon.annotation.solve import Annotated, annotated
from recon.annotation.truth_folder import write_truth
from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from tests.recon.annotation.conftest import MARKS
from twin import geometry as geo
from twin.errors import FuntwinError, InputError
from twin.scene import Trajectory


def solved(seen: Seen, *more: Mark) -> Annotated:
    return annotated(seen, marks_of([*MARKS, *more], seen.recording).parts[0])


@pytest.fixture(scope="module")
def drawer(seen: Seen) -> Annotated:
    return solved(seen)


def test_joint_and_states_are_the_true_ones(drawer: Annotated, true: Truth) -> None:
    part = true.parts[0]
    assert np.rad2deg(geo.angle_between(drawer.joint.axis, part.joint.axis)) < 0.2  # opening is positive
    off = drawer.states - (part.states - part.states[0])
    assert np.sqrt(np.mean(off**2)) < 1e-3
    assert abs(np.ptp(drawer.states) - np.ptp(part.states)) < 1e-3
    assert drawer.notes == ()


def test_the_drawn_outline_stays_on_the_part(seen: Seen, drawer: Annotated, true: Truth) -> None:
    """Its middle shows the part in every frame in which the hand isn't before it."""
    shown = overlay(seen, drawer)
    for frame in (0, 20, 70, 87):
        x, y = np.mean(shown["outline"][frame], axis=0).round().astype(int)
        assert true.labels[frame][y, x] == 2
    assert shown["unit"] == "mm"
    assert shown["states"][-1] == pytest.approx(288, abs=1.5)


def test_states_go_where_the_point_is_clicked(seen: Seen, drawer: Annotated) -> None:
    """A point of the closed drawer, told 8 mm farther when it is open than the video has it."""
    place = np.array([230.0, 180.0])
    point = seen.world(10, place[None])
    open_there = geo.transform(drawer.pose(80), point) + 0.008 * drawer.joint.axis
    x, y = seen.pixels(80, open_there)[0]
    corrected = solved(
        seen, Mark("drawer", "point", "10: 230,180"), Mark("drawer", "point", f"80: {x:.2f},{y:.2f}")
    )
    assert corrected.clicked_px == {10: pytest.approx(0, abs=0.1), 80: pytest.approx(0, abs=0.3)}
    assert corrected.states[87] - drawer.states[87] == pytest.approx(0.008, abs=1e-3)
    assert corrected.states[:30] == pytest.approx(drawer.states[:30], abs=1e-6)


def test_what_does_not_fit_is_told(seen: Seen) -> None:
    late = marks_of([*MARKS[:3], Mark("drawer", "moves", "45:61")], seen.recording).parts[0]
    assert "lies outside the marked motions" in annotated(seen, late).notes[0]
    skew = solved(seen, Mark("drawer", "axis", "15: 200,180 320,175"))
    assert "off what the video shows" in skew.notes[0]


def test_closed_is_the_frame_that_is_said(seen: Seen, drawer: Annotated) -> None:
    told = solved(seen, Mark("drawer", "closed", "80"))
    assert told.states[80] == 0.0
    assert told.joint.axis == pytest.approx(-drawer.joint.axis, abs=1e-6)
    assert told.states[0] == pytest.approx(drawer.states[80], abs=1e-6)


def test_a_mark_that_is_missing_is_named(seen: Seen) -> None:
    (part,) = marks_of(MARKS[:1], seen.recording).parts
    with pytest.raises(InputError, match="no outline"):
        annotated(seen, part)
    (part,) = marks_of(MARKS[:2], seen.recording).parts
    with pytest.raises(InputError, match="no motion"):
        annotated(seen, part)
    wall = Mark("drawer", "outline", "15: 20,20 100,20 100,90 20,90")
    with pytest.raises(FuntwinError, match="drawer: "):
        annotated(seen, marks_of([MARKS[0], wall, MARKS[3]], seen.recording).parts[0])


def test_the_folder_is_a_truth_of_what_it_knows(
    seen: Seen, drawer: Annotated, true: Truth, tmp_path: Path
) -> None:
    folder = tmp_path / "truth"
    marks = Marks((), (drawer.marks,), only=True)
    write_truth(folder, seen, marks, [drawer])
    (folder / "mine.txt").write_text("stays")
    write_truth(folder, seen, marks, [drawer])
    assert (folder / "mine.txt").read_text() == "stays"
    told = load_truth(folder)
    assert told.knows("states", "world", "fronts", "labels", "all parts")
    assert not told.knows("cameras")
    assert told.cameras is not None
    assert told.parts[0].states == pytest.approx(drawer.states)
    assert told.parts[0].spans == pytest.approx(np.array(true.parts[0].spans), abs=1)
    overlap = [(told.labels[f] == 2, true.labels[f] == 2) for f in (5, 25, 40)]
    assert min((a & b).sum() / (a | b).sum() for a, b in overlap) > 0.8


def test_a_truth_needs_all_cameras_and_a_part(seen: Seen, drawer: Annotated, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing is annotated"):
        write_truth(tmp_path / "t", seen, Marks((), ()), [])
    c = seen.cameras
    lost = replace(seen, cameras=Trajectory(c.frames[2:], c.times[2:], c.T_world_cam[2:]))
    with pytest.raises(InputError, match="frames 0 to 1 are not known"):
        write_truth(tmp_path / "t", lost, Marks((), (drawer.marks,)), [drawer])
    assert not (tmp_path / "t").exists()

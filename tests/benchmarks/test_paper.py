"""The paper's tables: fits to exact poses are exact, scores know an exact answer, a run goes on."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.paper import __main__ as paper
from benchmarks.paper import rooms
from benchmarks.paper.chain import Answer
from benchmarks.paper.page import write_page
from benchmarks.paper.poses import by_bic, by_residual, by_screws, poses_of_tracks
from benchmarks.paper.scores import scored
from recon.evaluation.truth import Truth
from recon.interaction.joints.observations import Kind
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.moving_part import MovingPart
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Motion, Prismatic, Revolute

AXIS = geo.unit([0.2, -0.4, 0.9])
HINGE = Revolute(AXIS, 0.0, 1.2, pivot=np.array([0.5, 1.0, -0.3]))
SLIDE = Prismatic(AXIS, 0.0, 0.4)
POINT = np.array([0.9, 1.4, 0.2])


def _poses(joint: Joint) -> tuple[Array, Array]:
    state = np.linspace(joint.lower, joint.upper, 25)
    return joint.poses(state), state


@pytest.mark.parametrize("joint", [HINGE, SLIDE], ids=["hinge", "slide"])
def test_fits_to_exact_poses_are_exact(joint: Joint) -> None:
    poses, state = _poses(joint)
    for fit in (
        by_residual(poses, POINT),
        by_bic(poses, POINT),
        by_screws(poses, POINT, joint.kind),
    ):
        assert fit.joint.kind == joint.kind
        assert geo.line_angle(fit.joint.axis, joint.axis) < 1e-6
        assert np.allclose(fit.state, state, atol=1e-6)
        if isinstance(fit.joint, Revolute):
            assert geo.point_line_distance(fit.joint.pivot, HINGE.pivot, HINGE.axis) < 1e-6


@pytest.mark.parametrize("joint", [HINGE, SLIDE], ids=["hinge", "slide"])
def test_outliers_do_not_move_a_fit(joint: Joint) -> None:
    poses, _ = _poses(joint)
    poses[[3, 9, 15], :3, 3] += [0.3, -0.2, 0.4]
    for fit in (by_residual(poses, POINT), by_bic(poses, POINT)):
        assert geo.line_angle(fit.joint.axis, joint.axis) < 1e-6


def test_a_part_that_stands_still_is_rigid_by_bic() -> None:
    rng = np.random.default_rng(1)
    poses = geo.exp_se3(1e-4 * rng.standard_normal((20, 6)))
    assert np.ptp(by_bic(poses, POINT).state) == 0.0


def test_poses_of_rigid_tracks_are_their_motion() -> None:
    rng = np.random.default_rng(2)
    poses, _ = _poses(HINGE)
    rest = rng.uniform(-0.2, 0.2, (40, 3)) + POINT
    points = np.stack([geo.transform(T, rest) for T in poses])
    points[:, :6] += rng.uniform(0.1, 0.3, (25, 6, 3))  # tracks that are not of it
    visible = np.ones(points.shape[:2], dtype=bool)
    visible[4, 3:] = False  # a frame with too few
    every = np.ones(40, dtype=bool)
    frames, found, _ = poses_of_tracks(Movers(points, visible, every, every), every)
    assert 4 not in frames
    first = frames[int(np.argmin(np.abs(found - np.eye(4)).sum(axis=(1, 2))))]
    assert np.allclose(found, poses[frames] @ geo.invert_pose(poses[first]), atol=1e-9)


def _answer(truth: Truth, joint: Joint, state: Array) -> Answer:
    assert truth.cameras is not None
    frames, times = truth.cameras.frames, truth.cameras.times
    part = MovingPart(2, joint, Motion(frames, times, state, (), 0.0, 1.0))
    return Answer((part,), truth.labels, truth.cameras)


@pytest.fixture
def moving(truth: Truth) -> Truth:
    """The cabinet's truth of a part that opens."""
    part = truth.parts[0]
    assert truth.cameras is not None
    state = np.linspace(0.0, 0.3 if part.joint.kind == "prismatic" else 1.0, truth.frames)
    moved = replace(
        part,
        states=state,
        T_world_part=part.joint.poses(state),
        segments=((0, truth.frames - 1),),
    )
    return replace(truth, parts=(moved,))


def test_an_exact_answer_has_no_error_whatever_its_sign_and_zero(moving: Truth) -> None:
    part = moving.parts[0]
    other = replace(part.joint, axis=-part.joint.axis, lower=-9.0, upper=9.0)
    for joint, state in ((part.joint, part.states), (other, 0.7 - part.states)):
        row = scored(_answer(moving, joint, state), moving)
        assert row["found"]
        assert row["type"]
        assert max(row["axis"], row["pivot"] or 0.0, row["state"], row["ate"]) < 1e-4
        assert row["add"] == row["add_s"] == 1.0


def test_free_poses_that_are_exact_have_no_error_whatever_frame_comes_first(moving: Truth) -> None:
    opened = moving.parts[0]
    closing = replace(opened, states=opened.states[::-1], T_world_part=opened.T_world_part[::-1])
    own = geo.make_pose(geo.exp_so3(np.array([0.3, -0.8, 0.1])), [0.4, 0.1, -0.2])  # of the method's part
    for part in (opened, closing):
        truth = replace(moving, parts=(part,))
        answer = _answer(truth, part.joint, part.states)
        free = replace(answer, free=(np.arange(truth.frames), part.T_world_part @ own))
        assert scored(free, truth)["add"] == 1.0


def test_what_is_missed_or_of_the_wrong_type_is_charged(moving: Truth) -> None:
    part = moving.parts[0]
    assert moving.cameras is not None
    missed = scored(Answer((), None, moving.cameras), moving)
    assert not missed["found"]
    assert (missed["axis"], missed["add"], missed["miou"]) == (90.0, 0.0, None)
    wrong: Joint = (
        Revolute(part.joint.axis, 0.0, 1.0, pivot=np.zeros(3))
        if part.joint.kind == "prismatic"
        else Prismatic(part.joint.axis, 0.0, 1.0)
    )
    row = scored(_answer(moving, wrong, part.states), moving)
    assert (row["found"], row["type"], row["axis"]) == (True, False, 90.0)


def test_the_set_has_the_shape_of_the_papers() -> None:
    every = rooms.clips()
    assert len(every) == len(set(every)) == 127
    assert {c.room for c in rooms.subset()} == {c.room for c in every} == set(range(12))
    assert every[:12] == rooms.subset()
    assert {rooms.stratum(k).sensor for k in range(12)} == {"ideal", "time_of_flight"}


def test_a_stopped_run_goes_on_and_lines_hold_no_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[tuple[str, int]] = []

    def render(room: rooms.Room, number: int, folder: Path) -> Path:
        folder.mkdir(parents=True)
        return folder

    def measured(folder: Path, names: list[str]) -> dict[str, dict[str, Any]]:
        made.append((folder.name, len(names)))
        return {name: _row("prismatic", 1.0) for name in names}

    monkeypatch.setattr(rooms.Room, "render", render)
    monkeypatch.setattr(paper, "measured", measured)
    results, work = tmp_path / "results", tmp_path / "work"
    paper.run(rooms.subset()[:2], results, work)
    before = {p.name: p.read_bytes() for p in results.iterdir()}
    path = results / "room_01.jsonl"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-2]))
    paper.run(rooms.subset()[:2], results, work)
    every = len(paper.NAMES)
    assert made == [("00-00", every), ("01-00", every), ("01-00", 2)]
    assert {p.name: p.read_bytes() for p in results.iterdir()} == before
    assert not any(work.iterdir())


def _row(kind: Kind, axis: float, found: bool = True) -> dict[str, Any]:
    hinge = kind == "revolute"
    return {
        "kind": kind, "found": found, "type": found, "axis": axis if found else 90.0,
        "pivot": (4.0 if found else 1000.0) if hinge else None, "state": 2.0, "add": 0.5, "add_s": 1.0,
        "miou": 0.9, "extra": 0, "ate": 1.0, "rpe": 0.5, "rpe_deg": 0.1,
    }  # fmt: skip


def test_the_page_charges_failures_in_one_table_and_not_in_the_other(tmp_path: Path) -> None:
    rows = [_row("prismatic", 1.0), _row("prismatic", 2.0, False), _row("revolute", 3.0)]
    lines = [json.dumps({"clip": f"00-0{k}", "method": "ours"} | r) for k, r in enumerate(rows)]
    (tmp_path / "room_00.jsonl").write_text("\n".join(lines) + "\n")
    write_page(tmp_path, tmp_path / "paper.md")
    charged, found = (
        line for line in (tmp_path / "paper.md").read_text().splitlines() if line.startswith("| ours |")
    )
    assert "| 3 | 67 % | 67 % | 45.50 [1.00, 90.00] / 3.00 [3.00, 3.00] | 0.004 [0.004, 0.004] |" in charged
    assert "| 2 | 1.00 / 3.00 | 4.0 | 2.00 mm / 2.00° | 90.0 % |" in found

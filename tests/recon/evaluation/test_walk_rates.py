"""Rates over walks are those of their sums."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import binomtest

from benchmarks.walk_rates import lines, pooled
from benchmarks.walks import _failed, _told
from recon.cameras.places import Seen
from recon.evaluation.truth import Truth
from recon.evaluation.walk_cameras import loop_counts
from recon.evaluation.walk_scores import IntervalCounts
from recon.evaluation.walks import walk_scores
from tests.makers.recon.tiny import DRAWER
from tests.makers.recon.walked import FRAMES
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Twin


def test_rates_of_walks_are_those_of_their_sums(truth: Truth, exact: Twin) -> None:
    far = geo.make_pose(translation=[0.0, 0.0, 1.0])
    ghost = replace(exact.part("drawer"), id=9, name="ghost", mesh=DRAWER.transformed(far))
    bad = walk_scores(replace(exact, parts=(*(p for p in exact.parts if p.name != "drawer"), ghost)), truth)
    good = walk_scores(exact, truth)
    two = pooled([good, bad])
    assert (two.walks, two.parts, two.found, two.right, two.rooms_right) == (2, 6, 5, 5, 1)
    assert (two.trusted, two.trusted_right, two.invented_trusted, two.invented_untrusted) == (6, 5, 1, 0)
    assert two.intervals == IntervalCounts(10, 14, 14)
    assert two.intervals_matched == IntervalCounts(10, 10, 10)
    assert two.states.right == good.states.right + bad.states.right
    assert pooled([bad, good]) == two
    assert pooled([good, good]).local.quantile(0.9) == good.local.quantile(0.9)
    texts = dict(lines(two))
    low, high = binomtest(5, 6).proportion_ci(method="wilson")
    assert texts["parts found"] == f"5/6 = 83 % [{100 * low:.0f}-{100 * high:.0f}]"
    assert texts["rooms right"].startswith("1/2 = 50 %")
    assert texts["interaction F1, all"] == "0.714"
    nothing = dict(lines(pooled([])))
    assert {v for k, v in nothing.items() if "part" in k or "pose" in k or "local" in k} == {"-"}


def test_the_error_of_paths_is_over_all_their_frames(truth: Truth, exact: Twin) -> None:
    torn = walk_scores(exact, truth, [(0, 449), (450, FRAMES - 1)])
    pieces = (replace(torn.pieces[0], ate_mm=6.0), replace(torn.pieces[1], ate_mm=3.0))
    both = pooled([replace(torn, pieces=pieces)])
    assert (both.torn, both.ate_mm) == (1, pytest.approx(np.sqrt((36 + 2 * 9) / 3)))


def test_the_error_of_a_path_is_told_beside_its_way(truth: Truth, exact: Twin) -> None:
    assert truth.cameras is not None
    centres = truth.cameras.T_world_cam[:, :3, 3]
    way = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(centres))
    walk = walk_scores(exact, truth)
    assert [p.way_m for p in walk.pieces] == [pytest.approx(way)]
    off = [replace(walk, pieces=(replace(walk.pieces[0], ate_mm=mm),)) for mm in (5.0, 100.0 * way, 300.0)]
    middle = sorted([5.0, 100.0 * way, 300.0])[1]
    told = dict(lines(pooled(off)))["ATE and its share of the way, medians of walks"]
    assert told == f"{middle:.1f} mm, {middle / way / 10:.2f} %"


def test_a_walk_without_a_twin_is_charged_with_all_that_was_to_be_found(truth: Truth, exact: Twin) -> None:
    good = walk_scores(exact, truth)
    record = {"failed": False, "scores": good.nameless().as_dict(), "loops": {"accepted": 3, "false": 1}}
    rows = "\n".join(_told([record, _failed(3, 7, FRAMES)]))
    assert "| parts found | 3/6 = 50 %" in rows
    assert "| rooms right | 1/2 = 50 %" in rows
    assert "| interaction recall, all | 7/14 = 50 %" in rows
    assert f"| frames with neither | {FRAMES}/{2 * FRAMES} = 50.0 % |" in rows
    right, frames = good.states.right, good.states.frames + 3 * FRAMES
    assert f"| states right, missed parts charged | {right}/{frames} = {100 * right / frames:.1f} % |" in rows
    assert "| false loops | 1 of 3 |" in rows
    assert rows.endswith("| walks without a twin | 1 |")


def test_a_record_has_the_rates_of_its_walk_and_none_of_its_names(truth: Truth, exact: Twin) -> None:
    walk = walk_scores(exact, truth)
    assert lines(pooled([walk.nameless()])) == lines(pooled([walk]))
    told = json.dumps(walk.nameless().as_dict())
    assert not any(p.name in told for p in exact.parts)


def turned(deg: float) -> Array:
    c, s = np.cos(np.radians(deg)), np.sin(np.radians(deg))
    return geo.make_pose(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))


@pytest.mark.parametrize(
    ("off", "false"),
    [
        (geo.make_pose(translation=[0.049, 0.0, 0.0]), 0),
        (geo.make_pose(translation=[0.0, 0.051, 0.0]), 1),
        (turned(2.9), 0),
        (turned(3.1), 1),
    ],
)
def test_a_loop_is_false_from_5_cm_or_3_deg_on(off: Array, false: int, truth: Truth) -> None:
    assert truth.cameras is not None
    a, b = truth.cameras.pose(10), truth.cameras.pose(400)
    assert a is not None
    assert b is not None
    right = Seen(10, 400, geo.invert_pose(a) @ b, 50, 0.5)
    counts = loop_counts([right, replace(right, T_a_b=right.T_a_b @ off)], truth)
    assert (counts.accepted, counts.false) == (2, false)

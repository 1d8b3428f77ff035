"""Rates over walks are those of their sums."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

from benchmarks.walk_rates import lines, pooled
from recon.evaluation.truth import Truth
from recon.evaluation.walk_scores import IntervalCounts
from recon.evaluation.walks import walk_scores
from tests.makers.recon.tiny import DRAWER
from tests.makers.recon.walked import FRAMES
from twin import geometry as geo
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

"""Counters of a twin against its truth: all of an exact one, one less for each planted error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.unseen_counts import counts
from benchmarks.unseen_page import section
from recon.evaluation.truth import Truth
from tests.test_unseen import seen_twin, truth_of
from twin import geometry as geo
from twin.placed import placed
from twin.scene import HAND_LABEL, JointSigma, Part, Revolute, Twin
from twin.verdict import Verdict, of_twin
from twin.verdict.reasons import reason

SIGMA = JointSigma(np.radians(0.1), 0.001, 0.01)


@pytest.fixture(scope="module")
def exact() -> Twin:
    """Each joint with the same sigmas."""
    twin = seen_twin()
    parts = tuple(
        replace(p, joint=replace(p.joint, covariance=None, sigma=replace(SIGMA, pivot=SIGMA.pivot if isinstance(p.joint, Revolute) else None)))
        for p in twin.parts
    )  # fmt: skip
    return replace(twin, parts=parts)


@pytest.fixture(scope="module")
def truth(exact: Twin) -> Truth:
    return truth_of(exact)


def hinge(twin: Twin) -> Part:
    return next(p for p in twin.parts if isinstance(p.joint, Revolute))


def tilted(twin: Twin, deg: float) -> Twin:
    """A hinge's axis leans by so many degrees, about the part's own pivot."""
    part = hinge(twin)
    across = geo.orthogonal_basis(part.joint.axis)[:, 0]
    joint = replace(part.joint, axis=geo.exp_so3(np.radians(deg) * across) @ part.joint.axis)
    return replace(twin, parts=tuple(replace(part, joint=joint) if p is part else p for p in twin.parts))


def test_an_exact_twin_is_within_every_limit(exact: Twin, truth: Truth) -> None:
    found, parts = counts(exact, truth), len(exact.parts)
    hinges = sum(isinstance(p.joint, Revolute) for p in exact.parts)
    assert 0 < hinges < parts
    assert found["success"] == parts
    assert found["hinges"] == hinges
    for what, of in (("axis", parts), ("state", parts), ("pivot", hinges)):
        assert found[f"{what} fine"] == found[f"{what} good"] == of
    assert found["axis components"] == found["axis within 1 sigma"] == 2 * parts
    assert found["pivot components"] == found["pivot within 1 sigma"] == 2 * hinges
    assert found["states within 1 sigma, ppm"] == 1_000_000 * parts


def test_an_error_is_counted_where_it_lies(exact: Twin, truth: Truth) -> None:
    parts = len(exact.parts)
    for deg, fine, good, one, two in (
        (0.15, 0, 0, 1, 0),
        (0.25, 0, 0, 1, 1),
        (0.5, 1, 0, 1, 1),
        (0.9, 1, 1, 1, 1),
    ):
        found = counts(tilted(exact, deg), truth)
        assert parts - found["axis fine"] == fine
        assert parts - found["axis good"] == good
        assert 2 * parts - found["axis within 1 sigma"] == one
        assert 2 * parts - found["axis within 2 sigma"] == two


def test_a_missed_part_is_within_no_limit(exact: Twin, truth: Truth) -> None:
    fewer = replace(exact, parts=exact.parts[1:])
    found = counts(fewer, truth)
    assert found["axis good"] == found["state good"] == len(exact.parts) - 1
    assert found["cause missed"] == 1


def test_hands_are_counted_on_frames_without_one(exact: Twin, truth: Truth) -> None:
    labels = dict(exact.labels)
    first = min(labels)
    labels[first] = labels[first].copy()
    labels[first][:4, :5] = HAND_LABEL
    found = counts(replace(exact, labels=labels), truth)
    share = 20 / labels[first].size / len(labels)
    assert found["hand, ppm"] == round(1e6 * share)
    assert found["hand above 3 %"] == 0
    labels[first][:, :] = HAND_LABEL
    assert counts(replace(exact, labels=labels), truth)["hand above 3 %"] == 1


def test_contact_is_counted_of_right_parts_that_a_hand_held(exact: Twin, truth: Truth) -> None:
    """By how much farther from the grip than the true surface: 10, 50 and 70 mm, and none at all."""
    held = [p for p in exact.parts if p.contact is not None]
    assert held
    grips = {p.id: p.contact.point for p in held if p.contact is not None}
    known = replace(truth, parts=tuple(replace(p, grip=grips.get(p.id)) for p in truth.parts))
    assert counts(exact, truth)["contacts"] == 0, "nobody knows where the hand was"
    for off, fine, good in ((0.010, 1, 1), (0.050, 0, 1), (0.070, 0, 0), (None, 0, 0)):
        parts = []
        for p in exact.parts:
            contact = p.contact
            if contact is not None:
                out = geo.unit(contact.point - p.mesh.area_centroid)
                contact = None if off is None else replace(contact, point=contact.point + off * out)
            parts.append(replace(p, contact=contact))
        found = counts(replace(exact, parts=tuple(parts)), known)
        assert found["contacts"] == len(held)
        assert (found["contact fine"], found["contact good"]) == (fine * len(held), good * len(held))
    missed = counts(replace(exact, parts=exact.parts[1:]), known)
    assert missed["contacts"] == len(held) - (exact.parts[0] in held)


def test_a_wrong_up_is_told_apart_from_one_that_the_twin_doubts(exact: Twin, truth: Truth) -> None:
    assert exact.cameras is not None
    leaning = geo.make_pose(geo.exp_so3([np.radians(8.0), 0.0, 0.0]))
    turned = placed(exact, leaning)
    assert (counts(turned, truth)["up wrong"], counts(turned, truth)["up wrong, told"]) == (1, 0)
    doubt = reason("UpUnsure", "doubtful", 0.5, 0.9, "0,-1,0", "")
    told = replace(
        turned, verdict=of_twin({p.name: p.verdict or Verdict() for p in turned.parts}, {}, (doubt,))
    )
    assert counts(told, truth)["up wrong, told"] == 1


def test_the_page_tells_shares_and_coverage(exact: Twin, truth: Truth) -> None:
    found = counts(tilted(exact, 0.5), truth)
    told = {f"ordinary: {k}": v for k, v in found.items()} | {"ordinary: parts": len(exact.parts)}
    page = section("abc", None, 1, told)
    within = 100 * (len(exact.parts) - 1) / len(exact.parts)
    assert f"| ordinary | {within:.0f} % / 100 % |" in page
    assert "Hand on hand-free frames: mean 0.00 % of the picture over 1 clips, above 3 % in 0." in page

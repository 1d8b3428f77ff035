"""Samplers and tolerances that tests share."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Prismatic, Revolute

EXACT = 3e-6  # m or rad: what exact input may miss after an iterative fit (3 micrometres)
EXACT_DEG = float(np.degrees(EXACT))


def assert_for_all(law: Callable[..., None], cases: Iterable[Any]) -> None:
    """One law over many cases (a tuple of arguments, or the only one): the failure names each case that
    breaks it."""
    tried = [case if isinstance(case, tuple) else (case,) for case in cases]
    broken = []
    for arguments in tried:
        try:
            law(*arguments)
        except (Exception, pytest.fail.Exception) as e:
            names = ", ".join(getattr(a, "__name__", str(a)) for a in arguments)
            broken.append(f"{names}: {e or type(e).__name__}")
    assert tried, "no case was tried"
    assert not broken, "\n".join([f"{len(broken)} of {len(tried)} cases:", *broken])


def has_no_negative_zero(text: str) -> None:
    """No number that is rounded to zero keeps its sign."""
    assert re.search(r"-0(\.0*)?(?![\d.])", text) is None, text


def random_pose(rng: np.random.Generator, reach: float = 2.0) -> Array:
    """Any rotation, and a translation (m) of about `reach`."""
    return geo.make_pose(geo.exp_so3(rng.normal(0, 1.5, 3)), rng.uniform(-reach, reach, 3))


def random_joint(rng: np.random.Generator, kind: str, upper: float = 1.0) -> Prismatic | Revolute:
    """Joint of the kind with any axis through a point within 1 m."""
    axis = geo.unit(rng.normal(0, 1, 3))
    if kind == "prismatic":
        return Prismatic(axis=axis, upper=upper)
    return Revolute(axis=axis, upper=upper, pivot=rng.uniform(-1, 1, 3))


def part_points(rng: np.random.Generator, joint: Prismatic | Revolute, count: int) -> Array:
    """Points (count, 3) of a part at state 0, within 0.4 m of its pivot, or of the origin."""
    origin = joint.pivot if isinstance(joint, Revolute) else np.zeros(3)
    return np.asarray(origin + rng.uniform(-0.4, 0.4, (count, 3)))


def axis_error_deg(a: Prismatic | Revolute, b: Prismatic | Revolute) -> float:
    """Angle in degrees, 0..90, between two joint axes as lines."""
    return float(np.degrees(geo.line_angle(a.axis, b.axis)))


def pivot_error(found: Prismatic | Revolute, truth: Prismatic | Revolute) -> float:
    """Distance (m) of the found axis point from the true axis; both must be hinges."""
    assert isinstance(found, Revolute)
    assert isinstance(truth, Revolute)
    return geo.point_line_distance(found.pivot, truth.pivot, truth.axis)


def state_error(found: Array, truth: Array) -> float:
    """Mean absolute difference of states after taking the constant between them out."""
    difference = np.asarray(found) - np.asarray(truth)
    return float(np.abs(difference - np.median(difference)).mean())

"""Numbers as a `repr` tells them: what is rounded to zero has no sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from tests.laws import assert_for_all, has_no_negative_zero
from twin import geometry as geo
from twin.scene import Box, Joint, Prismatic, Revolute

LITTLE = np.array([-1e-6, 1.0, -1e-6])  # what is left of a zero that was computed


@pytest.mark.parametrize(
    "joint",
    [Revolute(LITTLE, -1e-6, 1.4, pivot=-1e-6 * np.ones(3)), Prismatic(LITTLE, -1e-6, 0.3)],
    ids=["revolute", "prismatic"],
)
def test_a_number_that_is_rounded_to_zero_has_no_sign(joint: Joint) -> None:
    part = replace(cabinet_twin().parts[0], joint=joint)
    assert part.contact is not None
    contact = replace(part.contact, point=-1e-6 * np.ones(3))
    motion = replace(part.motion, state=-0.0 * part.motion.state)
    box = Box(geo.make_pose(translation=-1e-6 * np.ones(3)), np.ones(3))
    told = [repr(value) for value in (joint, part, contact, motion, box)]
    assert_for_all(has_no_negative_zero, [*told, part._repr_html_()])

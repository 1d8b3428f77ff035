"""Flat faces of closed-form bodies."""

from __future__ import annotations

import numpy as np
import pytest

from recon.contact.faces import faces_before, outer_faces, sample
from tests.makers.recon.tiny import box
from twin import geometry as geo

MIDDLE = (0.2, -0.1, 1.0)
TURN = geo.make_pose(geo.exp_so3(np.array([0.3, -0.2, 0.9])), np.array([0.4, 0.1, -0.3]))


@pytest.mark.parametrize("T", [np.eye(4), TURN], ids=["level", "aslant"])
def test_a_box_has_six_faces_and_a_panel_two(T: np.ndarray) -> None:
    """The edges of an 18 mm panel, of 2 and 3 % of its surface, are no faces."""
    size = np.array([0.5, 0.3, 0.7])
    for faces, thickness in ((6, 0.3), (2, 0.018)):
        size[1] = thickness
        found = outer_faces(sample(box(MIDDLE, tuple(size)).transformed(T)))
        assert len(found) == faces
        for face in found:
            normal = geo.rotate(geo.invert_pose(T), face.normal)
            k = int(np.argmax(np.abs(normal)))
            assert abs(normal[k]) > 0.9999
            centre = geo.transform(T, np.array([MIDDLE]))[0]
            assert face.offset - centre @ face.normal == pytest.approx(size[k] / 2, abs=1e-3)
            assert len(face.points) > 0
        assert [len(f.points) for f in found] == sorted((len(f.points) for f in found), reverse=True)


def test_the_face_before_a_hand_is_the_one_that_it_is_in_front_of() -> None:
    surface = sample(box(MIDDLE, (0.5, 0.3, 0.7)))
    for direction in (*np.eye(3), *-np.eye(3)):
        reach = np.abs(direction) @ [0.25, 0.15, 0.35]
        (face,) = faces_before(surface, MIDDLE + (reach + 0.05) * direction)
        assert face.normal @ direction > 0.9999
    assert faces_before(surface, np.array([*MIDDLE]) + [0.5, 0.5, 0.0]) == [], "the hand is beside every face"

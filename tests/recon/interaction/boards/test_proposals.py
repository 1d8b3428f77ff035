"""Joints that a board's shape and the room suggest."""

from __future__ import annotations

import numpy as np
import pytest

from recon.interaction.boards.proposals import Proposed, along_room, proposed_joints
from twin import geometry as geo
from twin.scene import Prismatic, Revolute


def test_a_rectangle_proposes_its_edges_and_its_normal() -> None:
    u, v = np.meshgrid(np.linspace(-0.3, 0.3, 40), np.linspace(-0.2, 0.2, 30))
    flat = np.stack([u.ravel(), v.ravel(), np.zeros(u.size)], axis=1)
    T = geo.make_pose(geo.exp_so3(np.array([0.5, 0.2, -0.4])), [1.0, 2.0, 3.0])
    noise = np.random.default_rng(0).normal(0, 0.002, flat.shape)
    proposed = proposed_joints(geo.transform(T, flat + noise))
    slides = [p for p in proposed if p.kind == "prismatic"]
    hinges = [p for p in proposed if p.kind == "revolute"]
    assert min(geo.line_angle(p.axis, T[:3, 2]) for p in slides) < 0.02
    for k, half in ((0, 0.2), (1, 0.3)):  # hinges along x lie at the ends of y, and the other way round
        for sign in (-1.0, 1.0):
            edge = geo.transform(T, np.eye(3)[1 - k][None] * sign * half)[0]
            off = [geo.point_line_distance(edge, p.pivot, p.axis) for p in hinges]
            nearest = hinges[int(np.argmin(off))]
            assert min(off) < 0.02
            assert geo.line_angle(nearest.axis, T[:3, k]) < 0.03


@pytest.mark.parametrize("strip", [0.03, 0.06, 0.11])
def test_a_hinge_is_proposed_where_the_strip_beside_it_was_not_seen_to_leave(strip: float) -> None:
    u, v = np.meshgrid(np.linspace(-0.3 + strip, 0.3, 40), np.linspace(-0.2, 0.2, 30))
    flat = np.stack([u.ravel(), v.ravel(), np.zeros(u.size)], axis=1)
    hinge, up = np.array([-0.3, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    near = [p for p in proposed_joints(flat) if geo.line_angle(p.axis, up) < 0.03]
    assert min(geo.point_line_distance(hinge, p.pivot, p.axis) for p in near) < 0.03


def test_poses_of_a_proposed_joint_are_those_of_a_twins() -> None:
    axis, pivot, states = (
        geo.unit(np.array([1.0, 2.0, 0.5])),
        np.array([0.3, -0.2, 1.0]),
        np.linspace(-1, 2, 7),
    )
    hinge, slide = Proposed("revolute", axis, pivot), Proposed("prismatic", axis, pivot)
    np.testing.assert_allclose(hinge.poses(states), Revolute(axis, pivot=pivot).poses(states), atol=1e-12)
    np.testing.assert_allclose(slide.poses(states), Prismatic(axis).poses(states), atol=1e-12)


def test_an_axis_near_a_direction_of_the_room_is_also_proposed_along_it() -> None:
    room = geo.exp_so3(np.array([0.2, -0.1, 0.4]))[:, :2]
    near = Proposed("revolute", geo.exp_so3(0.1 * room[:, 1]) @ room[:, 0], np.ones(3))
    far = Proposed("prismatic", geo.unit(room[:, 0] + room[:, 1]), np.zeros(3))
    (told,) = along_room([near, far], room)
    np.testing.assert_allclose(told.axis, room[:, 0], atol=1e-12)
    assert told.kind == near.kind
    assert told.pivot is near.pivot
    assert along_room([near], np.zeros((3, 0))) == []

"""What a part's motion carries along itself is seen where the part was, and tells nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.dense.noise import GOOD_SENSOR
from recon.interaction.labels.first_scores import first_scores, slides_in_itself
from recon.interaction.labels.reference_frames import View, as_references, normals_of
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Motion, Prismatic, Revolute, Trajectory

CAMERA = Intrinsics(80, 60, 70.0, 70.0, 39.5, 29.5)
MOTION = Motion(np.arange(3), np.arange(3) / 15.0, np.array([0.0, 0.1, 0.2]))


def plane(normal: Array, distance: float = 1.5) -> View:
    """A view of the plane {p: normal . p = -distance}, in the camera's axes."""
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    rays = CAMERA.backproject(np.stack([u, v], axis=-1).astype(float), np.ones(u.shape))
    depth = -distance / (rays @ normal)
    return View(0, np.where(depth > 0, depth, 0.0).astype(np.float32), np.zeros((*u.shape, 3), np.float32))


def share(view: View, joint: Joint, pose: Array) -> float:
    """Of the pixels whose normal is known."""
    known = np.any(normals_of(view, CAMERA) != 0, axis=-1)
    assert known.mean() > 0.3
    return float(slides_in_itself(view, MovingPart(2, joint, MOTION), pose, CAMERA)[known].mean())


WORLD = geo.make_pose(geo.exp_so3(np.array([0.3, -0.8, 0.4])), [1.0, 2.0, 0.5])


@pytest.mark.parametrize("pose", [np.eye(4), WORLD])
def test_a_wall_beside_a_drawer_does_and_its_front_does_not(pose: Array) -> None:
    normal = geo.unit(np.array([0.3, 0.2, -1.0]))  # of the surface, in the camera
    along = geo.unit(np.cross(normal, [0.0, 1.0, 0.0]))
    beside = Prismatic(axis=pose[:3, :3] @ along, lower=0.0, upper=0.2)
    ahead = Prismatic(axis=pose[:3, :3] @ normal, lower=0.0, upper=0.2)
    assert share(plane(normal), beside, pose) == 1.0
    assert share(plane(normal), ahead, pose) == 0.0


@pytest.mark.parametrize("pose", [np.eye(4), WORLD])
def test_a_floor_below_a_door_does_and_the_door_does_not(pose: Array) -> None:
    floor = geo.unit(np.array([0.1, -0.9, -0.5]))
    up, pivot = pose[:3, :3] @ floor, geo.transform(pose, np.array([[-0.6, 0.2, 1.6]]))[0]
    hinge = Revolute(axis=up, pivot=pivot, lower=0.0, upper=1.5)
    leaf = geo.unit(np.cross(floor, [1.0, 0.0, 0.2]))  # stands upright, before the hinge
    leaf = leaf if leaf[2] < 0 else -leaf
    at_hinge = -float(leaf @ [-0.6, 0.2, 1.6])
    assert share(plane(floor), hinge, pose) == 1.0
    assert share(plane(leaf, at_hinge), hinge, pose) < 0.02  # but beside the hinge itself


def test_a_wall_that_nobody_saw_before_is_not_taken_for_what_slides_along_it() -> None:
    """The camera went aside by .9 m while a drawer went .3 m along the wall: in a strip the wall was seen
    where the drawer's motion takes it back to, and never where it is."""
    normal, aside = np.array([0.0, 0.0, -1.0]), geo.make_pose(np.eye(3), [0.9, 0.0, 0.0])
    frames = np.arange(2)
    cameras = Trajectory(frames, frames / 15.0, np.stack([np.eye(4), aside]))
    motion = Motion(frames, frames / 15.0, np.array([0.0, 0.3]))
    before, now = plane(normal), replace(plane(normal), frame=1)
    refs = as_references([before, replace(before)], np.ones(2, bool), 3.0)
    scores = {}
    for name, axis in (("along", [1.0, 0.0, 0.0]), ("aslant", [0.8, 0.0, 0.6])):
        part = MovingPart(2, Prismatic(axis=np.array(axis), lower=0.0, upper=0.3), motion)
        scores[name], _ = first_scores(now, refs, cameras, [part], [None], CAMERA, 0.003, GOOD_SENSOR)
    static, moved = scores["along"][0], scores["along"][1]
    x = 1.5 / 70.0 * (np.arange(80) - 39.5) + 0.9  # m, of the columns on the wall
    strip = (x > 0.9) & (x < 1.1)  # the first picture ends at x = .85
    assert np.all(static[5:-5, strip] == 0.0)
    assert np.all(moved[5:-5, strip] <= 0.0)
    seen = (x > 0.3) & (x < 0.5)  # where both are known, both are supported
    assert np.all(static[5:-5, seen] > 0.5)
    assert np.all(moved[5:-5, seen] > 0.5)


def test_a_wall_slides_in_itself_up_to_the_picture_s_border() -> None:
    """What comes into view lies there, where normals are unknown."""
    normal = geo.unit(np.array([0.3, 0.2, -1.0]))
    along = geo.unit(np.cross(normal, [0.0, 1.0, 0.0]))
    beside = MovingPart(2, Prismatic(axis=along, lower=0.0, upper=0.2), MOTION)
    assert slides_in_itself(plane(normal), beside, np.eye(4), CAMERA).all()

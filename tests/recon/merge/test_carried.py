"""A basket in a drawer: a part on a part, which goes along with it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from recon.interaction.interaction import Interaction
from recon.interaction.motion.movers import Movers
from recon.interaction.parts.found import FoundParts, PartTracks
from recon.interaction.parts.moving_part import MovingPart
from recon.merge.merge import Merged, merge
from recon.merge.recall import recall
from recon.merge.relabel import all_labels
from recon.recording import Recording
from recon.windows.windows import Window
from tests.makers.recon.cabinets import CAMERA, cast, furniture
from tests.makers.recon.tiny import box
from tests.makers.recon.visits import COVARIANCE
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import STATIC_LABEL, Mesh, Motion, Prismatic, Trajectory

DRAWER, BASKET = 2, 3
# A basket left in the drawer, 12 cm high, that slides to the right.
BASKET_MESH = box((-0.15, 0.15, 1.39), (0.2, 0.25, 0.12))
SLIDE = Prismatic(np.array([1.0, 0.0, 0.0]), -1.0, 1.0, covariance=COVARIANCE[:2, :2])
PULL = Prismatic(np.array([0.0, -1.0, 0.0]), -1.0, 1.0, covariance=COVARIANCE[:2, :2])
OPEN, ASIDE = 0.24, 0.22
# Frames of an interaction, and of all.
N, ALL = 18, 54


@dataclass(frozen=True, eq=False)
class Visits:
    """Three interactions: the drawer is opened, its basket moved, the drawer closed."""

    recording: Recording
    cameras: Trajectory
    found: tuple[Interaction, ...]
    pulled: Array
    slid: Array

    def merged(self) -> Merged:
        return merge(self.recording, self.cameras, self.found)


def _part(number: int, joint: Prismatic, state: Array) -> MovingPart:
    n = len(state)
    moving = np.flatnonzero(np.abs(np.diff(state)) > 0)
    spans = ((int(moving[0]), int(moving[-1] + 1)),)
    return MovingPart(number, joint, Motion(np.arange(n), np.arange(n) / 5, state - state[0], spans))


@cache
def visits(basket_stays: bool = False) -> Visits:
    """basket_stays: it hangs in the cabinet, and the drawer is pulled out under it."""
    _, drawer, static, _, _ = furniture("drawer", "bar")
    ramp, rest = np.repeat([0.0, *np.linspace(0.0, 1.0, 8), 1.0], [5, *[1] * 8, 5]), np.zeros(N)
    pulled = OPEN * np.concatenate([ramp, rest + 1, ramp[::-1]])
    slid = ASIDE * np.concatenate([rest, ramp, rest + 1])
    T_world_cam = geo.make_pose(geo.exp_so3([-2.3, 0, 0]), [0.0, -0.75, 2.0])
    depth, images = [], []
    for k in range(ALL):
        T = PULL.pose(0.0 if basket_stays else pulled[k]) @ SLIDE.pose(slid[k])
        bodies: list[tuple[int, Mesh]] = [
            (STATIC_LABEL, static),
            (DRAWER, drawer.transformed(PULL.pose(pulled[k]))),
            (BASKET, BASKET_MESH.transformed(T)),
        ]
        seen, label = cast(bodies, T_world_cam)
        depth.append(seen)
        images.append(label)
    recording = Recording.from_arrays(
        np.zeros((ALL, CAMERA.height, CAMERA.width, 3), np.uint8), np.stack(depth), CAMERA, fps=5
    )
    cameras = Trajectory(np.arange(ALL), recording.times, np.tile(T_world_cam, (ALL, 1, 1)))
    still = STATIC_LABEL if basket_stays else DRAWER
    found = []
    for k, (joint, state, names) in enumerate(
        [
            (PULL, pulled, {DRAWER: DRAWER, BASKET: still}),
            (SLIDE, slid, {DRAWER: STATIC_LABEL, BASKET: 2}),
            (PULL, pulled, {DRAWER: DRAWER, BASKET: still}),
        ]
    ):
        part, frames = _part(2, joint, state[N * k : N * k + N]), range(N * k, N * k + N)
        table = np.arange(256, dtype=np.uint8)
        for number, name in names.items():
            table[number] = name
        none = Movers(np.zeros((N, 0, 3)), np.zeros((N, 0), bool), np.zeros(0, bool), np.zeros(0, bool))
        tracks = FoundParts(none, (PartTracks(part, np.zeros(0, bool), "motion"),))
        labels = {f - N * k: table[images[f]] for f in frames}
        found.append(Interaction(Window(frames[0], frames[-1]), tracks, (part,), labels))
    return Visits(recording, cameras, tuple(found), pulled, slid)


def test_a_basket_in_a_drawer_is_mounted_on_it() -> None:
    drawer, basket = visits().merged().parts
    assert drawer.carrier is None
    assert basket.carrier is not None
    assert basket.carrier.id == drawer.id


def test_a_basket_under_which_the_drawer_is_pulled_out_is_not() -> None:
    assert all(p.carrier is None for p in visits(basket_stays=True).merged().parts)


def test_a_basket_is_not_recalled_where_its_drawer_takes_it_along() -> None:
    told = visits()
    opened, aside, shut = told.found
    assert recall(told.recording, told.cameras, told.found).again == ()
    missed = replace(shut, parts=(), found=replace(shut.found, parts=()), labels={})
    (again,) = recall(told.recording, told.cameras, (opened, aside, missed)).again
    (part,) = again.parts
    assert again.interaction == 2
    axis = geo.rotate(told.cameras.T_world_cam[0], part.joint.axis)
    assert geo.line_angle(axis, PULL.axis) < 0.01


def test_what_is_carried_is_everywhere_where_its_carrier_takes_it() -> None:
    told = visits()
    _, basket = told.merged().parts
    # Its state 0 and its carrier's are those of the first frame.
    point = BASKET_MESH.vertices[:1]
    for frame in range(ALL):
        T, true = basket.pose(frame), PULL.pose(told.pulled[frame]) @ SLIDE.pose(told.slid[frame])
        assert T is not None
        np.testing.assert_allclose(geo.transform(T, point), geo.transform(true, point), atol=1e-6)


def test_in_the_frames_in_which_the_drawer_moves_its_basket_is_no_drawer() -> None:
    told = visits()
    merged = told.merged()
    labels = all_labels(told.recording, told.cameras, told.found, merged)
    drawer, basket = merged.parts
    for frame in (9, 45):
        points = told.recording.intrinsics.backproject(
            np.argwhere(labels[frame] == basket.id)[:, ::-1].astype(float),
            told.recording.depth(frame)[labels[frame] == basket.id].astype(float),
        )
        T = PULL.pose(told.pulled[frame]) @ SLIDE.pose(told.slid[frame])
        cam = told.cameras.pose(frame)
        assert cam is not None
        local = geo.transform(geo.invert_pose(T) @ cam, points)
        low, high = BASKET_MESH.vertices.min(axis=0) - 0.03, BASKET_MESH.vertices.max(axis=0) + 0.03
        assert len(points) > 200
        assert np.mean(((local > low) & (local < high)).all(axis=1)) > 0.9
        assert (labels[frame] == drawer.id).sum() > 500


@pytest.mark.parametrize("frame", [0, 27, 53])
def test_a_carried_part_stands_where_its_carrier_stands(frame: int) -> None:
    _, basket = visits().merged().parts
    stands = basket.standing(frame)
    T, own = basket.pose(frame), stands.pose(frame)
    assert stands.carrier is None
    assert T is not None
    assert own is not None
    np.testing.assert_allclose(own @ basket.carrier.pose(frame), T, atol=1e-9)  # type: ignore[union-attr]


def test_a_drawer_that_was_solved_wrong_the_second_time_is_not_mounted_on_itself() -> None:
    """It is shut, but that interaction was taken for a slide to the side, with the drawer's own surface."""
    told = visits()
    opened, _, shut = told.found
    wrong = Prismatic(np.array([1.0, 0.0, 0.0]), -1.0, 1.0, covariance=COVARIANCE[:2, :2])
    part = _part(2, wrong, told.pulled[shut.window.first : shut.window.last + 1])
    part = replace(part, motion=replace(part.motion, intervals=((2, 12),)))  # begun before the drawer moves
    left = np.arange(CAMERA.width) < CAMERA.width // 2  # it got half of the drawer's labels, at rest
    junk = replace(
        shut,
        parts=(part,),
        found=replace(shut.found, parts=(PartTracks(part, np.zeros(0, bool), "motion"),)),
        labels={f: np.where(left, shut.labels[f], STATIC_LABEL).astype(np.uint8) for f in range(5)},
    )
    parts = merge(told.recording, told.cameras, (opened, junk)).parts
    assert [p.carrier for p in parts] == [None, None]

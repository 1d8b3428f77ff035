"""A part ends at an edge of the picture: labels that end in the middle of an even face are no outline to fit
a joint to."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Intrinsics, Recording
from recon.verdict.bare_borders import bare_border
from recon.verdict.posed import PosedTwin
from twin.geometry import Array
from twin.scene import HAND_LABEL, STATIC_LABEL, Mesh, Motion, Prismatic, Trajectory

PART = 2
EMPTY = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
WIDTH, HEIGHT, FRAMES = 320, 240, 12
CAMERA = Intrinsics(WIDTH, HEIGHT, 300.0, 300.0, 159.5, 119.5)
BOX = (slice(80, 170), slice(100, 220))  # rows and columns of the part
INSIDE = np.zeros((HEIGHT, WIDTH), bool)
INSIDE[BOX] = True
WHOLE = np.where(INSIDE, PART, STATIC_LABEL).astype(np.uint8)


def plane(tilt: float) -> Array:
    """Depth (H, W) m of a wall 1.2 m ahead, turned about the picture's upward axis by `tilt` rad."""
    x = (np.arange(WIDTH) - CAMERA.cx) / CAMERA.fx
    return np.broadcast_to(1.2 / (1.0 - np.tan(tilt) * x), (HEIGHT, WIDTH)).copy()


def grey(level: float = 120.0) -> Array:
    """A plain picture (H, W) of a sensor with noise."""
    return level + np.random.default_rng(0).normal(0.0, 1.0, (HEIGHT, WIDTH))


def told(
    picture: Array, depth: Array, labels: NDArray[np.uint8] | None = None, moving: int = 6
) -> float | None:
    """The share of the part's border that is no edge, where all frames look like this and the part moves in
    two of them."""
    return of_frames([picture] * FRAMES, depth, labels, moving)


def of_frames(
    pictures: list[Array],
    depth: Array,
    labels: NDArray[np.uint8] | dict[int, NDArray[np.uint8]] | None = None,
    moving: int = 6,
) -> float | None:
    """The same of pictures, and label images, that differ."""
    colors = [np.repeat(np.clip(p, 0, 255).astype(np.uint8)[..., None], 3, axis=-1) for p in pictures]
    recording = Recording.from_arrays(colors, [depth.astype(np.float32)] * FRAMES, CAMERA, fps=10)
    frames = np.arange(FRAMES)
    motion = Motion(frames, frames / 10.0, np.zeros(FRAMES), ((moving, moving + 1),), 0.0, 1.0)
    part = MovingPart(PART, Prismatic(np.array([0.0, 0.0, 1.0]), 0.0, 1.0), motion)
    cameras = Trajectory(frames, frames / 10.0, np.tile(np.eye(4), (FRAMES, 1, 1)))
    image = WHOLE if labels is None else labels
    twin = PosedTwin(recording, cameras, EMPTY, ())
    images = image if isinstance(image, dict) else dict.fromkeys(range(0, FRAMES, 3), image)
    found = bare_border(twin, part, images)
    return None if found is None else found[1]


@pytest.mark.parametrize("tilt", [0.0, 0.9])
def test_a_border_in_the_middle_of_an_even_face_is_no_edge(tilt: float) -> None:
    assert told(grey(), plane(tilt)) == 1.0


def gap() -> Array:
    """A dark line around the part, off by two pixels from its labels."""
    picture = grey()
    picture[78:172, 98:222] = np.where(
        np.isin(np.arange(94), (0, 93))[:, None], 90.0, picture[78:172, 98:222]
    )
    picture[78:172, [98, 221]] = 90.0
    return picture


def stepping(by: float) -> Array:
    return plane(0.3) - by * INSIDE


def creased() -> Array:
    """The wall goes back by 45 degrees and more beyond the part."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    beyond = np.maximum(np.maximum(100 - x, x - 219), np.maximum(80 - y, y - 169)).clip(0)
    return plane(0.0) + 2.0 * beyond * 1.2 / CAMERA.fx


EDGES = {
    "gap": (gap(), plane(0.3)),
    "color": (grey() + 15.0 * INSIDE, plane(0.3)),
    "step": (grey(), stepping(0.05)),
    "crease": (grey(), creased()),
}


@pytest.mark.parametrize("name", EDGES)
def test_each_kind_of_edge_is_one(name: str) -> None:
    assert told(*EDGES[name]) == pytest.approx(0.0, abs=0.02)


def test_half_of_the_outline_may_be_lost() -> None:
    """The labels end halfway up a face that is another colour than the wall; the edge above is not theirs."""
    whole = np.zeros_like(INSIDE)
    whole[40:170, 100:220] = True
    share = told(grey() + 15.0 * whole, plane(0.3))
    assert share == pytest.approx(120 / 420, abs=0.05)


def test_a_face_with_a_pattern_asks_for_more_of_an_edge() -> None:
    """Up to a pattern so strong that there are edges anywhere."""
    pattern = np.random.default_rng(1).normal(size=(HEIGHT, WIDTH))
    assert (told(grey() + 5.0 * pattern, plane(0.3)) or 0.0) > 0.5
    assert told(grey() + 100.0 * pattern, plane(0.3)) == pytest.approx(0.0, abs=0.05)


def test_what_has_no_depth_is_not_called_even() -> None:
    depth = np.where(INSIDE, plane(0.3), 0.0)
    assert told(grey(), depth) == 0.0


def test_a_hand_a_small_part_and_one_that_never_rests_say_nothing() -> None:
    hand = np.where(INSIDE, PART, HAND_LABEL).astype(np.uint8)
    assert told(grey(), plane(0.3), hand) is None
    behind = np.where(cv2.dilate(INSIDE.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0, STATIC_LABEL, hand)
    assert told(grey(), plane(0.3), np.where(INSIDE, PART, behind).astype(np.uint8)) is None
    small = np.where(INSIDE & (np.add.outer(np.arange(HEIGHT), np.arange(WIDTH)) < 188), PART, STATIC_LABEL)
    assert told(grey(), plane(0.3), small.astype(np.uint8)) is None
    assert told(grey(), plane(0.3), moving=0) == 1.0


def test_the_rest_that_shows_more_edges_counts() -> None:
    """Even before the motion, as a front that closes flush, cut off by half of its outline or all of it after
    it."""
    half = np.zeros_like(INSIDE)
    half[40:170, 100:220] = True
    for edge, share in ((INSIDE, 0.0), (half, 120 / 420)):
        shown = [grey()] * 6 + [grey() + 15.0 * edge] * 6
        for order in (shown, shown[::-1]):
            assert of_frames(order, plane(0.3)) == pytest.approx(share, abs=0.05)


def test_a_frame_that_the_part_has_left_is_not_looked_at() -> None:
    """The person has turned away: a rest of the part's pixels stands on an even face."""
    left = np.full_like(WHOLE, STATIC_LABEL)
    left[80:130, 100:130] = PART
    images = dict.fromkeys(range(0, FRAMES, 3), WHOLE)
    pictures = [grey()] * 8 + [gap()] * (FRAMES - 8)
    assert of_frames(pictures, plane(0.0), images | {9: left}) == 1.0
    assert of_frames(pictures, plane(0.0), images) == 0.0

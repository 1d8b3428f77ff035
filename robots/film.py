"""Puts the person and the robot into one picture, side by side, with a line under each that says the part's state."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from robots.demonstration import Demonstration, Image, matching_samples
from robots.trajectory import RobotTrajectory
from twin.geometry import Array
from twin.scene import Part

_LINE = 0.05  # height of a caption by the picture's
_WIDEST = 2.0  # the recording's panel by its height; wider images get bands above and below
_INK, _PAPER = (235, 235, 235), (28, 30, 33)


def side_by_side(
    images: Sequence[Image],
    states: Array,
    trajectory: RobotTrajectory,
    part: Part,
    demonstration: Demonstration,
) -> list[Image]:
    """The robot's `images` (f of (H, W, 3)), each to the right of the frame in which the person had the part at its state.

    Args:
        states: (f,) the part's states in the images, m or rad.

    Raises:
        InputError: the recording doesn't fit the part's motion.
    """
    height = images[0].shape[0]
    samples = matching_samples(part.motion, trajectory.start, trajectory.goal, states)
    panels = {
        k: captioned(
            fitted(demonstration.picture(int(part.motion.frames[k])), height),
            f"{demonstration.name}  {state_text(part, part.motion.state[k])}",
        )
        for k in np.unique(samples).tolist()
    }
    return [
        np.hstack([panels[k], captioned(image, f"{trajectory.robot}  {state_text(part, state)}")])
        for k, image, state in zip(samples.tolist(), images, states.tolist(), strict=True)
    ]


def state_text(part: Part, state: float) -> str:
    """A state as people read it: whole degrees or millimetres."""
    value, unit = (np.rad2deg(state), "°") if part.joint.kind == "revolute" else (1000 * state, " mm")
    return f"{round(float(value))}{unit}"


def fitted(image: Image, height: int) -> Image:
    """The image at this height and an even width, its proportions kept; bands fill up what is very wide."""
    h, w = image.shape[:2]
    widest = int(_WIDEST * height)
    scale = min(height / h, widest / w)
    size = max(2 * round(scale * w / 2), 2), max(min(round(scale * h), height), 1)
    smaller = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    above = (height - size[1]) // 2
    return np.pad(smaller, ((above, height - size[1] - above), (0, 0), (0, 0)))


def captioned(image: Image, text: str) -> Image:
    """The image with a line of text below it; the line's height is even."""
    height, width = image.shape[:2]
    tall = max(2 * round(_LINE * height / 2), 12)
    line = np.full((tall, width, 3), _PAPER, dtype=np.uint8)
    scale = tall / 40
    cv2.putText(
        line,
        text,
        (tall // 3, round(0.72 * tall)),
        cv2.FONT_HERSHEY_SIMPLEX,
        scale,
        _INK,
        1,
        cv2.LINE_AA,
    )
    return np.vstack([image, line])

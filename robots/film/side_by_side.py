"""The lines under a film's pictures: the part's state, how fast time passes and what the robot stands on if
nobody saw it; and person and robot side by side."""

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
_REAL = 0.05  # of the pace; less can't be seen
_INK, _PAPER = (235, 235, 235), (28, 30, 33)


def pace_text(seconds: float, frames: int, rate: float) -> str:
    """How fast a film's frames at `rate` a second show `seconds` of simulation, such as "1.6 x real time"."""
    pace = seconds * rate / frames
    return "real time" if abs(pace - 1.0) < _REAL else f"{pace:.2g} x real time"


def alone(
    images: Sequence[Image], states: Array, trajectory: RobotTrajectory, part: Part, pace: str
) -> list[Image]:
    """The robot's `images` (f of (H, W, 3)), under each the part's state out of `states` (f,), the pace, and
    an assumed floor."""
    floor = trajectory.floor
    told = f"floor {floor.text}, " if floor is not None and floor.source == "assumed" else ""
    return [
        captioned(image, f"{trajectory.robot}  {state_text(part, state)}", f"{told}{pace}")
        for image, state in zip(images, states.tolist(), strict=True)
    ]


def side_by_side(
    images: Sequence[Image],
    states: Array,
    trajectory: RobotTrajectory,
    part: Part,
    demonstration: Demonstration,
    pace: str,
) -> list[Image]:
    """The robot's `images` (f of (H, W, 3)), each beside the frame in which the person had the part there.

    Args:
        states: (f,) the part's states in the images, m or rad.
        pace: see `pace_text`.

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
    robot = alone(images, states, trajectory, part, pace)
    return [np.hstack([panels[k], image]) for k, image in zip(samples.tolist(), robot, strict=True)]


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


def captioned(image: Image, text: str, right: str = "") -> Image:
    """The image with a line of text below, of even height, and one at the right; smaller if they meet."""
    height, width = image.shape[:2]
    tall = max(2 * round(_LINE * height / 2), 12)
    line = np.full((tall, width, 3), _PAPER, dtype=np.uint8)
    font, scale, margin = cv2.FONT_HERSHEY_SIMPLEX, tall / 40, tall // 3

    def wide(words: str) -> int:
        return int(cv2.getTextSize(words, font, scale, 1)[0][0])

    scale *= min(1.0, max(width - 3 * margin, 1) / max(wide(text) + wide(right), 1))
    for words, left in ((text, margin), (right, width - margin - wide(right))):
        cv2.putText(line, words, (left, round(0.72 * tall)), font, scale, _INK, 1, cv2.LINE_AA)
    return np.vstack([image, line])

"""Hand keypoints by mediapipe (optional extra `hands`), lifted to 3D by depth.

The detector looks at the whole picture first and then, where hand labels exist, at a magnified cut-out around
them: a sleeved hand seen from its wearer's eyes is often too small or covered for the whole picture.

FunREC, supplement 4: optional; another hand model.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.recording import Recording
from twin.errors import MissingDependencyError
from twin.geometry import Array
from twin.packages import to_install
from twin.scene import HAND_LABEL

# wrist, then thumb, index, middle, ring, little finger with four each, from the palm to the tip
KEYPOINTS = 21
FINGERTIPS = (4, 8, 12, 16, 20)
_CUT_PX = 640  # cut-outs are magnified to this size; the detector itself works at 192 px
# Most hands in a picture; chosen by us
_MOST_HANDS = 2
# Least confidence of the detector; chosen by us
_LEAST_CONFIDENCE = 0.5
_REACH_M = 0.12  # a fingertip lies no farther than that in depth from the hand's median


@dataclass(frozen=True, eq=False)
class HandKeypoints:
    """One entry per detected hand, frames not decreasing.

    frames: (n,). pixels: (n, 21, 2) x, y in the colour image. points_cam: (n, 21, 3) m, the visible surface
    at each keypoint, NaN where depth is unknown or shows something else. score: (n,) 0..1.
    """

    frames: NDArray[np.int64]
    pixels: Array
    points_cam: Array
    score: Array

    def __len__(self) -> int:
        return len(self.frames)


def detect_hands(
    recording: Recording,
    frames: Sequence[int],
    labels: Mapping[int, NDArray[np.uint8]] | None = None,
) -> HandKeypoints:
    """Detect hands in some frames and lift their keypoints by depth.

    Args:
        labels: label images (H, W); frames that have one are searched again around the hand label when the
            whole picture shows no hand.

    Raises MissingDependencyError when mediapipe is not installed.
    """
    found: list[tuple[int, Array, Array, float]] = []
    with _detector() as detector:
        for number in sorted(frames):
            color = recording.color(number)
            hands = _detect(detector, color)
            mask = None if labels is None or number not in labels else labels[number] == HAND_LABEL
            if not hands and mask is not None and mask.any():
                hands = _detect_in_cut_out(detector, color, mask)
            if hands:
                depth = recording.depth(number)
                found += [(number, p, _lift(recording, depth, p), score) for p, score in hands]
    return HandKeypoints(
        np.array([f[0] for f in found], dtype=np.int64),
        np.array([f[1] for f in found]).reshape(-1, KEYPOINTS, 2),
        np.array([f[2] for f in found]).reshape(-1, KEYPOINTS, 3),
        np.array([f[3] for f in found], dtype=np.float64),
    )


def _detector() -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the packages that mediapipe imports
            from mediapipe.python.solutions.hands import Hands
    except ImportError as error:
        raise MissingDependencyError(
            f"hand keypoints need mediapipe, which can't be imported ({error})",
            f'{to_install("mediapipe", "hands")}, or take contact source "geometry"',
        ) from None
    return Hands(
        static_image_mode=True,
        max_num_hands=_MOST_HANDS,
        min_detection_confidence=_LEAST_CONFIDENCE,
    )


def _detect(detector: Any, color: NDArray[np.uint8]) -> list[tuple[Array, float]]:
    """Pixels (21, 2) and score of each hand in a picture (H, W, 3)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = detector.process(np.ascontiguousarray(color))
    if not result.multi_hand_landmarks:
        return []
    height, width = color.shape[:2]
    hands = []
    for landmarks, side in zip(result.multi_hand_landmarks, result.multi_handedness, strict=True):
        # the detector counts from the edge of the picture, pixel centres lie at integers
        xy = np.array([(p.x * width - 0.5, p.y * height - 0.5) for p in landmarks.landmark])
        hands.append((xy, float(side.classification[0].score)))
    return hands


def _detect_in_cut_out(
    detector: Any, color: NDArray[np.uint8], mask: NDArray[np.bool_]
) -> list[tuple[Array, float]]:
    """Hands in a magnified cut-out around the mask (H, W)."""
    y, x = np.nonzero(mask)
    pad = int(0.3 * max(np.ptp(x), np.ptp(y))) + 1
    x0, y0 = max(0, int(x.min()) - pad), max(0, int(y.min()) - pad)
    cut = color[y0 : int(y.max()) + pad, x0 : int(x.max()) + pad]
    scale = _CUT_PX / max(cut.shape[:2])
    size = (max(1, round(cut.shape[1] * scale)), max(1, round(cut.shape[0] * scale)))
    large = np.asarray(cv2.resize(cut, size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
    factor = np.array([cut.shape[1] / size[0], cut.shape[0] / size[1]])
    return [((p + 0.5) * factor - 0.5 + [x0, y0], score) for p, score in _detect(detector, large)]


def _lift(recording: Recording, depth: NDArray[np.float32], pixels: Array) -> Array:
    """Points (21, 3) of keypoints (21, 2): median depth of 3x3 pixels; NaN far from the hand's middle."""
    height, width = depth.shape
    out = np.full((KEYPOINTS, 3), np.nan)
    for k, (x, y) in enumerate(np.rint(pixels).astype(int)):
        if 0 <= x < width and 0 <= y < height:
            patch = depth[max(0, y - 1) : y + 2, max(0, x - 1) : x + 2]
            known = patch[patch > 0]
            if len(known):
                out[k] = recording.intrinsics.backproject(
                    pixels[k], np.array(np.median(known), dtype=np.float64)
                )
    known_depth = out[np.isfinite(out[:, 2]), 2]
    if len(known_depth):
        out[np.abs(out[:, 2] - np.median(known_depth)) > _REACH_M] = np.nan
    return out

"""Two views of one place, registered: matches say what a bare wall leaves open."""

from __future__ import annotations

import cv2
import numpy as np

from recon.cameras.places import keyframes_of, register
from recon.recording import Intrinsics, Recording

CAMERA = Intrinsics(320, 240, 300.0, 300.0, 159.5, 119.5)
WALL = 2.0  # m away
SHIFT = 18  # px, by which the second view lies aside


def test_a_sensors_own_pattern_does_not_pull_two_views_of_a_wall_together() -> None:
    """Depth waves by a centimetre at the same pixels of both views, as of a sensor whose error stays."""
    rng = np.random.default_rng(3)
    poster = cv2.GaussianBlur(rng.integers(0, 255, (240, 400, 3)).astype(np.uint8), (0, 0), 1.5)
    v, u = np.mgrid[:240, :320]
    depth = (WALL + 0.01 * np.sin(u / 9.0) * np.sin(v / 9.0)).astype(np.float32)
    views = [poster[:, :320], poster[:, SHIFT : SHIFT + 320]]
    color = np.stack([views[k // 5] for k in range(10)])
    recording = Recording.from_arrays(color, np.stack([depth] * 10), CAMERA, fps=15)
    first, second = keyframes_of(recording, [0, 9])
    seen = register(first, second, CAMERA)
    assert seen is not None
    aside = SHIFT * WALL / CAMERA.fx
    np.testing.assert_allclose(seen.T_a_b[:3, 3], [aside, 0.0, 0.0], atol=0.004)
    assert np.degrees(np.arccos((np.trace(seen.T_a_b[:3, :3]) - 1) / 2)) < 0.2

"""Cameras of each clip by ours and by other programs on the same frames (the paper's Table 2)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.cameras import by_open3d, by_open3d_pairs, by_opencv
from benchmarks.paper.chain import Answer, Seen
from recon.recording import Recording
from twin.geometry import Array
from twin.scene import Trajectory


def _of(find: Callable[[Recording], Array]) -> Callable[[Seen], Answer]:
    def cameras(seen: Seen) -> Answer:
        poses, times = find(seen.recording), np.asarray(seen.recording.times)
        return Answer((), None, Trajectory(np.arange(len(poses)), times, poses))

    return cameras


# None of them is told where hands are.
CAMERAS: dict[str, Callable[[Seen], Answer]] = {
    "cameras: Open3D's SLAM": _of(by_open3d),
    "cameras: Open3D, pairs": _of(by_open3d_pairs),
    "cameras: OpenCV, pairs": _of(by_opencv),
}

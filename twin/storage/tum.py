"""Camera poses as lines of TUM RGB-D trajectories."""

from __future__ import annotations

from twin import geometry as geo
from twin.scene import Trajectory


def tum_lines(cameras: Trajectory) -> str:
    """TUM lines `t tx ty tz qx qy qz qw`, camera to world."""
    lines = []
    for t, pose in zip(cameras.times, cameras.T_world_cam, strict=True):
        w, x, y, z = geo.quat_wxyz_from_matrix(pose[:3, :3])
        lines.append(" ".join([_time(float(t)), *(repr(float(v)) for v in (*pose[:3, 3], x, y, z, w))]))
    return "\n".join(lines) + "\n"


def _time(t: float) -> str:
    short = f"{t:.6f}"
    return short if float(short) == t else repr(t)

"""trajectory.csv: a header line, then one line a sample (RFC 4180)."""

from __future__ import annotations

import csv
import io

import numpy as np

from robots.formats.trajectory_export import PlannedMotion, smooth_quaternions_wxyz

FILES = ("trajectory.csv",)


def columns(source: PlannedMotion) -> list[str]:
    """Column names; each ends in its unit (but quaternions, phases); tool poses are in the twin's world."""
    joints = [f"{j}_{u}" for j, u in zip(source.trajectory.joint_names, source.joint_units, strict=True)]
    return [
        "time_s", "phase",
        *joints, *(f"{j}_per_s" for j in joints),
        "gripper_m", f"part_state_{source.state_unit}",
        *(f"world_tool_{axis}_m" for axis in "xyz"), *(f"world_tool_q{axis}" for axis in "wxyz"),
        "position_error_m",
    ]  # fmt: skip


def render(source: PlannedMotion) -> dict[str, bytes]:
    """The table; numbers have as many digits as it takes to read back the same double."""
    t = source.trajectory
    quaternions = smooth_quaternions_wxyz(t.T_world_tool[:, :3, :3])
    numbers = np.column_stack(
        [t.q, t.qd, t.gripper, t.part_state, t.T_world_tool[:, :3, 3], quaternions, t.position_error]
    )
    text = io.StringIO(newline="")
    out = csv.writer(text)
    out.writerow(columns(source))
    for time, phase, row in zip(t.times.tolist(), t.phases, numbers.tolist(), strict=True):
        out.writerow([repr(time), phase, *map(repr, row)])
    return {FILES[0]: text.getvalue().encode()}

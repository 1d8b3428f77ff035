"""Robot trajectories as files of robots' own formats: a table name -> format.

    from robots.formats import export_trajectory, PlannedMotion
    motion = PlannedMotion(trajectory, twin.part("door"), robots.resolve("franka"))
    export_trajectory(motion, ["ros2", "csv"], Path("out"))

docs/robots.md tells what each file means: units, frames, quaternion order, and what is left out.
"""

from __future__ import annotations

from robots.formats.table import FORMATS as FORMATS
from robots.formats.table import export_trajectory as export_trajectory
from robots.formats.trajectory_export import PlannedMotion as PlannedMotion
from robots.formats.trajectory_export import require_trust as require_trust

__all__ = ["FORMATS", "PlannedMotion", "export_trajectory", "require_trust"]

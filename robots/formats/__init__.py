"""Robot trajectories as files of robots' own formats: a table name -> format.

    from robots.formats import hand_over, Handover
    hand_over(Handover(trajectory, twin.part("door_2"), robots.resolve("franka")), ["ros2", "csv"], Path("out"))

docs/robots.md tells what each file means: units, frames, quaternion order, and what is left out.
"""

from __future__ import annotations

from robots.formats.table import FORMATS as FORMATS
from robots.formats.table import hand_over as hand_over
from robots.formats.trajectory_export import Handover as Handover

__all__ = ["FORMATS", "Handover", "hand_over"]

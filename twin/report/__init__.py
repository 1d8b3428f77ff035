"""The run's page: `render(run)` writes RUN/report.html from whatever the run folder holds so far."""

from __future__ import annotations

from twin.report.frames import pick_key_frames, save_key_frames
from twin.report.page import render
from twin.report.sections import Section, Table, save_section

__all__ = ["Section", "Table", "pick_key_frames", "render", "save_key_frames", "save_section"]

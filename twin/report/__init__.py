"""What a page shows of a run and its twin: pictures, tables, a film of the recording."""

from __future__ import annotations

from twin.report.film import film_frames, save_film
from twin.report.frames import pick_key_frames, save_key_frames
from twin.report.sections import Section, Table, save_section

__all__ = [
    "Section",
    "Table",
    "film_frames",
    "pick_key_frames",
    "save_film",
    "save_key_frames",
    "save_section",
]

"""A twin in a notebook: its scene with a slider a joint, in a frame of its own."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

from twin.errors import InputError
from twin.page.page import html_of
from twin.scene import Twin


@dataclass(frozen=True, repr=False)
class Shown:
    """A page that a notebook shows where it stands last in a cell. text: all of it. height: px."""

    text: str
    height: int

    def _repr_html_(self) -> str:
        """The page in a frame that reaches nothing of the notebook."""
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe sandbox="allow-scripts" style="{style}" srcdoc="{escape(self.text)}"></iframe>'

    def __repr__(self) -> str:
        return f"<Shown: a page of {len(self.text) / 1e6:.1f} MB, for a notebook>"


def show(twin: Twin, height: int = 760) -> Shown:
    """The twin to be turned, and its joints to be moved, in a notebook.

    Args:
        height: of the frame, px.

    Raises InputError for a height that is none.
    """
    if height < 1:
        raise InputError(f"a frame is not {height} px high", "give a whole number from 1 on")
    return Shown(html_of(twin), height)

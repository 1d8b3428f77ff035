"""What the tests of the page's scene share: frames that tell their number, a still picture."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.makers.browser import Tab

# a text that a page must show as text
HOSTILE = "</script><script>window.hacked = 1</script><img src=x onerror='window.hacked = 2'>"
SIZE = (120, 160)


def pictured(frame: int) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """A frame that tells its number: its grey is four times it."""
    return np.full((*SIZE, 3), 4 * frame, np.uint8)


def settled(tab: Tab) -> None:
    """Wait until all that was asked for is on the screen, with all pixels, however slow the machine is."""
    tab.run("funtwin.still()")

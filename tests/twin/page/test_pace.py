"""While drawing is slow the scene has fewer pixels, and at rest all."""

from __future__ import annotations

import numpy as np
import pytest

from tests.makers.browser import Tab
from tests.makers.viewer import settled


def late(tab: Tab) -> None:
    """Make the next drawing come as on a machine that is late, with half as many pixels a side."""
    tab.run(
        "new Promise((done) => {let count = 0; const slow = () => {const end = performance.now() + 60;"
        " while (performance.now() < end); funtwin.changed();"
        " if (++count < 12 && funtwin.renderer.getPixelRatio() === 1) requestAnimationFrame(slow); else done();};"
        " slow();})"
    )
    assert tab.run("funtwin.renderer.getPixelRatio()") == 0.5


def test_late_drawings_have_fewer_pixels_and_a_still_one_has_all(tab: Tab) -> None:
    settled(tab)
    whole = tab.picture("#view")
    late(tab)
    settled(tab)
    assert tab.run("funtwin.renderer.getPixelRatio()") == 1
    assert np.array_equal(tab.picture("#view"), whole)
    late(tab)  # at rest all come back by themselves
    tab.until("funtwin.renderer.getPixelRatio() === 1")


@pytest.mark.parametrize(
    ("took", "is_late"),
    [
        ([70] * 3, False), ([70] * 4, True), ([500] * 4, True), ([16] * 20, False), ([70, 16] * 20, False),
        ([70] * 4 + [16], False), ([70] * 9 + [16] + [70], True),
    ],
)  # fmt: skip
def test_drawings_are_late_by_the_time_that_they_take(tab: Tab, took: list[int], is_late: bool) -> None:
    """ms from each drawing to the browser's next frame."""
    assert (
        tab.run(f"(() => {{const p = new Pace(); {took}.forEach((ms) => p.took(ms)); return p.late;}})()")
        is is_late
    )


@pytest.mark.parametrize(("frame", "pause", "pixels"), [(16, 70, 1), (70, 0, 0.5)])
def test_what_is_asked_for_seldom_is_not_late(tab: Tab, frame: int, pause: int, pixels: float) -> None:
    """Six drawings with the browser's frames told by hand, ms: how soon the next comes, and then nothing."""
    settled(tab)
    told = tab.run(
        "(() => {const real = requestAnimationFrame; let [now, queue] = [0, []];"
        " window.requestAnimationFrame = (f) => queue.push(f);"
        " const next = () => {const due = queue; queue = []; due.forEach((f) => f(now));};"
        f" for (let k = 0; k < 6; k++) {{funtwin.changed(); next(); now += {frame}; next(); now += {pause};}}"
        " window.requestAnimationFrame = real; return funtwin.renderer.getPixelRatio();})()"
    )
    assert told == pixels
    settled(tab)

"""The page of `twin annotate`: by requests, and clicked through in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from recon.annotation.seen import Seen
from recon.annotation.server import Server, annotating
from recon.evaluation.read_truth import load_truth
from tests.makers.browser import Tab, browser
from tests.makers.live import ask, post
from tests.recon.annotation.conftest import MARKS


@pytest.fixture
def server(seen: Seen, tmp_path: Path) -> Iterator[Server]:
    with annotating(seen, tmp_path) as server:
        yield server


def test_frames_are_given_and_nothing_else(server: Server, seen: Seen) -> None:
    status, data, headers = ask(server, "GET", f"/{server.token}/frame/7")
    assert (status, headers["Content-Type"]) == (200, "image/jpeg")
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    assert np.abs(image.astype(int) - seen.recording.color(7)).mean() < 4
    for path in ("frame/88", "frame/../page.html", "annotation.json", "frame/-1", "../x"):
        assert ask(server, "GET", f"/{server.token}/{path}")[0] == 404
    assert ask(server, "GET", "/frame/7")[0] == 403


def test_marks_are_kept_and_taken_back(server: Server, seen: Seen, tmp_path: Path) -> None:
    for mark in MARKS:
        assert post(server, "mark", mark.row)[1]["ok"]
    status, told = post(server, "mark", {"part": "drawer", "what": "moves", "value": "40:50"})
    assert (status, told["ok"]) == (409, False)
    assert "marked already" in told["error"]
    with annotating(seen, tmp_path) as again:
        assert again.state["marks"] == [m.row for m in MARKS]
    assert post(server, "undo", {})[1]["marks"] == [m.row for m in MARKS[:-1]]
    assert post(server, "solve", {"part": "drawer"})[0] == 409


def test_two_pages_do_not_undo_each_other(server: Server, seen: Seen, tmp_path: Path) -> None:
    with annotating(seen, tmp_path) as other:
        assert post(server, "mark", MARKS[0].row)[1]["ok"]
        status, told = post(other, "mark", {"part": "lid", "what": "part", "value": "hinge"})
        assert (status, "reload" in told["error"]) == (409, True)
        assert ask(other, "GET", f"/{other.token}/marks")[0] == 200
        assert post(other, "mark", {"part": "lid", "what": "part", "value": "hinge"})[1]["ok"]
        assert post(server, "undo", {})[0] == 409


def at(tab: Tab, x: float, y: float) -> None:
    """Click a pixel of the recording in its picture."""
    tab.run(
        "(() => { const i = document.querySelector('#picture img').getBoundingClientRect(), [w, h] = annotation.told.size;"
        " document.getElementById('picture').dispatchEvent(new MouseEvent('click', {bubbles: true,"
        f" clientX: i.left + ({x} + .5) / w * i.width, clientY: i.top + ({y} + .5) / h * i.height}})); }})()"
    )


def marked(tab: Tab, count: int) -> Any:
    return tab.until(f"annotation.marks.length === {count} && annotation.marks")


def test_a_part_is_annotated_by_clicks(server: Server, tmp_path: Path) -> None:
    with browser(tmp_path / "profile") as tab:
        tab.size(1400, 1000)
        tab.open(server.address)
        assert tab.run("annotation.ready") is True
        tab.run("document.getElementById('new').value = 'drawer'")
        tab.run("document.querySelector('[data-add=slide]').click()")
        marked(tab, 1)
        for count, (frame, corners) in enumerate(
            {15: [(191, 170), (330, 163), (324, 203), (194, 208)], 70: [(164, 164), (323, 168), (318, 209), (169, 209)]}.items(), 2
        ):  # fmt: skip
            assert tab.run(f"annotation.go({frame})") is True
            tab.run("document.querySelector('[data-tool=outline]').click()")
            for corner in corners:
                at(tab, *corner)
            tab.run("document.querySelector('[data-tool=outline]').click()")
            marked(tab, count)
        tab.run("annotation.go(34)")
        tab.run("document.getElementById('first').click()")
        tab.run("annotation.go(61)")
        tab.run("document.getElementById('last').click()")
        assert [m["what"] for m in marked(tab, 4)] == [m.what for m in MARKS]
        tab.run("document.getElementById('solve').click()")
        told = tab.until("annotation.solved.drawer && annotation.solved.drawer.told", 60)
        assert told.startswith("0 to 28")
        assert tab.run("document.querySelectorAll('#picture svg polygon').length") == 1
        tab.run("document.getElementById('write').click()")
        tab.until("document.getElementById('answer').textContent.startsWith('written')", 60)
        assert tab.complaints == []
        assert all(a.startswith((server.address, "data:")) for a in tab.asked)
    assert load_truth(tmp_path / "truth").parts[0].travel == pytest.approx(0.288, abs=2e-3)


def test_a_refusal_is_told_in_the_page(server: Server, tmp_path: Path) -> None:
    with browser(tmp_path / "profile") as tab:
        tab.open(server.address)
        tab.run("annotation.ready")
        tab.run("document.getElementById('new').value = '<script>'")
        tab.run("document.querySelector('[data-add=hinge]').click()")
        assert "not legal" in tab.until("document.getElementById('answer').textContent")
        assert tab.run("document.querySelectorAll('#part option').length") == 0

"""Edits by clicking, in a real browser: written, shown, kept over a reload, taken back."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from tests.makers.browser import Tab, browser
from tests.makers.twin.judged import doubted
from tests.twin.page.test_page import seen
from twin import edits, report
from twin.contacts import distance_to
from twin.storage import load, save
from twin.view import Server, serving, work


@pytest.fixture
def run(tmp_path: Path) -> Path:
    save(doubted(seen(cabinet_twin())), tmp_path / "run" / "twin")
    return tmp_path / "run"


@pytest.fixture
def server(run: Path) -> Iterator[Server]:
    with serving(run) as server:
        yield server


@pytest.fixture
def tab(server: Server, tmp_path: Path) -> Iterator[Tab]:
    with browser(tmp_path / "profile") as tab:
        tab.size(1400, 1000)
        tab.open(server.address)
        assert tab.run("funtwin.ready") is True
        yield tab


def click(tab: Tab, part: str, button: str, **fields: str) -> None:
    """Fill fields of a part's editor, click a button, and wait for the page that comes."""
    card = f"document.querySelector('.joint[data-part=\"{part}\"]')"
    for name, value in fields.items():
        tab.run(f"{card}.querySelector('.editor [name={name}]').value = {value!r}")
    tab.follow(f"{card}.querySelector('.editor button{button}').click()")
    assert tab.run("funtwin.ready") is True


def test_each_kind_by_its_button(tab: Tab, run: Path) -> None:
    click(tab, "door", '[data-what="upper"]', upper="95", why="pulled it")
    assert load(run).part("door").joint.upper == pytest.approx(np.deg2rad(95))
    assert tab.run("document.querySelector('.joint[data-part=door] .state input').max") == "95.0"
    assert tab.run("document.querySelector('.joint[data-part=door] .editor').open") is False
    click(tab, "drawer", '[data-value="front"]')
    click(tab, "door", '[data-nudge="0.5"]')
    tilt = np.rad2deg(
        np.arccos(min(1.0, abs(load(run).part("door").joint.axis @ cabinet_twin().part("door").joint.axis)))
    )
    assert 0.0 < tilt <= 0.5 + 1e-6
    click(tab, "drawer", '[data-what="name"]', name="cutlery")
    click(tab, "cutlery", '[data-what="mass"]', mass="2.5")
    (part,) = [p.name for p in load(run).parts if p.verdict is not None and p.verdict.reasons]
    click(tab, part, '[data-what="verdict"]', why="opened it")
    twin = load(run)
    assert twin.part("cutlery").inertial.mass.value == 2.5  # type: ignore[union-attr]
    assert twin.verdict is not None
    assert twin.verdict.trusted
    told = [(e.what, e.part) for e in edits.read(run, edits.found_twin(run))]
    assert told == [
        ("upper", "door"), ("axis", "drawer"), ("axis", "door"), ("name", "drawer"), ("mass", "cutlery"), ("verdict", part)
    ]  # fmt: skip
    assert edits.read(run, edits.found_twin(run))[0].why == "pulled it"
    assert tab.complaints == []
    tab.follow("location.reload()")
    assert "cutlery" in tab.run("document.body.textContent")
    for _ in told:
        tab.follow("document.getElementById('undo').click()")
    assert not (run / "edits.json").exists()
    assert tab.run("document.getElementById('undo')") is None


def test_what_is_shown_stays_when_the_page_comes_anew(tab: Tab) -> None:
    tab.run("document.querySelector('.joint[data-part=door] .editor').open = true")
    tab.run("funtwin.orbit.look([1, -2, 1.5], [0.1, 0.2, 0.4], 40); funtwin.clock.go(1.2)")
    click(tab, "door", '[data-what="upper"]', upper="95")
    assert tab.run("funtwin.camera.position.toArray()") == pytest.approx([1, -2, 1.5])
    assert tab.run("funtwin.clock.wanted") == pytest.approx(1.2)
    assert tab.run("document.querySelector('.joint[data-part=door] .editor').open") is True


def test_closed_is_where_the_slider_stands(tab: Tab, run: Path) -> None:
    tab.run(
        "(() => {const i = document.querySelector('.joint[data-part=drawer] .state input');"
        " i.value = 300; i.dispatchEvent(new Event('input'));})()"
    )
    click(tab, "drawer", '[data-what="closed"]')
    joint = load(run).part("drawer").joint
    assert (joint.lower, joint.upper) == pytest.approx((0.0, 0.3), abs=1e-4)
    assert joint.axis == pytest.approx(-cabinet_twin().part("drawer").joint.axis)


def test_a_refusal_is_told_in_the_page(tab: Tab, run: Path) -> None:
    card = "document.querySelector('.joint[data-part=door] .editor')"
    tab.run(
        f"{card}.querySelector('[name=upper]').value = '5'; {card}.querySelector('[data-what=upper]').click()"
    )
    told = tab.until("document.getElementById('answer').textContent")
    assert "cut off its recorded motion" in told
    assert not (run / "edits.json").exists()


def test_a_piece_is_split_off_where_it_is_clicked(tab: Tab, run: Path) -> None:
    """The door joined to the drawer, then split off again by a click on it while the drawer stands open."""
    tab.run("document.querySelector('.joint[data-part=door] select').value = 'drawer'")
    click(tab, "door", '[data-what="merged"]')
    assert [p.name for p in load(run).parts] == ["drawer"]
    tab.run(
        "(() => {const i = document.querySelector('.joint[data-part=drawer] .state input');"
        " i.value = 100; i.dispatchEvent(new Event('input'));})()"
    )
    middle = cabinet_twin().part("door").mesh.area_centroid + 0.1 * load(run).part("drawer").joint.axis
    tab.run(
        f"funtwin.orbit.look({(middle + 1.5 * load(run).part('drawer').joint.axis).tolist()}, {middle.tolist()}, 40)"
    )
    tab.run("document.querySelector('.editor button[data-pick]').click()")
    tab.follow(
        "(() => {const c = document.querySelector('#view canvas'); const b = c.getBoundingClientRect();"
        " for (const type of ['pointerdown', 'pointerup']) c.dispatchEvent(new PointerEvent(type,"
        " {clientX: b.x + b.width / 2, clientY: b.y + b.height / 2, pointerId: 1, bubbles: true}));})()"
    )
    assert len(load(run).parts) == 2
    clicked = edits.read(run, edits.found_twin(run))[-1].to
    assert distance_to(cabinet_twin().part("door").mesh, np.array(clicked)) < 1e-4  # where it is at state 0
    assert tab.complaints == []


def test_a_part_is_pointed_at_in_the_film(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A click is a pixel of the recording; what the reconstruction says stands in the page after it."""
    heard: list[list[str]] = []

    def again(_: Path, words: list[str]) -> list[str]:
        heard.append(list(words))
        return [sys.executable, "-c", "print('warning: said: no part was found for what was said')"]

    monkeypatch.setattr(work, "again", again)
    twin = load(run)
    size = next(iter(twin.labels.values())).shape
    report.save_film(run, report.film_frames(twin), lambda _: np.full((*size, 3), 90, np.uint8))
    with serving(run) as server, browser(tmp_path / "profile") as tab:
        tab.size(1400, 1000)
        tab.open(server.address)
        assert tab.run("funtwin.ready") is True
        assert tab.run("document.querySelector('#say [name=find]').disabled") is True
        tab.run("document.querySelector('#film input').click(); funtwin.clock.go(1.0)")
        frame = tab.run("funtwin.clock.frame().frame")
        tab.run(
            "(() => {const p = document.querySelector('#film .frame'); const b = p.getBoundingClientRect();"
            " p.dispatchEvent(new MouseEvent('click', {clientX: b.x + 0.75 * b.width,"
            " clientY: b.y + 0.25 * b.height, bubbles: true}));"
            " document.querySelector('#say [name=first]').click(); funtwin.clock.go(1.6);"
            " document.querySelector('#say [name=last]').click();"
            " document.querySelector('#say select').value = ' --type slide';})()"
        )
        last = tab.run("funtwin.clock.frame().frame")
        tab.follow("document.querySelector('#say [name=find]').click()")
        assert tab.run("funtwin.ready") is True
        assert tab.until("document.getElementById('answer').textContent") == (
            "said: no part was found for what was said"
        )
        height, width = size
        x, y = round(0.75 * width), round(0.25 * height)
        (words,) = heard
        assert [words[0], *words[2:]] == ["--at", "--interval", f"{frame}:{last}", "--type", "slide"]
        found = [int(v) for v in words[1].replace("@", ",").split(",")]
        assert np.abs(np.subtract(found, [x, y, frame])).max() <= 1
        assert tab.complaints == []
        tab.run("document.querySelector('.joint[data-part=door] .editor').open = true")
        tab.follow("document.querySelector('.joint[data-part=door] [data-say]').click()")
        assert heard[1][2:] == ["--type", "slide"]

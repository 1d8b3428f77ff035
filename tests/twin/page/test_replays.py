"""Which replays the page's scene shows, by files as `twin replay` leaves them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from tests.makers.browser import browser
from twin.errors import InputError
from twin.exporters.glb_buffer import GlbBuffer
from twin.exporters.glb_mesh import add_mesh
from twin.exporters.links import Visual
from twin.inferred import box_mesh
from twin.page import render
from twin.page.replays import replays_of
from twin.report.replayed import Replayed, furniture, load_replayed
from twin.scene import Twin
from twin.storage import save

HOSTILE = "</script><script>window.hacked = 1</script><img src=x onerror='window.hacked = 2'>"
TIMES = np.linspace(0.0, 2.0, 5)
SHAPES = {"robot/arm": 0.2, "stand/pedestal": 0.1}


def replayed_of(twin: Twin, **more: Any) -> Replayed:
    """A robot of two boxes that rises by .1 m a second while it opens the door."""
    turn = np.tile([0.0, 0.0, 0.0, 1.0], (len(TIMES), 1))
    at = np.stack([np.full_like(TIMES, 1.0), np.full_like(TIMES, -1.0), 0.5 + 0.1 * TIMES], axis=1)
    names = list(more.get("links") or SHAPES)
    made = Replayed(
        robot="arm",
        part="door",
        start=0.0,
        goal=1.0,
        ok=True,
        times=TIMES,
        states={p.name: 0.5 * TIMES for p in twin.parts},
        joints={"robot/lift": 0.1 * TIMES},
        links=dict.fromkeys(names, (at, turn)),
        column=(0.1, 0.4, 0.0, 0.0, -0.2),
        furniture=furniture(twin),
    )
    return replace(made, **{k: v for k, v in more.items() if k != "links"})


def glb_of(size: float, names: tuple[str, ...] = tuple(SHAPES)) -> bytes:
    buffer = GlbBuffer()
    nodes: list[dict[str, Any]] = []
    for name in names:
        mesh = add_mesh(buffer, Visual(name, box_mesh(np.eye(4), np.full(3, size)), color=(0.2, 0.3, 0.4)))
        nodes += [{"mesh": mesh}, {"name": name, "extras": {"link": name}, "children": [len(nodes)]}]
    roots = list(range(1, len(nodes), 2))
    return buffer.file(
        {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": roots}], "nodes": nodes}
    )


def leave(run: Path, where: str, replayed: Replayed, glb: bytes) -> Path:
    folder = run / "replay" / where
    folder.mkdir(parents=True)
    replayed.save(folder)
    (folder / "robot.glb").write_bytes(glb)
    return folder


@pytest.fixture
def twin() -> Twin:
    return cabinet_twin()


@pytest.fixture
def run(twin: Twin, tmp_path: Path) -> Path:
    save(twin, tmp_path / "run" / "twin")
    return tmp_path / "run"


def page_of(run: Path) -> str:
    return render(run).read_text(encoding="utf-8")


def test_what_was_left_is_read_as_it_was(twin: Twin, run: Path) -> None:
    folder = leave(run, "arm/door", replayed_of(twin), glb_of(0.1))
    read = load_replayed(folder)
    assert read is not None
    assert (read.robot, read.part, read.start, read.goal, read.ok) == ("arm", "door", 0.0, 1.0, True)
    assert read.column == (0.1, 0.4, 0.0, 0.0, -0.2)
    np.testing.assert_allclose(read.times, TIMES)
    np.testing.assert_allclose(read.states["drawer"], 0.5 * TIMES)
    np.testing.assert_allclose(read.joints["robot/lift"], 0.1 * TIMES)
    np.testing.assert_allclose(read.links["robot/arm"][0][:, 2], 0.5 + 0.1 * TIMES)


@pytest.mark.parametrize(
    ("more", "title"),
    [
        ({}, "Arm opens door"), ({"start": 1.0, "goal": 0.0}, "Arm closes door"), ({"ok": False}, "Arm fails to open door"),
        ({"start": 1.0, "goal": 0.0, "ok": False}, "Arm fails to close door"),
    ],
)  # fmt: skip
def test_the_choice_says_what_is_seen(twin: Twin, run: Path, more: dict[str, Any], title: str) -> None:
    leave(run, "arm/door", replayed_of(twin, **more), glb_of(0.1))
    assert f'<option value="0">{title}</option>' in page_of(run)


def test_without_a_replay_there_is_nothing_to_choose(run: Path) -> None:
    assert '<select name="played"' not in page_of(run)


def test_a_replay_of_an_earlier_version_has_no_robot_and_no_error(twin: Twin, run: Path) -> None:
    folder = leave(run, "arm/door", replayed_of(twin), glb_of(0.1))
    (folder / "motion.json").unlink()
    assert '<select name="played"' not in page_of(run)
    assert replays_of(run, twin).told == ()


def test_the_same_robot_is_in_the_page_once(twin: Twin, run: Path) -> None:
    for where, size in (("arm/door", 0.1), ("arm/door_close", 0.1), ("other/door", 0.3)):
        leave(run, where, replayed_of(twin), glb_of(size))
    found = replays_of(run, twin)
    assert [r["robot"] for r in found.told] == [0, 0, 1]
    assert page_of(run).count('class="robot"') == len(found.robots) == 2


@pytest.mark.parametrize("changed", ["axis", "upper", "name", "gone"])
def test_a_replay_with_an_earlier_twin_is_told_and_not_shown(twin: Twin, run: Path, changed: str) -> None:
    leave(run, "arm/door", replayed_of(twin), glb_of(0.1))
    part, *others = twin.parts
    now = {
        "axis": lambda: (replace(part, joint=replace(part.joint, axis=-part.joint.axis)), *others),
        "upper": lambda: (replace(part, joint=replace(part.joint, upper=part.joint.upper + 0.02)), *others),
        "name": lambda: (replace(part, name="other"), *others),
        "gone": lambda: tuple(others),
    }[changed]()
    edited = replace(twin, parts=now)
    found = replays_of(run, edited)
    assert found.told == ()
    assert found.earlier == ("Arm opens door",)
    assert len(replays_of(run, twin).told) == 1
    save(edited, run / "twin")
    text = page_of(run)
    assert '<select name="played"' not in text
    assert "played with an earlier twin: Arm opens door. Run" in text


def test_a_twin_that_was_written_and_read_is_the_same(twin: Twin, run: Path) -> None:
    from twin.storage import load

    leave(run, "arm/door", replayed_of(twin), glb_of(0.1))
    assert len(replays_of(run, load(run)).told) == 1


@pytest.mark.parametrize(
    ("key", "value"),
    [("times", []), ("times", [0, 1]), ("links", {"a": 1}), ("states", {"door": [0, 1, "x", 3, 4]}), ("column", [1]), ("times", None)],
)  # fmt: skip
def test_a_damaged_file_is_named(twin: Twin, run: Path, key: str, value: object) -> None:
    folder = leave(run, "arm/door", replayed_of(twin), glb_of(0.1))
    told = json.loads((folder / "motion.json").read_text())
    (folder / "motion.json").write_text(json.dumps({**told, key: value}))
    with pytest.raises(InputError, match=r"motion\.json is damaged.*twin replay"):
        replays_of(run, twin)
    (folder / "motion.json").write_text("not JSON")
    with pytest.raises(InputError, match=r"motion\.json is damaged"):
        replays_of(run, twin)


def test_names_with_markup_are_text(twin: Twin, run: Path, tmp_path: Path) -> None:
    link = f"robot/{HOSTILE}"
    hostile = replayed_of(twin, robot=HOSTILE, part=HOSTILE, links={link: 0.2, "stand/pedestal": 0.1})
    leave(run, "arm/door", hostile, glb_of(0.3, (link, "stand/pedestal")))
    text = page_of(run)
    assert HOSTILE not in text
    assert len(re.findall("window.hacked", text)) > 0
    with browser(tmp_path / "profile") as tab:
        tab.size(1400, 1000)
        tab.open((run / "report.html").as_uri())
        assert tab.run("funtwin.ready") is True
        tab.run("funtwin.watch(0)")
        tab.run("funtwin.clock.go(1.0); funtwin.still()")
        assert HOSTILE in tab.run("document.querySelector('#clock select').textContent")
        heights = tab.run("funtwin.replays.shown.node.children.map((n) => n.position.z)")
        assert heights == pytest.approx([0.6, 0.6])
        assert tab.run("typeof window.hacked") == "undefined"
        assert tab.complaints == []


def test_another_that_is_chosen_while_one_loads_is_shown(twin: Twin, run: Path, tmp_path: Path) -> None:
    """The two are asked for at once: the second is wanted, and nothing of the first stays."""
    leave(run, "a/door", replayed_of(twin), glb_of(0.3))
    leave(run, "b/door", replayed_of(twin, times=2 * TIMES), glb_of(0.2))
    with browser(tmp_path / "profile") as tab:
        tab.size(390, 844)
        tab.open(render(run).as_uri())
        assert tab.run("funtwin.ready") is True
        tab.run("Promise.all([funtwin.watch(0), funtwin.watch(1)])")
        assert tab.run("funtwin.clock.track.end") == 4.0
        assert (
            tab.run("funtwin.scene.root.children.filter((n) => n === funtwin.replays.shown.node).length") == 1
        )
        assert tab.run("funtwin.replays.shown.told === funtwin.told.replays[1]") is True
        assert tab.run("document.documentElement.scrollWidth") <= 390
        tab.run("Promise.all([funtwin.watch(0), funtwin.watch(null)])")
        assert tab.run("funtwin.replays.shown") is None
        assert tab.run("funtwin.clock.track.film") is True
        assert tab.complaints == []

"""Words on a recording that the live server hears: one reconstruction at a time, told and taken back."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.makers.live import UPPER, ask, post
from twin import edits
from twin.cli.parser import parse
from twin.errors import InputError
from twin.runs.manifest import update_manifest
from twin.storage import load, save
from twin.view import Server, serving, work

SAY = {"word": "--at 31,40@5 --type hinge"}


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """In place of a reconstruction: what goes on until a file is there, and tells what it was given."""
    gate = tmp_path / "gate"
    code = (
        "import pathlib, sys, time\n"
        "print('motion 1 s, 9 of 20')\n"
        f"while not (gate := pathlib.Path({str(gate)!r})).exists(): time.sleep(0.02)\n"
        "print('warning: said: no part was found for', *sys.argv[1:])\n"
        "sys.exit(int(gate.read_text()))\n"
    )
    monkeypatch.setattr(work, "again", lambda _, words: [sys.executable, "-c", code, *words])
    return gate


def state(server: Server) -> dict[str, Any]:
    status, told, _ = ask(server, "GET", f"/{server.token}/work")
    assert status == 200
    found: dict[str, Any] = json.loads(told)
    return found


def until_done(server: Server) -> dict[str, Any]:
    while state(server)["running"]:
        time.sleep(0.02)
    return state(server)


def test_a_word_is_heard_by_one_reconstruction_at_a_time(server: Server, slow: Path) -> None:
    assert state(server) == {"running": False, "line": "", "error": "", "warnings": []}
    assert post(server, "say", SAY) == (200, {"ok": True, "working": True})
    while not state(server)["line"]:
        time.sleep(0.02)
    assert state(server)["line"] == "motion 1 s, 9 of 20"
    status, told = post(server, "say", SAY)
    assert (status, told["error"]) == (409, "a reconstruction is going on; wait for its end")
    status, told = post(server, "edit", UPPER)  # it has the run to itself, also before it claims it
    assert (status, told["error"]) == (409, "a reconstruction is going on; wait for its end")
    assert b"reconstructed again" in ask(server, "GET", f"/{server.token}/")[1]
    slow.write_text("2")
    told = until_done(server)
    assert told["error"] == ""
    assert told["warnings"] == ["said: no part was found for --at 31,40@5 --type hinge"]
    assert b"data-what" in ask(server, "GET", f"/{server.token}/")[1]


def test_what_a_reconstruction_fails_of_is_told(server: Server, slow: Path) -> None:
    slow.write_text("1")
    post(server, "say", SAY)
    assert "no part was found for" in until_done(server)["error"]


@pytest.mark.parametrize(
    "word",
    [
        "",
        "--config /etc/passwd",
        "--at 1,2@3 --set a=b",
        "--type hinge",
        "--at 1,2@3\n",
        "--at 1,2@3 --at 4,5@6",
        "-o x",
    ],
)
def test_nothing_but_a_word_on_a_part_is_taken(server: Server, slow: Path, word: str) -> None:
    status, told = post(server, "say", {"word": word})
    assert (status, told["ok"]) == (409, False)
    assert "says nothing of a part; point at it in the picture" in told["error"]
    assert not state(server)["running"]


def test_a_part_that_was_found_is_pointed_at_where_it_is_seen_best(
    server: Server, run: Path, slow: Path
) -> None:
    twin = load(run)
    door = twin.part("door")
    labels = np.zeros((48, 64), np.uint8)
    labels[10:31, 20:41] = door.id
    labels[11:14, 50:60] = door.id
    first, last = door.motion.intervals[0]
    save(replace(twin, labels={last + 9: np.full_like(labels, door.id), first + 1: labels}), run / "twin")
    slow.write_text("0")
    assert post(server, "say", {"part": "door", "word": "--type slide"})[1]["ok"]
    assert until_done(server)["warnings"] == [
        f"said: no part was found for --at 30,20@{first + 1} --type slide"
    ]
    status, told = post(server, "say", {"part": "drawer", "word": "--type hinge"})
    assert (status, told["error"]) == (409, "no picture shows drawer; point at it yourself")


def test_a_word_that_is_taken_back_is_forgotten_by_another_reconstruction(
    server: Server, run: Path, slow: Path
) -> None:
    found = load(run)
    heard = replace(found, provenance={**found.provenance, "said": [SAY["word"]]})
    save(heard, run / "twin")
    edits.keep(run, heard, edits.with_said([], [SAY["word"]]))
    slow.write_text("0")
    _, told = post(server, "undo", {})
    assert told["working"]
    assert until_done(server)["warnings"] == ["said: no part was found for"]
    assert not (run / "edits.json").exists()


def test_a_killed_server_takes_the_reconstruction_with_it(run: Path, slow: Path) -> None:
    with serving(run) as server:
        post(server, "say", SAY)
    assert not server.work.going_on


def test_the_command_reconstructs_as_the_run_was_made(run: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="was made from no recording, seen from the run"):
        work.again(run, [])
    opened = {"layout": "tum", "calibration": "../c.json", "depth_delay": -2, "start": 1.5}
    update_manifest(run, recording="../recording", opened_with=opened)
    with pytest.raises(InputError, match="recording is not there"):
        work.again(run, [])
    (tmp_path / "recording").mkdir()
    (run / "config.toml").write_text("")
    _, _, module, verb, *options = work.again(run, SAY["word"].split())
    assert (module, verb) == ("twin", "reconstruct")
    told = vars(parse([verb, *options]))
    assert told["recording"] == tmp_path / "recording"
    assert told["out"] == run
    assert told["config"] == run / "config.toml"
    assert (told["layout"], told["calibration"], told["depth_delay"]) == ("tum", tmp_path / "c.json", -2)
    assert (told["start"], told["end"], told["at"]) == (1.5, None, [(31, 40, 5)])

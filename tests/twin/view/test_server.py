"""The live server: its own page alone may write; nothing else of the machine can be read or reached."""

from __future__ import annotations

import http.client
import json
import multiprocessing
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin import edits, report
from twin.cli.parser import parse
from twin.errors import InputError
from twin.page import page
from twin.runs.manifest import update_manifest
from twin.runs.run_lock import claimed
from twin.scene import Twin
from twin.storage import load, save
from twin.view import Server, serving, work
from twin.view.local import LocalServer


@pytest.fixture
def run(tmp_path: Path) -> Path:
    save(cabinet_twin(), tmp_path / "run" / "twin")
    return tmp_path / "run"


@pytest.fixture
def server(run: Path) -> Iterator[Server]:
    with serving(run) as server:
        yield server


def ask(
    server: LocalServer, method: str, path: str, body: Any = None, **headers: str
) -> tuple[int, bytes, dict[str, str]]:
    """Status, content and headers of an answer. headers: with _ for -, in place of what a browser sends."""
    host, port = server.server_address[:2]
    data = body if isinstance(body, bytes) else None if body is None else json.dumps(body).encode()
    sent = {"Host": f"{host}:{port}"} | ({} if data is None else {"Content-Type": "application/json"})
    sent |= {name.replace("_", "-"): value for name, value in headers.items()}
    link = http.client.HTTPConnection(str(host), port, timeout=60)
    try:
        link.request(method, path, data, sent)
        answer = link.getresponse()
        return answer.status, answer.read(), dict(answer.getheaders())
    finally:
        link.close()


def post(server: LocalServer, what: str, body: Any, **headers: str) -> tuple[int, dict[str, Any]]:
    status, told, _ = ask(server, "POST", f"/{server.token}/{what}", body, **headers)
    return status, json.loads(told)


UPPER = {"part": "door", "edit": "upper=95deg", "why": "looked"}


def test_the_page_is_given_with_its_editor_and_a_policy(server: Server) -> None:
    status, text, headers = ask(server, "GET", f"/{server.token}/")
    assert status == 200
    assert b'data-what="upper"' in text
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "http" not in policy
    assert headers["Cache-Control"] == "no-store"


def test_the_file_beside_it_has_no_editor(server: Server, run: Path) -> None:
    post(server, "edit", UPPER)
    text = (run / "report.html").read_text(encoding="utf-8")
    assert "data-what" not in text
    assert "Edited by the user" in text


def scenes_of(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """How often a page is put together: each takes one call of `scene_document`, which gives a name here."""
    made: list[str] = []
    document = page.scene_document

    def counted(run: Path, twin: Twin, *more: Any) -> dict[str, Any]:
        made.append(twin.name)
        return document(run, twin, *more)

    monkeypatch.setattr(page, "scene_document", counted)
    return made


def test_an_edit_puts_the_page_together_once(
    server: Server, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once for both, the file and the page that comes anew, and none for one that comes again."""
    made = scenes_of(monkeypatch)
    assert post(server, "edit", UPPER)[0] == 200
    assert b"95.0" in ask(server, "GET", f"/{server.token}/")[1]
    assert b"data-what" in ask(server, "GET", f"/{server.token}/")[1]
    assert len(made) == 1
    assert post(server, "undo", {})[0] == 200
    live = ask(server, "GET", f"/{server.token}/")[1]
    assert len(made) == 2
    assert b"Edited by the user" not in live
    assert "Edited by the user" not in (run / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("file", ["twin/twin.json", "config.toml", "report/check.json"])
def test_what_another_writes_into_the_run_is_shown(
    server: Server, run: Path, monkeypatch: pytest.MonkeyPatch, file: str
) -> None:
    (run / "config.toml").write_text("a = 1\n")
    report.save_section(run, report.Section("check", True, 1.0, [], [], ["the first"]))
    ask(server, "GET", f"/{server.token}/")
    made = scenes_of(monkeypatch)
    ask(server, "GET", f"/{server.token}/")
    assert made == []
    if file == "twin/twin.json":
        save(replace(load(run), name="of_another"), run / "twin")
    elif file == "config.toml":
        (run / "config.toml").write_text("of_another = 1\n")
    else:
        section = run / "report" / "check.json"  # in its place, which its folder does not tell
        section.write_text(section.read_text().replace("the first", "of_another"))
    assert b"of_another" in ask(server, "GET", f"/{server.token}/")[1]
    assert len(made) == 1


def test_an_edit_is_written_and_taken_back(server: Server, run: Path) -> None:
    status, told = post(server, "edit", UPPER)
    assert (status, told["ok"]) == (200, True)
    assert told["edit"]["why"] == "looked"
    assert load(run).part("door").joint.upper == pytest.approx(np.deg2rad(95))
    assert post(server, "undo", {}) == (200, {"ok": True, "undone": [told["edit"]], "warnings": []})
    assert load(run).part("door").joint.upper == pytest.approx(1.4)
    assert post(server, "undo", {})[0] == 409


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"part": "door", "edit": "upper=wide"}, "no state"),
        ({"part": "lid", "edit": "upper=1"}, "no part 'lid'"),
        ({"part": "door", "edit": "colour=red"}, "can't be edited"),
        ({"part": "door", "edit": "verdict=trusted"}, "no verdict|reason"),
        ({}, "can't be edited"),
    ],
)
def test_what_can_not_be_is_told_and_nothing_changes(
    server: Server, run: Path, body: Any, words: str
) -> None:
    before = (run / "twin" / "twin.json").read_bytes()
    status, told = post(server, "edit", body)
    assert (status, told["ok"]) == (409, False)
    assert any(w in told["error"] for w in words.split("|"))
    assert (run / "twin" / "twin.json").read_bytes() == before
    assert not (run / "edits.json").exists()


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/", 403), ("GET", "/nobody/", 403), ("GET", "/{}", 403), ("GET", "/{}x/", 403),
        ("GET", "/{}/twin/twin.json", 404), ("GET", "/{}/../../../etc/passwd", 404), ("GET", "/{}/..%2f..%2fetc%2fpasswd", 404),
        ("GET", "/{}//etc/passwd", 404), ("GET", "/{}/edit", 404), ("GET", "/../{}/", 403), ("GET", "{}/", 403),
        ("POST", "/{}/", 404), ("POST", "/{}/edit/../undo", 404), ("POST", "/nobody/edit", 403),
        ("PUT", "/{}/edit", 501), ("DELETE", "/{}/", 501), ("GET", "/%C3%A9/", 403),
    ],
)  # fmt: skip
def test_no_other_path_and_no_other_token_gives_anything(
    server: Server, method: str, path: str, status: int
) -> None:
    got, text, _ = ask(server, method, path.replace("{}", server.token), {} if method == "POST" else None)
    assert got == status
    assert b"root:" not in text
    assert b"funtwin" not in text


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "example.org"}, {"Host": "127.0.0.1"}, {"Host": "127.0.0.1:1"}, {"Host": ""},
        {"Origin": "http://example.org"}, {"Origin": "null"}, {"Origin": "http://127.0.0.1:1"}, {"Origin": "file://"},
    ],
)  # fmt: skip
def test_other_hosts_and_other_pages_are_refused(server: Server, run: Path, headers: dict[str, str]) -> None:
    for method, path, body in (("GET", "", None), ("POST", "edit", UPPER)):
        status, text, _ = ask(server, method, f"/{server.token}/{path}", body, **headers)
        assert status == 403
        assert b"funtwin" not in text
    assert not (run / "edits.json").exists()


def test_its_own_page_by_both_names_is_let_in(server: Server) -> None:
    port = server.server_address[1]
    for host in (f"127.0.0.1:{port}", f"localhost:{port}"):
        assert ask(server, "GET", f"/{server.token}/", Host=host, Origin=f"http://{host}")[0] == 200


@pytest.mark.parametrize(
    ("body", "headers", "status"),
    [
        (b"{}", {"Content_Type": "text/plain"}, 415),
        (b"part=door", {"Content_Type": "application/x-www-form-urlencoded"}, 415),
        (b"{", {}, 400), (b"[]", {}, 400), (b'{"part": 3}', {}, 400), (b"\xff\xfe", {}, 400),
        (b"x" * 70000, {}, 413), (b"{}", {"Content_Length": "-1"}, 413), (b"{}", {"Content_Length": "9" * 30}, 413),
    ],
)  # fmt: skip
def test_a_body_that_is_none_is_refused(
    server: Server, run: Path, body: bytes, headers: dict[str, str], status: int
) -> None:
    got, told = post(server, "edit", body, **headers)
    assert got == status
    assert told["ok"] is False
    assert not (run / "edits.json").exists()


def test_two_writers_at_once_both_count(server: Server, run: Path) -> None:
    told: list[int] = []
    bodies = [{"part": "door", "edit": "upper=95deg"}, {"part": "drawer", "edit": "upper=31cm"}] * 3
    threads = [threading.Thread(target=lambda b=b: told.append(post(server, "edit", b)[0])) for b in bodies]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert told == [200] * 6
    twin = load(run)
    assert len(edits.read(run, twin)) == 6
    assert twin.part("door").joint.upper == pytest.approx(np.deg2rad(95))
    assert twin.part("drawer").joint.upper == pytest.approx(0.31)


def hold(run: Path, held: Any, done: Any) -> None:
    with claimed(run):
        held.set()
        done.wait(60)


def test_another_process_that_works_on_the_run_is_told_of(server: Server, run: Path) -> None:
    context = multiprocessing.get_context("spawn")
    held, done = context.Event(), context.Event()
    other = context.Process(target=hold, args=(run, held, done))
    other.start()
    try:
        assert held.wait(60)
        status, told = post(server, "edit", UPPER)
        assert status == 409
        assert "in use by another process" in told["error"]
        status, text, headers = ask(server, "GET", f"/{server.token}/")
        assert status == 409
        assert b"in use by another process" in text
        assert headers["Content-Type"].startswith("text/plain")
    finally:
        done.set()
        other.join()
    assert post(server, "edit", UPPER)[0] == 200


def test_a_browser_that_is_killed_leaves_the_server_alive(
    server: Server, capfd: pytest.CaptureFixture[str]
) -> None:
    host, port = server.server_address[:2]
    for words in (
        f"GET /{server.token}/ HTTP/1.1\r\nHost: {host}:{port}\r\n\r\n",
        f"POST /{server.token}/edit HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Type: application/json\r\nContent-Length: 50\r\n\r\n{{",
    ):
        with socket.create_connection((str(host), port)) as link:
            link.setsockopt(
                socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\x00\x00\x00\x00\x00\x00\x00"
            )  # reset it
            link.sendall(words.encode())
    assert ask(server, "GET", f"/{server.token}/")[0] == 200
    assert "Traceback" not in capfd.readouterr().err


def test_a_port_in_use_and_a_folder_without_twin_are_told(server: Server, run: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="can't be used"):
        Server(run, server.server_address[1])
    with pytest.raises(InputError, match="can't be used"):
        Server(run, 99999)
    with pytest.raises(InputError, match=r"no twin/twin\.json"):
        Server(tmp_path)


def test_only_this_machine_reaches_it(server: Server) -> None:
    assert server.server_address[0] == "127.0.0.1"


def test_tokens_differ(run: Path) -> None:
    with serving(run) as one, serving(run) as other:
        assert one.token != other.token
        assert len(one.token) >= 32


def test_the_command_tells_its_address_and_ends_when_it_is_told_to(run: Path) -> None:
    words = [sys.executable, "-m", "twin", "view", str(run)]
    with subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        line = process.stderr.readline()
        assert line.startswith("open http://127.0.0.1:")
        address = line.split()[1]
        host, _, rest = address.removeprefix("http://").partition("/")
        link = http.client.HTTPConnection(host, timeout=60)
        link.request("GET", f"/{rest}")
        assert link.getresponse().status == 200
        link.close()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert "Traceback" not in err + out


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

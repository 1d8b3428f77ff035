"""The live server: its own page alone may write; nothing else of the machine can be read or reached."""

from __future__ import annotations

import http.client
import multiprocessing
import signal
import socket
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.makers.live import UPPER, ask, post
from twin import edits, report
from twin.errors import InputError
from twin.page import page
from twin.runs.run_lock import claimed
from twin.scene import Twin
from twin.storage import load, save
from twin.view import Server, serving


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

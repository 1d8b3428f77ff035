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
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin import edits
from twin.errors import InputError
from twin.runs.run_lock import claimed
from twin.storage import load, save
from twin.view import Server, serving


@pytest.fixture
def run(tmp_path: Path) -> Path:
    save(cabinet_twin(), tmp_path / "run" / "twin")
    return tmp_path / "run"


@pytest.fixture
def server(run: Path) -> Iterator[Server]:
    with serving(run) as server:
        yield server


def ask(
    server: Server, method: str, path: str, body: Any = None, **headers: str
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


def post(server: Server, what: str, body: Any, **headers: str) -> tuple[int, dict[str, Any]]:
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

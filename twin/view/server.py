"""A small web server of one run, for the browser of this machine's user alone.

It listens on the loopback. Its address holds a token that nobody can guess; requests for another host (a page
that had its name point here) or from another page are refused, as are all paths but its own few.
"""

from __future__ import annotations

import json
import re
import secrets
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from twin import edits
from twin.errors import FuntwinError, InputError
from twin.page.page import html, render
from twin.runs.run_lock import claimed
from twin.storage import load
from twin.view.pixel import pixel_of
from twin.view.work import Work

HOST = "127.0.0.1"
_BODY = 1 << 16  # bytes of a request, far above any edit; chosen by us
_WORD = re.compile(
    r"(--at \d+,\d+@\d+|--interval \d+:\d+)( --interval \d+:\d+)?( --type (hinge|slide))?", re.ASCII
)
_WAITING = (
    '<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="2"><title>Funtwin</title>'
    "<p>The recording is reconstructed again; the page comes when that is done.</p>"
)
# Nothing but what the page itself holds, and this server
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; media-src data:; "
    "connect-src 'self' blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class Server(ThreadingHTTPServer):
    """Serves `run`, one edit at a time. port: 0 takes one that is free.

    Raises InputError for a folder without a twin, and a port that is taken.
    """

    daemon_threads = True

    def __init__(self, run: Path, port: int = 0) -> None:
        if not (run / "twin" / "twin.json").is_file():
            raise InputError(f"{run} holds no twin/twin.json", "give the run folder")
        self.run, self.token = run, secrets.token_urlsafe(24)
        self.writing, self.work = threading.Lock(), Work(run)
        try:
            super().__init__((HOST, port), _Handler)
        except (OSError, OverflowError) as e:
            reason = e.strerror if isinstance(e, OSError) and e.strerror else str(e)
            raise InputError(
                f"port {port} can't be used ({reason})", "give another with --port, or none"
            ) from e

    @property
    def hosts(self) -> tuple[str, ...]:
        """What a browser calls this server."""
        return tuple(f"{name}:{self.server_address[1]}" for name in (HOST, "localhost"))

    @property
    def address(self) -> str:
        return f"http://{self.hosts[0]}/{self.token}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that is gone needs no answer; all else is a bug and is told as one."""
        import sys

        if not isinstance(sys.exc_info()[1], (ConnectionError, TimeoutError)):
            super().handle_error(request, client_address)


@contextmanager
def serving(run: Path, port: int = 0) -> Iterator[Server]:
    """The server, answering in a thread of its own until the end."""
    with Server(run, port) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()
            server.work.end()


class _Handler(BaseHTTPRequestHandler):
    server: Server
    protocol_version = "HTTP/1.1"
    timeout = 30  # s for a request to come whole

    def do_GET(self) -> None:
        if not self._allowed():
            return
        if self._path() == "work":
            self._json(200, self.server.work.state)
            return
        if self.server.work.going_on:
            self._answer(200, _WAITING.encode(), "text/html; charset=utf-8")
            return
        try:
            with self.server.writing, claimed(self.server.run):
                text = html(self.server.run, live=True)
        except FuntwinError as e:  # another process works on it, or changed it meanwhile
            self._answer(409, str(e).encode(), "text/plain; charset=utf-8")
        else:
            self._answer(200, text.encode(), "text/html; charset=utf-8")

    def do_POST(self) -> None:
        if not self._allowed():
            return
        act = {"edit": _edit, "undo": _undo, "say": _say}.get(self._path() or "")
        body = None if act is None else self._body()
        if act is None or body is None:
            return
        try:
            with self.server.writing:
                self.server.work.require_idle()
                with claimed(self.server.run):
                    told = act(self.server.run, body)
                    again = told.pop("again", None)
                    if again is None:
                        render(self.server.run)
                if again is not None:  # the other process claims the run
                    self.server.work.begin(again)
        except FuntwinError as e:
            self._json(409, {"ok": False, "error": str(e)})
        else:
            self._json(200, {"ok": True, **told} | ({} if again is None else {"working": True}))

    def _allowed(self) -> bool:
        """Whether the request comes from this server's own page; else it is refused."""
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
        own = host in self.server.hosts and origin in (None, f"http://{host}")
        if not own or not secrets.compare_digest(self._token().encode(), self.server.token.encode()):
            self._refuse(403, "this is not the address that `twin view` told")
            return False
        if self._path() is None:
            self._refuse(404, "there is nothing here")
            return False
        return True

    def _token(self) -> str:
        return self.path.split("/", 2)[1] if self.path.startswith("/") and self.path.count("/") > 1 else ""

    def _path(self) -> str | None:
        """What is asked for behind the token, None for what this server has not."""
        rest = self.path.split("/", 2)[-1]
        return (
            rest if rest in ({"POST": ("edit", "undo", "say"), "GET": ("", "work")}[self.command]) else None
        )

    def _body(self) -> Mapping[str, Any] | None:
        """The JSON object of a request; None, and an answer, where there is none."""
        if self.headers.get("Content-Type", "").partition(";")[0] != "application/json":
            self._refuse(415, "the body is no JSON")
            return None
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > _BODY:
            self._refuse(413, f"the body has more than {_BODY} bytes, or does not say how many")
            return None
        try:
            told = json.loads(self.rfile.read(int(length)))
        except ValueError:
            told = None
        if not isinstance(told, dict) or not all(isinstance(v, str) for v in told.values()):
            self._refuse(400, "the body is no JSON object of texts")
            return None
        return told

    def _json(self, code: int, data: Mapping[str, Any]) -> None:
        self._answer(code, json.dumps(data).encode(), "application/json")

    def _refuse(self, code: int, why: str) -> None:
        """Answer and hang up: what is left of the request is not read."""
        self.close_connection = True
        self._json(code, {"ok": False, "error": why})

    def _answer(self, code: int, data: bytes, kind: str) -> None:
        self.send_response(code)
        for name, value in {
            "Content-Type": kind, "Content-Length": str(len(data)), "Cache-Control": "no-store",
            "Content-Security-Policy": _POLICY, "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer",
            **({"Connection": "close"} if self.close_connection else {}),
        }.items():  # fmt: skip
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: Any) -> None:
        """Nothing: addresses hold the token."""


Act = Callable[[Path, Mapping[str, Any]], dict[str, Any]]


def _edit(run: Path, told: Mapping[str, Any]) -> dict[str, Any]:
    edit = edits.edit_of(load(run), told.get("part", ""), told.get("edit", ""), told.get("why", ""))
    return {"edit": edit.row, "warnings": edits.add(run, [edit]).warnings}


def _undo(run: Path, _: Mapping[str, Any]) -> dict[str, Any]:
    """A word on the recording is taken back by another reconstruction."""
    undone, made = edits.undo(run)
    again = {"again": ""} if any(e.what == edits.SAID for e in undone) else {}
    return {"undone": [e.row for e in undone], "warnings": made.warnings, **again}


def _say(run: Path, told: Mapping[str, Any]) -> dict[str, Any]:
    """A word on a part: at a pixel of a frame, in which frames it moves, its type; or, of a part that was
    found, its type alone."""
    word = told.get("word", "")
    if told.get("part"):
        word = f"--at {pixel_of(load(run), told['part'])} {word}"
    if not _WORD.fullmatch(word):
        raise InputError(f"{word!r:.80} says nothing of a part", "point at it in the picture")
    return {"again": word}

"""A small web server for the browser of this machine's user alone.

It listens on the loopback. Its address holds a token that nobody can guess; requests for another host (a page
that had its name point here) or from another page are refused, as are all paths but its own few.
"""

from __future__ import annotations

import json
import secrets
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, TypeVar

from twin.errors import FuntwinError, InputError

HOST = "127.0.0.1"
_BODY = 1 << 16  # bytes of a request, far above any edit; chosen by us
# Nothing but what the page itself holds, and this server
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src 'self' data: blob:; "
    "media-src data:; connect-src 'self' blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

HTML, JSON, JPEG = "text/html; charset=utf-8", "application/json", "image/jpeg"
Act = Callable[[Mapping[str, Any]], Mapping[str, Any]]


@dataclass(frozen=True)
class Answer:
    """What a browser gets. kind: the content's type."""

    content: bytes
    kind: str
    status: int = 200


class LocalServer(ThreadingHTTPServer, ABC):
    """Gives pages and takes acts. port: 0 takes one that is free.

    Raises InputError for a port that is taken.
    """

    daemon_threads = True

    def __init__(self, port: int = 0) -> None:
        self.token = secrets.token_urlsafe(24)
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

    @abstractmethod
    def page(self, path: str) -> Answer | None:
        """What lies at a path behind the token, "" first; None where nothing does."""

    @property
    @abstractmethod
    def acts(self) -> Mapping[str, Act]:
        """What may be asked for by POST: each takes an object of texts and gives one."""

    def end(self) -> None:
        """End what the server began."""

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that is gone needs no answer; all else is a bug and is told as one."""
        import sys

        if not isinstance(sys.exc_info()[1], (ConnectionError, TimeoutError)):
            super().handle_error(request, client_address)


S = TypeVar("S", bound=LocalServer)


@contextmanager
def answering(server: S) -> Iterator[S]:
    """The server, answering in a thread of its own until the end."""
    with server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()
            server.end()


class _Handler(BaseHTTPRequestHandler):
    server: LocalServer
    protocol_version = "HTTP/1.1"
    timeout = 30  # s for a request to come whole

    def do_GET(self) -> None:
        if not self._allowed():
            return
        try:
            told = self.server.page(self._path())
        except FuntwinError as e:  # another process works on it, or changed it meanwhile
            told = Answer(str(e).encode(), "text/plain; charset=utf-8", 409)
        if told is None:
            self._refuse(404, "there is nothing here")
            return
        self._answer(told)

    def do_POST(self) -> None:
        if not self._allowed():
            return
        act = self.server.acts.get(self._path())
        if act is None:
            self._refuse(404, "there is nothing here")
            return
        body = self._body()
        if body is None:
            return
        try:
            told = act(body)
        except FuntwinError as e:
            self._json(409, {"ok": False, "error": str(e)})
        else:
            self._json(200, {"ok": True, **told})

    def _allowed(self) -> bool:
        """Whether the request comes from this server's own page; else it is refused."""
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
        own = host in self.server.hosts and origin in (None, f"http://{host}")
        if not own or not secrets.compare_digest(self._token().encode(), self.server.token.encode()):
            self._refuse(403, "this is not the address that was told")
            return False
        return True

    def _token(self) -> str:
        return self.path.split("/", 2)[1] if self.path.startswith("/") and self.path.count("/") > 1 else ""

    def _path(self) -> str:
        """What is asked for behind the token."""
        return self.path.split("/", 2)[-1]

    def _body(self) -> Mapping[str, Any] | None:
        """The JSON object of a request; None, and an answer, where there is none."""
        if self.headers.get("Content-Type", "").partition(";")[0] != JSON:
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

    def _json(self, status: int, data: Mapping[str, Any]) -> None:
        self._answer(Answer(json.dumps(data).encode(), JSON, status))

    def _refuse(self, status: int, why: str) -> None:
        """Answer and hang up: what is left of the request is not read."""
        self.close_connection = True
        self._json(status, {"ok": False, "error": why})

    def _answer(self, told: Answer) -> None:
        self.send_response(told.status)
        for name, value in {
            "Content-Type": told.kind, "Content-Length": str(len(told.content)), "Cache-Control": "no-store",
            "Content-Security-Policy": _POLICY, "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer",
            **({"Connection": "close"} if self.close_connection else {}),
        }.items():  # fmt: skip
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(told.content)

    def log_message(self, *_: Any) -> None:
        """Nothing: addresses hold the token."""

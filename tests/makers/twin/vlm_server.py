"""A chat endpoint on this machine that answers what a test tells it to, and remembers what it was asked."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

KEY = "sk-secret-0123456789abcdef"


def completion(content: Any, **message: Any) -> bytes:
    """What an endpoint sends for an answer of the model."""
    reason = message.pop("finish_reason", "stop")
    choice = {"message": {"role": "assistant", "content": content, **message}, "finish_reason": reason}
    return json.dumps({"choices": [choice]}).encode()


@dataclass
class Reply:
    """One answer: status, body, headers; `delay` s before it, `drip` s between pieces of 20 bytes."""

    body: bytes = b""
    status: int = 200
    headers: dict[str, str] = field(default_factory=dict)
    delay: float = 0.0
    drip: float = 0.0


@dataclass
class Asked:
    path: str
    headers: dict[str, str]
    body: dict[str, Any]


class Server:
    """Gives its replies in turn, the last one again and again."""

    def __init__(self) -> None:
        self.replies: list[Reply] = []
        self.asked: list[Asked] = []
        self.url = ""

    def reply(self, number: int) -> Reply:
        return self.replies[min(number, len(self.replies) - 1)]


@contextmanager
def serving(*replies: Reply) -> Iterator[Server]:
    server = Server()
    server.replies = list(replies)

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            length = int(self.headers.get("Content-Length", 0))
            body = json.loads(self.rfile.read(length))
            server.asked.append(Asked(self.path, dict(self.headers), body))
            reply = server.reply(len(server.asked) - 1)
            time.sleep(reply.delay)
            try:
                self.send_response(reply.status)
                for name, value in {"Content-Length": str(len(reply.body)), **reply.headers}.items():
                    self.send_header(name, value)
                self.end_headers()
                step = 20 if reply.drip else max(1, len(reply.body))
                for k in range(0, len(reply.body), step):
                    self.wfile.write(reply.body[k : k + step])
                    self.wfile.flush()
                    time.sleep(reply.drip)
            except OSError:  # the client went away
                pass

        def log_message(self, *args: Any) -> None:
            """Stay silent."""

    http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.url = f"http://127.0.0.1:{http.server_port}/v1"
    thread = threading.Thread(target=http.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        http.shutdown()
        http.server_close()

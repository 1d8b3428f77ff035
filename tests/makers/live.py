"""Asking a live server as a browser does."""

from __future__ import annotations

import http.client
import json
from typing import Any

from twin.view.local import LocalServer

# an edit that a cabinet takes
UPPER = {"part": "door", "edit": "upper=95deg", "why": "looked"}


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

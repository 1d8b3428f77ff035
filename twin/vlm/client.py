"""One question to an OpenAI-compatible chat endpoint: bounded time and size, one-line errors without the key.

Address, key and model come from the environment: FUNTWIN_VLM_URL, FUNTWIN_VLM_KEY and FUNTWIN_VLM_MODEL.
Where neither of the first two is set, OPENAI_API_KEY goes with OPENAI_BASE_URL (by default OpenAI's own): a
key is only ever sent to the address that it was set for.
"""

from __future__ import annotations

import base64
import ipaddress
import json
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

from twin.errors import InputError, MissingDependencyError, ServiceError
from twin.packages import to_install

NO_KEY = "none"  # the key of a server that wants none
_OPENAI = "https://api.openai.com/v1"
_AGAIN = (408, 429, 500, 502, 503, 504)  # answers that another attempt may better
_SECRET = 8  # characters; keys are longer, and stand-ins for servers that want none are often shorter
_TOLD = 200  # most characters of a server's own message in an error


@dataclass(frozen=True)
class Endpoint:
    """Where questions go. `url` is the full address of /chat/completions; the key is never shown."""

    url: str
    model: str
    key: str = field(repr=False)

    def __post_init__(self) -> None:
        try:
            parts = urlsplit(self.url)
            host, _ = parts.hostname or "", parts.port
        except ValueError:
            parts, host = urlsplit(""), ""
        if parts.scheme not in ("http", "https") or not host or parts.username or parts.password:
            raise InputError(
                "the address of the model is not a plain http(s) address",
                "set FUNTWIN_VLM_URL to something like https://host/v1, without a name or key in it",
            )
        if not self.key or not self.key.isascii() or not self.key.isprintable() or " " in self.key:
            raise InputError(
                "the key of the model holds characters that no key has", "set FUNTWIN_VLM_KEY again"
            )
        if parts.scheme == "http" and self.key != NO_KEY and not _is_loopback(host):
            raise InputError(
                f"{host} would be sent the key in the clear (http)",
                f"use https, or FUNTWIN_VLM_KEY={NO_KEY} for a server that wants no key",
            )
        if not self.model.strip() or not self.model.isprintable():
            raise InputError("no model is named", "name it with --model or FUNTWIN_VLM_MODEL")

    @property
    def place(self) -> str:
        """Host and path without query, for messages and the cache."""
        parts = urlsplit(self.url)
        port = f":{parts.port}" if parts.port else ""
        return f"{parts.scheme}://{parts.hostname}{port}{parts.path}"


@dataclass(frozen=True)
class Limits:
    """Bounds of one question, chosen by us. connect, read: s without a sign of life. total: s for all
    attempts. attempts: when the server is busy or fails. pause: s before the second attempt, doubled for each
    further one; a server that names a longer wait gets at most `longest_pause`. max_bytes: of the answer."""

    connect: float = 10.0
    read: float = 120.0
    total: float = 240.0
    attempts: int = 3
    pause: float = 1.0
    longest_pause: float = 20.0
    max_bytes: int = 1_000_000


DEFAULT = Limits()


def endpoint_from_environment(model: str | None = None, environ: Mapping[str, str] | None = None) -> Endpoint:
    """The endpoint that the environment names. Raises InputError if key, address or model is missing."""
    env = os.environ if environ is None else environ
    if env.get("FUNTWIN_VLM_URL") or env.get("FUNTWIN_VLM_KEY"):
        url, key = env.get("FUNTWIN_VLM_URL"), env.get("FUNTWIN_VLM_KEY")
        if not url or not key:
            have, lack = (
                ("FUNTWIN_VLM_KEY", "FUNTWIN_VLM_URL") if key else ("FUNTWIN_VLM_URL", "FUNTWIN_VLM_KEY")
            )
            raise InputError(
                f"{have} is set but {lack} is not",
                f"export both; FUNTWIN_VLM_KEY={NO_KEY} for a server that wants no key",
            )
    else:
        url, key = env.get("OPENAI_BASE_URL") or _OPENAI, env.get("OPENAI_API_KEY")
        if not key:
            raise InputError(
                "no key for a vision-language model is set",
                "export FUNTWIN_VLM_KEY and FUNTWIN_VLM_URL, or OPENAI_API_KEY",
            )
    name = model or env.get("FUNTWIN_VLM_MODEL") or ""
    address, mark, query = url.strip().partition("?")
    address = address.rstrip("/").removesuffix("/chat/completions")
    return Endpoint(f"{address}/chat/completions{mark}{query}", name, key.strip())


@dataclass(frozen=True)
class Question:
    """What is asked: instructions, text, and pictures as JPEG bytes in the order of the text."""

    instructions: str
    text: str
    pictures: tuple[bytes, ...]

    def body(self, model: str) -> bytes:
        """The request as JSON. Only what every compatible server takes: no temperature, no token limits."""
        content: list[dict[str, Any]] = [{"type": "text", "text": self.text}]
        for jpeg in self.pictures:
            data = f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"
            content.append({"type": "image_url", "image_url": {"url": data}})
        messages = [
            {"role": "system", "content": self.instructions},
            {"role": "user", "content": content},
        ]
        return json.dumps({"model": model, "messages": messages}).encode()


def ask(question: Question, endpoint: Endpoint, limits: Limits = DEFAULT) -> str:
    """The model's answer as text.

    ServiceError: no connection, slow, long, refused or no answer. MissingDependencyError: no extra `vlm`.
    """
    httpx = _httpx()
    deadline = time.monotonic() + limits.total
    body = question.body(endpoint.model)
    timeout = httpx.Timeout(limits.read, connect=limits.connect)
    # TLS is verified by default. Proxies of the environment never see what may go in the clear.
    encrypted = endpoint.url.startswith("https:")
    with httpx.Client(timeout=timeout, follow_redirects=False, trust_env=encrypted) as client:
        for attempt in range(1, limits.attempts + 1):
            problem, wait = "", None
            try:
                status, wait, data = _post(client, endpoint, body, deadline, limits)
            except httpx.TimeoutException:
                raise _too_slow(endpoint, limits) from None
            except (httpx.HTTPError, httpx.InvalidURL) as e:
                problem = f"{endpoint.place} can't be reached: {_plain(str(e), endpoint)}"
            else:
                if status == 200:
                    return _content(data, endpoint)
                problem = _refusal(status, data, endpoint)
                if status not in _AGAIN:
                    raise ServiceError(problem, _remedy(status))
            pause = limits.pause * 2 ** (attempt - 1) if wait is None else wait
            pause = min(pause, limits.longest_pause)
            if attempt == limits.attempts or time.monotonic() + pause > deadline:
                raise ServiceError(
                    f"{problem} (attempt {attempt})", "check address and network, or try later"
                )
            time.sleep(pause)
    raise AssertionError("unreachable")


def _post(
    client: Any, endpoint: Endpoint, body: bytes, deadline: float, limits: Limits
) -> tuple[int, float | None, bytes]:
    """Status, the wait that the server asks for, and the answer's bytes."""
    headers = {
        "Content-Type": "application/json",
        "Accept": "application/json",
        "Accept-Encoding": "identity",
    }
    if endpoint.key != NO_KEY:
        headers["Authorization"] = f"Bearer {endpoint.key}"
    data = bytearray()
    with client.stream("POST", endpoint.url, content=body, headers=headers) as response:
        for chunk in response.iter_raw():
            data += chunk
            if len(data) > limits.max_bytes:
                raise ServiceError(
                    f"{endpoint.place} answers with more than {limits.max_bytes} bytes",
                    "check that the address is that of a chat endpoint",
                )
            if time.monotonic() > deadline:
                raise _too_slow(endpoint, limits)
        after = response.headers.get("retry-after", "")
        wait = float(after) if after.isdecimal() and len(after) < 6 else None
        return int(response.status_code), wait, bytes(data)


def _too_slow(endpoint: Endpoint, limits: Limits) -> ServiceError:
    return ServiceError(
        f"{endpoint.place} did not answer in time ({limits.read:g} s of silence, {limits.total:g} s in all)",
        "try again later or another model",
    )


def _content(data: bytes, endpoint: Endpoint) -> str:
    """The text of the first choice of a chat completion."""
    try:
        choice = json.loads(data)["choices"][0]
        message = choice["message"]
        content, why = message.get("content"), choice.get("finish_reason")
        refusal = message.get("refusal")
    except (ValueError, LookupError, TypeError, AttributeError):
        raise ServiceError(
            f"{endpoint.place} does not answer as a chat endpoint does: {_plain(data.decode(errors='replace'), endpoint)}",
            "check FUNTWIN_VLM_URL; it usually ends in /v1",
        ) from None
    if refusal or why == "content_filter":
        told = _plain(str(refusal or "content filter"), endpoint)
        raise ServiceError(f"{endpoint.model} refuses to answer: {told}", "use another picture or model")
    if why == "length":
        raise ServiceError(f"the answer of {endpoint.model} was cut off", "use a model with longer answers")
    if isinstance(content, list):
        content = "".join(str(c.get("text", "")) for c in content if isinstance(c, dict))
    if not isinstance(content, str) or not content.strip():
        raise ServiceError(f"the answer of {endpoint.model} is empty", "try again or another model")
    return _without_key(content, endpoint)


def _refusal(status: int, data: bytes, endpoint: Endpoint) -> str:
    """What an HTTP status other than 200 means."""
    if 300 <= status < 400:
        return f"{endpoint.place} redirects (HTTP {status}), which is not followed"
    meaning = {
        401: "refuses the key",
        403: "refuses the key",
        404: f"knows no model {endpoint.model!r} or is no chat endpoint",
        413: "finds the picture too large",
        429: "is busy or its quota is used up",
    }.get(status, "fails" if status >= 500 else "refuses the request")
    return f"{endpoint.place} {meaning} (HTTP {status}){_server_message(data, endpoint)}"


def _remedy(status: int) -> str:
    remedies = {
        401: "check FUNTWIN_VLM_KEY",
        403: "check FUNTWIN_VLM_KEY",
        404: "check FUNTWIN_VLM_URL and --model",
    }
    return remedies.get(status, "check FUNTWIN_VLM_URL, --model and what the server says")


def _server_message(data: bytes, endpoint: Endpoint) -> str:
    """The server's own message, if it gives one."""
    try:
        error = json.loads(data)["error"]
        text = error["message"] if isinstance(error, dict) else error
    except (ValueError, LookupError, TypeError):
        return ""
    return f": {_plain(text, endpoint)}" if isinstance(text, str) and text else ""


def _plain(text: str, endpoint: Endpoint) -> str:
    """Foreign text for a message: without the key, of one line, not long."""
    text = "".join(c if c.isprintable() else " " for c in _without_key(text, endpoint))
    return text if len(text) <= _TOLD else f"{text[:_TOLD]} ..."


def _without_key(text: str, endpoint: Endpoint) -> str:
    """Text from the server, which may repeat the key. A word shorter than any real key is no secret."""
    return text.replace(endpoint.key, "[key]") if len(endpoint.key) >= _SECRET else text


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _httpx() -> Any:
    try:
        import httpx
    except ImportError as e:
        raise MissingDependencyError(
            f"asking a vision-language model needs httpx, which can't be imported ({e})",
            to_install("httpx", "vlm"),
        ) from None
    return httpx

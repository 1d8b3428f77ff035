"""The chat client against a server on this machine: good, malformed, refused, slow and oversized answers."""

from __future__ import annotations

import json
import logging
import sys
import time
import traceback
from pathlib import Path

import pytest

pytest.importorskip("httpx", reason="needs the extra vlm")

from tests.makers.twin.vlm_server import KEY, Reply, completion, serving
from twin.errors import FuntwinError, InputError, MissingDependencyError, ServiceError
from twin.vlm.cache import ask_once, question_key
from twin.vlm.client import Endpoint, Limits, Question, ask, endpoint_from_environment

QUESTION = Question("estimate", "the door", (b"\xff\xd8 no real picture",))
QUICK = Limits(connect=2, read=0.5, total=3, attempts=3, pause=0.01, longest_pause=0.02, max_bytes=5000)


@pytest.fixture(autouse=True)
def proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A proxy that nobody runs: what goes to this machine in the clear must not go there."""
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")
    monkeypatch.setenv("ALL_PROXY", "http://127.0.0.1:9")
    monkeypatch.setenv("NO_PROXY", "")


def endpoint(url: str, model: str = "seer-1") -> Endpoint:
    return endpoint_from_environment(model, {"FUNTWIN_VLM_URL": url, "FUNTWIN_VLM_KEY": KEY})


def test_a_question_is_sent_once_with_key_picture_and_model() -> None:
    with serving(Reply(completion("four kilograms"))) as server:
        assert ask(QUESTION, endpoint(server.url), QUICK) == "four kilograms"
    (asked,) = server.asked
    assert asked.path == "/v1/chat/completions"
    assert asked.headers["Authorization"] == f"Bearer {KEY}"
    assert asked.body["model"] == "seer-1"
    system, user = asked.body["messages"]
    assert system == {"role": "system", "content": "estimate"}
    assert user["content"][0] == {"type": "text", "text": "the door"}
    assert user["content"][1]["image_url"]["url"].startswith("data:image/jpeg;base64,/9gg")
    assert set(asked.body) == {"model", "messages"}, "other fields are refused by some servers"


def test_a_server_without_key_gets_none() -> None:
    with serving(
        Reply(completion([{"type": "text", "text": "fo"}, {"type": "text", "text": "ur"}]))
    ) as server:
        keyless = endpoint_from_environment("m", {"FUNTWIN_VLM_URL": server.url, "FUNTWIN_VLM_KEY": "none"})
        assert ask(QUESTION, keyless, QUICK) == "four"
    assert "Authorization" not in server.asked[0].headers


@pytest.mark.parametrize(
    ("reply", "message", "attempts"),
    [
        (Reply(b'{"error": {"message": "bad key sk-secret-0123456789abcdef"}}', 401), "refuses the key .HTTP 401", 1),
        (Reply(b"", 403), "refuses the key .HTTP 403", 1),
        (Reply(b'{"error": "no such model"}', 404), "knows no model 'seer-1'.*no such model", 1),
        (Reply(b"<html>", 400), r"refuses the request \(HTTP 400\)", 1),
        (Reply(b"", 429), r"quota is used up \(HTTP 429\) \(attempt 3\)", 3),
        (Reply(b"", 429, {"Retry-After": "999999"}), "quota", 3),
        (Reply(b"", 500), r"fails \(HTTP 500\) \(attempt 3\)", 3),
        (Reply(b"", 302, {"Location": "http://elsewhere.example/v1"}), "redirects .HTTP 302., which is not", 1),
        (Reply(completion(None, refusal="I can't look at homes")), "refuses to answer: I can't look at homes", 1),
        (Reply(completion("", finish_reason="content_filter")), "refuses to answer: content filter", 1),
        (Reply(completion("{", finish_reason="length")), "was cut off", 1),
        (Reply(completion("  ")), "is empty", 1),
        (Reply(completion(7)), "is empty", 1),
        (Reply(b"<html>Welcome</html>"), "does not answer as a chat endpoint does: <html>Welcome", 1),
        (Reply(b'{"choices": []}'), "does not answer as a chat endpoint", 1),
        (Reply(b"[1]"), "does not answer as a chat endpoint", 1),
        (Reply(completion("x" * 9000)), "more than 5000 bytes", 1),
        (Reply(completion("late"), delay=1.5), "did not answer in time", 1),
    ],
)  # fmt: skip
def test_what_goes_wrong_is_one_line_without_the_key(
    reply: Reply, message: str, attempts: int, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    with serving(reply) as server, pytest.raises(ServiceError, match=message) as caught:
        ask(QUESTION, endpoint(server.url), QUICK)
    assert len(server.asked) == attempts
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500
    told = "".join(traceback.format_exception(caught.value)) + repr(caught.value) + caplog.text
    assert KEY not in told


def test_a_server_that_drips_is_left_after_the_total_time() -> None:
    start = time.monotonic()
    limits = Limits(connect=2, read=0.5, total=0.6, attempts=1, pause=0.01, max_bytes=100_000)
    with (
        serving(Reply(completion("x" * 2000), drip=0.1)) as server,
        pytest.raises(ServiceError, match="in time"),
    ):
        ask(QUESTION, endpoint(server.url), limits)
    assert time.monotonic() - start < 3.0


def test_a_busy_server_is_asked_again() -> None:
    with serving(Reply(b"", 503), Reply(b"", 429, {"Retry-After": "0"}), Reply(completion("4"))) as server:
        assert ask(QUESTION, endpoint(server.url), QUICK) == "4"
    assert len(server.asked) == 3


def test_nobody_listening_is_one_line() -> None:
    with serving(Reply()) as server:
        url = server.url
    with pytest.raises(ServiceError, match="can't be reached"):
        ask(QUESTION, endpoint(url), QUICK)


def test_an_untrusted_certificate_is_not_accepted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A TLS server with a certificate of its own making: nothing is sent to it."""
    monkeypatch.delenv("ALL_PROXY")
    import ssl
    import subprocess

    pem, key = tmp_path / "c.pem", tmp_path / "k.pem"
    made = subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=127.0.0.1",
         "-addext", "subjectAltName=IP:127.0.0.1", "-out", str(pem), "-keyout", str(key)],
        capture_output=True, check=False,
    )  # fmt: skip
    if made.returncode:
        pytest.skip("openssl can't make a certificate here")
    with serving(Reply(completion("4"))) as plain:
        from http.server import ThreadingHTTPServer
        from threading import Thread

        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(pem, key)
        asked: list[object] = []

        class Server(ThreadingHTTPServer):
            def finish_request(self, request: object, _: object) -> None:
                asked.append(request)

        http = Server(("127.0.0.1", 0), None)  # type: ignore[arg-type]
        http.socket = context.wrap_socket(http.socket, server_side=True)
        Thread(target=http.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
        try:
            with pytest.raises(ServiceError, match=r"can't be reached.*[Cc]ertificate"):
                ask(QUESTION, endpoint(f"https://127.0.0.1:{http.server_port}/v1"), QUICK)
        finally:
            http.shutdown()
            http.server_close()
        assert asked == []
        assert plain.asked == []


@pytest.mark.parametrize(
    ("environ", "message"),
    [
        ({}, "no key for a vision-language model is set"),
        ({"FUNTWIN_VLM_URL": "https://h/v1"}, "FUNTWIN_VLM_KEY is not"),
        ({"FUNTWIN_VLM_URL": "https://h/v1", "OPENAI_API_KEY": KEY}, "FUNTWIN_VLM_KEY is not"),
        ({"FUNTWIN_VLM_KEY": KEY, "OPENAI_BASE_URL": "https://h/v1"}, "FUNTWIN_VLM_URL is not"),
        ({"FUNTWIN_VLM_URL": "http://h/v1", "FUNTWIN_VLM_KEY": KEY}, "in the clear"),
        ({"FUNTWIN_VLM_URL": "ftp://h/v1", "FUNTWIN_VLM_KEY": KEY}, "no.? ?.*plain http"),
        ({"FUNTWIN_VLM_URL": f"https://me:{KEY}@h/v1", "FUNTWIN_VLM_KEY": KEY}, "plain http"),
        ({"FUNTWIN_VLM_URL": "https://h:port/v1", "FUNTWIN_VLM_KEY": KEY}, "plain http"),
        ({"OPENAI_API_KEY": f"{KEY}\nX-Evil: 1"}, "characters that no key has"),
    ],
)
def test_what_the_environment_lacks_is_one_line(environ: dict[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        endpoint_from_environment("m", environ)
    assert KEY not in str(caught.value)
    with pytest.raises(InputError, match="no model is named"):
        endpoint_from_environment(None, {"OPENAI_API_KEY": KEY})


def test_a_key_goes_only_to_its_own_address() -> None:
    openai = endpoint_from_environment("m", {"OPENAI_API_KEY": KEY})
    assert openai.url == "https://api.openai.com/v1/chat/completions"
    both = {"OPENAI_API_KEY": "sk-openai-000", "FUNTWIN_VLM_URL": "https://h/v1/", "FUNTWIN_VLM_KEY": KEY}
    own = endpoint_from_environment("m", both)
    assert (own.url, own.key) == ("https://h/v1/chat/completions", KEY)
    assert KEY not in repr(own)
    versioned = {"FUNTWIN_VLM_URL": "https://h/v1/?version=2", "FUNTWIN_VLM_KEY": KEY}
    assert endpoint_from_environment("m", versioned).url == "https://h/v1/chat/completions?version=2"
    assert "secret" not in Endpoint("https://h:8/v1?token=secret", "m", KEY).place


def test_an_answer_is_kept_and_asked_once(tmp_path: Path) -> None:
    with serving(Reply(completion(f"4 says {KEY}"))) as server:
        here = endpoint(server.url)
        first = ask_once(QUESTION, here, str.upper, tmp_path / "vlm", limits=QUICK)
        again = ask_once(QUESTION, here, str.upper, tmp_path / "vlm", limits=QUICK)
        assert (first.cached, again.cached) == (False, True)
        assert first.value == again.value == "4 SAYS [KEY]"
        assert len(server.asked) == 1
        assert not ask_once(QUESTION, here, str, tmp_path / "vlm", refresh=True, limits=QUICK).cached
        other = Question("estimate", "the door", (b"another picture",))
        assert not ask_once(other, here, str, tmp_path / "vlm", limits=QUICK).cached
        assert not ask_once(
            QUESTION, endpoint(server.url, "seer-2"), str, tmp_path / "vlm", limits=QUICK
        ).cached
        files = sorted((tmp_path / "vlm").iterdir())
        assert len(files) == 3
        for file in files:
            assert KEY not in file.read_text()
        record = json.loads((tmp_path / "vlm" / f"{question_key(QUESTION, here)}.json").read_text())
        assert record["model"] == "seer-1"
        (tmp_path / "vlm" / f"{question_key(QUESTION, here)}.json").write_text("{ torn")
        assert not ask_once(QUESTION, here, str, tmp_path / "vlm", limits=QUICK).cached


def test_an_answer_that_can_not_be_used_is_not_kept(tmp_path: Path) -> None:
    def read(text: str) -> str:
        raise ServiceError("no")

    with serving(Reply(completion("nonsense"))) as server:
        for _ in range(2):
            with pytest.raises(ServiceError):
                ask_once(QUESTION, endpoint(server.url), read, tmp_path / "vlm", limits=QUICK)
        assert len(server.asked) == 2
    assert list(tmp_path.rglob("*.json")) == []


def test_without_the_extra_its_name_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "httpx", None)
    with pytest.raises(MissingDependencyError, match=r"install the package httpx.*extra `vlm`") as caught:
        ask(QUESTION, Endpoint("https://h/v1", "m", KEY), QUICK)
    assert isinstance(caught.value, FuntwinError)

"""A real browser without a window, by the DevTools protocol: Chromium as the system has it."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
# WebGL by the processor; nothing asks its maker's hosts
OPTIONS = [
    "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
    "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--hide-scrollbars", "--remote-debugging-port=0", "--remote-allow-origins=*",
]  # fmt: skip


class Tab:
    """One page of a browser. events: all that the browser told, as DevTools has it."""

    def __init__(self, socket: Any) -> None:
        self._socket, self._count = socket, 0
        self.events: list[dict[str, Any]] = []
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        self._count += 1
        self._socket.send(json.dumps({"id": self._count, "method": method, "params": params}))
        while True:
            answer: dict[str, Any] = json.loads(self._socket.recv(timeout=60))
            if answer.get("id") == self._count:
                assert "error" not in answer, answer
                return answer["result"]
            self.events.append(answer)

    def size(self, width: int, height: int) -> None:
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )

    def open(self, address: str) -> None:
        """Go there and wait until it has loaded."""
        self.events.clear()
        self.call("Page.navigate", url=address)
        while not any(e.get("method") == "Page.loadEventFired" for e in self.events):
            self.events.append(json.loads(self._socket.recv(timeout=60)))

    def follow(self, code: str) -> None:
        """Run what makes the page come anew, and wait for it."""
        self.events.clear()
        self.run(code)
        while not any(e.get("method") == "Page.loadEventFired" for e in self.events):
            self.events.append(json.loads(self._socket.recv(timeout=60)))

    def until(self, code: str, patience: float = 30.0) -> Any:
        """The first value of an expression that is not empty."""
        end = time.monotonic() + patience
        while not (value := self.run(code)):
            assert time.monotonic() < end, code
            time.sleep(0.05)
        return value

    def run(self, code: str) -> Any:
        """The value of an expression, awaited."""
        done = self.call("Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in done, done["exceptionDetails"]
        return done["result"].get("value")

    def picture(self, selector: str = "") -> NDArray[np.uint8]:
        """What is seen (H, W, 3) RGB, of the whole window or of one element."""
        import cv2

        clip: dict[str, Any] = {}
        if selector:
            box = self.run(f"(() => {{const b = document.querySelector({selector!r}).getBoundingClientRect();"
                           " return {x: b.x, y: b.y, width: b.width, height: b.height};})()")  # fmt: skip
            clip = {"clip": {**box, "scale": 1}}
        data = base64.b64decode(self.call("Page.captureScreenshot", format="png", **clip)["data"])
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        assert image is not None
        return np.asarray(image[:, :, ::-1], dtype=np.uint8)

    @property
    def complaints(self) -> list[Any]:
        """Exceptions, and errors and warnings in the console."""
        return [
            e["params"] for e in self.events
            if e.get("method") == "Runtime.exceptionThrown"
            or (e.get("method") == "Log.entryAdded" and e["params"]["entry"]["level"] in ("error", "warning"))
            or (e.get("method") == "Runtime.consoleAPICalled" and e["params"]["type"] in ("error", "warning"))
        ]  # fmt: skip

    @property
    def asked(self) -> list[str]:
        """Addresses that were asked for."""
        return [
            e["params"]["request"]["url"]
            for e in self.events
            if e.get("method") == "Network.requestWillBeSent"
        ]


def missing() -> str:
    """What this machine lacks to drive a browser; empty if nothing."""
    if find_spec("websockets") is None:
        return "the package websockets is not installed"
    return "" if _program() else "no Chromium is installed"


def _program() -> str | None:
    return next((p for p in map(shutil.which, NAMES) if p), None)


@contextmanager
def browser(profile: Path, *options: str) -> Iterator[Tab]:
    """A tab of a browser with an empty profile. Raises FileNotFoundError where there is none."""
    program = _program()
    if program is None:
        raise FileNotFoundError(missing())
    from websockets.sync import client

    words = [program, *OPTIONS, *options, f"--user-data-dir={profile}", "about:blank"]
    with subprocess.Popen(words, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as process:
        try:
            address = f"http://127.0.0.1:{_port(profile / 'DevToolsActivePort')}/json"
            with urllib.request.urlopen(address, timeout=30) as told:
                (target,) = [t for t in json.load(told) if t["type"] == "page"]
            with client.connect(target["webSocketDebuggerUrl"], max_size=None) as socket:
                yield Tab(socket)
        finally:
            process.kill()


def _port(told: Path, patience: float = 60.0) -> int:
    """The port that the browser writes into its profile when it listens."""
    until = time.monotonic() + patience
    while time.monotonic() < until:
        if told.is_file() and len(lines := told.read_text(encoding="utf-8").splitlines()) > 1:
            return int(lines[0])
        time.sleep(0.05)
    raise TimeoutError(f"no browser listens after {patience:g} s")

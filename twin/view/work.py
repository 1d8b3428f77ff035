"""A reconstruction that goes on with a run in a process of its own, as the page asks for one."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twin.errors import InputError
from twin.files.text import read_json
from twin.runs.manifest import MANIFEST, opened_with
from twin.runs.stages import CONFIG

_DONE = (0, 2)  # a twin was made, trusted or not
_WARNING = "warning: "


class Work:
    """At most one reconstruction of a run at a time."""

    def __init__(self, run: Path) -> None:
        self.run = run
        self._process: subprocess.Popen[str] | None = None
        self._lines: list[str] = []
        self._reader: threading.Thread | None = None

    def begin(self, word: str = "") -> None:
        """Reconstruct the run's recording again, with one more word on it.

        word: options of `twin reconstruct`. Raises InputError where one is going on, and where the recording
        does not lie where the run has it from.
        """
        self.require_idle()
        command = again(self.run, word.split())
        self._lines = []
        environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
        self._process = subprocess.Popen(  # noqa: S603
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True,
            errors="replace", env=environment, cwd=tempfile.gettempdir(),
        )  # fmt: skip
        self._reader = threading.Thread(target=self._read, args=(self._process,), daemon=True)
        self._reader.start()

    def require_idle(self) -> None:
        """Raises InputError while a reconstruction is going on, which has the run to itself."""
        if self.going_on:
            raise InputError("a reconstruction is going on", "wait for its end")

    def _read(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with process.stdout as told:
            self._lines.extend(line.strip() for line in told)
        process.wait()

    @property
    def going_on(self) -> bool:
        return self._reader is not None and self._reader.is_alive()

    @property
    def state(self) -> dict[str, Any]:
        """JSON types: whether it is going on, how far it is, its error, warnings of what was not found."""
        lines, going_on = list(self._lines), self.going_on
        code = None if self._process is None or going_on else self._process.returncode
        failed = code is not None and code not in _DONE
        last = next((line for line in reversed(lines) if line), "")
        return {
            "running": going_on,
            "line": last if going_on else "",
            "error": (last or f"it ended with code {code}") if failed else "",
            "warnings": [
                t.removeprefix(_WARNING)
                for t in lines
                if t.startswith(_WARNING) and "no part was found for" in t
            ],
        }

    def end(self) -> None:
        """End what is going on; its finished stages stay."""
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
        if self._reader is not None:
            self._reader.join(timeout=30)


def again(run: Path, words: Sequence[str]) -> list[str]:
    """The command that reconstructs a run's recording again as it was, with further options.

    Raises InputError for a run that has no recording any more.
    """
    place = read_json(run / MANIFEST).get("recording")
    if not isinstance(place, str) or not (run / place).exists():
        where = f"{run} was made from no recording" if not isinstance(place, str) else f"{place} is not there"
        raise InputError(f"{where}, seen from the run", "run twin reconstruct RECORDING -o RUN yourself")
    config = ["--config", str((run / CONFIG).resolve())] if (run / CONFIG).is_file() else []
    opening = _options(opened_with(run))
    out = ["-o", str(run.resolve())]
    return [
        sys.executable,
        "-m",
        "twin",
        "reconstruct",
        str((run / place).resolve()),
        *out,
        *config,
        *opening,
        *words,
    ]


def _options(opened: Mapping[str, Any]) -> list[str]:
    """Keywords of `recon.open_recording` as the command line has them; = keeps negative values together."""
    return [
        f"--{name.replace('_', '-')}={value.resolve() if isinstance(value, Path) else value}"
        for name, value in opened.items()
        if value is not None
    ]

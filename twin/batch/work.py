"""One unit at work: its verbs one after the other, each a process that is watched."""

from __future__ import annotations

import ctypes
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from twin.batch.units import Unit
from twin.files.room import FULL, full
from twin.files.text import read_json

VERBS = ("reconstruct", "evaluate", "export", "check", "replay")
LOOK = 0.2  # s between two looks at a process; a unit takes a minute or more
SHARE = 0.9  # of the memory that a machine has to give, for all units on it together; chosen by us
PROGRAM = (sys.executable, "-m", "twin")
_LOOKS = 50  # the time between two looks at all processes, in times of a look; chosen by us
_PAGE_KB = os.sysconf("SC_PAGE_SIZE") / 1024
_TAIL = 4000  # characters of what a process said that are looked at for its error
_KILLED = ", from outside, as the system does where memory lacks; give --retry failed"
_DIES_WITH_ITS_PARENT = 1  # PR_SET_PDEATHSIG of prctl(2)
_LIBC = ctypes.CDLL(None, use_errno=True)


@dataclass(frozen=True)
class Limits:
    """Of one unit. seconds: of wall clock, memory_mb: of all its processes together, threads: of each."""

    seconds: float
    memory_mb: float
    threads: int


@dataclass
class Work:
    """A unit whose verbs are carried out in `folder`/runs/ID.

    It is driven by `step`, which never waits. program: what is called with each verb.
    """

    unit: Unit
    folder: Path
    verbs: Sequence[str]
    options: Sequence[str]
    limits: Limits
    program: Sequence[str] = field(default_factory=lambda: PROGRAM)
    steps: dict[str, dict[str, Any]] = field(default_factory=dict)
    peak_mb: float = 0.0
    error: str = ""
    _began: float = field(default_factory=time.monotonic)
    _verb_began: float = 0.0
    _process: subprocess.Popen[bytes] | None = None
    _verb: str = ""

    @property
    def run(self) -> Path:
        return self.folder / "runs" / self.unit.id

    @property
    def recording(self) -> Path:
        return self.unit.recording or self.folder / "recordings" / self.unit.id

    @property
    def seconds(self) -> float:
        return time.monotonic() - self._began

    @property
    def doing(self) -> str:
        """The verb that is at work."""
        return self._verb

    def step(self) -> bool:
        """Look after the process, or begin the next one; False when all is done."""
        if self._process is None:
            return self._begin()
        self._watch()
        code = self._process.poll()
        if code is None:
            return True
        self._ended(code)
        return self._begin()

    def stop(self) -> None:
        """End the process and all that it began."""
        if self._process is None:
            return
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._process = None

    @property
    def code(self) -> int:
        """The exit code of the unit: 1 if a verb failed or was ended, else 2 if one says so, else 0."""
        codes = [s["exit"] for s in self.steps.values()]
        return 1 if self.error or any(c not in (0, 2) for c in codes) else max(codes, default=0)

    @property
    def verdict(self) -> str:
        """trusted, doubtful or refused; empty if there is no twin."""
        return str(self._twin().get("level", ""))

    @property
    def reasons(self) -> list[str]:
        """Types of the reasons of the verdict, the parts' own among them."""
        return [
            str(r.get("values", {}).get("sort", r.get("type", ""))) for r in self._twin().get("reasons", [])
        ]

    def _twin(self) -> dict[str, Any]:
        told = read_json(self.run / "twin" / "twin.json").get("verdict")
        return told if isinstance(told, dict) else {}

    def _commands(self) -> dict[str, list[str]]:
        """What each verb is called with, in their order; evaluate where there is a truth."""
        run, recording = str(self.run), str(self.recording)
        told: dict[str, list[str]] = {}
        if self.unit.rendered and not (self.recording / "truth" / "truth.json").is_file():
            told["simulate"] = [*self.unit.rendered, "-o", recording]
        every = {"reconstruct": [recording, "-o", run, *self.options], **{v: [run] for v in VERBS[1:]}}
        truths = [p for p in (self.recording / "truth", self.run / "truth") if (p / "truth.json").is_file()]
        truth = self.recording / "truth" if self.unit.rendered else next(iter(truths), None)
        every["evaluate"] = [run, "--truth", str(truth)]
        wanted = [v for v in VERBS if v in self.verbs and (v != "evaluate" or truth is not None)]
        return told | {v: every[v] for v in wanted}

    def _begin(self) -> bool:
        left = [v for v in self._commands() if v not in self.steps]
        if self.error or not left:
            return False
        self._verb = left[0]
        try:
            self._start()
        except OSError as e:
            self.error = f"{self._verb}: {self._of_system(e)}"
            return False
        return True

    def _start(self) -> None:
        self._log(self._verb).parent.mkdir(parents=True, exist_ok=True)
        words = [*self.program, self._verb, *self._commands()[self._verb], "--json"]
        threads = str(self.limits.threads)
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "PYTHONUNBUFFERED": "1"}
        self._verb_began = time.monotonic()
        with self._log(self._verb).open("wb") as log, self._log(self._verb, ".json").open("wb") as out:
            self._process = subprocess.Popen(  # noqa: S603
                words, stdout=out, stderr=log, stdin=subprocess.DEVNULL, env=environment,
                start_new_session=True, preexec_fn=_dies_with_its_parent,
            )  # fmt: skip

    def _of_system(self, error: OSError) -> str:
        """Why a process could not be begun."""
        if error.errno in FULL:
            return self._full()
        return f"{error.filename or self.program[0]}: {error.strerror}; check {self.folder}"

    def _full(self) -> str:
        return f"the disk of {self.folder} is full; free some space, then give --retry failed"

    def _log(self, verb: str, end: str = ".log") -> Path:
        return self.folder / "logs" / self.unit.id / f"{verb}{end}"

    def _watch(self) -> None:
        assert self._process is not None
        used = _HELD.by(self._process.pid)
        self.peak_mb = max(self.peak_mb, used)
        if used > self.limits.memory_mb:
            self.error = (
                f"too large for this machine: {self._verb} took more than {self.limits.memory_mb:.0f} MB"
            )
        elif self.seconds > self.limits.seconds:
            self.error = f"{self._verb} was ended after {self.limits.seconds:.0f} s"
        if self.error:
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)

    def _ended(self, code: int) -> None:
        with suppress(ProcessLookupError):  # what it left behind
            os.killpg(self._process.pid, signal.SIGKILL)  # type: ignore[union-attr]
        self._process = None
        self.steps[self._verb] = {"exit": code, "seconds": round(time.monotonic() - self._verb_began, 2)}
        if code not in (0, 2) and not self.error:
            self.error = self._said(code)

    def _said(self, code: int) -> str:
        """The line in which a process told why it ended; a full disk may have taken nothing or half of it."""
        text = self._log(self._verb).read_text(encoding="utf-8", errors="replace")[-_TAIL:]
        lines = [line for line in text.splitlines(keepends=True) if line.strip()]
        whole = [t.strip() for t in lines if t.endswith("\n")]
        told = next((t.removeprefix("twin: ") for t in reversed(whole) if t.startswith("twin: ")), "")
        if not told and full(self.folder):
            told = self._full()
        if not told and code < 0:
            told = f"was ended by signal {-code}{_KILLED if -code == signal.SIGKILL else ''}"
        return f"{self._verb}: {told or (lines[-1].strip() if lines else f'exit code {code}')}"


def row_of(work: Work, settings: str, host: str) -> dict[str, Any]:
    """JSON types: the line of a unit in the journal."""
    return {
        "id": work.unit.id,
        "recording": work.unit.source,
        "settings": settings,
        "do": list(work.verbs),
        "exit": work.code,
        "verdict": work.verdict,
        "reasons": work.reasons,
        "seconds": round(work.seconds, 1),
        "peak_mb": round(work.peak_mb),
        "host": host,
        "error": work.error,
        "steps": work.steps,
    }


def slim(run: Path, keep: str) -> None:
    """Take off a finished run what is not kept. keep: "all", "exports" (no stages), or "twin" alone."""
    gone = {"all": (), "exports": ("stages",), "twin": ("stages", "export", "replay", "completed")}[keep]
    for name in gone:
        shutil.rmtree(run / name, ignore_errors=True)


class Held:
    """Memory (MB) that the processes of each session hold.

    One look at all processes serves every unit at work. The next one waits until the last took no more than
    a fiftieth of the time: on a machine with thousands of processes a look takes a tenth of a second.
    """

    def __init__(self) -> None:
        self._due = 0.0
        self._of: dict[int, float] = {}

    def by(self, session: int) -> float:
        """Of one session, as of the last look."""
        began = time.monotonic()
        if began >= self._due:
            self._of = sessions_mb()
            self._due = began + max(LOOK / 2, _LOOKS * (time.monotonic() - began))
        return self._of.get(session, 0.0)


_HELD = Held()


def sessions_mb() -> dict[int, float]:
    """Memory (MB) by session, of all processes."""
    held: dict[int, float] = {}
    for process in Path("/proc").iterdir():
        if not process.name.isdecimal():
            continue
        with suppress(OSError, ValueError, IndexError):
            fields = (process / "stat").read_text().rpartition(")")[2].split()
            session = int(fields[3])
            held[session] = held.get(session, 0.0) + int(fields[21]) * _PAGE_KB / 1000
    return held


def _dies_with_its_parent() -> None:
    """In the child: a batch that is killed leaves no process behind."""
    _LIBC.prctl(_DIES_WITH_ITS_PARENT, signal.SIGKILL)


def machine_mb() -> float:
    """Memory (MB) that this machine has to give now."""
    told: Mapping[str, str] = dict(
        line.split(":", 1) for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    )
    return int(told["MemAvailable"].split()[0]) / 1000

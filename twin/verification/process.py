"""Asks an engine in a process of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from twin.engines import interpreter

ENGINES: dict[str, tuple[str, ...]] = {
    "mujoco": ("urdf", "mjcf", "usd"),
    "pinocchio": ("urdf", "mjcf"),
    "yourdfpy": ("urdf",),
    "drake": ("urdf", "mjcf"),
    "newton": ("urdf", "mjcf", "usd"),
    "physx": ("usd",),
    "pybullet": ("urdf",),
    "sapien": ("urdf",),
}
# come with this project; the others have environments of their own
OURS = "mujoco", "pinocchio", "yourdfpy"
# the probe that moves parts, for twin.verification.behaviour: it compares nothing and is no engine to choose
BEHAVIOUR = "behaviour"
SECONDS = 300.0  # an engine that takes longer for one file hangs; Newton compiles for half a minute once
_RUN = Path(__file__).resolve().parents[1] / "probes" / "run.py"


def python_of(engine: str) -> Path:
    """Python that has the engine. Raises MissingDependencyError when its environment is not installed."""
    return Path(sys.executable) if engine in (*OURS, BEHAVIOUR) else interpreter(engine)


def ask(engine: str, jobs: Sequence[dict[str, Any]], seconds: float = SECONDS) -> list[dict[str, Any]]:
    """One answer per job (twin.probes); a crash or hang is the answer's error, the rest is asked again."""
    python = python_of(engine)
    answers: list[dict[str, Any]] = []
    while len(answers) < len(jobs):
        got, why, whole = _run(python, engine, jobs[len(answers) :], seconds)
        answers += got
        lost = len(jobs) - len(answers) if whole else min(1, len(jobs) - len(answers))
        answers += [{"parts": {}, "warnings": [], "error": why, "version": "", "seconds": 0.0}] * lost
    return answers


def _run(
    python: Path, engine: str, jobs: Sequence[dict[str, Any]], seconds: float
) -> tuple[list[dict[str, Any]], str, bool]:
    """The answers of one process, in an empty folder (MuJoCo leaves a log where it runs), why it did not
    answer all, and whether that is about the engine as a whole and not about the file it was at."""
    with tempfile.TemporaryDirectory() as folder:
        request, answers, said = (Path(folder) / n for n in ("request.json", "answers.jsonl", "said.txt"))
        request.write_text(json.dumps(list(jobs)), encoding="utf-8")
        answers.touch()
        with said.open("wb") as out:
            process = subprocess.Popen(  # noqa: S603  (an interpreter of ours, a file of ours, no shell)
                [str(python), "-P" if python == Path(sys.executable) else "-I", str(_RUN), engine, str(request), str(answers)],
                cwd=folder, stdout=out, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                env={**os.environ, "CUDA_VISIBLE_DEVICES": ""},
            )  # fmt: skip
            hung = _wait(process, answers, seconds)
        got = [
            json.loads(x)
            for x in answers.read_text(encoding="utf-8").splitlines(keepends=True)
            if x[-1] == "\n"
        ]
        if len(got) == len(jobs):
            return got, "", False
        if hung:
            return got, f"no answer within {seconds:g} s", False
        if process.returncode < 0:
            return got, f"the engine crashed ({signal.Signals(-process.returncode).name})", False
        last = [x for x in said.read_text("utf-8", "replace").splitlines() if x.strip()][-1:]
        # what a file makes a reader raise is caught and answered: this is an engine that can't be started
        return got, last[0] if last else f"the engine stopped with exit code {process.returncode}", True


def _wait(process: subprocess.Popen[bytes], answers: Path, seconds: float) -> bool:
    """Wait for the end; True when it had to be killed because a file took too long."""
    size, since = 0, time.monotonic()
    while True:
        try:
            process.wait(timeout=0.5)
            return False
        except subprocess.TimeoutExpired:
            if answers.stat().st_size != size:
                size, since = answers.stat().st_size, time.monotonic()
            elif time.monotonic() - since > seconds:
                process.kill()
                process.wait()
                return True

"""Asks MuJoCo what it makes of a file, in a process of its own: a crash, a hang or its log file stay there,
and its USD reader must be imported before any other use of pxr."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from twin.lint.model import Behaviour, Fault, LintModel

_SECONDS = 300  # a model that takes longer is too large for this probe


def behaviour(model: LintModel) -> Behaviour:
    """Load the file, look at contacts at rest, push every part, wait ten seconds; see twin.lint.run."""
    if model.refused:
        return Behaviour(refused=model.refused)
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]),
        }
        command = [
            sys.executable,
            "-m",
            "twin.lint.run",
            str(model.path.resolve()),
            model.format,
            str(answer),
        ]
        try:
            done = subprocess.run(  # noqa: S603  (this interpreter, this package, no shell)
                command, cwd=folder, env=environment, capture_output=True, text=True, timeout=_SECONDS, check=False
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return Behaviour(skipped=f"it took longer than {_SECONDS} s")
        if not answer.exists():
            if done.returncode < 0:
                return Behaviour(refused=f"MuJoCo crashes on it (signal {-done.returncode})")
            raise RuntimeError(f"the probe of {model.path} failed:\n{done.stderr}")
        told = json.loads(answer.read_text(encoding="utf-8"))
    faults = {k: tuple(Fault(*row) for row in told[k]) for k in ("overlaps", "stuck", "drifts")}
    return Behaviour(refused=told["refused"], skipped=told["skipped"], **faults)

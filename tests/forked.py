"""Own programs forked from one process that has their imports, in place of a start each.

`twin check` and `twin lint` ask every engine in a process of its own, and most of that time is imports. A
fork has a memory, folder, environment and end of its own, as a process that was started. Tests with the mark
`started` start them.
"""

from __future__ import annotations

import gc
import json
import os
import runpy
import select
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any, NoReturn

ROOT = Path(__file__).resolve().parents[1]
# None of pxr: MuJoCo's USD reader must be imported before it.
ENGINES = ("numpy", "scipy.interpolate", "mujoco", "pinocchio", "yourdfpy", "twin.lint.loading")  # fmt: skip


def serve(imports: Sequence[str]) -> None:
    """For every job {argv, cwd, env, said} on standard input fork and answer the child's id; for [id] answer
    its exit code."""
    for name in imports:
        import_module(name)
    gc.freeze()
    for line in sys.stdin:
        job = json.loads(line)
        if isinstance(job, list):
            _answer(os.waitstatus_to_exitcode(os.waitpid(job[0], 0)[1]))
        elif child := os.fork():
            _answer(child)
        else:
            _run(**job)


def _answer(number: int) -> None:
    sys.stdout.write(f"{number}\n")
    sys.stdout.flush()


def _run(argv: list[str], cwd: str, env: dict[str, str], said: str) -> NoReturn:
    nothing, out = os.open(os.devnull, os.O_RDONLY), os.open(said, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for place, own in enumerate((nothing, out, out)):
        os.dup2(own, place)
    os.chdir(cwd)
    os.environ.clear()
    os.environ.update(env)
    sys.argv, code = argv, 0
    try:
        if argv[0] == "-m":
            runpy.run_module(argv.pop(1), run_name="__main__", alter_sys=True)
        elif argv[0] == "-c":
            exec(argv.pop(1), {"__name__": "__main__"})  # noqa: S102  (as `python -c` does)
        else:
            runpy.run_path(argv[0], run_name="__main__")
    except BaseException:
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # to take the imports down takes as long as to load them


class Server:
    """The process that forks, started with its imports when it is first needed."""

    def __init__(self, imports: Sequence[str] = ENGINES) -> None:
        self._imports = imports
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None

    def ask(self, job: Any) -> int:
        with self._lock:
            if self._process is None:
                path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
                self._process = subprocess.Popen(
                    [sys.executable, "-P", __file__, *self._imports], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                    env={**os.environ, "PYTHONPATH": path, "OMP_NUM_THREADS": "1"}, text=True,
                )  # fmt: skip
            assert self._process.stdin is not None
            assert self._process.stdout is not None
            print(json.dumps(job), file=self._process.stdin, flush=True)
            return int(self._process.stdout.readline())

    def close(self) -> None:
        if self._process is not None:
            assert self._process.stdin is not None
            self._process.stdin.close()
            self._process.wait()


class Forked:
    """What of subprocess.Popen `twin.verification.process` uses, for an own program; others are started."""

    def __init__(
        self,
        server: Server,
        args: list[str],
        *,
        cwd: str,
        stdout: IO[bytes] | str,
        env: Mapping[str, str],
        **_: Any,
    ):
        self.args, self._server, self.returncode = args, server, None
        said = stdout if isinstance(stdout, str) else stdout.name
        argv = [a for a in args[1:] if a != "-P"]
        self.pid = server.ask({"argv": argv, "cwd": cwd, "env": dict(env), "said": said})
        self._end = os.pidfd_open(self.pid)

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None:
            if not select.select([self._end], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
            os.close(self._end)
            self.returncode = self._server.ask([self.pid])
        return self.returncode

    def kill(self) -> None:
        with suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)


def in_place_of_subprocess(server: Server) -> SimpleNamespace:
    """The module `subprocess` for code that starts own programs by `Popen` to a file, or by `run` for what
    they wrote."""

    def popen(args: list[str], **options: Any) -> Any:
        own = args[0] == sys.executable
        return Forked(server, args, **options) if own else subprocess.Popen(args, **options)

    def run(args: list[str], *, cwd: str, env: Mapping[str, str], timeout: float, **_: Any) -> Any:
        said = Path(cwd) / "said.txt"
        said.touch()
        process = Forked(server, args, cwd=cwd, stdout=str(said), env=env)
        try:
            process.wait(timeout)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise
        return subprocess.CompletedProcess(args, process.wait(), "", said.read_text(encoding="utf-8"))

    names = {n: getattr(subprocess, n) for n in ("STDOUT", "DEVNULL", "TimeoutExpired")}
    return SimpleNamespace(Popen=popen, run=run, **names)


if __name__ == "__main__":
    serve(sys.argv[1:])

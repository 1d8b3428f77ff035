"""Ctrl-C and closed pipes end the command in one line or in silence, wherever the program is."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace

import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin import interrupt
from twin.storage import save

# Places in which Python can't hand a KeyboardInterrupt on as it is.
BUSY = {
    "a compiled kernel": """
        import numba, numpy as np
        @numba.njit
        def step(x):
            for k in range(len(x)):
                x[k] = x[k] * 0.5 + k
            return x
        x = step(np.zeros(9)); ready()
        while True:
            step(x)
    """,
    "a callback whose errors are dropped": """
        import ctypes
        kind = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
        compare = kind(lambda a, b: sum(range(2000)) * 0)
        data = (ctypes.c_int * 4096)(*range(4096))
        ready()
        while True:
            ctypes.CDLL(None).qsort(data, 4096, 4, compare)
    """,
    "a finalizer": """
        class Slow:
            def __del__(self): sum(range(300000))
        ready()
        while True:
            Slow()
    """,
    "an error of another kind": """
        ready()
        try:
            while True: pass
        except KeyboardInterrupt as e:
            raise SystemError("returned a result with an exception set") from e
    """,
    "a library that drops every error": """
        import time
        from twin.cli.console import Outcome
        ready()
        try:
            time.sleep(60)
        except BaseException:
            pass
        return Outcome({})
    """,
    "threads that go on": """
        from concurrent.futures import ThreadPoolExecutor
        import time
        with ThreadPoolExecutor(2) as pool:
            for _ in range(50): pool.submit(time.sleep, 1.0)
            ready(); time.sleep(60)
    """,
    "a child that goes on": """
        import subprocess, sys
        from twin.interrupt import spared
        with spared():
            child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
        ready(); child.wait()
    """,
}


@contextmanager
def command(tmp_path: Path, body: str) -> Iterator[subprocess.Popen[str]]:
    """The command line with a verb that does `body`, in a session of its own; what is left of it at the end
    is killed."""
    (tmp_path / "busy.py").write_text(
        "def ready():\n    print('ready', flush=True)\n\ndef busy(**_):\n"
        + textwrap.indent(textwrap.dedent(body), "    ")
    )
    start = "import sys; from twin.cli import main as cli; cli.VERBS['doctor'] = ('busy:busy', 'wait'); sys.argv[1:] = ['doctor']; cli.main()"
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2])])
    with subprocess.Popen(
        [sys.executable, "-c", start], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": path}, start_new_session=True,
    ) as process:  # fmt: skip
        try:
            yield process
        finally:
            for line in running_in(process.pid):
                with suppress(ProcessLookupError):
                    os.kill(int(line.split()[0]), signal.SIGKILL)


def running_in(session: int) -> list[str]:
    """Processes of a session that are not dead."""
    told = subprocess.run(["ps", "-o", "pid=,stat=", "-s", str(session)], capture_output=True, text=True)
    return [x for x in told.stdout.splitlines() if "Z" not in x]


@pytest.mark.parametrize("place", BUSY)
def test_ctrl_c_is_one_line_and_exit_code_130(tmp_path: Path, place: str) -> None:
    with command(tmp_path, BUSY[place]) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.1)
        os.killpg(process.pid, signal.SIGINT)  # a terminal sends it to all
        _, err = process.communicate(timeout=30)
        assert err == "twin: interrupted; run the same command again to go on\n"
        assert process.returncode == 130
        started = time.monotonic()
        while left := running_in(process.pid):  # killed processes take a moment to go on a busy machine
            assert time.monotonic() - started < 10, f"what it started is gone: {left}"
            time.sleep(0.05)


@pytest.mark.parametrize("options", [["--json"], []])
def test_a_reader_that_stops_reading_is_no_error(tmp_path: Path, options: list[str]) -> None:
    save(cabinet_twin(), tmp_path / "twin")
    show = [sys.executable, "-m", "twin", "physics", "show", str(tmp_path), *options]
    process = subprocess.Popen(
        show, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=Path(__file__).parents[2]
    )
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == b""
    assert process.wait(timeout=30) == 141


def test_ctrl_c_is_heard_before_the_imports_that_take_time() -> None:
    """Importing the scene types first left a tenth of a second in which Ctrl-C was a traceback."""
    code = (
        "import sys; from twin import __main__; print([m for m in ('numpy', 'argparse', 'dataclasses', 'json', 'twin.cli.main')"
        " if m in sys.modules])"
    )
    command = [sys.executable, "-S", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parents[2], check=True)
    assert done.stdout == "[]\n"


def test_ctrl_c_while_modules_are_imported_is_one_line(tmp_path: Path) -> None:
    slow = "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(5)\n"
    (tmp_path / "argparse.py").write_text(slow)
    process = subprocess.run(
        [sys.executable, "-m", "twin", "doctor"], capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2])])},
    )  # fmt: skip
    assert process.stderr == "twin: interrupted; run the same command again to go on\n"
    assert process.returncode == 130


@pytest.mark.parametrize("when", ["exit functions run", "modules are unloaded"])
def test_ctrl_c_when_all_is_done_keeps_the_exit_code(when: str) -> None:
    code = (
        "import atexit, os, signal, sys, time\n"
        "from twin import interrupt\n"
        "interrupt.handle()\n"
        "class Last:\n"
        "    def __del__(self, kill=os.kill, me=os.getpid()): kill(me, 2)\n"
        + ("last = Last()\n" if when.startswith("modules") else "atexit.register(Last().__del__)\n")
        + "interrupt.finish(2)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=Path(__file__).parents[2]
    )
    assert (done.returncode, done.stderr) == (2, "")


def test_an_interruption_that_comes_back_while_the_first_is_dropped_waits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The timer ran out inside of the hook that had set it: "Exception ignored in: sys.unraisablehook" and a
    traceback."""
    alarms = []

    def at_once(_kind: int, seconds: float) -> None:
        alarms.append(seconds)
        if len(alarms) == 1:
            interrupt._late(signal.SIGALRM, sys._getframe())

    monkeypatch.setattr(interrupt, "_signals", [signal.SIGINT])
    monkeypatch.setattr(interrupt, "_deadline", [time.monotonic() + 3])
    monkeypatch.setattr(signal, "setitimer", at_once)
    interrupt._unraisable(SimpleNamespace(exc_value=KeyboardInterrupt()))
    assert len(alarms) == 2
    with pytest.raises(KeyboardInterrupt):
        interrupt._late(signal.SIGALRM, sys._getframe())

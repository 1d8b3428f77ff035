"""The command `twin`: parses arguments, then imports what the verb needs.

Exit codes: 0 done and every check or goal met; 1 bad input or environment, told in one line; 2 ran, but a
check failed or a goal was missed; 130 interrupted. Errors in the program keep their traceback.
"""

from __future__ import annotations

import errno
import json
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

from twin import interrupt
from twin.cli.parser import parse
from twin.cli.table import VERBS, named
from twin.errors import FuntwinError

# Causes outside of the program, which a traceback would not explain better.
_ENVIRONMENT = {
    errno.ENOSPC: "free some space and run again: what was computed is kept",
    errno.EDQUOT: "free some space and run again: what was computed is kept",
    errno.EFBIG: "raise the limit of file sizes (`ulimit -f`) and run again: what was computed is kept",
    errno.EACCES: "give a folder that you may read and write",
    errno.EPERM: "give a folder that you may read and write",
    errno.EROFS: "give a folder that you may write",
    errno.ENOTDIR: "give a folder, not a file",
    errno.EIO: "check the disk",
    errno.ENAMETOOLONG: "use shorter names",
}


def main() -> NoReturn:
    """Carry out the command line of this process and end it; `twin.__main__` calls it."""
    interrupt.handle()
    interrupt.finish(run(sys.argv[1:]))


def run(argv: Sequence[str]) -> int:
    """Carry out one command line and return its exit code."""
    as_json = "--json" in argv
    try:
        options = vars(parse(argv))
        code = _carry_out(options.pop("verb"), options.pop("json"), options)
        sys.stdout.flush()
    except BaseException as e:
        return _ended(e, as_json)
    return code


def _ended(error: BaseException, as_json: bool) -> int:
    """Tell the error in one line and return the exit code; an error in the program is raised again."""
    if isinstance(error, KeyboardInterrupt) or interrupt.happened():
        _fail(interrupt.MESSAGE, interrupt.REMEDY, as_json)
        return interrupt.code()
    if isinstance(error, BrokenPipeError) or isinstance(error.__context__, BrokenPipeError):
        _close_pipes()
        return 128 + 13  # as SIGPIPE would end it
    if isinstance(error, SystemExit):  # --help and --version
        return int(error.code or 0)
    if isinstance(error, FuntwinError):
        return _fail(error.problem, error.remedy, as_json)
    if isinstance(error, OSError) and error.errno in _ENVIRONMENT:
        name = f"{error.filename}: " if error.filename else ""
        return _fail(f"{name}{error.strerror}", _ENVIRONMENT[error.errno], as_json)
    raise error


def _close_pipes() -> None:
    """Nobody reads any more (`| head`): what Python still flushes at its end goes nowhere, silently."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
            continue
        with suppress(OSError, ValueError):
            os.dup2(nowhere, stream.fileno())


def _carry_out(verb: str, as_json: bool, options: dict[str, Any]) -> int:
    if sys.platform == "linux":
        # read by MuJoCo when it is imported; pictures without a screen
        os.environ.setdefault("MUJOCO_GL", "egl")
    from twin.cli.console import Console

    console = Console(quiet=as_json)
    told = _edited(options.get("run"))
    outcome = named(VERBS[verb][0])(console=console, **options)
    outcome = replace(outcome, warnings=[*told, *outcome.warnings])
    if as_json:
        report = {"ok": outcome.ok, **outcome.data, "warnings": list(outcome.warnings)}
        print(json.dumps(report, indent=1, ensure_ascii=False))
    else:
        console.show(outcome)
    if outcome.problem:
        print(f"twin: {outcome.problem}", file=sys.stderr)
        return 1
    if outcome.doubt:
        print(f"twin: {outcome.doubt}", file=sys.stderr)
    return 0 if outcome.ok else 2


def _edited(run: object) -> list[str]:
    """Lines about the edits of a run, which every verb makes where they are not made yet."""
    if not isinstance(run, Path):
        return []
    from twin.runs.manifest import EDITS, FOUND

    if not any((p / name).exists() for p in (run, run.parent) for name in (EDITS, FOUND)):
        return []
    from twin.cli.step import settled_edits

    return settled_edits(run)


def _fail(problem: str, remedy: str, as_json: bool) -> int:
    line = " ".join(f"{problem}; {remedy}".split() if remedy else problem.split())
    print(f"twin: {line}", file=sys.stderr)
    if as_json:
        print(json.dumps({"ok": False, "error": problem, "remedy": remedy}, ensure_ascii=False))
    return 1

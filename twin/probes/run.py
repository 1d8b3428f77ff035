"""Runs one engine on a list of files; see the package."""

from __future__ import annotations

import importlib.util
import json
import os
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

PACKAGE = "funtwin_probes"


@contextmanager
def captured(lines: list[str]) -> Iterator[None]:
    """Collect every line that Python or native code writes to standard output or error."""
    sys.stdout.flush()
    sys.stderr.flush()
    keep = os.dup(1), os.dup(2)
    with tempfile.TemporaryFile() as sink:
        os.dup2(sink.fileno(), 1)
        os.dup2(sink.fileno(), 2)
        try:
            yield
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            for k, fd in enumerate(keep):
                os.dup2(fd, k + 1)
                os.close(fd)
            sink.seek(0)
            lines += [x.strip() for x in sink.read().decode("utf-8", "replace").splitlines() if x.strip()]


def _show(message: Warning | str, category: type[Warning], *_: Any) -> None:
    """A warning in one line, without the line of source."""
    sys.stderr.write(f"{category.__name__}: {' '.join(str(message).split())}\n")


def answer(probe: Any, job: dict[str, Any]) -> dict[str, Any]:
    """What `probe` measures in one file."""
    said: list[str] = []
    parts, error, started = {}, None, time.perf_counter()
    with captured(said), warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = _show  # type: ignore[assignment]  # takes any further arguments
        warnings.simplefilter("ignore", DeprecationWarning)  # about the reader's own code, not the file
        try:
            parts = probe.read(Path(job["path"]), job["format"], job)
        except Exception as e:  # a reader may fail in any way; the check reports it as a failed row
            where = traceback.extract_tb(e.__traceback__)[-1]
            error = f"{type(e).__name__}: {e} ({Path(where.filename).name}, line {where.lineno})"
    tidy = getattr(probe, "tidy", None)  # for one that does not print a warning a line
    seconds = round(time.perf_counter() - started, 3)
    return {
        "parts": parts, "warnings": tidy(said) if tidy else said, "error": error, "version": probe.VERSION, "seconds": seconds,
    }  # fmt: skip


def load(engine: str) -> Any:
    """The probe of that name, as a member of a package of its own: engines' names clash with files'."""
    folder = Path(__file__).resolve().parent
    spec = importlib.util.spec_from_file_location(
        PACKAGE, folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    if spec is None:
        raise ImportError(f"{folder} is not a package")
    sys.modules[PACKAGE] = importlib.util.module_from_spec(spec)
    return import_module(f"{PACKAGE}.{engine}")


def main(engine: str, request: str, answers: str) -> None:
    """Answer every job of the request."""
    jobs = json.loads(Path(request).read_text(encoding="utf-8"))
    with captured([]):  # greetings
        probe = load(engine)
    with Path(answers).open("a", encoding="utf-8") as out:
        for job in jobs:
            out.write(json.dumps(answer(probe, job)) + "\n")
            out.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
    os._exit(0)  # all is written, and to take an engine's imports down takes as long as to load them

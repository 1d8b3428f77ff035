"""Runs one probe; see the package."""

from __future__ import annotations

import json
import os
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path


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


def main(request_path: str, answer_path: str) -> None:
    """Answer one request."""
    request = json.loads(Path(request_path).read_text(encoding="utf-8"))
    probe = import_module(f"twin.probes.{request['consumer']}")
    answer = {}
    for fmt, path in request["files"].items():
        said: list[str] = []
        parts, error = {}, None
        with captured(said), warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.simplefilter("ignore", DeprecationWarning)  # about the reader's own code, not the file
            try:
                parts = probe.read(Path(path), fmt, request["parts"], request["states"])
            except Exception as e:  # a reader may fail in any way; the check reports it as a failed row
                error = f"{type(e).__name__}: {e}"
        answer[fmt] = {"parts": parts, "warnings": said, "error": error}
    Path(answer_path).write_text(json.dumps(answer), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])

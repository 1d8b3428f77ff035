"""The verb `view` of the command line: the page of a run in a browser, with edits."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from pathlib import Path

from twin.cli.console import Console, Outcome
from twin.cli.step import run_folder


def view(console: Console, run: Path, port: int) -> Outcome:  # noqa: ARG001
    """Serve the page until the user ends it."""
    from twin.view import serving

    with serving(run_folder(run), port) as server:
        until_ended(server.address)
    return Outcome({"run": str(run)})


def until_ended(address: str) -> None:
    """Tell a page's address and wait until the user ends it."""
    sys.stderr.write(f"open {address} in a browser of this machine; Ctrl-C ends it\n")
    sys.stderr.flush()
    with suppress(KeyboardInterrupt):
        while True:
            time.sleep(3600)

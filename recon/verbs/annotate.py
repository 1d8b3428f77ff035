"""The verb `annotate`: truth of one's own recording, marked in a browser."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from recon.annotation.server import annotating, seen_in
from twin.cli.console import Console, Outcome
from twin.cli.view_verb import until_ended
from twin.errors import ReconstructionError
from twin.files.paths import require_writable


def annotate(console: Console, recording: Path, out: Path, port: int, **opening: Any) -> Outcome:
    """Find the cameras, then serve the page until the user ends it. opening: of `recon.open_recording`."""
    require_writable(out)
    from recon.pipeline import reconstruct
    from recon.readers import open_recording

    opened = open_recording(recording, **opening)
    with console.progress() as progress, suppress(ReconstructionError):
        reconstruct(opened, out=out, progress=progress)
    seen = seen_in(out, opened)
    with annotating(seen, out, port) as server:
        until_ended(server.address)
    notes = [f"truth: {server.truth}"] if (server.truth / "truth.json").is_file() else []
    return Outcome({"run": str(out), "truth": str(server.truth)}, notes=notes)

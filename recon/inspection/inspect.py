"""Inspect a recording: every check, in the order in which its findings matter."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from recon.inspection import frame_checks, motion_checks
from recon.inspection.finding import Finding, Inspection, Unknown
from recon.inspection.glance import glance
from recon.readers import open_recording
from recon.recording import Recording
from twin.runs.progress import shows_bar


@shows_bar("inspect")
def inspect(recording: Recording | Path | str) -> Inspection:
    """Say what is wrong with a recording before anything is reconstructed, within seconds.

    Nothing is changed or kept. A check that can't be made is told in `unknown`, and is no finding.

    Raises InputError when the recording can't be opened or a frame can't be read.
    """
    if not isinstance(recording, Recording):
        recording = open_recording(recording)
    opened = recording
    stretches = glance(opened)
    checks: dict[str, Callable[[], list[Finding | Unknown]]] = {
        "clock": lambda: frame_checks.clock(opened.times),
        "size": lambda: frame_checks.size(opened),
        "copies": lambda: frame_checks.copies(stretches),
        "registration": lambda: motion_checks.registration(stretches, opened),
        "focal length": lambda: motion_checks.focal(stretches, opened),
        "blur": lambda: frame_checks.blur(stretches),
        "exposure": lambda: frame_checks.exposure(stretches),
        "depth": lambda: frame_checks.depth(stretches),
        "rest and hand": lambda: motion_checks.rest_and_hand(stretches),
    }
    told = [said for check in checks.values() for said in check()]
    return Inspection(
        name=opened.name,
        findings=tuple(t for t in told if isinstance(t, Finding)),
        checked=tuple(checks),
        unknown=tuple(t for t in told if isinstance(t, Unknown)),
        frames=sum(len(s.frames) for s in stretches),
        of=len(opened),
    )

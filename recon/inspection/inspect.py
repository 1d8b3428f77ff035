"""Inspect a recording: every check, in the order in which its findings matter."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

from recon.inspection import frame_checks, motion_checks
from recon.inspection.cuts import Shown, thumbnail
from recon.inspection.finding import Inspection, Unknown
from recon.inspection.findings import late_frames
from recon.inspection.glance import Stretch, glance, thinned
from recon.inspection.outlook import outlook
from recon.readers import open_recording
from recon.recording import Recording
from twin.cause import Cause
from twin.runs.keys import Stage
from twin.runs.progress import shows_bar
from twin.runs.threads import each

INSPECTION = Stage("inspect", 2, ())

Check = Callable[[], list[Cause | Unknown]]


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
    checks = _quick(stretches, [s.shown for s in stretches], opened)
    checks["focal length"] = lambda: motion_checks.focal(stretches, opened)
    checks["rest and hand"] = lambda: motion_checks.rest_and_hand(stretches)
    results = _results(checks)
    return Inspection(
        name=opened.name,
        findings=tuple(t for t in results if isinstance(t, Cause)),
        checked=tuple(checks),
        unknown=tuple(t for t in results if isinstance(t, Unknown)),
        frames=sum(len(s.frames) for s in stretches),
        of=len(opened),
        outlook=outlook(opened),
    )


def quick_findings(recording: Recording) -> tuple[Cause, ...]:
    """What the checks without tracks find before a reconstruction, each a warning too. Cuts: in all."""
    stretches = glance(recording)
    shown = [s.shown for s in stretches]
    if len(stretches) > 1:
        frames = thinned(recording.times)
        shown = [Shown(frames, list(each(lambda i: thumbnail(recording.frame(i)), frames.tolist())))]
    found = tuple(t for t in _results(_quick(stretches, shown, recording)) if isinstance(t, Cause))
    for finding in found:
        warnings.warn(f"{finding.text}; {finding.help}", stacklevel=2)
    return found


def _quick(stretches: list[Stretch], shown: Sequence[Shown], opened: Recording) -> dict[str, Check]:
    """The checks that need no tracks."""
    return {
        "clock": lambda: frame_checks.clock(opened.times),
        "size": lambda: frame_checks.size(opened),
        "copies": lambda: frame_checks.copies(stretches),
        "cuts": lambda: frame_checks.cut(shown, opened),
        "lag of depth": lambda: motion_checks.lag(stretches, opened),
        "registration": lambda: motion_checks.registration(stretches, opened),
        "blur": lambda: frame_checks.blur(stretches),
        "exposure": lambda: frame_checks.exposure(stretches),
        "depth": lambda: frame_checks.depth(stretches),
    }


def _results(checks: dict[str, Check]) -> list[Cause | Unknown]:
    """What the checks say; those that a lag of depth would spoil wait until it is mended."""
    out: list[Cause | Unknown] = []
    for name, check in checks.items():
        late = sum(late_frames(f) for f in out if isinstance(f, Cause))
        if late and name in ("registration", "focal length"):
            out.append(Unknown(name, f"depth lags; inspect again with --depth-delay {late}"))
        else:
            out += check()
    return out

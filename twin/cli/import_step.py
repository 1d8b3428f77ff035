"""The step of the verb `twin import`."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

from twin.cli.console import Outcome
from twin.cli.step import Step, joint_row, judged, page_note
from twin.errors import InputError
from twin.importers import from_file
from twin.importers.source import Closed
from twin.report.sections import Table
from twin.runs.stages import Progress
from twin.storage import save


def import_step(
    progress: Progress,
    scene: Path,
    out: Path,
    closed: Sequence[str] = (),
    limits: Sequence[str] = (),
    exclude: Sequence[str] = (),
    visual_groups: Sequence[int] = (),
) -> Step:
    """Write the twin of a URDF or MJCF file to out/twin, where there must be none yet."""
    started = time.perf_counter()
    if (out / "twin" / "twin.json").exists():
        raise InputError(f"{out / 'twin'} holds a twin already", "give another folder with -o")
    ends, ranges = _ends(closed), _ranges(limits)
    progress("import", 0.0, str(scene))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        twin = from_file(scene, closed=ends, limits=ranges, exclude=exclude, visual_groups=visual_groups)
    save(twin, out / "twin")
    progress("import", 1.0, f"{len(twin.parts)} parts")
    told = [str(w.message) for w in caught if issubclass(w.category, UserWarning)]
    columns = ["part", "joint", "range", "axis ±", "pivot ±", "mass", "closed at"]
    rows = [[p.name, *joint_row(p), p.closed_source] for p in twin.parts]
    data = {
        "run": str(out),
        "parts": [p.name for p in twin.parts],
        "closed": {p.name: p.closed_source for p in twin.parts},
    }
    outcome = Outcome(data, [Table(f"{scene.name} → {out}", columns, rows)], [page_note(out)], told)
    return Step("import", judged(outcome, twin), f"{len(twin.parts)} parts", started)


def _pairs(option: str, texts: Sequence[str], example: str) -> dict[str, str]:
    pairs = {}
    for text in texts:
        joint, equals, value = text.partition("=")
        if not equals or not joint or not value:
            raise InputError(f"{option} {text!r} names no joint and value", f"write for example {example}")
        pairs[joint] = value
    return pairs


def _ends(texts: Sequence[str]) -> Mapping[str, Closed]:
    ends: dict[str, Closed] = {}
    for joint, value in _pairs("--closed", texts, "--closed door_hinge=upper").items():
        number = _number(value)
        ends[joint] = value if number is None else number
    return ends


def _ranges(texts: Sequence[str]) -> Mapping[str, tuple[float, float]]:
    ranges = {}
    for joint, value in _pairs("--limit", texts, "--limit door_hinge=0,1.57").items():
        low, high = ([_number(word) for word in value.split(",")] + [None, None])[:2]
        if value.count(",") != 1 or low is None or high is None:
            raise InputError(
                f"--limit {joint}={value} is no range", f"write two numbers: --limit {joint}=0,1.57"
            )
        ranges[joint] = (low, high)
    return ranges


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None

"""What the steps of all verbs share: their outcome, the run folder they work on, and its page."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path

from twin.cli.console import Outcome
from twin.errors import FuntwinError
from twin.files.paths import require_writable
from twin.report.sections import Section, require_own_page, save_section
from twin.runs.manifest import EDITS, MANIFEST
from twin.runs.run_lock import claimed
from twin.scene import Part, Twin
from twin.storage import require_place
from twin.verdict import verdict_document, verdict_line


class Step:
    """What one verb did, how long it took, and a line about it."""

    def __init__(self, verb: str, outcome: Outcome, summary: str, started: float) -> None:
        self.verb, self.outcome, self.summary = verb, outcome, summary
        self.seconds = time.perf_counter() - started

    def recorded(self, run: Path) -> Step:
        """Keep the tables for the page."""
        o = self.outcome
        save_section(run, Section(self.verb, o.ok, round(self.seconds, 2), o.tables, o.warnings, o.notes))
        return self


def run_folder(path: Path) -> Path:
    """The run folder of a path that is one, or that is its twin/."""
    return path.parent if (path / "twin.json").is_file() and path.name == "twin" else path


def judged(outcome: Outcome, twin: Twin) -> Outcome:
    """The outcome of a verb that uses a twin: the verdict on it comes first, and stands in the JSON."""
    data = {"verdict": verdict_document(twin.verdict), **outcome.data}
    return replace(outcome, data=data, first=verdict_line(twin))


def joint_row(part: Part) -> list[str]:
    """Type, range, 1 sigma of axis and pivot, and mass of a part, for a table."""
    from twin.page.facts import part_facts

    facts = {name: value for name, value, _ in part_facts(part)}
    axis, pivot = (facts.get(k, "").partition(" ± ")[2] for k in ("axis", "pivot"))
    return [part.joint.kind, facts["range"], axis, pivot, facts.get("mass", "")]


def joint_text(part: Part) -> str:
    from twin.page.facts import part_facts

    facts = {name: value for name, value, _ in part_facts(part)}
    return f"{part.joint.kind}, {facts['range']}"


def page_note(run: Path) -> str:
    return f"report: {run / 'report.html'}"


@contextmanager
def page(run: Path) -> Iterator[None]:
    """Hold the run and render its page at the verb's end, also when the verb failed after it changed the run.

    A run folder that is not there yet is held by what makes it.
    """
    place = run_folder(run)
    with claimed(place) if place.is_dir() else nullcontext():
        require_own_page(place)
        before = _shown(place)
        try:
            yield
        except FuntwinError:
            if (place / MANIFEST).is_file() and _shown(place) != before:
                _render(place)
            raise
        with claimed(place):
            _render(place)


def _render(place: Path) -> None:
    from twin.page import render  # imports what takes a second, which a wrong word needs not wait for

    render(place)


def settled_edits(run: Path) -> list[str]:
    """Make the edits of RUN/edits.json where somebody put them there since; a line for each thing to tell."""
    from twin.edits import settled

    place = run_folder(run)
    with claimed(place):
        made = settled(place)
    if made is None:
        return []
    count = len(made.twin.provenance.get("edits", []))
    return [f"{place / EDITS} was changed: {count} of its edits are made now", *made.warnings]


def _shown(run: Path) -> dict[Path, int]:
    """When what the page shows was written last."""
    files = (run / MANIFEST, run / "twin" / "twin.json", *(run / "report").glob("*.json"))
    return {f: f.stat().st_mtime_ns for f in files if f.is_file()}


def require_run(out: Path) -> None:
    """Raises InputError unless a twin can be written to the run folder; called before any computation."""
    require_writable(out)
    require_place(out / "twin")


@contextmanager
def unlogged(name: str) -> Iterator[None]:
    """Keep the warnings of a logger from the terminal, where the verb tells them itself."""
    logger = logging.getLogger(name)
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)

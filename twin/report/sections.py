"""Results of the verbs as tables, kept in RUN/report/ for the page."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from twin.errors import InputError
from twin.files.paths import AnyPath
from twin.files.text import read_json, write_json

PAGE = "report.html"
_BEGINS = "· Funtwin</title>".encode()  # as every page of ours does
# Cells with these texts stand out, on the terminal and on the page.
MARKS = {"ok": "good", "FAILED": "bad", "missing": "bad"}


@dataclass(frozen=True)
class Table:
    """Rows of text under column names."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Section:
    """What a verb found: `ok` is False when a check failed or a goal was missed. `twin` identifies the
    twin.json it belongs to, so that the page can tell results of an earlier twin."""

    verb: str
    ok: bool
    seconds: float
    tables: Sequence[Table]
    warnings: Sequence[str] = ()
    notes: Sequence[str] = ()
    twin: str = ""


def save_section(run: AnyPath, section: Section) -> None:
    """Write RUN/report/<verb>.json. Raises OSError when the folder can't be written."""
    run = Path(run)
    folder = run / "report"
    folder.mkdir(parents=True, exist_ok=True)
    data = asdict(section) | {"twin": twin_key(run)}
    write_json(folder / f"{section.verb}.json", data)


def load_section(run: Path, verb: str) -> Section | None:
    """What `save_section` wrote, None when the verb has not been run here."""
    data: dict[str, Any] = read_json(run / "report" / f"{verb}.json")
    if not data:
        return None
    tables = [Table(t["title"], t["columns"], t["rows"]) for t in data["tables"]]
    return Section(**{**data, "tables": tables})


def require_own_page(run: Path) -> None:
    """Raises InputError when RUN/report.html is somebody else's page, which the run's page would replace."""
    path = run / PAGE
    if path.is_file() and _BEGINS not in path.read_bytes()[:4096]:
        raise InputError(
            f"{path} is not a report of Funtwin", "move it away: the report of the run goes there"
        )


def twin_key(run: Path) -> str:
    """SHA-256 of RUN/twin/twin.json without what `twin export` adds to it; empty when there is none.

    Collision shapes and the inferred layer are made by `twin export` and don't make it another twin.
    """
    document = read_json(run / "twin" / "twin.json")
    if not document:
        return ""
    for owner in (document.get("static", {}), *document.get("parts", [])):
        for key in ("collision", "completion"):
            owner.pop(key, None)
    return hashlib.sha256(repr(document).encode()).hexdigest()

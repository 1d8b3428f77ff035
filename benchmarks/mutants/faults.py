"""A planted fault is one changed line; the list of them is faults.toml, which people read and edit."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
LIST, RESULTS = HERE / "faults.toml", HERE / "results.jsonl"

HEAD = """# Faults that `make mutants` plants, one at a time: a line of the source and what stands there instead. The line is found by
# its text (its `occurrence`-th in the file), so it may move. `python -m benchmarks.mutants draw` adds faults where a module
# has too few and replaces those whose line is gone; named ones and a survivor's `reason` are written by hand.
"""


class Gone(LookupError):
    """The line of a fault no longer stands in its file."""


def room_of(file: str) -> str:
    """The folder of a file without subfolders, robots/planning; of the steps of an interaction their own, and
    the package for a file beside the folders."""
    folders = file.split("/")[:-1]
    return "/".join(folders[: 3 if folders[:2] == ["recon", "interaction"] else 2])


@dataclass(frozen=True)
class Fault:
    """file: below the root; rule: how it was made; line: source line without its indent; occurrence: 1 for
    the first such line; planted: what replaces it; name: what a fault that was written by hand stands for;
    reason: why no test needs to notice it."""

    file: str
    rule: str
    line: str
    planted: str
    occurrence: int = 1
    name: str = ""
    reason: str = ""

    @property
    def key(self) -> str:
        """Short name that stays as long as the fault does."""
        said = "\n".join((self.file, self.line, str(self.occurrence), self.planted))
        return hashlib.sha256(said.encode()).hexdigest()[:10]

    @property
    def room(self) -> str:
        """The room of its file."""
        return room_of(self.file)

    def line_number(self, source: str) -> int:
        """Its line in the source of its file, from 1. Raises Gone when there is none."""
        places = [k for k, line in enumerate(source.splitlines(), 1) if line.strip() == self.line]
        if len(places) < self.occurrence:
            raise Gone(f"{self.file}: {self.line!r} no longer stands there; draw again")
        return places[self.occurrence - 1]

    def plant(self, source: str) -> str:
        """The source with the fault in it. Raises Gone when its line is not there."""
        k = self.line_number(source) - 1
        lines = source.splitlines(keepends=True)
        lines[k] = lines[k].replace(self.line, self.planted, 1)
        return "".join(lines)


def read_faults(path: Path = LIST) -> list[Fault]:
    """Faults of a list, in its order; none where there is no file."""
    if not path.exists():
        return []
    return [Fault(**row) for row in tomllib.loads(path.read_text(encoding="utf-8"))["fault"]]


def write_faults(faults: Iterable[Fault], path: Path = LIST) -> None:
    """Write a list as TOML; what stands at its default is left out."""
    blocks = [HEAD]
    for fault in faults:
        rows = {k: v for k, v in asdict(fault).items() if v != "" and (k, v) != ("occurrence", 1)}
        blocks.append("\n[[fault]]\n" + "".join(f"{k} = {_toml(v)}\n" for k, v in rows.items()))
    path.write_text("".join(blocks), encoding="utf-8")


def _toml(value: str | int) -> str:
    if isinstance(value, str) and "'" not in value and value.isprintable():
        return f"'{value}'"
    return json.dumps(value, ensure_ascii=False)

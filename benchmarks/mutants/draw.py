"""Draw faults: which of a module's candidates are planted is decided by hashes, so equal sources give an
equal list."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.mutants.faults import ROOT, Fault, Gone
from benchmarks.mutants.rules import Candidate, candidates

SEED = 12
ROOMS = (
    "recon/motion",
    "recon/parts",
    "recon/joints",
    "recon/refine",
    "recon/labels",
    "recon/contact",
    "robots/planning",
)
LONG = 120  # lines of a module that has two faults; one more for each further LONG


def draw(
    known: Sequence[Fault], root: Path = ROOT, seed: int = SEED, rooms: Iterable[str] = ROOMS
) -> tuple[list[Fault], list[Fault]]:
    """(the list, those whose line is gone): the known ones that stand, and new ones for modules of the rooms
    that have too few.

    A named fault whose line is gone stays in the list: only a person knows where it stands now.
    """
    known = [_moved(f, root) for f in known]
    gone = missing(known, root)
    stand = [f for f in known if f not in gone or f.name]
    for path in (p for room in rooms for p in modules(root, room)):
        file = path.relative_to(root).as_posix()
        source = path.read_text(encoding="utf-8")
        stand += _more(file, source, [f for f in stand if f.file == file], seed)
    named = [f for f in stand if f.name]
    return named + sorted((f for f in stand if not f.name), key=lambda f: f.file), gone


def sample(
    known: Sequence[Fault], count: int, seed: int, root: Path = ROOT, rooms: Iterable[str] = ROOMS
) -> list[Fault]:
    """`count` faults drawn with another seed and spread over the rooms by hashes, none of them among the
    known."""
    others, _ = draw((), root, seed, rooms)
    keys = {f.key for f in known}
    lots = {f.key: hashlib.sha256(f"{seed}\n{f.key}".encode()).hexdigest() for f in others}
    return sorted((f for f in others if f.key not in keys), key=lambda f: lots[f.key])[:count]


def modules(root: Path, room: str) -> list[Path]:
    """Modules of a room. Raises FileNotFoundError when there are none."""
    found = sorted((root / room).rglob("*.py"))
    if not found:
        raise FileNotFoundError(
            f"no modules in {root / room}: ROOMS in {__name__} must name the folders as they are now"
        )
    return found


def wanted(source: str) -> int:
    """How many faults a module shall have."""
    return 2 + (len(source.splitlines()) - 1) // LONG


def missing(faults: Iterable[Fault], root: Path) -> list[Fault]:
    """Faults whose line is gone."""
    return [f for f in faults if not _stands(f, root)]


def _stands(fault: Fault, root: Path) -> bool:
    try:
        fault.line_number((root / fault.file).read_text(encoding="utf-8"))
    except (Gone, OSError):
        return False
    return True


def _moved(fault: Fault, root: Path) -> Fault:
    """The fault in the module that has its line now: the one file of the same name elsewhere, or the one file
    at all."""
    if _stands(fault, root):
        return fault
    package, _, name = fault.file.partition("/")
    others = [p.relative_to(root).as_posix() for p in sorted((root / package).rglob("*.py"))]
    holding = [f for f in (replace(fault, file=o) for o in others) if _stands(f, root)]
    for found in ([f for f in holding if f.file.endswith("/" + name.rpartition("/")[2])], holding):
        if len(found) == 1:
            return found[0]
    return fault


def _more(file: str, source: str, have: Sequence[Fault], seed: int) -> list[Fault]:
    """New faults of a module: rule by rule in a drawn order, rather in functions and on lines that have none
    yet."""
    out: list[Fault] = []
    left = candidates(source)
    taken = [c for c in left if any((f.line, f.planted) == (c.line, c.planted) for f in have)]
    lines, functions, rules = ({getattr(c, k) for c in taken} for k in ("number", "function", "rule"))
    drawn = sum(not f.name for f in have)
    while drawn + len(out) < wanted(source):
        left = [c for c in left if c.number not in lines]
        if not left:
            break
        if rules >= {c.rule for c in left}:
            rules = set()
        best = min(
            left, key=lambda c: (c.rule in rules, c.function in functions, _lot(seed, file, c, source))
        )
        lines.add(best.number)
        functions.add(best.function)
        rules.add(best.rule)
        out.append(Fault(file, best.rule, best.line, best.planted, _occurrence(best, source)))
    return out


def _lot(seed: int, file: str, c: Candidate, source: str) -> str:
    said = f"{seed}\n{file}\n{c.rule}\n{c.line}\n{_occurrence(c, source)}\n{c.planted}"
    return hashlib.sha256(said.encode()).hexdigest()


def _occurrence(c: Candidate, source: str) -> int:
    return sum(line.strip() == c.line for line in source.splitlines()[: c.number])

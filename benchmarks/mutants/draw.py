"""Draw faults: which of a room's candidates are planted is decided by hashes, so equal sources give an equal
list."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.mutants.faults import ROOT, Fault, Gone, room_of
from benchmarks.mutants.rules import Candidate, candidates
from benchmarks.mutants.testmap import PACKAGES

SEED = 12
# A room has one fault for so many lines and at least FEWEST: all rooms together have some 270, by us.
LINES, FEWEST = 360, 3


def draw(
    known: Sequence[Fault], root: Path = ROOT, seed: int = SEED, rooms: Iterable[str] | None = None
) -> tuple[list[Fault], list[Fault]]:
    """(the list, those whose line is gone): of each room the known faults that stand, at most as many as it
    shall have, and new ones where it has too few.

    A named fault whose line is gone stays in the list: only a person knows where it stands now.
    """
    known = [_moved(f, root) for f in known]
    gone = missing(known, root)
    named = [f for f in known if f.name]
    drawn: list[Fault] = []
    for room in rooms_of(root) if rooms is None else rooms:
        texts = {p.relative_to(root).as_posix(): p.read_text(encoding="utf-8") for p in modules(root, room)}
        count = wanted(texts.values())
        have = [f for f in known if f.file in texts and f not in gone and not f.name]
        kept = sorted(have, key=_lot(seed))[:count]
        drawn += _more(texts, [f for f in have if f in kept], named, count, seed)
    return named + sorted(drawn, key=lambda f: f.file), gone


def sample(
    known: Sequence[Fault], count: int, seed: int, root: Path = ROOT, rooms: Iterable[str] | None = None
) -> list[Fault]:
    """`count` faults drawn with another seed and spread over the rooms by hashes, none of them among the
    known."""
    others, _ = draw((), root, seed, rooms)
    keys = {f.key for f in known}
    return sorted((f for f in others if f.key not in keys), key=_lot(seed))[:count]


def rooms_of(root: Path) -> list[str]:
    """The rooms of a tree: folders of the packages, and each package for the modules beside its folders."""
    files = [p.relative_to(root).as_posix() for name in PACKAGES for p in (root / name).rglob("*.py")]
    return sorted({room_of(f) for f in files})


def modules(root: Path, room: str) -> list[Path]:
    """Modules of a room. Raises FileNotFoundError when there are none."""
    found = [p for p in (root / room).rglob("*.py") if room_of(p.relative_to(root).as_posix()) == room]
    if not found:
        raise FileNotFoundError(f"no modules in {root / room}: name a room of `rooms_of`")
    return sorted(found)


def wanted(sources: Iterable[str]) -> int:
    """How many faults the modules of a room shall have together."""
    return max(FEWEST, round(sum(len(s.splitlines()) for s in sources) / LINES))


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


def _more(
    texts: Mapping[str, str], have: Sequence[Fault], named: Sequence[Fault], count: int, seed: int
) -> list[Fault]:
    """The faults of a room with new ones up to `count`: rules in turn, rather in modules and functions that
    have none yet, never two on a line."""
    out = list(have)
    found = [(file, c) for file, text in texts.items() for c in candidates(text)]
    faults = {
        k: Fault(k[0], k[1].rule, k[1].line, k[1].planted, _occurrence(k[1], texts[k[0]])) for k in found
    }
    lots = {k: _lot(seed)(f) for k, f in faults.items()}
    standing = {(f.file, f.line, f.planted) for f in (*have, *named)}
    taken = [(file, c) for file, c in found if (file, c.line, c.planted) in standing]
    left = [k for k in found if not any((k[0], k[1].number) == (f, t.number) for f, t in taken)]
    while len(out) < count and left:
        rules = {c.rule for _, c in taken}
        rules = set() if rules >= {c.rule for _, c in left} else rules
        files, functions = {f for f, _ in taken}, {(f, c.function) for f, c in taken}
        best = min(
            left,
            key=lambda k: (k[1].rule in rules, k[0] in files, (k[0], k[1].function) in functions, lots[k]),
        )
        taken.append(best)
        out.append(faults[best])
        left = [k for k in left if (k[0], k[1].number) != (best[0], best[1].number)]
    return out


def _lot(seed: int) -> Callable[[Fault], str]:
    """What decides between faults that are equal otherwise."""
    return lambda f: hashlib.sha256(f"{seed}\n{f.key}".encode()).hexdigest()


def _occurrence(c: Candidate, source: str) -> int:
    return sum(line.strip() == c.line for line in source.splitlines()[: c.number])

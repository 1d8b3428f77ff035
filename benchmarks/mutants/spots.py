"""Lines that a test must run to be able to notice a fault.

For a statement in a function that is the statement. Coverage sees neither what numba compiled nor who reads a
constant of a module; there it is every line that names the function or the constant, through other such
functions and constants.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.mutants.faults import Fault

Spot = tuple[str, int]
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Statement:
    """A statement's own lines (without those of its body), the names it reads and sets, and the function it
    stands in."""

    file: str
    lines: range
    reads: frozenset[str]
    sets: frozenset[str]
    function: str
    compiled: bool

    def spots(self) -> set[Spot]:
        return {(self.file, line) for line in self.lines}


class Sources:
    """Statements of all modules of the packages below a root."""

    def __init__(self, root: Path, packages: tuple[str, ...]) -> None:
        self.of_file: dict[str, list[Statement]] = {}
        self.readers: dict[str, list[Statement]] = defaultdict(list)
        for path in sorted(p for package in packages for p in (root / package).rglob("*.py")):
            file = path.relative_to(root).as_posix()
            self.of_file[file] = list(
                _statements(ast.parse(path.read_text(encoding="utf-8")), file, "", False)
            )
            for statement in self.of_file[file]:
                for name in statement.reads:
                    self.readers[name].append(statement)

    def spots(self, fault: Fault, source: str) -> set[Spot]:
        """Lines (file, number), one of which a test must run; source: of the fault's file, without the
        fault."""
        number = fault.line_number(source)
        found: set[Spot] = set()
        for statement in self.of_file[fault.file]:
            if number in statement.lines:
                self._follow(statement, found, set())
        return found

    def _follow(self, statement: Statement, found: set[Spot], seen: set[str]) -> None:
        if statement.function and not statement.compiled:
            found |= statement.spots()
            return
        for name in {statement.function} if statement.compiled else statement.sets:
            if name in seen:
                continue
            seen.add(name)
            for reader in self.readers[name]:
                self._follow(reader, found, seen)


def _statements(node: ast.AST, file: str, function: str, compiled: bool) -> Iterator[Statement]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, Function):
            jitted = compiled or any("jit" in ast.unparse(d) for d in child.decorator_list)
            yield _signature(child, file)
            yield from _statements(child, file, child.name, jitted)
        elif isinstance(child, ast.ClassDef):
            yield from _statements(child, file, function, compiled)
        elif isinstance(child, ast.stmt):
            first = min(
                (s.lineno for s in ast.iter_child_nodes(child) if isinstance(s, ast.stmt)), default=None
            )
            last = child.end_lineno or child.lineno
            lines = range(child.lineno, last + 1 if first is None else max(first, child.lineno + 1))
            yield Statement(file, lines, *_names(child), function, compiled)
            yield from _statements(child, file, function, compiled)
        elif isinstance(child, ast.ExceptHandler | ast.match_case):
            yield from _statements(child, file, function, compiled)


def _signature(node: Function, file: str) -> Statement:
    """Head of a function: whoever names the function reads its defaults."""
    defaults = [d for d in (*node.args.defaults, *node.args.kw_defaults) if d is not None]
    reads = frozenset[str]().union(*(_names(d)[0] for d in defaults))
    return Statement(
        file, range(node.lineno, node.body[0].lineno), reads, frozenset({node.name}), "", compiled=False
    )


def _names(node: ast.AST) -> tuple[frozenset[str], frozenset[str]]:
    """Names that a statement (not those in its body) reads, and sets."""
    reads: set[str] = set()
    sets: set[str] = set()
    waiting = [node]
    while waiting:
        at = waiting.pop()
        waiting += [
            n
            for n in ast.iter_child_nodes(at)
            if not isinstance(n, ast.stmt | ast.ExceptHandler | ast.match_case)
        ]
        if isinstance(at, ast.Name | ast.Attribute):
            name = at.id if isinstance(at, ast.Name) else at.attr
            (reads if isinstance(at.ctx, ast.Load) else sets).add(name)
    return frozenset(reads), frozenset(sets)

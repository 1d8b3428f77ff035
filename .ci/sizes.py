"""What `make lint` says of size and repetition: functions of at most 60 lines and ten parameters, files of at
most 300 lines, and no ten equal lines in two places. Imports, comments, docstrings and blank lines do not
count as equal ones.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("twin", "recon", "robots")
FUNCTION, PARAMETERS, FILE, EQUAL = 60, 10, 300, 10


def sources(*folders: str) -> Iterator[Path]:
    for folder in folders:
        yield from sorted((ROOT / folder).rglob("*.py"))


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def sizes() -> Iterator[tuple[str, int, str, int]]:
    """(name, size, what is counted, limit) of every file and function."""
    for path in sources(*PACKAGES):
        text = path.read_text(encoding="utf-8")
        yield name_of(path), len(text.splitlines()), "lines", FILE
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                yield f"{name_of(path)}:{node.name}", lines, "lines", FUNCTION
                names = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
                yield f"{name_of(path)}:{node.name}", len(names), "parameters", PARAMETERS


def code_lines(path: Path) -> list[tuple[int, str]]:
    """(number, text) of the lines that hold code."""
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    left_out: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            left_out.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and isinstance(body[0], ast.Expr):
            value = body[0].value
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                left_out.update(range(value.lineno, (value.end_lineno or value.lineno) + 1))
    lines = text.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            lines[token.start[0] - 1] = lines[token.start[0] - 1][: token.start[1]]
    return [(k, s.strip()) for k, s in enumerate(lines, 1) if s.strip() and k not in left_out]


def repeated() -> list[str]:
    """Pairs of places that share EQUAL lines of code, the first of each run."""
    seen: dict[tuple[str, ...], list[tuple[str, int]]] = defaultdict(list)
    for path in sources(*PACKAGES, "tests", "benchmarks"):
        rows = code_lines(path)
        for k in range(len(rows) - EQUAL + 1):
            seen[tuple(text for _, text in rows[k : k + EQUAL])].append((name_of(path), rows[k][0]))
    found = {}
    for places in seen.values():
        if len(places) > 1:
            files = tuple(name for name, _ in places)
            found.setdefault(files, " and ".join(f"{name}:{line}" for name, line in places))
    return [f"{places} share {EQUAL} lines or more" for places in found.values()]


def main() -> int:
    faults = [
        f"{name} has {size} {what}, at most {most} are allowed"
        for name, size, what, most in sizes()
        if size > most
    ]
    faults += repeated()
    print("\n".join(faults) or "sizes and repetition: nothing to tell")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())

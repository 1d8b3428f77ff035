"""Docstrings are read by a program that makes the API reference: what it would show as running text is found
here."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted(p for package in ("twin", "recon", "robots") for p in (ROOT / package).rglob("*.py"))
SECTION = re.compile(r"^ *(Args|Attributes|Raises|Returns):$")


def names_of(node: ast.FunctionDef | ast.ClassDef) -> set[str]:
    """Parameters of a function; fields of a class and what it is made of."""
    if isinstance(node, ast.ClassDef):
        fields = {
            n.target.id for n in node.body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)
        }
        made = (n for n in node.body if isinstance(n, ast.FunctionDef) and n.name == "__init__")
        return fields.union(*(names_of(n) for n in made))
    a = node.args
    return {x.arg for x in (*a.posonlyargs, *a.args, *a.kwonlyargs, *(v for v in (a.vararg, a.kwarg) if v))}


def faults(source: str) -> Iterator[str]:
    """What is wrong with the sections of a file's docstrings."""
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.FunctionDef | ast.ClassDef):
            continue
        lines = (ast.get_docstring(node) or "").splitlines()
        names, inside = names_of(node), ""
        for above, line in zip(["", *lines], lines, strict=False):
            if found := SECTION.match(line):
                inside = found[1]
                if above.strip():
                    yield f"{node.name}: no empty line above {inside}"
            elif line and not line.startswith(" "):
                inside = ""
            if inside not in ("Args", "Attributes"):
                continue
            entry = re.match(r"    (\*{0,2}\w+(?:, \w+)*): ", line)
            if entry and entry[1].lstrip("*") not in names:
                yield f"{node.name}: {entry[1]!r} is none of {sorted(names)}"
            for other in re.findall(rf"[.;] ({'|'.join(names or {'-'})}): ", line):
                yield f"{node.name}: {other!r} has no line of its own"


@pytest.mark.parametrize("package", ["twin", "recon", "robots"])
def test_every_parameter_has_a_line_of_its_own(package: str) -> None:
    files = [p for p in FILES if p.relative_to(ROOT).parts[0] == package]
    told = [f"{p.relative_to(ROOT)} {f}" for p in files for f in faults(p.read_text(encoding="utf-8"))]
    assert len(files) > 40
    assert told == []


def test_hidden_parameters_are_found() -> None:
    source = '''
def good(a, *rest, b=1):
    """Told. b: in running text nobody looks for names.

    Args:
        a: (3,) m. Not one: of them.
            c: of a list.
        rest: more.
        b: a number.

    Returns:
        a: number.
    """

def bad(a, b, c):
    """Told.

    Args:
        a: (3,) m. b: s.
        d: what is not there.
        b, c: both.
    Returns:
        nothing.
    """
'''
    assert list(faults(source)) == [
        "bad: 'b' has no line of its own",
        "bad: 'd' is none of ['a', 'b', 'c']",
        "bad: 'b, c' is none of ['a', 'b', 'c']",
        "bad: no empty line above Returns",
    ]

"""Benchmarks name what the product has: the default tests run few of them."""

from __future__ import annotations

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "benchmarks").rglob("*.py"))
PRODUCT = ("twin", "recon", "robots")


def missing(source: str) -> list[str]:
    """Names that a source imports from the product and that are not there."""
    imports = [n for n in ast.walk(ast.parse(source)) if isinstance(n, ast.ImportFrom)]
    named = [(str(n.module), a.name) for n in imports for a in n.names]
    return [f"{m}.{name}" for m, name in named if m.split(".")[0] in PRODUCT and not _there(m, name)]


def _there(module: str, name: str) -> bool:
    found = import_module(module)
    return hasattr(found, name) or (hasattr(found, "__path__") and find_spec(f"{module}.{name}") is not None)


@pytest.mark.parametrize("path", FILES, ids=[p.relative_to(ROOT).as_posix() for p in FILES])
def test_what_a_benchmark_imports_of_the_product_is_there(path: Path) -> None:
    assert missing(path.read_text(encoding="utf-8")) == []


def test_a_name_that_is_gone_is_found() -> None:
    assert missing("from twin.scene import Part, Gone\nfrom twin import geometry") == ["twin.scene.Gone"]

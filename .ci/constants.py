"""Counts settings and named constants of each room: python .ci/constants.py

A setting is what `twin config` lists. The settings of the paper's own ways (PAPER) are counted apart. A named
constant is a module-level name in capitals that holds numbers; `numbers` counts the number literals in their
values.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from twin.cli.table import SETTINGS, named
from twin.runs.settings import nested

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("twin", "recon", "robots")
# Packages that hold the paper's motion clustering and part-pose graph.
PAPER = ("recon.interaction.joints.clustering", "recon.interaction.joints.pose_graph")


def room(module: str) -> str:
    """The folder of a module, at most two levels deep: "recon/interaction/parts"."""
    path = ROOT.joinpath(*module.split("."))
    folders = module.split(".") if path.is_dir() else module.split(".")[:-1]
    return "/".join(folders[:2])


def classes(cls: Any) -> Iterator[Any]:
    """A class of settings and all that are nested in it."""
    yield cls
    for _, inner in nested(cls):
        yield from classes(inner)


def settings() -> Iterator[tuple[str, int]]:
    """(room, number of settings) of each table that `twin config` lists."""
    for name in SETTINGS.values():
        for cls in classes(named(name)):
            inner = dict(nested(cls))
            place = "the paper's ways" if cls.__module__.startswith(PAPER) else room(cls.__module__)
            yield place, sum(f.name not in inner for f in fields(cls))


def constants(path: Path) -> Iterator[int]:
    """The number literals of each named constant of a file."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        names = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        value = getattr(node, "value", None)
        told = [n for t in names if t is not None for n in ast.walk(t) if isinstance(n, ast.Name)]
        if value is None or not told or not all(n.id.isupper() for n in told):
            continue
        numbers = [
            n
            for n in ast.walk(value)
            if isinstance(n, ast.Constant)
            and isinstance(n.value, int | float)
            and not isinstance(n.value, bool)
        ]
        if numbers:
            yield len(numbers)


def main() -> int:
    rows: dict[str, Counter[str]] = {}
    for place, count in settings():
        rows.setdefault(place, Counter())["settings"] += count
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
            for numbers in constants(path):
                count = rows.setdefault(room(module), Counter())
                count["constants"] += 1
                count["numbers"] += numbers
    columns = ("settings", "constants", "numbers")
    print(f"{'room':24}" + "".join(f"{c:>11}" for c in columns))
    for place in sorted(rows):
        print(f"{place:24}" + "".join(f"{rows[place][c]:>11}" for c in columns))
    total = sum((rows[p] for p in rows if p != "the paper's ways"), Counter())
    print(f"{'all but the paper':24}" + "".join(f"{total[c]:>11}" for c in columns))
    return 0


if __name__ == "__main__":
    sys.exit(main())

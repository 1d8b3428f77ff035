"""Which parts of an imported twin don't collide with each other, as the file has it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from twin.importers.source import Source, SourceBody


def filtered_pairs(
    source: Source, names: Sequence[str], groups: Sequence[Sequence[SourceBody]]
) -> tuple[tuple[str, str], ...]:
    """Pairs of names of what the file never lets touch.

    A body without collision shapes touches nothing. Two groups without any form no pair: both get shapes.

    Args:
        names: of the static scene and of each part.
        groups: the bodies that move as each of them.
    """
    solid = [[b.name for b in bodies if b.collision or not b.shapes] for bodies in groups]
    found = []
    for (a, mine), (b, theirs) in combinations(zip(names, solid, strict=True), 2):
        some = bool(mine or theirs)
        if some and all(frozenset((x, y)) in source.never_touching for x in mine for y in theirs):
            found.append((a, b))
    return tuple(found)

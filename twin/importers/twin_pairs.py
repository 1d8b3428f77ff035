"""Which parts of an imported twin don't collide with each other, as the file has it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

from twin.collision.meetings import meetings
from twin.importers.source import Source, SourceBody
from twin.scene import Collision, Twin


def filtered_pairs(
    source: Source, twin: Twin, groups: Sequence[Sequence[SourceBody]]
) -> tuple[tuple[str, str], ...]:
    """Pairs of names of what the file never lets touch.

    A body without collision shapes touches nothing. Two groups without any form no pair: both get shapes.
    Where the file lets some bodies of two groups touch and others never, the two are a pair if the former
    keep clear of each other wherever either group goes, and the latter don't: a pair loses no contact then.

    Args:
        twin: with the shapes of the groups, closed.
        groups: the bodies that move as each of the twin's owners.
    """
    solid = [[b for b in bodies if b.collision or not b.shapes] for bodies in groups]
    found, mixed = set(), set()
    for a, b in combinations(range(len(groups)), 2):
        never = [frozenset((x.name, y.name)) in source.never_touching for x in solid[a] for y in solid[b]]
        if (solid[a] or solid[b]) and all(never):
            found.add((a, b))
        elif any(never):
            mixed.add((a, b))
    names = [o.name for o in twin.owners]
    for met in meetings(twin) if mixed else []:
        pair = names.index(met.names[0]), names.index(met.names[1])
        if pair in mixed and _only_the_apart_overlap(source, twin, pair, groups):
            found.add(pair)
    return tuple((names[a], names[b]) for a, b in sorted(found))


def _only_the_apart_overlap(
    source: Source, twin: Twin, owners: tuple[int, int], groups: Sequence[Sequence[SourceBody]]
) -> bool:
    """Whether of two owners bodies that never touch overlap somewhere, and those that may touch nowhere."""
    overlap = {True: False, False: False}
    for x, mine in _by_body(twin, owners[0], groups[owners[0]]):
        for y, theirs in _by_body(twin, owners[1], groups[owners[1]]):
            never = frozenset((x, y)) in source.never_touching
            overlap[never] |= any(
                m.overlaps for m in meetings(_bare(twin, {owners[0]: mine, owners[1]: theirs}))
            )
    return overlap[True] and not overlap[False]


def _by_body(
    twin: Twin, owner: int, bodies: Sequence[SourceBody]
) -> Iterator[tuple[str, tuple[Collision, ...]]]:
    """Each body's name and its shapes among those of the owner, which has them in the bodies' order."""
    shapes = iter(twin.owners[owner].collision)
    for body in bodies:
        yield body.name, tuple(shape for _, shape in zip(body.collision, shapes, strict=False))


def _bare(twin: Twin, shapes: dict[int, tuple[Collision, ...]]) -> Twin:
    """The twin with no other shapes than these, by the number of their owner."""
    parts = tuple(replace(p, collision=shapes.get(k, ())) for k, p in enumerate(twin.parts, 1))
    return replace(twin, static=replace(twin.static, collision=shapes.get(0, ())), parts=parts)

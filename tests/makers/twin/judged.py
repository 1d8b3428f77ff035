"""Twins with verdicts."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.scenes.boards import cabinet_twin
from twin.scene import Twin
from twin.verdict import Verdict, of_twin, reason

DOUBT = reason("AxisUnsure", "doubtful", 1.25, 0.5)
REFUSAL = reason("SurfaceUnseen", "refused", 0.1, 0.3)
NOTHING = reason("NothingArticulated", "refused", 1)


def doubted(twin: Twin | None = None) -> Twin:
    """The cabinet, its door doubtful and its drawer trusted."""
    twin = twin or cabinet_twin()
    verdicts = {"door": Verdict((DOUBT,)), "drawer": Verdict()}
    parts = tuple(replace(p, verdict=verdicts[p.name]) for p in twin.parts)
    return replace(twin, parts=parts, verdict=of_twin(verdicts))


def bare() -> Twin:
    """The cabinet without its parts, in which nothing articulated was found."""
    return replace(cabinet_twin(), parts=(), verdict=Verdict((NOTHING,)))

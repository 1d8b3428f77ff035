"""Demands on parts that rest: where they are closed or half open, and where the recording left them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from twin.physics.rests import Rest, place, rests
from twin.scene import Part, Twin
from twin.verification.rest import Hold, hold

REST = 1e-3  # m
_YIELD = 1.1  # chosen by us: the closed form is that of a creep that is steady already

# quantity, measured and limit in m at the farthest point, explanation
Demand = tuple[str, float | None, float, str]


@dataclass(frozen=True)
class Rested:
    """Where the recording left a part.

    Attributes:
        closed: text for when it was closed and all others were, empty where it was not.
        others: the other rests.
        names: part id -> name, of the whole twin.
    """

    closed: str
    others: tuple[Rest, ...]
    names: Mapping[int, str]

    @property
    def asked(self) -> list[dict[str, Any]]:
        """What the probe is asked of the others: state, and the other parts' by name."""
        return [
            {"state": r.state, "held": {self.names[k]: s for k, s in r.others.items()}} for r in self.others
        ]


def rested(twin: Twin, part: Part) -> Rested:
    """When and where a part of a twin with masses rested, no hand in view."""
    found = rests(twin, part.id)
    own = (
        None
        if hold(twin, part, 0.0).moves
        else next((r for r in found if not (r.state or any(r.others.values()))), None)
    )
    told = "" if own is None else f", as it rested {place(part, own)}"
    return Rested(told, tuple(r for r in found if r is not own), {p.id: p.name for p in twin.parts})


def uncaught(twin: Twin, part: Part, where: Rested) -> Rested:
    """Without the rests that only a catch explains, which the file does not have.

    Args:
        twin: with masses, and without catches.
        part: of the twin that has them.
        where: it rested.
    """
    caught = part.physics is not None and part.physics.catch is not None
    kept = (
        r
        for r in where.others
        if not (caught and hold(twin, twin.part(part.id), r.state, dict(r.others)).moves)
    )
    if not caught:
        return where
    return replace(
        where, closed=f"{where.closed}, without its catch, which the format does not have", others=tuple(kept)
    )


def rested_rows(
    twin: Twin, part: Part, where: Rested, got: Sequence[Mapping[str, float] | None], lever: float
) -> Iterator[Demand]:
    """A demand for every other state of rest in the recording: the file holds the part there, or fails.

    Args:
        twin: what was exported.
        part: of it.
        where: it rested.
        got: what the probe measured, in the order of `where.others`.
        lever: m, of the part's farthest point; 1 for a slide.
    """
    for rest, measured in zip(where.others, got, strict=True):
        held = hold(twin, part, rest.state, dict(rest.others))
        name, drift, limit, told = left(
            _name(part, rest), f"it rested {place(part, rest)}", measured, held, lever
        )
        yield name, drift, REST if held.moves else limit, told


def _name(part: Part, rest: Rest) -> str:
    if part.joint.kind == "revolute":
        return f"rest_at_{np.degrees(rest.state):.0f}_deg_m"
    return f"rest_at_{1e3 * rest.state:.0f}_mm_m"


def left(name: str, where: str, got: Mapping[str, float] | None, held: Hold, lever: float) -> Demand:
    """Row of a part that friction or a stop holds. MuJoCo's friction may yield so much to a steady pull."""
    drift = None if got is None else got["drift"] * lever
    creep = 0.0 if got is None or held.stopped else _YIELD * got["creep"] * lever
    text = f"{where}, left alone for 10 s; {held.text}"
    if creep > REST / 2:
        text += f"; MuJoCo's soft friction yields {creep:.2g} m to it in that time"
    return name, drift, REST + creep, text

"""Demands on catches: they hold almost what they say, let go at a little more, and exist only in MJCF."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from twin.quantities import PartPhysics
from twin.scene import Twin

CATCHING = ("mjcf",)  # formats that simulate a catch; the others only tell of it
# Share of the catch that it holds: what a force gauge in a hand tells apart. Friction, which is soft in
# MuJoCo and creeps, has no share in it. Chosen by us.
HOLDS = 0.95
# Share of catch and friction at which it lets go. Chosen by us.
LETS_GO = 1.05
_STILL = 1e-3  # m
_SHORT = 0.01  # share of the width


def without_catches(twin: Twin) -> Twin:
    """The twin as a format shows it that has no catches; the same one where it has none."""
    if not any(p.physics is not None and p.physics.catch is not None for p in twin.parts):
        return twin
    bare = (
        p if p.physics is None else replace(p, physics=replace(p.physics, catch=None)) for p in twin.parts
    )
    return replace(twin, parts=tuple(bare))


def catch_asked(physics: PartPhysics) -> dict[str, float] | None:
    """What the probe needs: pulls (N or N m) that the closed part bears and not, and width (m or rad)."""
    if physics.catch is None:
        return None
    whole = physics.catch.force.value + physics.frictionloss.value
    return {
        "less": HOLDS * physics.catch.force.value,
        "more": LETS_GO * whole,
        "width": physics.catch.width.value,
    }


def catch_rows(
    physics: PartPhysics, got: Mapping[str, Any] | None, lever: float, unit: str
) -> Iterator[tuple[str, float | None, float, str]]:
    """A demand that the catch holds, and one that it lets go; none without a catch.

    Args:
        physics: of the part.
        got: what the probe measured.
        lever: m, of the part's farthest point; 1 for a slide.
        unit: N or N m.
    """
    asked = catch_asked(physics)
    if asked is None or got is None:
        return
    held, gone = got["less"], got["more"]
    told = (
        f"a catch of {physics.caught(0.0):.3g} {unit} and friction of {physics.frictionloss.value:.2g} {unit}"
    )
    drift = None if held is None else lever * held
    yield "catch_holds_m", drift, _STILL, f"{told}, pulled with {asked['less']:.3g} {unit} for 10 s"
    when = "" if gone is None else f", {gone['seconds']:.1f} s"
    left = None if gone is None else gone["left"]
    yield (
        "catch_lets_go",
        left,
        _SHORT,
        f"{told}, pulled with {asked['more']:.3g} {unit}; share of the width left{when}",
    )


def caught_energy(physics: PartPhysics) -> float:
    """J that a catch gives to a part that it pulls shut: force times width."""
    return 0.0 if physics.catch is None else physics.catch.force.value * physics.catch.width.value

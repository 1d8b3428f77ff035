"""What is known about a part's mass and resistance in words: for the terminal and the page."""

from __future__ import annotations

import numpy as np

from twin.geometry import Array
from twin.quantities import Catch, Inertial, Quantity
from twin.scene import Part


def described(part: Part) -> list[tuple[str, str, str]]:
    """Every physical number of a part: name, value with unit and interval, source. Missing ones are not."""
    hinge = part.joint.kind == "revolute"
    units = {"friction": "", "density": " kg/m³"}
    units |= (
        {"damping": " N m s/rad", "frictionloss": " N m"}
        if hinge
        else {"damping": " N s/m", "frictionloss": " N"}
    )
    rows = []
    if part.inertial is not None:
        rows += _described_inertial(part.inertial)
    if part.physics is not None:
        for name, unit in units.items():
            q: Quantity = getattr(part.physics, name)
            rows.append(
                (
                    name,
                    f"{_number(q.value)}{unit} ({_number(q.interval[0])} to {_number(q.interval[1])})",
                    q.source,
                )
            )
        rows += _described_catch(part.physics.catch, hinge)
    return rows


def _described_catch(catch: Catch | None, hinge: bool) -> list[tuple[str, str, str]]:
    """What holds a closed part, none of one without a catch; a hinge's width in degrees."""
    if catch is None:
        return []
    unit, scale, of_width = ("N m", float(np.degrees(1.0)), "deg") if hinge else ("N", 1e3, "mm")
    rows = []
    for name, q, times, text in (
        ("catch", catch.force, 1.0, unit),
        ("catch width", catch.width, scale, of_width),
    ):
        value, low, high = (_number(times * v) for v in (q.value, *q.interval))
        rows.append((name, f"{value} {text} ({low} to {high})", q.source))
    return rows


def _described_inertial(it: Inertial) -> list[tuple[str, str, str]]:
    m, box, factors = it.mass, it.com_interval, it.inertia_interval
    centre = _vector(it.com) + " m"
    centre += (
        f", from {_vector(box[0])} to {_vector(box[1])}" if box is not None else " (interval not stated)"
    )
    moments = ", ".join(f"{v:.3g}" for v in np.linalg.eigvalsh(it.inertia))
    spread = f" (times {factors[0]:.2g} to {factors[1]:.2g})" if factors else " (interval not stated)"
    return [
        ("mass", f"{_number(m.value)} kg ({_number(m.interval[0])} to {_number(m.interval[1])})", m.source),
        ("centre of mass", centre, it.inertia_source),
        ("principal moments", f"{moments} kg m²{spread}", it.inertia_source),
    ]


def _vector(v: Array) -> str:
    return "(" + ", ".join(f"{x:z.3f}" for x in v) + ")"


def _number(x: float) -> str:
    return f"{x:.0f}" if abs(x) >= 1000 else f"{x:.3g}"

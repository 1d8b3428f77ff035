"""What the page says of a part in numbers: its facts with their sources, and the fields of its editor."""

from __future__ import annotations

from typing import Any

import numpy as np

from twin.physics.text import described
from twin.report.plots import shown, unit
from twin.scene import Part


def numbers(part: Part) -> list[tuple[str, str, str, str]]:
    """What the page's editor shows in fields: name, value, unit on the page, unit in an edit."""
    suffix = "deg" if part.joint.kind == "revolute" else "mm"
    limits = [
        (n, f"{float(shown(part, getattr(part.joint, n))):.2f}", unit(part), suffix)
        for n in ("lower", "upper")
    ]
    mass = "" if part.inertial is None else f"{part.inertial.mass.value:.3g}"
    friction = "" if part.physics is None else f"{part.physics.friction.value:.3g}"
    return [*limits, ("mass", mass, "kg", ""), ("friction", friction, "", "")]


def part_facts(part: Part) -> list[tuple[str, str, str]]:
    """What is known about a part: name, value with its uncertainty, and where it comes from."""
    joint, u = part.joint, unit(part)
    low, high = (float(shown(part, v)) for v in (joint.lower, joint.upper))
    sigma = joint.sigma
    tilt = f" ± {np.rad2deg(sigma.axis):.2f}°" if sigma is not None else ""
    facts = [("joint", joint.kind, part.type_source), ("axis", _vector(joint.axis) + tilt, "")]
    pivot = getattr(joint, "pivot", None)
    if pivot is not None:
        shift = f" ± {sigma.pivot * 1000:.1f} mm" if sigma is not None and sigma.pivot is not None else ""
        facts.append(("pivot", f"{_vector(pivot)} m{shift}", ""))
    spread = f" ± {float(shown(part, sigma.state)):.1f}" if sigma is not None else ""
    facts.append(("range", f"{low:z.1f} to {high:z.1f}{spread} {u}", part.limits_source))
    facts.append(("closed end", "state 0", part.closed_source))
    if part.motion.intervals:
        moved = ", ".join(f"{a}-{b}" for a, b in part.motion.intervals)
        facts.append(("moving frames", moved, f"residual {part.motion.residual * 1000:.1f} mm"))
    facts += described(part)
    if part.contact is not None:
        c = part.contact
        facts.append(("hand holds at", f"{_vector(c.point)} m, {c.width * 1000:.0f} mm wide", c.source))
    return facts


def _vector(v: Any) -> str:
    return "(" + ", ".join(f"{x:z.3f}" for x in v) + ")"

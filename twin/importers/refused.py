"""Why MuJoCo refuses an MJCF file, and what to do about it."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco

from twin.errors import InputError

_MASSLESS = "mass and inertia of moving bodies"
_ALL_GROUPS = [0, 5]


def refusal(path: Path, error: ValueError) -> InputError:
    """MuJoCo's reason, with what it leaves unsaid: where a file was looked for, why a body has no mass."""
    reason = " ".join(str(error).split())
    if "Error opening file" in reason:
        remedy = f"put the file there: names count from {path.parent}, behind meshdir and texturedir"
    elif _MASSLESS in reason:
        remedy = _massless(path, reason)
    else:
        remedy = "correct what the message names; no program that uses MuJoCo loads the file as it is"
    return InputError(f"MuJoCo can't load {path}: {reason}", remedy)


def _massless(path: Path, reason: str) -> str:
    """What gives the body a mass that the message names."""
    named = re.search(r"Element name '([^']*)'", reason)
    name = named[1] if named else ""
    try:
        spec = mujoco.MjSpec.from_file(str(path.resolve()))  # a failed compilation leaves nothing to read
    except ValueError:
        return "give the body an <inertial>, or its geoms a mass"
    body = spec.body(name) if name else None
    low, high = (int(g) for g in spec.compiler.inertiagrouprange)
    groups = sorted({int(g.group) for g in body.geoms}) if body is not None else []
    if [low, high] == _ALL_GROUPS or any(low <= g <= high for g in groups):
        return "give the body an <inertial>, or its geoms a mass"
    has = (
        f"body {name!r} has geoms in {' and '.join(map(str, groups))} alone"
        if groups
        else "it has none there"
    )
    return (
        f'inertiagrouprange="{low} {high}" takes masses from geoms of groups {low} to {high}, and {has}: widen the range,'
        " or give the body an <inertial>"
    )

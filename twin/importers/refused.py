"""Why MuJoCo refuses an MJCF file, and what to do about it."""

from __future__ import annotations

import re
from pathlib import Path

from twin.errors import InputError
from twin.lint.mjcf import read

_MASSLESS = "mass and inertia of moving bodies"


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
    why = next((b.weightless for b in read(path).bodies if name and b.name == name), "")
    if not why:
        return "give the body an <inertial>, or its geoms a mass"
    return f"{why}: widen the range, or give the body an <inertial>"

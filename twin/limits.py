"""The limits of a part's joint: changing them, and whether they hold the motion that was recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twin.completion import without_shapes
from twin.completion.asset import is_reconstructed
from twin.errors import InputError, SceneError
from twin.placed import replaced
from twin.scene import Part, Twin
from twin.units import ANGLES, LENGTHS, number_and_unit

Limit = float | str
# Quantile of recorded states a range has to hold: a reconstruction's own (docs/settings.md, limit_quantile).
_OUTLIERS = 0.02
# Share of the recorded range by which stated limits may fall short of it; chosen by us: rounding.
_STATED = 0.05
# The same of limits in twin.json; chosen by us: doubtful reconstructions are this far off by noise and creep.
_STORED = 0.25


def with_limits(twin: Twin, part: int | str, lower: Limit | None = None, upper: Limit | None = None) -> Twin:
    """The twin with other limits of one part's joint, counted from the closed state 0 of its meshes.

    Collision shapes and the inferred layer depend on the range; the next export makes them anew.

    Args:
        part: id or name.
        lower: m or rad, or a text with its unit ("-5deg", "10mm"). Default: as it is.
        upper: the same.

    Raises:
        SceneError: no such part, limits that do not hold state 0, or limits that cut off the part's recorded
            motion.
        InputError: a text that is no state of the joint.
    """
    old = twin.part(part)
    low = old.joint.lower if lower is None else _state(old, "lower", lower)
    high = old.joint.upper if upper is None else _state(old, "upper", upper)
    if not low <= 0.0 <= high or low == high:
        raise SceneError(
            f"part {old.name!r} can't have the range {low:g}..{high:g}, which does not hold the closed state 0",
            "give lower <= 0 < upper",
        )
    new = replace(old, joint=replace(old.joint, lower=low, upper=high), limits_source="stated")
    if cut := cut_off(new, _STATED):
        raise SceneError(cut, "give limits that hold it")
    changed = replaced(twin, new)
    return without_shapes(changed) if is_reconstructed(changed) else changed


def cut_off(part: Part, short: float = _STORED) -> str:
    """What of its recorded motion a part's limits cut off, in a line; empty if at most the share `short`."""
    if not len(part.motion.frames):
        return ""
    low, high = (float(v) for v in np.quantile(part.motion.state, [_OUTLIERS, 1.0 - _OUTLIERS]))
    slack, joint = short * (high - low), part.joint
    if joint.lower <= low + slack and joint.upper >= high - slack:
        return ""
    unit = "rad" if joint.kind == "revolute" else "m"
    return (
        f"the limits {joint.lower:.3f}..{joint.upper:.3f} {unit} of part {part.name!r} cut off its recorded motion, which "
        f"goes from {low:z.3f} to {high:z.3f} {unit}"
    )


def _state(part: Part, what: str, limit: Limit) -> float:
    sizes = ANGLES if part.joint.kind == "revolute" else LENGTHS
    number, unit = number_and_unit(limit) if isinstance(limit, str) else (float(limit), next(iter(sizes)))
    if not np.isfinite(number) or unit not in sizes:
        raise InputError(
            f"{what} = {limit!r} is no state of part {part.name!r}",
            f"give a number in {next(iter(sizes))}, or a text in {' or '.join(sizes)}",
        )
    return number * sizes[unit]

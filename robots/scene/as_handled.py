"""The room as it stood when a part was handled."""

from __future__ import annotations

import numpy as np

from twin.placed import counted_from
from twin.scene import Part, Twin


def as_handled(twin: Twin, key: int | str) -> tuple[Twin, Part]:
    """The twin with what carries a part as it stood when a person first handled the part (state 0 is there),
    and the part, by its id or name, in it.

    A basket is taken out of an open drawer. Where no state of a carrier is known, as in an imported twin, it
    stays at its own state 0. Raises SceneError: no such part.
    """
    part = twin.part(key)
    if not part.motion.intervals:
        return twin, part
    frame, states = part.motion.intervals[0][0], {}
    carrier = part.parent
    while carrier is not None:
        of = twin.part(carrier)
        known = int(np.searchsorted(of.motion.frames, frame, side="right"))
        if known:
            states[of.id] = float(of.motion.state[known - 1])
        carrier = of.parent
    stood = counted_from(twin, states)
    return stood, stood.part(part.id)

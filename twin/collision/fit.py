"""How well collision shapes stand for a surface: volume ratio and the 95th percentiles of four distances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from twin.collision.solid import Solid
from twin.scene import Collision

# On each side: a 95th percentile then rests on 250 points. 20,000 changed none of five parts' numbers by more
# than 3 % and took five times as long.
_POINTS = 5_000


@dataclass(frozen=True)
class Fit:
    """Shapes against what they stand for; distances are 95th percentiles in metres.

    ratio: volume of the shapes' union over that of the solid, None where the surface encloses none. surface:
    from the outside of the shapes to the surface, whichever side. outside: by how much it stands out of the
    solid, 0 within and behind the faces of an open piece. buried: by how much it lies within the solid, 0
    outside; None without a closed piece. missed: from the surface to the nearest shape, 0 where one covers
    it.
    """

    shapes: int
    ratio: float | None
    surface: float
    outside: float
    buried: float | None
    missed: float

    def to_json(self) -> dict[str, float | int | None]:
        """Plain values, by name."""
        return asdict(self)


def fit_of(shapes: Sequence[Collision], solid: Solid, volume: float | None = None) -> Fit:
    """Measure shapes against a solid that lies in the same frame.

    Args:
        volume: what the shapes' volume is compared with (m^3); by default the solid's own when all of it is
            closed.
    """
    union = Solid.of_shapes(shapes)
    if volume is None and solid.closed and not solid.open:
        volume = solid.volume()
    if not union.closed:
        return Fit(len(shapes), 0.0 if volume else None, np.inf, np.inf, None, np.inf)
    points = union.surface(_POINTS)
    d = solid.signed_distance(points)
    out = np.where(solid.behind(points), 0.0, np.maximum(d, 0.0))
    missed = np.maximum(union.signed_distance(solid.surface(_POINTS)), 0.0)
    return Fit(
        shapes=len(shapes),
        ratio=union.volume() / volume if volume else None,
        surface=_p95(np.abs(d)),
        outside=_p95(out),
        buried=_p95(np.maximum(-d, 0.0)) if solid.closed else None,
        missed=_p95(missed),
    )


def _p95(distance: np.ndarray) -> float:
    return float(np.quantile(distance, 0.95)) if len(distance) else float("inf")

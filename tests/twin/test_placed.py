"""A twin with other zeros of its states: every point is where it was."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.scenes.furniture import laden_door
from twin import geometry as geo
from twin.placed import counted_from
from twin.scene import Twin

DOOR, TRAY = 2, 3
ZERO = {DOOR: 0.9, TRAY: 0.05}


@pytest.fixture(scope="module")
def both() -> tuple[Twin, Twin]:
    twin = laden_door()
    return twin, counted_from(twin, ZERO)


@pytest.mark.parametrize("part", [DOOR, TRAY])
@pytest.mark.parametrize("states", [(0.0, 0.0), (0.9, 0.05), (1.3, 0.12)])
def test_points_stay_where_they_are(both: tuple[Twin, Twin], part: int, states: tuple[float, float]) -> None:
    then, now = both
    old = dict(zip((DOOR, TRAY), states, strict=True))
    new = {k: s - ZERO[k] for k, s in old.items()}
    a, b = then.part_pose(part, old), now.part_pose(part, new)
    pairs = [(t.part(part).mesh.vertices, T) for t, T in ((then, a), (now, b))]
    pairs += [(t.part(part).contact.point[None], T) for t, T in ((then, a), (now, b))]  # type: ignore[union-attr]
    pairs += [(t.part(part).inertial.com[None], T) for t, T in ((then, a), (now, b))]  # type: ignore[union-attr]
    for k in range(0, len(pairs), 2):
        (p, T), (q, U) = pairs[k], pairs[k + 1]
        np.testing.assert_allclose(geo.transform(T, p), geo.transform(U, q), atol=1e-12)


@pytest.mark.parametrize("part", [DOOR, TRAY])
def test_limits_and_states_are_counted_from_there(both: tuple[Twin, Twin], part: int) -> None:
    then, now = (t.part(part) for t in both)
    assert now.joint.lower == pytest.approx(then.joint.lower - ZERO[part])
    assert now.joint.upper == pytest.approx(then.joint.upper - ZERO[part])
    np.testing.assert_allclose(now.motion.state, then.motion.state - ZERO[part])


def test_from_where_they_are_nothing_changes() -> None:
    twin = laden_door()
    assert counted_from(twin, {DOOR: 0.0}) is twin

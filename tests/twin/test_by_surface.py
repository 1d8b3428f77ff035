"""What was computed of a surface is computed once, whoever asks again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from twin.by_surface import by_surface
from twin.scene import Mesh

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
FACES = np.array([[0, 1, 2]], np.int32)


def test_equal_surfaces_are_asked_once_and_others_anew() -> None:
    asked = []

    @by_surface
    def area(mesh: Mesh, scale: float = 1.0) -> float:
        asked.append((mesh, scale))
        return mesh.area * scale

    mesh = Mesh(CORNERS, FACES)
    red = replace(mesh, colors=np.full((3, 3), (255, 0, 0), np.uint8))
    assert [area(mesh), area(Mesh(CORNERS.copy(), FACES.copy())), area(red)] == [0.5, 0.5, 0.5]
    assert len(asked) == 1
    assert asked[0][0].colors is None, "nobody can take the first mesh's colours for the others'"
    assert area(mesh, 2.0) == area(mesh, scale=2.0) == 1.0
    others = [Mesh(2 * CORNERS, FACES), Mesh(CORNERS, FACES[:, ::-1]), Mesh(CORNERS, np.tile(FACES, (2, 1)))]
    assert [area(m) for m in others] == [2.0, 0.5, 1.0]
    with pytest.raises(TypeError, match="unhashable"):
        area(mesh, [1.0])  # type: ignore[arg-type]


def test_an_error_is_raised_each_time() -> None:
    @by_surface
    def none(mesh: Mesh) -> float:
        raise ValueError("no")

    for _ in range(2):
        with pytest.raises(ValueError, match="no"):
            none(Mesh(CORNERS, FACES))

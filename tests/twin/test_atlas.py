"""Meshes with different pictures become one mesh with one picture, which shows what they showed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.makers.twin.colours import BLUE, GREEN, RED, YELLOW, quarters, seen_at
from twin.atlas import BORDER, joined_textures
from twin.importers.look import pictured
from twin.scene import Mesh

NEAR = 3
Places = dict[tuple[float, float, float], tuple[int, int, int]]


def require_colors(mesh: Mesh, at: Places) -> None:
    assert np.abs(seen_at(mesh, list(at)) - np.array(list(at.values()))).max() <= NEAR


def square(x: float, color: tuple[int, int, int] | None = None) -> Mesh:
    corners = np.array([[x, 0, 0], [x + 1, 0, 0], [x + 1, 0, 1], [x, 0, 1]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Mesh(corners, faces, None if color is None else np.tile(np.array(color, np.uint8), (4, 1)))


UPRIGHT = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], float)


def test_meshes_with_pictures_and_with_colours_become_one_with_one_picture() -> None:
    first, second = quarters(), quarters(32)[::-1].copy()
    worn = [
        pictured(square(x).vertices, square(x).faces, UPRIGHT, p)[0]
        for x, p in ((0, first), (2, second), (4, first))
    ]
    shaded = replace(square(6), colors=np.array([RED, RED, BLUE, BLUE], np.uint8))
    whole, scale = joined_textures([worn[0], square(8, GREEN), worn[1], worn[2], shaded])
    assert scale == 1.0
    assert whole.texture is not None
    assert whole.texture.image.size < 3.5 * first.size  # the first picture is there once
    for x, upper, lower in ((0.25, RED, BLUE), (2.25, BLUE, RED), (4.25, RED, BLUE), (8.25, GREEN, GREEN)):
        assert np.abs(seen_at(whole, [[x, 0, 0.75], [x, 0, 0.25]]) - np.array([upper, lower])).max() <= NEAR
    middle = seen_at(whole, [[6.5, 0, 0.5]])[0]
    assert np.abs(middle - (np.array(RED) + BLUE) / 2).max() < 30  # shaded as before, in steps of its texels
    for m in worn:  # beside each picture lies its own border
        assert m.texture is not None
        assert m.texture.image.shape[0] + 2 * BORDER <= whole.texture.image.shape[0]


def test_a_picture_that_repeats_is_there_as_often_as_a_face_shows_it() -> None:
    made, scale = pictured(square(0).vertices, square(0).faces, UPRIGHT * [3, 2] - 1.0, quarters())
    assert scale == 1.0
    assert made.texture is not None
    assert made.texture.image.shape == (128, 192, 3)
    assert len(made.faces) == 2
    require_colors(
        made, {(0.05, 0, 0.45): RED, (0.72, 0, 0.95): RED, (0.28, 0, 0.05): YELLOW, (0.95, 0, 0.55): YELLOW}
    )


def test_pictures_that_do_not_fit_together_are_shrunk_by_what_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("twin.atlas.MOST_TEXELS", 96)
    worn = [
        pictured(square(x).vertices, square(x).faces, UPRIGHT, np.roll(quarters(), x, axis=0))[0]
        for x in range(4)
    ]
    whole, scale = joined_textures(worn)
    assert whole.texture is not None
    assert max(whole.texture.image.shape[:2]) <= 96
    assert 0.5 < scale < 0.7
    require_colors(whole, {(0.25, 0, 0.75): RED, (0.75, 0, 0.25): YELLOW})

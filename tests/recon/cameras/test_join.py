"""Pieces of a path that are joined by places seen again; places are stood in for."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from recon.cameras import join
from recon.cameras.join import joined, keyframes_every
from recon.cameras.places import Keyframe, Seen, places_seen_again
from recon.cameras.submaps import Piece
from recon.recording import Intrinsics, Recording
from twin import geometry as geo
from twin.geometry import Array

FRAMES = 60
CAMERA = Intrinsics(64, 48, 60.0, 60.0, 32.0, 24.0)


def recording(blurred: Sequence[int] = ()) -> Recording:
    """One picture at 15 frames a second, of which some frames are blurred."""
    rng = np.random.default_rng(0)
    sharp = rng.integers(0, 255, (48, 64, 3)).astype(np.uint8)
    color = np.stack([cv2.GaussianBlur(sharp, (0, 0), 2.0) if f in blurred else sharp for f in range(FRAMES)])
    return Recording.from_arrays(color, np.full((FRAMES, 48, 64), 2.0, np.float32), CAMERA, fps=15)


def path() -> Array:
    k = np.arange(FRAMES)
    return geo.make_pose(
        geo.exp_so3(0.02 * k[:, None] * [0.0, 1.0, 0.1]), 0.01 * k[:, None] * [1.0, 0.2, 0.0]
    )


def pieces() -> tuple[Piece, Piece]:
    """Both halves of the path, each in a world of its own."""
    frames, apart = np.arange(FRAMES), geo.make_pose(geo.exp_so3([0.3, 0.2, 0.1]), [3.0, 1.0, 2.0])
    return Piece(frames[:35], path()[:35]), Piece(frames[35:], apart @ path()[35:])


def seen(a: int, b: int, off: float = 0.0) -> Seen:
    T = geo.invert_pose(path()[a]) @ path()[b]
    return Seen(a, b, T @ geo.make_pose(translation=[off, 0.0, 0.0]), 20, 0.9)


def told(monkeypatch: pytest.MonkeyPatch, first: list[Seen], every: list[Seen]) -> list[bool]:
    """What is seen by pictures that look alike, and by all; whether all were asked for, call by call."""
    asked: list[bool] = []

    def places(
        keys: Sequence[Keyframe],
        allowed: NDArray[np.bool_],
        camera: Intrinsics,
        candidates: int | None = 4,
    ) -> list[Seen]:
        asked.append(candidates is None)
        return first if candidates is not None else every

    monkeypatch.setattr(join, "places_seen_again", places)
    return asked


def test_of_each_stretch_the_sharpest_picture_is_the_keyframe() -> None:
    keys = keyframes_every(recording(blurred=[f for f in range(FRAMES) if f % 12 != 7]), np.arange(FRAMES))
    assert [k.frame for k in keys] == [7, 19, 31, 43, 55]


def test_two_places_join_two_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = told(monkeypatch, [seen(3, 40), seen(20, 50)], [])
    (whole,) = joined(recording(), pieces())
    assert asked == [False]
    np.testing.assert_array_equal(whole.frames, np.arange(FRAMES))
    np.testing.assert_allclose(whole.poses, path(), atol=1e-9)


def test_pieces_that_share_a_few_frames_have_each_of_them_once(monkeypatch: pytest.MonkeyPatch) -> None:
    told(monkeypatch, [seen(3, 45), seen(20, 50)], [])
    _, second = pieces()
    longer = Piece(np.arange(40), path()[:40])
    (whole,) = joined(recording(), (longer, second))
    np.testing.assert_array_equal(whole.frames, np.arange(FRAMES))
    np.testing.assert_allclose(whole.poses, path(), atol=1e-9)


def test_pieces_that_look_alike_nowhere_are_compared_at_all_places(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = told(monkeypatch, [], [seen(3, 40), seen(20, 50)])
    (whole,) = joined(recording(), pieces())
    assert asked == [False, True]
    np.testing.assert_allclose(whole.poses, path(), atol=1e-9)


def test_a_place_has_one_vote_however_often_it_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    told(monkeypatch, [seen(3, 40)], [seen(3, 40)])
    assert [len(p.frames) for p in joined(recording(), pieces())] == [35, 25]


def test_two_places_that_contradict_each_other_join_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    told(monkeypatch, [], [seen(3, 40), seen(20, 50, off=0.5)])
    assert [len(p.frames) for p in joined(recording(), pieces())] == [35, 25]


def test_all_places_are_asked_for_when_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of keyframes that look alike, each is compared with some; else with all that are allowed."""
    from recon.cameras import places

    pairs: list[tuple[int, int]] = []
    monkeypatch.setattr(places, "register", lambda a, b, _: pairs.append((a.frame, b.frame)))
    keys = keyframes_every(recording(), np.arange(FRAMES))
    allowed = np.ones((5, 5), bool)
    np.fill_diagonal(allowed, False)
    places_seen_again(keys, allowed, CAMERA, candidates=None)
    assert len(pairs) == 10
    pairs.clear()
    places_seen_again(keys, allowed & False, CAMERA, candidates=None)
    assert pairs == []

"""Clips in the data sets' layouts: read by the one reader that knows them, as they were written, or refused
in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import recon
from recon.readers.arti4d import Arti4dReader
from recon.readers.bundlesdf import BundleSdfReader
from recon.readers.hoi4d import Hoi4dReader
from recon.readers.itaco import ItacoReader
from recon.readers.scannet import ScanNetReader
from recon.readers.streams import recording_of
from twin.errors import InputError

FRAMES = 12
READERS: list[Any] = [ScanNetReader(), Hoi4dReader(), Arti4dReader(), ItacoReader(), BundleSdfReader()]


def read(reader: Any, path: Path) -> recon.Recording:
    """The recording at a path, which this reader alone knows."""
    assert [r for r in READERS if r.recognises(path)] == [reader]
    return recording_of(reader.streams(path))


def assert_same(
    found: recon.Recording, true: recon.Recording, depth: float = 5e-4, color: float = 1.5
) -> None:
    """Equal frames: depth within `depth` m, colour within `color` of 255 in the mean, as JPEG leaves it;
    relative times within 1 us."""
    assert len(found) == len(true)
    k = true.intrinsics
    np.testing.assert_allclose(found.intrinsics.vector, k.vector, rtol=1e-6)
    assert (found.intrinsics.width, found.intrinsics.height) == (k.width, k.height)
    for i in range(0, len(true), 5):
        np.testing.assert_allclose(found.depth(i), true.depth(i), atol=depth)
        off = np.abs(found.color(i).astype(float) - true.color(i).astype(float))
        assert off.mean() <= color, i


def assert_poses(found: recon.Recording, T: Any, frames: Any = None, atol: float = 1e-6) -> None:
    assert found.poses is not None
    frames = np.arange(FRAMES) if frames is None else frames
    assert found.poses.frames.tolist() == list(frames)
    np.testing.assert_allclose(found.poses.T_world_cam, T[frames], atol=atol)


def read_whole(reader: Any, path: Path) -> None:
    opened = recording_of(reader.streams(path))
    for i in range(len(opened)):
        opened.frame(i)


def refused(reader: Any, path: Path, match: str) -> str:
    """One line that says what is wrong, when opened or when the first frame that is touched is read."""
    with pytest.raises(InputError, match=match) as caught:
        read_whole(reader, path)
    said = str(caught.value)
    assert "\n" not in said
    assert caught.value.remedy
    return said

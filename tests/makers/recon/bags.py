"""A small recording to write bags from, and what is asked of the bags when they are read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recon.readers.ros import RosReader
from recon.readers.streams import recording_of
from recon.recording import Intrinsics, Recording
from twin.errors import InputError

FRAMES = 12
CALIBRATED = frozenset(("color", "depth", "pose"))  # all that a calibration tells
CAMERA = Intrinsics(32, 24, 30.0, 31.0, 15.2, 11.7)


def frames() -> Recording:
    """Twelve frames whose colours, columns, rows and times all differ; a hole in each depth image."""
    y, x = np.mgrid[0:24, 0:32]
    color = np.stack(
        [np.stack([40 + 5 * x + k, 90 + 3 * y + 0 * x, 220 - 4 * x - 2 * y], axis=-1) for k in range(FRAMES)]
    ).astype(np.uint8)
    depth = np.stack([900 + 7 * x + 13 * y + 3 * k for k in range(FRAMES)]).astype(np.uint16)
    depth[:, 5, 7] = 0
    times = 1_700_000_000.25 + np.arange(FRAMES) / 15.0
    return Recording.from_arrays(color, depth, CAMERA, times=times, depth_scale=1000)


def opened(path: Path, **options: Any) -> Recording:
    reader = RosReader(**options)
    assert reader.recognises(path)
    return recording_of(reader.streams(path))


def check_same(recording: Recording, original: Recording, color: int = 0, depth: float = 0.0) -> None:
    """Within `color` levels, `depth` m, a microsecond, and with the same camera."""
    assert len(recording) == len(original)
    np.testing.assert_allclose(recording.times, original.times, rtol=0, atol=1e-6)
    assert recording.intrinsics == original.intrinsics
    for k in (0, 5, FRAMES - 1):
        got, wanted = recording.frame(k), original.frame(k)
        assert got.color.dtype == np.uint8
        assert got.depth.dtype == np.float32
        assert np.abs(got.color.astype(int) - wanted.color).max() <= color
        np.testing.assert_allclose(got.depth, wanted.depth, rtol=0, atol=depth)
        np.testing.assert_array_equal(got.depth == 0, wanted.depth == 0)


def problem(path: Path, **options: Any) -> str:
    """The one line that opening or reading a bag ends with."""
    with pytest.raises(InputError) as caught:
        read_all(path, **options)
    assert "\n" not in str(caught.value)
    assert path.name in str(caught.value)
    return str(caught.value)


def read_all(path: Path, **options: Any) -> None:
    recording = opened(path, **options)
    for k in range(len(recording)):
        recording.frame(k)
